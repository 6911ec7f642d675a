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
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Observation as Fragment, Progress};
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
use simulation::wire::{self, MapChangeCause};
use world::map_change::MapChange;
use world::workers::Workers;
use world::{Presence, World};

mod completion;
mod counters;
mod interventions;
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
