//! Tours: agents share the frontiers out as tasks, so that each has a short tour.
//!
//! The tasks of a map ([`tasks`]) are the sources of a Voronoi decomposition of its abstract graph:
//! so each agent knows how far its tasks are apart, which ones adjoin, and which task a viewpoint
//! belongs to. When two agents meet, the one with the lower id divides the tasks of both between
//! them ([`tour`]) and proposes that ([`exchange`]) if the division costs less, or if the longer of
//! the two tours becomes shorter by a tenth.
//!
//! The exploration stage is that of the auction, and the relocation stage goes to the frontier of
//! least cost, to which a task that its holder reaches sooner adds, and a remnant that probably
//! hides no free cells. By settings the exploration stage sees own tasks only, or the relocation
//! stage goes to the next task of the tour, as in the sources; both are slower
//! (docs/benchmarks.md).
//!
//! An unallocated task belongs to the agent in contact that is nearest to it, by what all of them
//! have announced.
//!
//! Invariants: it depends on the map, the graph and the messages alone; a message has no more than
//! [`message::RECORD_BYTES_MAX`] bytes for each agent. This module plans no motions.

mod exchange;
mod message;
mod tasks;
#[cfg(test)]
mod tests;
mod tour;

use std::collections::{BTreeMap, BTreeSet};

use msgs::ids::{AgentId, Tick};
use nalgebra::Point3;
use voxels::{Cell, Extent};

use super::gain::{Likelihood, WHOLE};
use crate::abstract_graph::{AbstractGraph, RegionId, ShortestPaths, Voronoi};
use crate::command::AgentMessage;
use crate::controllers::auction::AuctionParams;
use crate::exploration_map::ExplorationMap;
use crate::observation::{Contact, ReceivedMessage};
use exchange::Ledger;
use message::Message;
pub use message::TASKS_MESSAGE;
use message::{Record, TASKS_MAX};
use tasks::{Survey, TaskGrid, TaskId};
use tour::{Legs, Problem, Tenths, UNREACHABLE};

/// Ticks for which an agent holds tasks that it has been given but does not see on its map: two
/// exchanges of maps.
const GRACE_TICKS: u64 = 502;

/// Most tasks of a division.
const DIVIDED_MAX: usize = 2 * TASKS_MAX;

/// Path length by which a task of the tour counts as farther than the one before it, metres: more
/// than any path.
const RANK_M: f64 = 10_000.0;

/// Path length that counts for a task of another agent, metres: more than any own task.
const FOREIGN_M: f64 = 1_000_000.0;

/// Parameters of the tours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ToursParams {
    /// Those of the auction: the planning speed of submarines is that of all tours.
    pub(super) auction: AuctionParams,
    /// Time to explore a region with frontiers, seconds.
    pub(super) visit_s: f64,
    /// Price of two adjoining tasks with different agents, seconds.
    pub(super) cut_s: f64,
    /// Ticks between two divisions with the same agent.
    pub(super) meeting_ticks: u64,
    /// Value from which on a task is promising, cells.
    pub(super) promising_min: f64,
    /// Path length added to a task that is not promising, metres.
    pub(super) remnant_m: f64,
    /// Whether the exploration stage sees own tasks only.
    pub(super) explores_own: bool,
    /// Whether the relocation stage goes to the next task of the tour; otherwise to that of least
    /// cost.
    pub(super) follows_tour: bool,
}

/// The tasks of a team as one agent knows them.
#[derive(Debug)]
pub(super) struct Tours {
    params: ToursParams,
    own: AgentId,
    agents: u32,
    extent: Extent,
    grid: TaskGrid,
    ledger: Ledger,
    survey: Survey,
    /// By the numbers of the tasks of the survey.
    voronoi: Voronoi,
    /// The agent that each task of the survey belongs to.
    holders: Vec<AgentId>,
    /// Durations between tasks of the survey that adjoin.
    adjoining: Vec<Vec<(usize, Tenths)>>,
    /// The place of each own task in the tour.
    ranks: BTreeMap<usize, usize>,
    /// The task of the present goal.
    claimed: Option<TaskId>,
    /// Until when tasks are held that are not on the map.
    grace_ends: Tick,
    /// When tasks, holders and tour were last brought up to date.
    updated: Option<Tick>,
    /// When the next division with each agent is due.
    next_meeting: BTreeMap<AgentId, Tick>,
}

impl Tours {
    pub(super) fn new(params: ToursParams, own: AgentId, agents: u32, extent: Extent) -> Self {
        Self {
            params,
            own,
            agents,
            extent,
            grid: TaskGrid::new(extent),
            ledger: Ledger::new(own),
            survey: Survey::default(),
            voronoi: Voronoi::default(),
            holders: Vec::new(),
            adjoining: Vec::new(),
            ranks: BTreeMap::new(),
            claimed: None,
            grace_ends: Tick::ZERO,
            updated: None,
            next_meeting: BTreeMap::new(),
        }
    }

    /// Processes the messages of an observation.
    pub(super) fn receive(&mut self, messages: &[ReceivedMessage], now: Tick) {
        for message in messages.iter().filter(|message| message.kind == TASKS_MESSAGE) {
            if message.from != self.own
                && let Some(content) = Message::decode(&message.data, self.extent, &self.grid, self.agents)
                && self.ledger.receive(message.from, content, now)
            {
                self.grace_ends = now.after(GRACE_TICKS);
            }
        }
        self.ledger.expire(now);
    }

    /// Brings tasks, holders and the own tour up to date. The graph must be up to date.
    pub(super) fn update(
        &mut self,
        (map, graph, paths): (&ExplorationMap, &AbstractGraph, &mut ShortestPaths),
        (here, contacts): (Cell, &[Contact]),
        (ignored, likelihood): (&BTreeSet<Cell>, Likelihood),
        now: Tick,
    ) {
        if self.updated == Some(now) {
            return;
        }
        self.updated = Some(now);
        self.survey = Survey::new(map, graph, &self.grid, ignored, likelihood);
        let tasks = (0..).zip(&self.survey.tasks);
        let sources: Vec<(u32, RegionId)> =
            tasks.flat_map(|(number, task)| task.regions.iter().map(move |&region| (number, region))).collect();
        self.voronoi.decompose(graph, sources);
        self.adjoining = vec![Vec::new(); self.survey.tasks.len()];
        for ((a, b), length) in self.voronoi.borders(graph) {
            let duration = self.travel(length);
            self.adjoining[a as usize].push((b as usize, duration));
            self.adjoining[b as usize].push((a as usize, duration));
        }
        self.holders = self.survey.tasks.iter().map(|task| self.owner(task.id, contacts, now)).collect();
        let from = self.legs_from(graph, paths, here);
        let own: Vec<usize> = (0..self.holders.len())
            .filter(|&task| self.holders[task] == self.own && from[task] < UNREACHABLE)
            .collect();
        let (open, remnants): (Vec<usize>, Vec<usize>) = own.into_iter().partition(|&task| self.is_promising(task));
        let (mut tour, duration) = self.tour(&from, &open);
        let at = tour.last().map_or(from, |&last| tour::shortest(&self.adjoining, last));
        let (rest, _) = self.tour(&at, &remnants);
        tour.extend(rest);
        self.ranks = tour.iter().enumerate().map(|(rank, &task)| (task, rank)).collect();
        let mut held: Vec<TaskId> = tour.iter().map(|&task| self.survey.tasks[task].id).collect();
        if now < self.grace_ends
            && let Some(record) = self.ledger.own_record()
        {
            let is_on_map = |id: TaskId| self.survey.tasks.iter().any(|task| task.id.overlaps(id));
            held.extend(record.tasks.iter().copied().filter(|&id| !is_on_map(id)));
        }
        let lease_ticks = self.lease_ticks(duration);
        self.ledger.hold(&held, here, lease_ticks, now);
    }

    /// Whether a task probably hides free cells.
    fn is_promising(&self, task: usize) -> bool {
        f64::from(self.survey.tasks[task].value) >= self.params.promising_min * f64::from(WHOLE)
    }

    /// A short tour over some tasks of the survey, and its duration.
    fn tour(&self, from: &[Tenths], tasks: &[usize]) -> (Vec<usize>, u64) {
        let (legs, starts) = self.legs(tasks, &[from]);
        let all: Vec<usize> = (0..tasks.len()).collect();
        let tour = if tasks.len() <= DIVIDED_MAX { legs.tour(&starts[0], &all) } else { nearest_first(&starts[0]) };
        let duration = legs.duration(&starts[0], &tour);
        (tour.into_iter().map(|task| tasks[task]).collect(), duration)
    }

    /// The agent that a task belongs to: its holder, or else the agent in contact that is nearest.
    fn owner(&self, task: TaskId, contacts: &[Contact], now: Tick) -> AgentId {
        if let Some(holder) = self.ledger.holder(task, now) {
            return holder;
        }
        let centre = self.grid.centre(task);
        let distance_m = |record: &Record| {
            let to = |point: Point3<f64>| (point - centre).norm();
            record
                .tasks
                .iter()
                .map(|&held| to(self.grid.centre(held)))
                .fold(to(self.extent.centre(record.at)), f64::min)
        };
        let beside =
            contacts.iter().filter_map(|contact| Some((contact.agent, self.ledger.record(contact.agent, now)?)));
        let own = self.ledger.own_record().map(|record| (self.own, record));
        let candidates = own.into_iter().chain(beside).map(|(agent, record)| (distance_m(record), agent));
        let nearest = candidates.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        nearest.map_or(self.own, |(_, agent)| agent)
    }

    /// Duration of a path of this length in cells.
    fn travel(&self, cells: f64) -> Tenths {
        (cells * self.extent.cell_m() / self.params.auction.pace_m_s * 10.0).min(f64::from(UNREACHABLE)) as Tenths
    }

    fn lease_ticks(&self, tour: u64) -> u64 {
        tour.min(UNREACHABLE.into()) * message::TICKS_PER_S / 10 + self.params.auction.lease_ticks
    }

    /// Durations from a cell to all tasks of the survey.
    fn legs_from(&self, graph: &AbstractGraph, paths: &mut ShortestPaths, cell: Cell) -> Vec<Tenths> {
        let mut from = vec![UNREACHABLE; self.survey.tasks.len()];
        let mut left = from.len();
        paths.begin(graph, cell);
        while left > 0
            && let Some((region, _, length)) = paths.next(graph)
        {
            if let Some(&task) = self.survey.task_of.get(&region)
                && from[task] == UNREACHABLE
            {
                from[task] = self.travel(length);
                left -= 1;
            }
        }
        from
    }

    /// The legs between some tasks of the survey, and from starts with these legs to all tasks.
    fn legs(&self, tasks: &[usize], from: &[&[Tenths]]) -> (Legs, Vec<Vec<Tenths>>) {
        let row = |&task: &usize| {
            let reached = tour::shortest(&self.adjoining, task);
            tasks.iter().map(|&other| reached[other]).collect()
        };
        let work = |&task: &usize| {
            let regions = self.survey.tasks[task].regions.len() as f64;
            (self.params.visit_s * regions * 10.0).min(f64::from(UNREACHABLE)) as Tenths
        };
        let legs = Legs { between: tasks.iter().map(row).collect(), work: tasks.iter().map(work).collect() };
        (legs, from.iter().map(|from| tasks.iter().map(|&task| from[task]).collect()).collect())
    }

    /// Proposes a division to an agent in contact if one is due and worth it. Tasks must be up to
    /// date.
    pub(super) fn negotiate(
        &mut self,
        (graph, paths): (&AbstractGraph, &mut ShortestPaths),
        (here, contacts): (Cell, &[Contact]),
        now: Tick,
    ) {
        let Some(contact) = self.next_peer(contacts, now) else { return };
        let peer = contact.agent;
        self.next_meeting.insert(peer, now.after(self.params.meeting_ticks));
        let Some(theirs) = self.ledger.record(peer, now).cloned() else { return };
        let mine = self.legs_from(graph, paths, here);
        let other = self.legs_from(graph, paths, self.extent.cell_of(&contact.position));
        let is_divided = |&task: &usize| {
            [self.own, peer].contains(&self.holders[task]) && mine[task] < UNREACHABLE && other[task] < UNREACHABLE
        };
        let mut tasks: Vec<usize> = (0..self.holders.len()).filter(is_divided).collect();
        if tasks.iter().any(|&task| self.is_promising(task)) {
            tasks.retain(|&task| self.is_promising(task));
        }
        tasks.sort_by_key(|&task| (mine[task].min(other[task]), task));
        tasks.truncate(DIVIDED_MAX);
        tasks.sort_unstable();
        let (legs, mut from) = self.legs(&tasks, &[&mine, &other]);
        let from = [std::mem::take(&mut from[0]), std::mem::take(&mut from[1])];
        let place = |task: usize| tasks.binary_search(&task).ok();
        let pairs = tasks.iter().enumerate().flat_map(|(a, &task)| {
            self.adjoining[task].iter().filter_map(move |&(other, _)| Some((a, place(other)?))).filter(|(a, b)| a < b)
        });
        let neighbours = pairs.collect();
        let problem = Problem { legs, from, neighbours, cut: (self.params.cut_s * 10.0) as Tenths };
        let held_by = |agent: AgentId| -> Vec<usize> {
            (0..tasks.len()).filter(|&number| self.holders[tasks[number]] == agent).collect()
        };
        let [own, peers] = [held_by(self.own), held_by(peer)];
        let present = problem.keeping([&own, &peers]);
        let divided = problem.divided([&own, &peers]);
        let is_same = (0..2).all(|agent| {
            let sorted = |tour: &[usize]| BTreeSet::from_iter(tour.iter().copied());
            sorted(&present.tours[agent]) == sorted(&divided.tours[agent])
        });
        let [before, after] = [problem.cost(&present), problem.cost(&divided)];
        if is_same || !after.is_worth_it(before) {
            return;
        }
        let name = |tour: &[usize]| -> Vec<TaskId> {
            tour.iter().map(|&number| self.survey.tasks[tasks[number]].id).collect()
        };
        let [mut own, mut peers] = [name(&divided.tours[0]), name(&divided.tours[1])];
        // What is not divided stays where it is.
        let is_divided = |id: TaskId| tasks.iter().any(|&task| self.survey.tasks[task].id.overlaps(id));
        let rest = |record: &Record| record.tasks.clone().into_iter().filter(|&id| !is_divided(id));
        own.extend(self.ledger.own_record().into_iter().flat_map(rest));
        peers.extend(rest(&theirs));
        let lease_ticks = self.lease_ticks(after.makespan);
        self.ledger.propose(peer, [&own, &peers], lease_ticks, now);
    }

    /// Whether a division with an agent in contact is due.
    pub(super) fn is_meeting_due(&self, contacts: &[Contact], now: Tick) -> bool {
        self.next_peer(contacts, now).is_some()
    }

    fn next_peer<'c>(&self, contacts: &'c [Contact], now: Tick) -> Option<&'c Contact> {
        if self.ledger.is_pending() {
            return None;
        }
        let due = |contact: &Contact| self.next_meeting.get(&contact.agent).copied().unwrap_or(Tick::ZERO);
        let peers = contacts.iter().filter(|contact| {
            contact.agent > self.own && self.ledger.record(contact.agent, now).is_some() && due(contact) <= now
        });
        peers.min_by_key(|contact| (due(contact), contact.agent))
    }

    /// The messages for the agents in contact.
    pub(super) fn messages(&mut self, contacts: &[Contact], now: Tick) -> Vec<AgentMessage> {
        let messages = self.ledger.messages(contacts.iter().map(|contact| contact.agent), now);
        let encoded = messages.into_iter().map(|(to, message)| AgentMessage {
            to: Some(to),
            kind: TASKS_MESSAGE,
            data: message.encode(self.extent).into(),
        });
        encoded.collect()
    }

    /// Notes the task that a goal belongs to.
    pub(super) fn claim(&mut self, graph: &AbstractGraph, cell: Cell) {
        self.claimed = self.task_at(graph, cell).map(|task| self.survey.tasks[task].id);
    }

    /// Notes that there is no goal that belongs to a task.
    pub(super) fn withdraw(&mut self) {
        self.claimed = None;
    }

    /// Whether another agent holds the task of the present goal.
    pub(super) fn is_lost(&self, now: Tick) -> bool {
        let holder = self.claimed.and_then(|task| self.ledger.holder(task, now));
        holder.is_some_and(|holder| holder != self.own)
    }

    fn task_at(&self, graph: &AbstractGraph, cell: Cell) -> Option<usize> {
        let (task, _) = self.voronoi.nearest(graph, graph.region_listing(cell)?)?;
        Some(task as usize)
    }

    /// Whether the nearest task of a cell is an own one.
    pub(super) fn is_own(&self, graph: &AbstractGraph, cell: Cell) -> bool {
        self.task_at(graph, cell).is_some_and(|task| self.holders.get(task) == Some(&self.own))
    }

    /// The cost added to the path length to a region with frontiers, metres, given that of the
    /// auction.
    pub(super) fn penalty_m(&self, region: RegionId, path_m: f64, bid_m: f64, now: Tick) -> f64 {
        let Some(&task) = self.survey.task_of.get(&region) else { return FOREIGN_M };
        let is_promising = self.is_promising(task);
        let remnant_m = if is_promising { 0.0 } else { self.params.remnant_m };
        let is_sooner = || self.arrival_m(task, now).is_some_and(|other_m| other_m < path_m);
        let is_trespass = self.holders[task] != self.own && is_sooner();
        let trespass_m = if is_trespass { self.params.auction.trespass_m } else { 0.0 };
        match self.ranks.get(&task) {
            _ if !self.params.follows_tour => remnant_m + trespass_m.max(bid_m),
            Some(&rank) if is_promising => rank as f64 * RANK_M,
            _ => FOREIGN_M + remnant_m + trespass_m,
        }
    }

    /// Whether the exploration stage sees own tasks only.
    pub(super) fn explores_own(&self) -> bool {
        self.params.explores_own
    }

    /// The path length that the holder of a task still has to go until it is there, metres, if it
    /// visits its tasks in the order announced.
    fn arrival_m(&self, task: usize, now: Tick) -> Option<f64> {
        let id = self.survey.tasks[task].id;
        let record = self.ledger.record(self.holders[task], now)?;
        let mut at = self.extent.centre(record.at);
        let mut length_m = 0.0;
        for &held in &record.tasks {
            let next = self.grid.centre(held);
            length_m += (next - at).norm() * self.params.auction.detour;
            if held.overlaps(id) {
                break;
            }
            length_m += self.params.visit_s * self.params.auction.pace_m_s;
            at = next;
        }
        let passed_s = now.0.saturating_sub(record.stamp.0) as f64 * Tick::TICK_S;
        Some((length_m - passed_s * self.params.auction.pace_m_s).max(0.0))
    }
}

/// The order by these durations.
fn nearest_first(from: &[Tenths]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..from.len()).collect();
    order.sort_by_key(|&task| (from[task], task));
    order
}
