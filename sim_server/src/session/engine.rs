//! The engine: the world, the digest chain, and what the session keeps for each agent; executes one
//! tick phase by phase.
//!
//! Invariants: only what is committed is recorded and enters the digest; an agent that was lost or
//! removed is never asked again; the same replies in the same ticks give the same bytes.
//!
//! With look-ahead off every agent is asked in every tick. A reply out of turn is committed only if
//! it does something; otherwise the observation stays pending, as if the agent had not been asked.
//! So controllers that act only when they are due leave the same recording with and without
//! look-ahead.
//!
//! This module knows no transport and no wall time.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use msgs::cdr;
use msgs::counters::CounterName;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Counter, Observation as Fragment, Progress};
use msgs::shared_bytes::SharedBytes;

use super::RunError;
use super::log::{EntryKind, SessionLog};
use crate::setup;
use protocol::command::Command;
use protocol::lockstep::{CommandReply, ObservationRequest, Replies};
use protocol::observation::{RequestKind, fragments};
use protocol::stage::Stage;
use protocol::wake_condition::WakeCondition;
use recording::playback::RecordedTick;
use simulation::digest::{Chain, Digest};
use simulation::scenario::{EventAction, MapKind, Scenario, ScheduledEvent, StopRule};
use simulation::wire::{self, Change, MapChangeCause};
use voxels::Terrain;
use world::body::Pose;
use world::energy::EnergyTotals;
use world::localisation::DriftTotals;
use world::map_change::{CellBox, MapChange};
use world::workers::Workers;
use world::{Presence, World};

mod completion;
mod standstill;

/// A committed exchange with an agent.
pub(super) struct CommittedReply {
    pub(super) agent: AgentId,
    pub(super) fragments: Arc<Vec<Fragment>>,
    pub(super) reply: CommandReply,
}

/// What is shown of a run.
pub(super) struct Shown<'e> {
    pub(super) world: &'e mut World,
    /// The last information text of each agent.
    pub(super) infos: &'e [String],
    /// Agents without a process.
    pub(super) lost: &'e BTreeSet<AgentId>,
}

/// Beyond so many bytes the digest waits for no scans any more: in a tick in which a thousand
/// agents exchange their maps, observations have some gigabytes.
const KEPT_BYTES_MAX: usize = 1 << 25;

/// The state of a run.
pub(super) struct Engine<'a> {
    scenario: &'a Scenario,
    /// The scenarios that have held so far because of events, the present one last.
    changed: Vec<Scenario>,
    /// Events to come, ascending.
    schedule: VecDeque<ScheduledEvent>,
    /// Changes of the map whose time has come, in order, and what the digest covers of each: they
    /// wait for an agent to come near, or for bodies to leave.
    map_changes: Vec<(MapChange, String)>,
    /// Late agents whose time has come, and that have no room yet.
    joining: BTreeSet<AgentId>,
    world: World,
    chain: Chain,
    workers: Arc<Workers>,
    wake_conditions: Vec<WakeCondition>,
    /// Agents without a process: lost, removed, or retired.
    lost: BTreeSet<AgentId>,
    /// Agents removed since the last tick, whose bodies stop in this one.
    removed: Vec<AgentId>,
    /// Agents that an event has taken out of the run.
    retired: BTreeSet<AgentId>,
    interventions: u64,
    decisions: u64,
    failed_searches: Vec<u32>,
    /// The stage of each agent.
    stages: Vec<Option<Stage>>,
    /// What the team had seen, in cells, when all of it rested, or had seen nothing new for long,
    /// and there was something left to see.
    rested_at: Option<usize>,
    /// What the team has seen, in cells, and since when.
    last_new: (usize, Tick),
    standstill: standstill::Standstill,
    /// Since when all agents wait in their bases.
    waiting_since: Option<Tick>,
    /// The last information text of each agent.
    infos: Vec<String>,
}

impl<'a> Engine<'a> {
    pub(super) fn new(scenario: &'a Scenario, mut world: World) -> Result<Self, RunError> {
        if matches!(scenario.stop_rule(), StopRule::Back | StopRule::Duration) {
            world.defer_scans();
        }
        let agents = scenario.agents.count as usize;
        let workers = Arc::new(Workers::new(setup::threads(scenario))?);
        Ok(Self {
            scenario,
            changed: Vec::new(),
            schedule: scenario.schedule().into(),
            map_changes: Vec::new(),
            joining: BTreeSet::new(),
            chain: Chain::new(&scenario.initial_identity(), &world, Arc::clone(&workers)),
            world,
            workers,
            wake_conditions: vec![WakeCondition::NEXT_TICK; agents],
            lost: BTreeSet::new(),
            removed: Vec::new(),
            retired: BTreeSet::new(),
            interventions: 0,
            decisions: 0,
            failed_searches: vec![0; agents],
            stages: vec![None; agents],
            rested_at: None,
            last_new: (0, Tick::ZERO),
            standstill: standstill::Standstill::default(),
            waiting_since: None,
            infos: vec![String::new(); agents],
        })
    }

    /// The scenario as it holds now.
    pub(super) fn scenario(&self) -> &Scenario {
        self.changed.last().unwrap_or(self.scenario)
    }

    /// The world, to be read.
    pub(super) fn world(&self) -> &World {
        &self.world
    }

    /// Whether an agent has no process: it was lost or has left.
    pub(super) fn is_lost(&self, agent: AgentId) -> bool {
        self.lost.contains(&agent)
    }

    /// Agents without a process, ascending.
    pub(super) fn lost(&self) -> impl Iterator<Item = AgentId> + '_ {
        self.lost.iter().copied()
    }

    /// Notes that an agent has no process any more.
    pub(super) fn lose(&mut self, agent: AgentId) {
        self.lost.insert(agent);
    }

    /// Agents that an event or a request has taken out of the run, ascending.
    pub(super) fn retired(&self) -> impl Iterator<Item = AgentId> + '_ {
        self.retired.iter().copied()
    }

    /// Whether an agent is asked for commands.
    pub(super) fn takes_part(&self, agent: AgentId) -> bool {
        !self.is_lost(agent) && self.world.presence(agent) == Presence::Active
    }

    /// What is shown of a run, once all scans are counted.
    pub(super) fn shown(&mut self) -> Shown<'_> {
        self.flush_scans();
        let Self { world, infos, lost, .. } = self;
        Shown { world, infos, lost }
    }

    /// The progress of the run.
    pub(super) fn progress(&mut self) -> Progress {
        self.flush_scans();
        wire::progress(&mut self.world)
    }

    pub(super) fn tick(&self) -> Tick {
        self.world.tick()
    }

    /// Number of agents, lost ones included.
    pub(super) fn agents(&self) -> usize {
        self.wake_conditions.len()
    }

    /// Casts the scans that are due, or has helpers cast them while the run continues.
    pub(super) fn sense(&mut self) {
        self.world.sense(&self.workers);
    }

    /// Waits for all scans and counts them. Whatever shows or records the coverage or the digest
    /// comes after it.
    pub(super) fn flush_scans(&mut self) {
        if !self.world.has_no_pending_scans() {
            let shares = self.world.flush_scans();
            self.chain.resolve(&shares);
        }
    }

    /// Begins the digest as the build of a recording did, whose first digest is `recorded`: earlier
    /// ones had the name of a map file in it. Call it before the first tick.
    pub(super) fn continue_chain_of(&mut self, recorded: Digest) {
        if self.scenario.map.kind != MapKind::File || self.digest() == recorded {
            return;
        }
        let identity = self.scenario.initial_identity_with_map_file();
        let mut earlier = Chain::new(&identity, &self.world, Arc::clone(&self.workers));
        if earlier.digest() == recorded {
            self.chain = earlier;
        }
    }

    /// The digest up to the last tick.
    pub(super) fn digest(&mut self) -> Digest {
        self.flush_scans();
        self.chain.digest()
    }

    /// The agents to ask in this tick, ascending. `recorded` has the replies of a tick that is
    /// re-executed.
    pub(super) fn due(&mut self, recorded: Option<&RecordedTick>) -> Vec<(AgentId, RequestKind)> {
        let tick = self.tick();
        let mut due = Vec::new();
        for agent in self.world.agents() {
            if !self.takes_part(agent) {
                continue;
            }
            let wake = self.wake_conditions[agent.index()];
            let happened = self.world.events(agent, wake.events);
            if wake.is_met(tick, happened) {
                due.push((agent, RequestKind::Scheduled));
                continue;
            }
            // Out of turn, a recording has only replies that did something.
            let is_asked = match recorded {
                Some(recorded) => recorded.commands.contains_key(&agent),
                None => !self.scenario.execution.look_ahead,
            };
            if is_asked {
                due.push((agent, RequestKind::Polled));
            }
        }
        due
    }

    /// The observation of an agent as a request.
    pub(super) fn request(&mut self, agent: AgentId, kind: RequestKind, phase: u8) -> ObservationRequest {
        let observation = self.world.observe(agent, kind);
        ObservationRequest { agent, kind, fragments: Arc::new(fragments::split(observation, phase)) }
    }

    /// Commits and logs the exchanges of a tick. Returns them, and the actions for
    /// [`Engine::step`].
    pub(super) fn commit(
        &mut self,
        requests: Vec<ObservationRequest>,
        mut replies: Replies,
        log: &mut SessionLog<'_>,
    ) -> Result<(Vec<CommittedReply>, BTreeMap<AgentId, Command>), RunError> {
        let tick = self.tick();
        let mut committed = Vec::new();
        let mut actions = BTreeMap::new();
        for ObservationRequest { agent, kind, fragments } in requests {
            let Some(reply) = replies.remove(&agent) else {
                actions.insert(agent, Command::LOST);
                continue;
            };
            let fragments = match kind {
                RequestKind::Scheduled => fragments,
                RequestKind::Polled if reply.is_no_op() => continue,
                RequestKind::Polled => self.request(agent, RequestKind::Scheduled, Fragment::RUNNING).fragments,
            };
            for fragment in &*fragments {
                log.write_digested(EntryKind::Observation(agent), tick, fragment, &mut self.chain)?;
                if self.chain.kept_bytes() >= KEPT_BYTES_MAX {
                    self.flush_scans();
                }
            }
            log.write_digested(EntryKind::Command(agent), tick, &reply.message, &mut self.chain)?;
            self.wake_conditions[agent.index()] = reply.command.wake;
            self.decisions += 1;
            self.world.note_belief(agent, reply.message.known_free);
            self.failed_searches[agent.index()] = reply.message.failed_searches;
            if let Ok(Some(stage)) = Stage::from_wire(reply.message.stage) {
                self.stages[agent.index()] = Some(stage);
            }
            if !reply.message.info.is_empty() {
                self.infos[agent.index()].clone_from(&reply.message.info);
            }
            actions.insert(agent, reply.command.clone());
            committed.push(CommittedReply { agent, fragments, reply });
        }
        Ok((committed, actions))
    }

    /// Advances the world by one tick.
    pub(super) fn step(&mut self, mut actions: BTreeMap<AgentId, Command>) {
        actions.extend(std::mem::take(&mut self.removed).into_iter().map(|agent| (agent, Command::LOST)));
        self.world.step(actions);
        self.world.cast_ahead(&self.workers);
        self.chain.close(&self.world);
    }

    /// The next event that is due in this tick, which enters the digest; changes of the map are put
    /// aside for [`Engine::change_map`].
    pub(super) fn next_event(&mut self) -> Option<EventAction> {
        let tick = self.tick();
        loop {
            self.schedule.front().filter(|event| event.tick <= tick)?;
            let ScheduledEvent { digested, action, .. } = self.schedule.pop_front()?;
            if let EventAction::ChangeMap(change) = action {
                self.map_changes.push((change, digested));
                continue;
            }
            self.chain.message(digested.as_bytes());
            return Some(action);
        }
    }

    /// Executes the changes of the map that wait for nothing any more. They enter the digest in
    /// this tick.
    pub(super) fn change_map(&mut self, log: &mut SessionLog<'_>) -> Result<(), RunError> {
        if self.map_changes.is_empty() {
            return Ok(());
        }
        let tick = self.tick();
        for (change, digested) in std::mem::take(&mut self.map_changes) {
            if !self.world.is_due(&change) {
                self.map_changes.push((change, digested));
                continue;
            }
            self.flush_scans();
            self.chain.message(digested.as_bytes());
            if let Some(cells) = change.cells(self.world.terrain().extent())
                && self.world.change_map(cells, change.terrain) > 0
            {
                let message = wire::map_change(tick, cells, change.terrain, MapChangeCause::Event);
                log.write(EntryKind::MapChange, tick, &message)?;
            }
            // Those who rested may have something to see now.
            self.rested_at = None;
        }
        Ok(())
    }

    /// Makes the cells of a box free or wall, as a request says, and returns how many have changed;
    /// or returns the reason why they stay as they are.
    pub(super) fn change_cells(
        &mut self,
        cells: CellBox,
        terrain: Terrain,
        log: &mut SessionLog<'_>,
    ) -> Result<Result<u32, &'static str>, RunError> {
        if terrain == Terrain::Wall && self.world.is_anything_in(cells) {
            return Ok(Err("a body, a relay or an obstacle is in the box: move it away, or choose other cells"));
        }
        self.flush_scans();
        let changed = self.world.change_map(cells, terrain);
        if changed > 0 {
            let tick = self.tick();
            self.interventions += 1;
            let message = wire::map_change(tick, cells, terrain, MapChangeCause::Request);
            log.write_digested(EntryKind::MapChange, tick, &message, &mut self.chain)?;
            self.rested_at = None;
            self.standstill = standstill::Standstill::default();
        }
        Ok(Ok(changed))
    }

    /// Lets a late agent join as soon as there is room for it.
    pub(super) fn expect_join(&mut self, agent: AgentId) {
        self.joining.insert(agent);
    }

    /// Lets late agents join that have room now.
    pub(super) fn admit_late(&mut self) {
        let Self { joining, world, .. } = self;
        joining.retain(|&agent| !world.join(agent));
    }

    /// Takes an agent out of the run. Returns whether it has a process, which has to end.
    pub(super) fn retire(&mut self, agent: AgentId) -> bool {
        self.joining.remove(&agent);
        self.retired.insert(agent);
        !self.is_lost(agent)
    }

    /// Takes the body of a retired agent out of the world.
    pub(super) fn withdraw(&mut self, agent: AgentId) {
        self.world.leave(agent);
    }

    /// Leaves the body of a retired agent in the world, where it does nothing more.
    pub(super) fn break_down(&mut self, agent: AgentId) {
        self.world.break_down(agent);
    }

    /// Switches the radio of an agent on or off.
    pub(super) fn switch_radio(&mut self, agent: AgentId, is_on: bool) {
        self.world.switch_radio(agent, is_on);
    }

    /// Lets another scenario hold from now on. The agents receive it, except `third_party` ones;
    /// those whose controller or its settings change hand over their bodies and LiDARs, and are
    /// due.
    pub(super) fn change(&mut self, scenario: Scenario, third_party: &BTreeSet<AgentId>) {
        let before = self.scenario();
        let choices = before.agents.controllers().into_iter().zip(scenario.agents.controllers());
        let takes_over: Vec<bool> = choices.map(|(old, new)| old != new).collect();
        let has_other_radio = before.communication != scenario.communication;
        let extent = self.world.terrain().extent();
        let announcement = wire::scenario(&scenario, &extent, self.world.rays());
        let is_news = announcement != wire::scenario(before, &extent, self.world.rays());
        if has_other_radio {
            self.world.set_radios(scenario.communication.comms(scenario.seed));
        }
        let data = SharedBytes::from(cdr::encode(&announcement));
        for agent in self.world.agents().filter(|agent| !self.lost.contains(agent) && !third_party.contains(agent)) {
            if is_news {
                self.world.tell(agent, data.clone());
            }
            if takes_over[agent.index()] && self.world.presence(agent) == Presence::Active {
                self.world.hand_over(agent);
                self.wake_conditions[agent.index()] = WakeCondition::NEXT_TICK;
                // The next one names its own, or none.
                self.stages[agent.index()] = None;
            }
        }
        self.changed.push(scenario);
    }

    /// Moves an agent to a pose at rest, or returns the reason why it cannot be there.
    pub(super) fn place(
        &mut self,
        agent: AgentId,
        pose: Pose,
        log: &mut SessionLog<'_>,
    ) -> Result<Result<(), &'static str>, RunError> {
        let placed = self.world.place(agent, pose);
        if placed.is_ok() {
            // Its wake-up condition was meant for another place.
            self.wake_conditions[agent.index()] = WakeCondition::NEXT_TICK;
            self.standstill = standstill::Standstill::default();
            self.record_intervention(agent, &Change::Place(pose), log)?;
        }
        Ok(placed)
    }

    /// Removes an agent from the run as builds did whose services left the body in the world.
    pub(super) fn remove(&mut self, agent: AgentId, log: &mut SessionLog<'_>) -> Result<(), RunError> {
        self.lost.insert(agent);
        self.removed.push(agent);
        self.record_intervention(agent, &Change::Remove, log)
    }

    /// Takes an agent and its body out of the world.
    pub(super) fn leave(&mut self, agent: AgentId, log: &mut SessionLog<'_>) -> Result<(), RunError> {
        self.lost.insert(agent);
        self.retired.insert(agent);
        self.world.leave(agent);
        self.record_intervention(agent, &Change::Leave, log)
    }

    /// Lets an agent of the reserve join at a pose, or returns the reason why it cannot be there.
    pub(super) fn join(
        &mut self,
        agent: AgentId,
        pose: Pose,
        log: &mut SessionLog<'_>,
    ) -> Result<Result<(), &'static str>, RunError> {
        let joined = self.world.join_at(agent, pose);
        if joined.is_ok() {
            self.record_intervention(agent, &Change::Join(pose), log)?;
        }
        Ok(joined)
    }

    /// The agents of the reserve that have not joined, ascending.
    pub(super) fn reserve(&self) -> Vec<AgentId> {
        let is_absent = |agent: &AgentId| self.world.presence(*agent) == Presence::Absent && !self.lost.contains(agent);
        let mut reserve: Vec<AgentId> = self.scenario.agents.reserve.iter().copied().map(AgentId).collect();
        reserve.retain(is_absent);
        reserve.sort_unstable();
        reserve
    }

    fn record_intervention(
        &mut self,
        agent: AgentId,
        change: &Change,
        log: &mut SessionLog<'_>,
    ) -> Result<(), RunError> {
        let tick = self.tick();
        self.interventions += 1;
        Ok(log.write_digested(
            EntryKind::Intervention,
            tick,
            &wire::intervention(tick, agent, change),
            &mut self.chain,
        )?)
    }

    /// The counters of the result, without those of refused messages.
    pub(super) fn counters(&self) -> Vec<Counter> {
        let totals = self.world.totals();
        let mut counters = vec![
            Counter::new(CounterName::FreeCells, self.world.coverage().free_cells() as u64),
            Counter::new(CounterName::Decisions, self.decisions),
            Counter::new(CounterName::FailedSearches, self.failed_searches.iter().copied().map(u64::from).sum()),
            Counter::new(CounterName::Scans, totals.scans.due()),
            Counter::new(CounterName::ScansCast, totals.scans.cast()),
            Counter::new(CounterName::Collisions, totals.collisions),
            Counter::new(CounterName::MessagesSent, totals.messages_sent),
            Counter::new(CounterName::MessagesDelivered, totals.messages_delivered),
            Counter::new(CounterName::MessagesOutOfContact, totals.messages_out_of_contact),
            Counter::new(CounterName::MessagesInboxFull, totals.messages_inbox_full),
            Counter::new(CounterName::MessageBytesDelivered, totals.message_bytes_delivered),
            Counter::new(CounterName::AgentsDropped, self.lost.difference(&self.retired).count() as u64),
        ];
        let map_changes = u64::from(self.world.map_revision());
        // Counters of features that the scenario does not use are left out.
        let radios = || std::iter::once(self.scenario).chain(&self.changed).map(|held| &held.communication);
        let communication = &self.scenario.communication;
        counters.extend(
            radios()
                .any(|radio| radio.loss > 0.0)
                .then(|| Counter::new(CounterName::MessagesLostRadio, totals.messages_lost_radio)),
        );
        if radios().any(|radio| radio.bytes_per_s.is_finite()) {
            counters.push(Counter::new(CounterName::MessagesQueueFull, totals.messages_queue_full));
        }
        if communication.relays.per_agent > 0 {
            counters.extend([
                Counter::new(CounterName::RelaysLeft, totals.relays_left),
                Counter::new(CounterName::RelaysRefused, totals.relays_refused),
                Counter::new(CounterName::RelayWritings, totals.relay_writings),
                Counter::new(CounterName::RelayWritingsLost, totals.relay_writings_lost),
                Counter::new(CounterName::RelayReadings, totals.relay_readings),
            ]);
        }
        let kinds = totals.message_bytes_by_kind.iter();
        counters.extend(kinds.map(|(kind, &bytes)| Counter::new(CounterName::MessageBytesOfType(*kind), bytes)));
        let milestones = self.world.coverage().milestones();
        counters
            .extend(milestones.map(|(permille, tick)| Counter::new(CounterName::TickExplored { permille }, tick.0)));
        let attainable = self.world.attainable_share();
        counters.extend(attainable.map(|share| Counter::new(CounterName::AttainablePpm, (share * 1e6).round() as u64)));
        if let Some(EnergyTotals { used_j, ran_empty, home_at }) = self.world.energy_totals() {
            let used = Counter::new(CounterName::EnergyUsed, (used_j * 1e3).round() as u64);
            counters.extend([used, Counter::new(CounterName::RanEmpty, ran_empty)]);
            counters.extend(home_at.map(|tick| Counter::new(CounterName::TickHome, tick.0)));
        }
        let known_at_base_since = self.world.coverage().known_at_base_since();
        counters.extend(known_at_base_since.map(|tick| Counter::new(CounterName::TickKnownAtBase, tick.0)));
        if let Some(DriftTotals { position_error_m, map_errors, blocks, closures }) = self.world.drift_totals() {
            counters.extend([
                Counter::new(CounterName::PositionError, (position_error_m * 1e6).round() as u64),
                Counter::new(CounterName::MapCells, map_errors.cells()),
                Counter::new(CounterName::MapCellsOffBy1, map_errors.off_by_1),
                Counter::new(CounterName::MapCellsOffBy2, map_errors.off_by_2),
                Counter::new(CounterName::MapCellsOffByMore, map_errors.off_by_more),
                Counter::new(CounterName::MapBlocks, blocks),
                Counter::new(CounterName::LoopClosures, closures),
            ]);
        }
        counters.extend((self.interventions > 0).then(|| Counter::new(CounterName::Interventions, self.interventions)));
        counters.extend((map_changes > 0).then(|| Counter::new(CounterName::MapChanges, map_changes)));
        counters
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chain_continues_that_of_an_earlier_build() {
        let folder = tempfile::tempdir().unwrap();
        let hall = "#####\n#####\n#####\n#####\n#####\n";
        let room = "#####\n#...#\n#...#\n#...#\n#####\n";
        let file = folder.path().join("hall.txt");
        std::fs::write(&file, [hall, room, room, room, hall].join("\n")).unwrap();
        let text = format!(
            "seed = 1\nduration_s = 1.0\nmap = {{ kind = \"file\", file = {:?}, cell_m = 1.0 }}\nagents = {{ count = 1 }}\n",
            file.display().to_string()
        );
        let scenario = Scenario::parse("s.toml", &text, &[]).unwrap();
        let engine = || Engine::new(&scenario, setup::build(&scenario).unwrap().0).unwrap();
        let now = engine().digest();
        let (mut continued, identity) = (engine(), scenario.initial_identity_with_map_file());
        let mut earlier = Chain::new(&identity, &continued.world, Arc::clone(&continued.workers));
        assert_ne!(earlier.digest(), now);
        continued.continue_chain_of(earlier.digest());
        assert_eq!(continued.digest(), earlier.digest());
        for recorded in [now, Digest([7; 32])] {
            let mut other = engine();
            other.continue_chain_of(recorded);
            assert_eq!(other.digest(), now);
        }
    }
}
