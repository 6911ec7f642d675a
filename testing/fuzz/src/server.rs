//! Target `server`: the session loop, with two scripted agents and a hostile sender.
//!
//! The hostile sender is either the process of agent 1, and its messages come before the legal
//! reply; or it is foreign. Every message of a foreign sender is refused, counted and without
//! effect. With a hostile member, the run is that of the replies which the server has to accept,
//! and of no other message.
//!
//! Or all messages are signed, under a join secret, and the hostile sender uses the source of agent
//! 1 without its key: whatever it repeats or forges is refused, and the run is the undisturbed one.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use arbitrary::Unstructured;
use msgs::cdr;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{
    self, AgentMessage, Command, Join, JoinReply, Motion, Observation, SignedCommand, SignedJoin, WakeCondition,
};
use protocol::limits::{OBSERVATION_BYTES_MAX, PROTOCOL};
use protocol::lockstep::SourceId;
use protocol::signed::{JoinRequest, Signed};
use protocol::signing::{self, Bytes, JoinContext, JoinSecret, NONE, SessionKey};
use sim_server::session::{JoinPolicy, RunConfig, RunObserver};
use sim_server::setup;
use simulation::scenario::Scenario;
use transport::{AgentTransport, ControlInput, Inbound, Incoming, Level, ObserverOutput};
use world::World;

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
    let mode = data.arbitrary::<u8>().unwrap_or(0);
    let (is_member, is_signed) = (mode & 1 == 1, mode & 2 == 2);
    let mut script = Script::new(Some(data), if is_member || is_signed { MEMBERS[1].0 } else { FOREIGN });
    script.signing = is_signed.then(Signing::new);
    let (result, notes) = script.play();
    assert!(notes <= NOTES_MAX, "{notes} notes");
    let refused: u64 = refusals(&result).map(|counter| counter.value).sum();
    if is_signed {
        assert_eq!(refused, script.forged, "each forged message is refused");
        assert_eq!(without_refusals(result), without_refusals(undisturbed().clone()));
    } else if is_member {
        let mut honest = Script { instead: script.taken, ..Script::new(None, FOREIGN) };
        let (expected, _) = honest.play();
        assert_eq!(without_refusals(result), without_refusals(expected));
    } else {
        assert_eq!(refused, script.foreign, "each message of a foreign sender is refused");
        assert_eq!(without_refusals(result), without_refusals(undisturbed().clone()));
    }
}

/// The result of the run without hostile messages.
fn undisturbed() -> &'static maes_msgs::Result {
    static RESULT: OnceLock<maes_msgs::Result> = OnceLock::new();
    RESULT.get_or_init(|| Script::new(None, FOREIGN).play().0)
}

fn refusals(result: &maes_msgs::Result) -> impl Iterator<Item = &maes_msgs::Counter> {
    result.counters.iter().filter(|counter| counter.is_refusal())
}

fn without_refusals(mut result: maes_msgs::Result) -> maes_msgs::Result {
    result.counters.retain(|counter| !counter.is_refusal());
    result
}

/// What the members of a signed run know.
struct Signing {
    secret: JoinSecret,
    announcement: Bytes,
    joins: Vec<Signed<JoinRequest>>,
    keys: [Option<SessionKey>; AGENTS as usize],
    /// The codes that were sent last, by agent: every node can read them.
    macs: [Bytes; AGENTS as usize],
}

impl Signing {
    fn new() -> Self {
        let secret = JoinSecret::new(b"the join secret of the target").expect("long enough");
        Self { secret, announcement: NONE, joins: Vec::new(), keys: [None, None], macs: [NONE; AGENTS as usize] }
    }

    /// The join of a member, which proves the secret.
    fn join(&mut self, agent: usize, join: Join) -> Inbound {
        let request = JoinRequest { join, nonce: [7; 32], starts: 1 };
        let signed = Signed::sign(request, &self.secret.join_key(&self.announcement, &MEMBERS[agent].0.0));
        self.joins.push(signed.clone());
        Inbound::Join(signed)
    }

    /// Derives the key of a member, if the reply is for it and proven.
    fn take_reply(&mut self, reply: &JoinReply) {
        let agent = reply.agent as usize;
        let Some(join) = self.joins.get(agent) else { return };
        let context = JoinContext { announcement: &self.announcement, source: &MEMBERS[agent].0.0, join };
        if let Ok(reply) = Signed::from(reply.clone()).verify(&self.secret.reply_key(context)) {
            assert!(reply.accepted, "agent {agent} hears a refusal that it believes: {}", reply.reason);
            self.keys[agent] = Some(self.secret.session_key(context, &reply.nonce));
        }
    }

    /// The command of a member.
    fn command(&mut self, command: Command) -> Inbound {
        let agent = command.agent as usize;
        let signed = Signed::sign_with(command, self.keys[agent].as_ref());
        self.macs[agent] = SignedCommand::from(signed.clone()).mac;
        Inbound::Command(signed)
    }

    /// A hostile message with a signature of the sender's making: none, a wrong one, or one that
    /// was heard.
    fn forged(&self, data: &mut Unstructured<'_>, message: Inbound) -> arbitrary::Result<Inbound> {
        let choice = data.int_in_range(0..=2)?;
        let bytes = |heard: Bytes, data: &mut Unstructured<'_>| match choice {
            0 => Ok(NONE),
            1 => data.arbitrary(),
            _ => Ok(heard),
        };
        Ok(match message {
            Inbound::Join(signed) => {
                let join = SignedJoin::from(signed).join;
                let heard = SignedJoin::from(self.joins.get(join.agent as usize).cloned().unwrap_or_default());
                let (nonce, proof) = (bytes(heard.nonce, data)?, bytes(heard.proof, data)?);
                Inbound::Join(SignedJoin { join, nonce, proof, starts: data.arbitrary()? }.into())
            }
            Inbound::Command(signed) => {
                let command = SignedCommand::from(signed).command;
                let heard = self.macs.get(command.agent as usize).copied().unwrap_or(NONE);
                let mac = bytes(heard, data)?;
                Inbound::Command(SignedCommand { command, mac }.into())
            }
            other => other,
        })
    }

    /// Whether a hostile message is one of a member that was heard, and that may come twice.
    fn is_repeated_join(&self, message: &Inbound) -> bool {
        let without_tick = |signed: &Signed<JoinRequest>| {
            let mut signed = SignedJoin::from(signed.clone());
            signed.join.last_tick = Join::NONE;
            signed
        };
        matches!(message, Inbound::Join(join)
            if self.joins.iter().any(|heard| without_tick(heard) == without_tick(join)))
    }
}

/// The link of a run, on which every message arrives at once.
struct Script<'a> {
    /// The bytes of hostile messages; `None`: there are none.
    data: Option<Unstructured<'a>>,
    hostile: SourceId,
    /// Replies of agent 1 in place of the script's, by tick.
    instead: BTreeMap<u64, Command>,
    /// Each with whether it is a hostile one that has to be refused.
    said: VecDeque<(Incoming, bool)>,
    run: u64,
    tick: u64,
    /// Agents with a request in this tick, and its phase.
    asked: BTreeSet<u32>,
    phase: u8,
    /// Replies of agent 1 that the server has to accept, by tick.
    taken: BTreeMap<u64, Command>,
    /// Messages of a foreign sender that the server has received.
    foreign: u64,
    /// `None`: nothing is signed.
    signing: Option<Signing>,
    /// Hostile messages of a signed run that the server has received and has to refuse.
    forged: u64,
}

impl<'a> Script<'a> {
    fn new(data: Option<Unstructured<'a>>, hostile: SourceId) -> Self {
        Self {
            data,
            hostile,
            instead: BTreeMap::new(),
            said: VecDeque::new(),
            run: 0,
            tick: 0,
            asked: BTreeSet::new(),
            phase: Observation::RUNNING,
            taken: BTreeMap::new(),
            foreign: 0,
            signing: None,
            forged: 0,
        }
    }

    /// The result of the run and the number of notes.
    fn play(&mut self) -> (maes_msgs::Result, usize) {
        let scenario = Scenario::parse("run", SCENARIO, &[]).expect("a legal scenario");
        let (world, _) = setup::build(&scenario).expect("there is such a world");
        let mut notes = Notes(0);
        let secret = self.signing.as_ref().map(|signing| signing.secret.clone());
        let config = RunConfig::live(&scenario).expect("the system has random numbers");
        let config = config.with_policy(JoinPolicy { secret, third_party: BTreeSet::new() });
        let outcome = sim_server::session::run(config, world, self, None, &mut notes, &AtomicBool::new(false));
        let outcome = outcome.unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(Tick(outcome.result.tick), scenario.duration_ticks());
        (outcome.result, notes.0)
    }

    fn say(&mut self, agent: usize, message: Inbound) {
        let topic_agent = AgentId::from_index(agent);
        self.said.push_back((Incoming { topic_agent, source: MEMBERS[agent].0, message }, false));
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
                let (message, is_forged) = match &self.signing {
                    Some(signing) => {
                        let Ok(message) = signing.forged(data, message) else { return };
                        let is_repeated = signing.is_repeated_join(&message);
                        (message, !is_repeated)
                    }
                    None => (message, false),
                };
                let incoming = Incoming { topic_agent: AgentId(topic), source: self.hostile, message };
                self.said.push_back((incoming, is_forged));
            }
        }
    }

    /// Keeps a reply of agent 1 that the server has to accept now.
    fn keep(&mut self, incoming: &Incoming) {
        let Inbound::Command(signed) = &incoming.message else { return };
        let command = signed.claimed();
        let is_of_agent_1 = incoming.source == MEMBERS[1].0 && incoming.topic_agent == AgentId(1) && command.agent == 1;
        if is_of_agent_1
            && command.run == self.run
            && command.tick == self.tick
            && self.phase == Observation::RUNNING
            && self.asked.contains(&1)
            && protocol::command::Command::from_message(command, AGENTS).is_ok()
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
        let motion = match (tick + u64::from(agent)) % 5 {
            0 => Motion { kind: Motion::TURN, angle_rad: 0.5, ..Motion::default() },
            1 => Motion { kind: Motion::MOVE, pitch_rad: 0.3, distance_m: 1.0, ..Motion::default() },
            _ => Motion::default(),
        };
        let message = AgentMessage { agent: AgentMessage::BROADCAST, kind: 9, data: vec![tick as u8; 100].into() };
        Command {
            tick,
            run: self.run,
            agent,
            motion,
            messages: if tick.is_multiple_of(3) { vec![message] } else { Vec::new() },
            wake: WakeCondition { at_tick: tick + 2, events: WakeCondition::MESSAGE },
            ..Command::default()
        }
    }
}

impl AgentTransport for Script<'_> {
    fn announce(&mut self, scenario: &maes_msgs::Scenario) {
        self.run = scenario.run;
        if let Some(signing) = &mut self.signing {
            signing.announcement = signing::announcement(scenario);
        }
        for (agent, (_, instance)) in MEMBERS.into_iter().enumerate() {
            let controller = "script".to_owned();
            let (run, last_tick) = (self.run, Join::NONE);
            let agent_id = AgentId::from_index(agent).0;
            let join = Join { run, agent: agent_id, instance, protocol: PROTOCOL, controller, last_tick };
            let message = match &mut self.signing {
                Some(signing) => signing.join(agent, join),
                None => Inbound::Join(Signed::unsigned(join)),
            };
            self.say(agent, message);
        }
    }

    fn is_open(&self) -> bool {
        self.signing.is_some()
    }

    fn reply_join(&mut self, reply: &JoinReply) {
        if let Some(signing) = &mut self.signing {
            signing.take_reply(reply);
        }
        let is_meant = |(source, instance): &(SourceId, u64)| *instance == reply.instance && *source != self.hostile;
        let honest_is_meant = MEMBERS.get(reply.agent as usize).is_some_and(is_meant);
        assert!(reply.accepted || !honest_is_meant, "agent {} receives a refusal: {}", reply.agent, reply.reason);
    }

    fn send(&mut self, agent: AgentId, signed: Signed<Observation>) {
        let key = self.signing.as_ref().and_then(|signing| signing.keys[agent.index()].as_ref());
        let part = signed.verify_with(key).expect("each observation is signed");
        assert!(cdr::encode(&*part).len() <= OBSERVATION_BYTES_MAX, "a part is larger than a sample may be");
        if (part.tick, part.phase) != (self.tick, self.phase) {
            (self.tick, self.phase) = (part.tick, part.phase);
            self.asked.clear();
        }
        // Resent requests come on a busy machine only.
        if part.is_last() && self.asked.insert(agent.0) {
            self.send_hostile();
            let reply = self.reply(agent.0);
            let reply = match &mut self.signing {
                Some(signing) => signing.command(reply),
                None => Inbound::Command(Signed::unsigned(reply)),
            };
            self.say(agent.index(), reply);
            self.send_hostile();
        }
    }

    fn receive(&mut self, _timeout: Duration) -> Option<Incoming> {
        let (incoming, is_forged) = self.said.pop_front()?;
        self.forged += u64::from(is_forged);
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

    fn note(&mut self, _level: Level, _text: &str) {
        self.0 += 1;
    }
}
