//! Dual-Stage Viewpoint Planner (DSVP) in three dimensions, for many agents.
//!
//! Source: Zhu et al., IROS 2021 (see `dsvp/tree.rs`), and its use for several agents in the papers on MAES3D. In the *exploration*
//! stage the agent grows a tree of viewpoints within its horizon and goes along the branch that is worth most; when no viewpoint
//! is worth anything, the *relocation* stage takes it to the nearest frontier of all that it knows and can reach.
//!
//! Beyond the papers: the gain of a viewpoint is found by rays; the way of the relocation is the shortest one on a coarse graph
//! of all known free space ([`crate::regions`]), which has the place of the global graph; a goal is given up as soon as what it
//! was for has been seen, by whomever; an agent that knows of no frontier carries what it knows to the agent it has not met for
//! longest, and explores again when news bring frontiers.
//!
//! **Frontiers of other agents.** A frontier is a fact about a map: what an agent learns of another's map brings the other's
//! frontiers, less those that it knows better about. So the exchange of maps is the exchange of frontiers.
//!
//! Invariants: it goes only through cells that it knows to be free; it never waits for ever as long as it knows a frontier it can
//! reach, or an agent it has met.

mod auction;
mod dtw;
mod gain;
mod goal;
mod others;
mod params;
mod passing;
mod peers;
#[cfg(test)]
mod tests;
mod tree;

use std::cmp::Ordering;
use std::collections::BTreeSet;

use msgs::ids::Tick;
use msgs::maes_msgs::Wake as Events;
use nalgebra::Vector3;
use rand::RngExt;
use rand::seq::{IndexedRandom, SliceRandom};
use rand_chacha::ChaCha8Rng;
use voxels::Cell;

use super::settings::{SettingError, Settings};
use super::{Controller, Ctx};
use crate::command::{Command, LidarRequest, Motion, Wake};
use crate::exploration_map::ExplorationMap;
use crate::observation::Observation;
use crate::path::{Neighbours, Path};
use crate::regions::{RegionId, Regions, Ways};
pub use auction::CLAIMS_PARCEL;
use auction::{Auction, Terms};
use gain::Viewer;
use goal::Goal;
use others::Others;
pub use params::Params;
use passing::{length_m, others_near, past, rest, way};
use peers::Peers;
use tree::{Tree, vector};

/// Longest wait after a collision with another agent, ticks: about the time in which the other one gets out of the way.
const BACK_OFF_TICKS_MAX: u64 = 100;

/// Ticks after which an agent without a goal thinks again, even without news.
const IDLE_TICKS: u64 = 250;

/// Ticks that an agent at rest waits for a scan, if it does not get the one it asked for in the next tick.
const SCAN_PATIENCE_TICKS: u64 = 50;

/// Goals that are tried when there is no way to some because other agents are in it.
const TRIES: usize = 3;

/// How far an agent goes out of the way of others, cells of way at the most.
const ASIDE_CELLS_MAX: f64 = 15.0;

/// The planner of one agent.
#[derive(Debug)]
pub struct Dsvp {
    params: Params,
    /// Of the auction, if there is one.
    terms: Option<Terms>,
    rng: ChaCha8Rng,
    /// Made with the first observation, which says how large the map is.
    sight: Option<Sight>,
    /// The last local tree.
    tree: Option<Tree>,
    /// Where the last plan of the exploration stage led to, as seen from where it began; length 1.
    direction: Option<Vector3<f64>>,
    goal: Option<Goal>,
    /// How many cells were known when it made its last plan.
    known_cells: usize,
    /// There was nothing better to go for than what another agent is nearer to.
    is_contested: bool,
    /// At rest until then, because another agent was in the way.
    waits_until: Option<Tick>,
    /// Since when it is at rest, for a scan that shows what there is to see from here.
    rests_since: Option<Tick>,
    peers: Peers,
    /// Frontiers that have been looked at from as near as can be, to no avail.
    given_up: BTreeSet<Cell>,
    /// Viewpoints from which a scan did not show what they were chosen for.
    barren: BTreeSet<Cell>,
}

/// What the planner knows of the map in its own way.
#[derive(Debug)]
struct Sight {
    regions: Regions,
    ways: Ways,
    viewer: Viewer,
    auction: Option<Auction>,
}

impl Dsvp {
    /// Settings: those of [`Params`].
    ///
    /// # Errors
    /// If a setting is not allowed.
    pub fn new(settings: &mut Settings, rng: ChaCha8Rng) -> Result<Self, SettingError> {
        Ok(Self::with(Params::from_settings(settings)?, None, rng))
    }

    /// With an auction: agents share out what there is to explore. Settings: those of [`Params`], and `spread_m`, `discount`,
    /// `trespass_m`, `detour`, `pace_m_s`, `lease_s` (see docs/controllers.md).
    ///
    /// # Errors
    /// If a setting is not allowed.
    pub fn with_auction(settings: &mut Settings, rng: ChaCha8Rng) -> Result<Self, SettingError> {
        Ok(Self::with(Params::from_settings(settings)?, Some(Terms::from_settings(settings)?), rng))
    }

    fn with(params: Params, terms: Option<Terms>, rng: ChaCha8Rng) -> Self {
        Self {
            params,
            terms,
            rng,
            sight: None,
            tree: None,
            direction: None,
            goal: None,
            known_cells: 0,
            is_contested: false,
            waits_until: None,
            rests_since: None,
            peers: Peers::default(),
            given_up: BTreeSet::new(),
            barren: BTreeSet::new(),
        }
    }

    /// Takes in what is new.
    fn look(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) {
        let briefing = ctx.briefing();
        let extent = briefing.extent;
        let Params { gain_range_m, gain_rays, gain_depth, .. } = self.params;
        let sight = self.sight.get_or_insert_with(|| Sight {
            regions: Regions::new(extent, ctx.body().radius_m),
            ways: Ways::default(),
            viewer: Viewer::new(
                gain_rays,
                gain_range_m.min(briefing.lidar_range_m).min(100.0 * extent.cell_m()) / extent.cell_m(),
                gain_depth,
            ),
            auction: self.terms.map(|terms| Auction::new(terms, &briefing.bodies, ctx.agent(), extent)),
        });
        if let Some(auction) = &mut sight.auction {
            auction.hear(&observation.parcels, observation.tick, briefing.agents);
        }
        let (map, moves, _) = ctx.searching(Neighbours::TwentySix);
        sight.regions.renew(map, moves);
        self.peers.meet(&observation.contacts, extent, observation.tick);
    }

    /// Whether there is still reason to go where it goes.
    fn goes_on(&mut self, observation: &Observation, ctx: &Ctx<'_>) -> bool {
        let Some(sight) = &mut self.sight else { return false };
        let is_outbid = || sight.auction.as_ref().is_some_and(|auction| auction.is_outbid(observation.tick));
        if !self.is_contested && is_outbid() {
            return false;
        }
        match self.goal {
            Some(Goal::Viewpoint { cell, gain }) => {
                let left = sight.viewer.gain(ctx.map(), cell);
                left >= self.params.gain_min && f64::from(left) >= self.params.gain_left * f64::from(gain)
            }
            Some(Goal::Frontier { frontier, .. }) => ctx.map().is_frontier(frontier),
            Some(Goal::Peer { agent, .. }) => {
                !observation.contacts.iter().any(|contact| contact.agent == agent) && !self.has_news(ctx.map())
            }
            Some(Goal::Anywhere { .. }) => !self.has_news(ctx.map()),
            Some(Goal::Aside { .. }) => true,
            None => false,
        }
    }

    /// Whether the map has changed since the last plan in a way that may have brought something to explore.
    fn has_news(&self, map: &ExplorationMap) -> bool {
        map.free() + map.wall() != self.known_cells
    }

    /// At rest and with all seen that can be seen from here, or its goal is none any more: where to?
    fn plan(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let others = others_near(observation, ctx);
        let plan = match self.explore(observation, ctx, &others) {
            Plan::Nothing => match self.relocate(observation, ctx, &others) {
                Plan::Nothing => self.carry(observation, ctx, &others),
                plan => plan,
            },
            plan => plan,
        };
        self.rests_since = None;
        self.known_cells = ctx.map().free() + ctx.map().wall();
        match plan {
            Plan::Go(goal, motion) => self.go(goal, motion, observation, ctx),
            Plan::Blocked => self.give_way(observation, ctx, &others),
            Plan::Nothing => {
                self.goal = None;
                let wake = Wake::at(observation.tick.after(IDLE_TICKS));
                Command::new(rest(observation), wake.or(Wake::on(Events::CONTACTS | Events::PARCEL)))
                    .saying("waiting for news")
            }
        }
    }

    fn go(&mut self, goal: Goal, motion: Motion, observation: &Observation, ctx: &Ctx<'_>) -> Command {
        self.goal = Some(goal);
        if let Some(auction) = self.sight.as_mut().and_then(|sight| sight.auction.as_mut()) {
            match goal {
                Goal::Viewpoint { cell, .. } | Goal::Frontier { cell, .. } => {
                    auction.claim(cell, length_m(&ctx.position(), &motion), observation.tick);
                }
                _ => auction.give_up(),
            }
            self.is_contested = auction.is_outbid(observation.tick);
        }
        let command = Command::new(motion, self.wake()).saying(goal.info());
        self.telling(command, observation)
    }

    /// A command that also tells the agents in contact of the claims, if there is an auction.
    fn telling(&self, command: Command, observation: &Observation) -> Command {
        match self.sight.as_ref().and_then(|sight| sight.auction.as_ref()) {
            Some(auction) if !observation.contacts.is_empty() => command.sending(None, CLAIMS_PARCEL, auction.parcel()),
            _ => command,
        }
    }

    /// When to ask an agent that is on its way.
    fn wake(&self) -> Wake {
        let news = if self.terms.is_some() { Events::CONTACTS | Events::PARCEL } else { 0 };
        Wake::TASK_DONE.or(Wake::on(Events::NEW_CELL | news))
    }

    /// Other agents are in the way. It waits for them to go on or goes aside, by chance, so that no two agents wait for each other
    /// for ever.
    fn give_way(&mut self, observation: &Observation, ctx: &mut Ctx<'_>, others: &Others) -> Command {
        if self.rng.random_bool(0.5)
            && let Some((goal, motion)) = self.aside(ctx, others)
        {
            return self.go(goal, motion, observation, ctx);
        }
        self.goal = None;
        let until = observation.tick.after(self.rng.random_range(1..=BACK_OFF_TICKS_MAX));
        self.waits_until = Some(until);
        Command::new(rest(observation), Wake::at(until)).saying("gives way")
    }

    /// To a region nearby, at random.
    fn aside(&mut self, ctx: &mut Ctx<'_>, others: &Others) -> Option<(Goal, Motion)> {
        let Sight { regions, ways, .. } = self.sight.as_mut()?;
        let here = ctx.cell();
        ways.begin(regions, here);
        let mut reached = Vec::new();
        while let Some((_, region, length)) = ways.next(regions)
            && length <= ASIDE_CELLS_MAX
        {
            reached.push(region.centre);
        }
        reached.retain(|&cell| cell != here && !others.take(cell));
        reached.shuffle(&mut self.rng);
        reached.into_iter().take(TRIES).find_map(|cell| {
            let motion = way(ctx, regions, ways, cell, others)?;
            Some((Goal::Aside { cell }, motion))
        })
    }

    /// The exploration stage.
    fn explore(&mut self, observation: &Observation, ctx: &Ctx<'_>, others: &Others) -> Plan {
        let Some(sight) = &mut self.sight else { return Plan::Nothing };
        let (map, here) = (ctx.map(), ctx.cell());
        let growth = self.params.growth(map.extent().cell_m(), ctx.body().radius_m);
        let frontiers = local_frontiers(&sight.regions, here, growth.horizon);
        if frontiers.is_empty() {
            self.tree = None;
            return Plan::Nothing;
        }
        let ahead = most_ahead(frontiers, here, self.direction, self.params.frontiers as usize, &mut self.rng);
        let mut tree = match self.tree.take() {
            Some(tree) => tree.moved_to(here, map, &growth),
            None => Tree::new(here),
        };
        tree.grow(map, &growth, &ahead, others, &mut self.rng);
        let auction = sight.auction.as_ref();
        if let Some(Goal::Viewpoint { cell, .. }) = self.goal
            && cell == here
            && sight.viewer.gain(map, here) >= self.params.gain_min
        {
            self.barren.insert(here);
        }
        let barren = &self.barren;
        let worth = |cell: Cell, way_m: f64| {
            if barren.contains(&cell) {
                return 0.0;
            }
            auction.map_or(1.0, |auction| auction.worth(cell, way_m, observation.tick))
        };
        let branch = tree.best(map, &mut sight.viewer, &self.params.valuation(), self.direction, &worth);
        self.tree = Some(tree);
        let Some((branch, end)) = branch.and_then(|branch| branch.cells.last().copied().map(|end| (branch, end)))
        else {
            return Plan::Nothing;
        };
        match past(ctx, &Path { cells: branch.cells, cost: 0 }, others) {
            Some(motion) => {
                self.direction = vector(end - here).try_normalize(0.0);
                Plan::Go(Goal::Viewpoint { cell: end, gain: branch.gain }, motion)
            }
            None => Plan::Blocked,
        }
    }

    /// The relocation stage: to the nearest frontier of all, or with an auction to the one that costs least.
    fn relocate(&mut self, observation: &Observation, ctx: &mut Ctx<'_>, others: &Others) -> Plan {
        let Some(Sight { regions, ways, auction, .. }) = &mut self.sight else { return Plan::Nothing };
        let here = ctx.cell();
        let cell_m = ctx.map().extent().cell_m();
        // The cheapest ones so far: what they cost, from where to look, at what.
        let mut best: Vec<(f64, Cell, Cell)> = Vec::new();
        ways.begin(regions, here);
        while let Some((id, region, length)) = ways.next(regions) {
            let way_m = length * cell_m;
            if best.len() == TRIES && best.last().is_some_and(|&(most, ..)| most <= way_m) {
                break;
            }
            let given_up = &self.given_up;
            let open = region.frontiers.iter().filter(|&frontier| !given_up.contains(frontier));
            let Some(&frontier) = open.min_by(|a, b| by_distance(here, a, b)) else {
                continue;
            };
            let cell = viewpoint(regions, id, region.centre, frontier);
            if cell == here {
                let seen_from_here = |frontier: &&Cell| viewpoint(regions, id, region.centre, **frontier) == here;
                self.given_up.extend(region.frontiers.iter().filter(seen_from_here));
                continue;
            }
            let penalty_m = auction
                .as_ref()
                .map_or(0.0, |auction| auction.penalty_m(cell, way_m, &observation.contacts, observation.tick));
            best.push((way_m + penalty_m, cell, frontier));
            best.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
            best.truncate(TRIES);
        }
        for &(_, cell, frontier) in &best {
            if let Some(motion) = way(ctx, regions, ways, cell, others) {
                return Plan::Go(Goal::Frontier { cell, frontier }, motion);
            }
        }
        if best.is_empty() { Plan::Nothing } else { Plan::Blocked }
    }

    /// Nothing is left to explore as far as this agent knows: it takes what it knows to the agent that it has not met for longest,
    /// and once it has looked for all of them, to anywhere.
    fn carry(&mut self, observation: &Observation, ctx: &mut Ctx<'_>, others: &Others) -> Plan {
        let Some(Sight { regions, ways, .. }) = &mut self.sight else { return Plan::Nothing };
        if observation.contacts.len() + 1 >= ctx.briefing().agents as usize {
            return Plan::Nothing;
        }
        let here = ctx.cell();
        if let Some(Goal::Peer { agent, cell }) = self.goal
            && cell == here
        {
            self.peers.note_gone(agent);
        }
        ways.begin(regions, here);
        let mut reached = Vec::new();
        while let Some((_, region, _)) = ways.next(regions) {
            reached.push(region.centre);
        }
        let anywhere = reached.choose(&mut self.rng).map(|&cell| Goal::Anywhere { cell });
        for goal in self.peers.away(&observation.contacts, here).take(TRIES - 1).chain(anywhere) {
            if let Some(motion) = way(ctx, regions, ways, goal.cell(), others) {
                return Plan::Go(goal, motion);
            }
        }
        Plan::Blocked
    }
}

/// What came of a stage.
#[derive(Debug, Clone, PartialEq)]
enum Plan {
    /// There is something to go for.
    Go(Goal, Motion),
    /// There would be, but other agents are in the way.
    Blocked,
    /// There is not.
    Nothing,
}

impl Controller for Dsvp {
    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        self.look(observation, ctx);
        let now = observation.tick;
        if observation.is_active {
            if !self.goes_on(observation, ctx) {
                return self.plan(observation, ctx);
            }
            let keep = Command::keep(self.wake());
            let has_met = observation.events & Events::CONTACTS != 0;
            return if has_met { self.telling(keep, observation) } else { keep };
        }
        if let Some(until) = self.waits_until
            && now < until
        {
            return Command::keep(Wake::at(until));
        }
        let has_waited = self.waits_until.take().is_some();
        if !has_waited && observation.collision.is_some_and(|collision| collision.with_agent) {
            let others = others_near(observation, ctx);
            return self.give_way(observation, ctx, &others);
        }
        let since = *self.rests_since.get_or_insert(now);
        let is_seen = observation.scan_tick.is_some_and(|scan| scan >= since);
        if !is_seen && now < since.after(SCAN_PATIENCE_TICKS) {
            let lidar =
                if now == since { LidarRequest::Every(ctx.briefing().lidar_period_ticks) } else { LidarRequest::Keep };
            return Command { lidar, ..Command::keep(Wake::NEXT_TICK) };
        }
        self.plan(observation, ctx)
    }
}

/// One frontier of each region within the horizon: the one nearest to the agent.
fn local_frontiers(regions: &Regions, here: Cell, horizon: i32) -> Vec<Cell> {
    let nearest = |frontiers: &[Cell]| frontiers.iter().copied().min_by(|a, b| by_distance(here, a, b));
    regions.near(here, horizon).filter_map(|(_, region)| nearest(&region.frontiers)).collect()
}

fn by_distance(here: Cell, a: &Cell, b: &Cell) -> Ordering {
    tree::length_between(here, *a).total_cmp(&tree::length_between(here, *b)).then(a.cmp(b))
}

/// The local frontiers that lie most in the direction of travel; without one yet, some at random.
fn most_ahead(
    mut frontiers: Vec<Cell>,
    here: Cell,
    direction: Option<Vector3<f64>>,
    count: usize,
    rng: &mut ChaCha8Rng,
) -> Vec<Cell> {
    match direction {
        Some(direction) => {
            let ahead = |cell: &Cell| vector(*cell - here).try_normalize(0.0).map_or(1.0, |to| to.dot(&direction));
            frontiers.sort_by(|a, b| ahead(b).total_cmp(&ahead(a)).then(a.cmp(b)));
        }
        None => frontiers.shuffle(rng),
    }
    frontiers.truncate(count);
    frontiers
}

/// From where to look at a frontier: it itself, or the centre of its region if the body does not fit into it.
fn viewpoint(regions: &Regions, region: RegionId, centre: Cell, frontier: Cell) -> Cell {
    if regions.region_of(frontier) == Some(region) { frontier } else { centre }
}
