//! Target `server`: the session loop, with two scripted agents and a hostile sender.
//!
//! The hostile sender is either the process of agent 1, and its messages come before the legal
//! reply; or it is foreign. Every message of a foreign sender is refused, counted and without
//! effect. With a hostile member, the run is that of the replies which the server has to accept,
//! and of no other message.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use arbitrary::Unstructured;
use msgs::cdr;
use msgs::ids::{AgentId, Tick};
use msgs::limits::{OBSERVATION_BYTES_MAX, PROTOCOL};
use msgs::maes_msgs::{self, Command, Join, JoinReply, Observation, Parcel, Task, Wake};
use sim_server::session::{RunConfig, RunObserver};
use sim_server::setup;
use sim_server::transport::{AgentTransport, ControlInput, Inbound, Incoming, ObserverOutput};
use simulation::lockstep::SourceId;
use simulation::scenario::Scenario;
use simulation::wire;
use simulation::world::World;

use crate::hostile_messages::{self, Known};

/// A short run in a small cave. Without look-ahead there is a request to each agent in every tick.
const SCENARIO: &str = "seed = 7\nduration_s = 0.4\nstop_when_explored = false\n[map]\nkind = \"spheres\"\nsize = 14\n\
                        spheres = { radius_min = 2, radius_max = 4 }\n[agents]\ncount = 2\n[lidar]\nrays = 16\n[execution]\nthreads = 1\nlook_ahead = false\n";

/// Number of agents of the run.
const AGENTS: u32 = 2;

/// The processes of the agents, with their instance numbers.
const MEMBERS: [(SourceId, u64); AGENTS as usize] = [(SourceId([1; 16]), 11), (SourceId([2; 16]), 12)];

/// The source of a foreign sender.
const FOREIGN: SourceId = SourceId([0xee; 16]);

/// Most hostile messages before and after a reply.
const HOSTILE_MAX: usize = 6;

/// Most notes of the server: five for each of ten kinds of refusals, and ten others.
const NOTES_MAX: usize = 60;

/// Executes a run with hostile messages and the run that it must equal.
pub(crate) fn run(bytes: &[u8]) {
    let mut data = Unstructured::new(bytes);
    let is_member = data.arbitrary().unwrap_or(false);
    let mut script = Script::new(Some(data), if is_member { MEMBERS[1].0 } else { FOREIGN }, BTreeMap::new());
    let (result, notes) = script.play();
    assert!(notes <= NOTES_MAX, "{notes} notes");
    let refused: u64 = refusals(&result).map(|counter| counter.value).sum();
    if is_member {
        let mut honest = Script::new(None, FOREIGN, script.taken);
        let (expected, _) = honest.play();
        assert_eq!(without_refusals(result), without_refusals(expected));
    } else {
        static HONEST: OnceLock<maes_msgs::Result> = OnceLock::new();
        let honest = HONEST.get_or_init(|| Script::new(None, FOREIGN, BTreeMap::new()).play().0);
        assert_eq!(refused, script.foreign, "each message of a foreign sender is refused");
        assert_eq!(without_refusals(result), without_refusals(honest.clone()));
    }
}

fn refusals(result: &maes_msgs::Result) -> impl Iterator<Item = &maes_msgs::Counter> {
    result.counters.iter().filter(|counter| counter.name.starts_with("refused_"))
}

fn without_refusals(mut result: maes_msgs::Result) -> maes_msgs::Result {
    result.counters.retain(|counter| !counter.name.starts_with("refused_"));
    result
}

/// The link of a run, on which every message arrives at once.
struct Script<'a> {
    /// The bytes of hostile messages; `None`: there are none.
    data: Option<Unstructured<'a>>,
    hostile: SourceId,
    /// Replies of agent 1 in place of the script's, by tick.
    instead: BTreeMap<u64, Command>,
    said: VecDeque<Incoming>,
    run: u64,
    tick: u64,
    /// Agents with a request in this tick, and its phase.
    asked: BTreeSet<u32>,
    phase: u8,
    /// Replies of agent 1 that the server has to accept, by tick.
    taken: BTreeMap<u64, Command>,
    /// Messages of a foreign sender that the server has received.
    foreign: u64,
}

impl<'a> Script<'a> {
    fn new(data: Option<Unstructured<'a>>, hostile: SourceId, instead: BTreeMap<u64, Command>) -> Self {
        Self {
            data,
            hostile,
            instead,
            said: VecDeque::new(),
            run: 0,
            tick: 0,
            asked: BTreeSet::new(),
            phase: Observation::RUNNING,
            taken: BTreeMap::new(),
            foreign: 0,
        }
    }

    /// The result of the run and the number of notes.
    fn play(&mut self) -> (maes_msgs::Result, usize) {
        let scenario = Scenario::parse("run", SCENARIO, &[]).expect("a legal scenario");
        let (world, _) = setup::build(&scenario).expect("there is such a world");
        let mut notes = Notes(0);
        let config = RunConfig::live(&scenario).expect("the system has random numbers");
        let outcome = sim_server::session::run(config, world, self, None, &mut notes, &AtomicBool::new(false));
        let outcome = outcome.unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(Tick(outcome.result.tick), scenario.duration_ticks());
        (outcome.result, notes.0)
    }

    fn say(&mut self, agent: usize, message: Inbound) {
        let topic_agent = AgentId::from_index(agent);
        self.said.push_back(Incoming { topic_agent, source: MEMBERS[agent].0, message });
    }

    fn send_hostile(&mut self) {
        let Some(data) = &mut self.data else { return };
        let instances = MEMBERS.map(|(_, instance)| instance).to_vec();
        let known = Known { run: self.run, tick: self.tick, agents: AGENTS, instances };
        let count = data.int_in_range(0..=HOSTILE_MAX).unwrap_or(0);
        for _ in 0..count {
            if data.is_empty() {
                return;
            }
            if let Ok((topic, message)) = hostile_messages::message(data, &known) {
                self.said.push_back(Incoming { topic_agent: AgentId(topic), source: self.hostile, message });
            }
        }
    }

    /// Keeps a reply of agent 1 that the server has to accept now.
    fn keep(&mut self, incoming: &Incoming) {
        let Inbound::Command(command) = &incoming.message else { return };
        let is_of_agent_1 = incoming.source == MEMBERS[1].0 && incoming.topic_agent == AgentId(1) && command.agent == 1;
        if is_of_agent_1
            && command.run == self.run
            && command.tick == self.tick
            && self.phase == Observation::RUNNING
            && self.asked.contains(&1)
            && wire::command(command, AGENTS).is_ok()
        {
            self.taken.entry(self.tick).or_insert_with(|| command.clone());
        }
    }

    /// The reply of the script.
    fn reply(&self, agent: u32) -> Command {
        let instead = self.instead.get(&self.tick).filter(|_| agent == 1 && self.phase == Observation::RUNNING);
        if let Some(command) = instead {
            return Command { run: self.run, ..command.clone() };
        }
        let tick = self.tick;
        let task = match (tick + u64::from(agent)) % 5 {
            0 => Task { kind: Task::TURN, angle_rad: 0.5, ..Task::default() },
            1 => Task { kind: Task::MOVE, pitch_rad: 0.3, distance_m: 1.0, ..Task::default() },
            _ => Task::default(),
        };
        let parcel = Parcel { agent: Parcel::BROADCAST, kind: 9, data: vec![tick as u8; 100] };
        Command {
            tick,
            run: self.run,
            agent,
            task,
            parcels: if tick.is_multiple_of(3) { vec![parcel] } else { Vec::new() },
            wake: Wake { at_tick: tick + 2, events: Wake::PARCEL },
            ..Command::default()
        }
    }
}

impl AgentTransport for Script<'_> {
    fn announce(&mut self, scenario: &maes_msgs::Scenario) {
        self.run = scenario.run;
        for (agent, (_, instance)) in MEMBERS.into_iter().enumerate() {
            let controller = "script".to_owned();
            let (run, last_tick) = (self.run, Join::NONE);
            let agent_id = AgentId::from_index(agent).0;
            let join = Join { run, agent: agent_id, instance, protocol: PROTOCOL, controller, last_tick };
            self.say(agent, Inbound::Join(join));
        }
    }

    fn reply_join(&mut self, reply: &JoinReply) {
        let is_meant = |(source, instance): &(SourceId, u64)| *instance == reply.instance && *source != self.hostile;
        let honest_is_meant = MEMBERS.get(reply.agent as usize).is_some_and(is_meant);
        assert!(reply.accepted || !honest_is_meant, "agent {} receives a refusal: {}", reply.agent, reply.reason);
    }

    fn send(&mut self, agent: AgentId, part: &Observation) {
        assert!(cdr::encode(part).len() <= OBSERVATION_BYTES_MAX, "a part is larger than a sample may be");
        if (part.tick, part.phase) != (self.tick, self.phase) {
            (self.tick, self.phase) = (part.tick, part.phase);
            self.asked.clear();
        }
        // Resent requests come on a busy machine only.
        if part.part + 1 == part.parts && self.asked.insert(agent.0) {
            self.send_hostile();
            self.say(agent.index(), Inbound::Command(self.reply(agent.0)));
            self.send_hostile();
        }
    }

    fn receive(&mut self, _timeout: Duration) -> Option<Incoming> {
        let incoming = self.said.pop_front()?;
        self.keep(&incoming);
        self.foreign += u64::from(incoming.source == FOREIGN);
        Some(incoming)
    }
}

impl ObserverOutput for Script<'_> {}

impl ControlInput for Script<'_> {}

/// Counts the notes of the server.
struct Notes(usize);

impl RunObserver for Notes {
    fn waiting(&mut self, _missing: &[AgentId]) {}

    fn started(&mut self) {}

    fn progress(&mut self, _world: &World) {}

    fn note(&mut self, _text: &str) {
        self.0 += 1;
    }
}
