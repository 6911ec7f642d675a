use std::mem::take;
use std::sync::{Arc, Mutex};

use msgs::maes_msgs::{AgentMessage as Message, CellRuns, Contact};
use nalgebra::Point3;
use protocol::event_mask::EventMask;
use protocol::message_type::MessageType;
use protocol::signed::Signed;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::*;
use agent::command::{AgentMessage, Peer};
use agent::sharing::VERSION;

/// Counts its decisions.
struct Counting(u32);

impl Controller for Counting {
    fn decide(&mut self, _observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        self.0 += 1;
        assert!(ctx.map().free() > 0, "the observation is in the map");
        let distance_m = f64::from(self.0);
        Command::new(Motion::Move { pitch_rad: 0.0, distance_m }, WakeCondition::NEXT_TICK)
    }
}

/// The run info of a small run with this many agents.
fn run_info(agents: u32) -> RunInfo {
    let scenario = maes_msgs::Scenario {
        size: [4, 4, 4],
        cell_m: 1.0,
        agents,
        bodies: vec![maes_msgs::Body::default()],
        body_of: vec![0; agents as usize],
        duration_ticks: 10_000,
        share_period_ticks: 10,
        ..Default::default()
    };
    RunInfo::from_message(&scenario, AgentId(2)).unwrap()
}

fn agent() -> Agent {
    Agent::new(AgentId(2), run_info(9), Box::new(Counting(0)))
}

/// As it comes over a private transport.
fn observe(agent: &mut Agent, part: Part) -> Result<Reaction, AgentError> {
    agent.take(Signed::unsigned(part).trusted())
}

fn part(tick: u64, phase: u8) -> Part {
    let seen_free = CellRuns { start: vec![0], length: vec![3] };
    Part { tick, parts: 1, phase, seen_free, ..Part::default() }
}

#[test]
fn resent_observation_gets_the_same_reply() {
    let mut agent = agent();
    let first = observe(&mut agent, part(3, Part::RUNNING)).unwrap();
    assert_eq!(observe(&mut agent, part(3, Part::RUNNING)).unwrap(), first);
    let Reaction::Reply(command) = first else { panic!("{first:?}") };
    assert_eq!((command.agent, command.tick, command.motion.distance_m), (2, 3, 1.0));
    let Reaction::Reply(next) = observe(&mut agent, part(4, Part::RUNNING)).unwrap() else { panic!() };
    assert_eq!(next.motion.distance_m, 2.0);
    assert_eq!(observe(&mut agent, part(3, Part::RUNNING)).unwrap(), Reaction::None);
    assert_eq!(agent.last_tick(), Some(Tick(4)));
}

#[test]
fn end_is_acknowledged_even_in_a_replied_tick() {
    let mut agent = agent();
    observe(&mut agent, part(3, Part::RUNNING)).unwrap();
    let Reaction::Acknowledge(acknowledgement) = observe(&mut agent, part(3, Part::ENDED)).unwrap() else { panic!() };
    assert_eq!((acknowledgement.tick, acknowledgement.motion.kind), (3, maes_msgs::Motion::KEEP));
    assert_eq!((agent.map().free(), agent.map().covered()), (3, 1));
}

/// Acts at random when it is due, depending on all it knows; logs the observations of these ticks.
struct Whim {
    rng: ChaCha8Rng,
    wake: WakeCondition,
    shown: Arc<Mutex<Vec<Observation>>>,
    is_restless: bool,
}

impl Controller for Whim {
    fn is_polled_between_wakes(&self) -> bool {
        true
    }

    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        assert!(observation.messages.iter().all(|message| message.kind != MessageType::Map.number()));
        if !self.wake.is_met(observation.tick, observation.events) {
            let is_acting = self.is_restless && observation.tick.0.is_multiple_of(7);
            let info = if is_acting { "restless".to_owned() } else { String::new() };
            return Command { info, ..Command::keep(self.wake) };
        }
        self.shown.lock().unwrap().push(observation.clone());
        let rng = &mut self.rng;
        self.wake = WakeCondition {
            at: observation.tick.after(rng.random_range(0..40)),
            events: EventMask::from_bits_retain(rng.random_range(0..32)),
        };
        let angle_rad = (ctx.map().free() + 3 * ctx.map().covered() + 7 * ctx.map().wall()) as f64 / 1e3;
        let noise = |rng: &mut ChaCha8Rng| (0..rng.random_range(0..9)).map(|_| rng.random()).collect::<Vec<u8>>();
        Command {
            motion: if rng.random_bool(0.5) { Motion::Turn { angle_rad } } else { Motion::Keep },
            want_view: rng.random_bool(0.2),
            messages: match rng.random_range(0..4) {
                0 => {
                    vec![AgentMessage { peer: Peer::Broadcast, kind: rng.random_range(0..3), data: noise(rng).into() }]
                }
                1 => vec![AgentMessage {
                    peer: Peer::Broadcast,
                    kind: 9,
                    data: vec![0; rng.random_range(0..AGENT_MESSAGE_BYTES_MAX)].into(),
                }],
                _ => Vec::new(),
            },
            ..Command::keep(self.wake)
        }
    }
}

/// The pending observation of an agent, as the server keeps it.
#[derive(Default)]
struct Mailbox {
    free: Vec<u32>,
    messages: Vec<Message>,
    events: EventMask,
    requested: (usize, usize, EventMask),
    contacts: Vec<u32>,
    /// The contacts that were listed since the last multiple of [`SHARE_PERIOD`].
    listed: Vec<u32>,
    wake: Option<WakeCondition>,
    committed: Vec<maes_msgs::Command>,
}

const AGENTS: u32 = 4;
const SIDE: u32 = 12;
const SHARE_PERIOD: u32 = 23;

/// Simulates a world that depends on its seed alone; the committed commands and the observations of
/// the controllers.
fn play(
    seed: u64,
    looks_ahead: bool,
    is_restless: bool,
) -> (Vec<Vec<maes_msgs::Command>>, Vec<Vec<Observation>>, bool) {
    let scenario = maes_msgs::Scenario {
        size: [SIDE; 3],
        cell_m: 1.0,
        agents: AGENTS,
        bodies: vec![maes_msgs::Body::default()],
        body_of: vec![0; AGENTS as usize],
        share_period_ticks: SHARE_PERIOD,
        duration_ticks: 10_000,
        ..Default::default()
    };
    let run_info = RunInfo::from_message(&scenario, AgentId(2)).unwrap();
    let mut rng = voxels::random_streams::stream(seed, 0, "world");
    let mut agents = Vec::new();
    let mut shown = Vec::new();
    let mut boxes: Vec<Mailbox> = Vec::new();
    for id in 0..AGENTS {
        shown.push(Arc::<Mutex<_>>::default());
        let rng = voxels::random_streams::stream(seed, id.into(), "whim");
        let shown = Arc::clone(&shown[id as usize]);
        let whim = Whim { rng, wake: WakeCondition::NEXT_TICK, shown, is_restless };
        agents.push(Agent::new(AgentId(id), run_info.clone(), Box::new(whim)));
        boxes.push(Mailbox::default());
    }
    let mut places = [0usize; AGENTS as usize];
    let mut pairs = Vec::new();
    let free_cells: Vec<u32> = (0..SIDE.pow(3)).collect();
    for tick in 0..300 {
        if rng.random_bool(0.1) {
            pairs = (0..AGENTS).flat_map(|a| (0..a).map(move |b| (a, b))).filter(|_| rng.random_bool(0.4)).collect();
        }
        let mut posted = Vec::new();
        for id in 0..AGENTS {
            let index = id as usize;
            let mailbox = &mut boxes[index];
            if rng.random_bool(0.3) {
                let start = rng.random_range(0..free_cells.len() - 8);
                let unseen = free_cells[start..start + 8].iter().filter(|cell| !mailbox.free.contains(cell));
                mailbox.free.extend(unseen.copied().collect::<Vec<_>>());
            }
            if rng.random_bool(0.2) {
                places[index] = rng.random_range(0..free_cells.len());
                mailbox.events |= EventMask::NEW_CELL;
            }
            let contacts: Vec<u32> =
                (0..AGENTS).filter(|&other| pairs.contains(&(id, other)) || pairs.contains(&(other, id))).collect();
            let mut change = if contacts == mailbox.contacts { EventMask::empty() } else { EventMask::CONTACTS };
            if tick % u64::from(SHARE_PERIOD) == 0 {
                mailbox.listed.clear();
            }
            let asks = mailbox.wake.is_some_and(|wake| wake.events.intersects(EventMask::FIRST_CONTACT));
            if asks && contacts.iter().any(|contact| !mailbox.listed.contains(contact)) {
                change |= EventMask::FIRST_CONTACT;
            }
            let is_due = mailbox.wake.is_none_or(|wake| wake.is_met(Tick(tick), mailbox.events | change));
            if !is_due && looks_ahead {
                continue;
            }
            let (free, messages, events) = if is_due { (0, 0, EventMask::empty()) } else { mailbox.requested };
            let mut seen = mailbox.free[free..].to_vec();
            seen.sort_unstable();
            let (start, length) = voxels::runs(seen.into_iter());
            let centre = run_info.extent.centre(run_info.extent.cell_at(places[index]));
            let part = Part {
                tick,
                parts: 1,
                position: msgs::geometry_msgs::Point { x: centre.x, y: centre.y, z: centre.z },
                events: (mailbox.events & !events | change).bits(),
                contacts: contacts.iter().map(|&agent| Contact { agent, ..Contact::default() }).collect(),
                messages: mailbox.messages[messages..].to_vec(),
                scan_tick: Part::NEVER,
                seen_free: CellRuns { start, length },
                ..Part::default()
            };
            mailbox.requested = (mailbox.free.len(), mailbox.messages.len(), mailbox.events);
            let Reaction::Reply(command) = observe(&mut agents[index], part).unwrap() else { panic!() };
            let data_bytes: usize = command.messages.iter().map(|message| message.data.len()).sum();
            assert!(data_bytes <= AGENT_MESSAGE_BYTES_MAX);
            let nothing = maes_msgs::Command {
                tick,
                agent: id,
                wake: command.wake,
                known_free: command.known_free,
                failed_searches: command.failed_searches,
                ..Command::keep(WakeCondition::NEXT_TICK).into_message(AgentId(id), Tick(tick))
            };
            if !is_due && command == nothing {
                continue;
            }
            let wake = WakeCondition { at: Tick(command.wake.at_tick.max(tick + 1)), ..command.wake.into() };
            let committed = [std::mem::take(&mut mailbox.committed), vec![command.clone()]].concat();
            let listed = [std::mem::take(&mut mailbox.listed), contacts.clone()].concat();
            let contacts_now = contacts.clone();
            *mailbox = Mailbox { contacts: contacts_now, listed, wake: Some(wake), committed, ..Mailbox::default() };
            for message in command.messages {
                let named = contacts.iter().filter(|&&to| message.agent == Message::BROADCAST || message.agent == to);
                posted.extend(named.map(|&to| (to, Message { agent: id, ..message.clone() })));
            }
        }
        for (to, message) in posted {
            boxes[to as usize].messages.push(message);
            boxes[to as usize].events |= EventMask::MESSAGE;
        }
    }
    let has_shared = agents.iter().all(|agent| agent.sharing().totals().messages_taken > 3);
    let committed = boxes.into_iter().map(|mailbox| mailbox.committed).collect();
    drop(agents);
    (committed, shown.into_iter().map(|shown| take(&mut *shown.lock().unwrap())).collect(), has_shared)
}

#[test]
fn polling_between_triggers_changes_nothing() {
    for seed in 0..12 {
        let (commands, shown, has_shared) = play(seed, true, false);
        let (polled, shown_polled, _) = play(seed, false, false);
        assert_eq!(commands, polled, "seed {seed}");
        assert_eq!(shown, shown_polled, "seed {seed}");
        assert!(has_shared, "seed {seed}: nothing was shared");
        let restless = play(seed, false, true);
        assert_ne!(restless.0, commands);
        assert_eq!(restless.0, play(seed, false, true).0);
    }
}

/// Is due at the given ticks only, and logs its observations.
struct Sleeper {
    ticks: Vec<u64>,
    shown: Arc<Mutex<Vec<Observation>>>,
}

impl Controller for Sleeper {
    fn decide(&mut self, observation: &Observation, _ctx: &mut Ctx<'_>) -> Command {
        self.shown.lock().unwrap().push(observation.clone());
        let wake = WakeCondition { at: Tick(self.ticks.remove(0)), events: EventMask::empty() };
        Command { want_view: true, ..Command::keep(wake) }
    }
}

#[test]
fn controller_is_called_at_its_triggers_with_all_observations() {
    let shown = Arc::<Mutex<_>>::default();
    let sleeper = Sleeper { ticks: vec![30, 90], shown: Arc::clone(&shown) };
    let mut agent = Agent::new(AgentId(2), run_info(3), Box::new(sleeper));
    let mut ask = |tick: u64, cell: u32, messages: Vec<Message>| {
        let seen_free = CellRuns { start: vec![cell], length: vec![1] };
        let contacts = vec![Contact { agent: 1, ..Contact::default() }];
        let part = Part { messages, seen_free, contacts, events: 1 << (tick % 3), ..part(tick, Part::RUNNING) };
        let Reaction::Reply(command) = observe(&mut agent, part).unwrap() else { panic!() };
        command
    };
    let first = ask(5, 0, Vec::new());
    assert_eq!((first.wake.at_tick, first.wake.events, first.messages.len()), (6, EventMask::FIRST_CONTACT.bits(), 1));
    let map_message = Message {
        agent: 1,
        kind: MessageType::Map.number(),
        data: vec![VERSION, 1, 1, 2, 9, 1, 0b1111_1000, 1].into(),
    };
    let other_message = Message { agent: 1, kind: 7, data: vec![3].into() };
    let shared = ask(10, 9, vec![map_message, other_message.clone()]);
    assert_eq!((shared.wake.at_tick, shared.want_view, shared.messages.len()), (11, true, 1));
    assert_eq!(shown.lock().unwrap().len(), 1, "the controller sleeps");
    assert_eq!(ask(20, 4, Vec::new()).wake.at_tick, 21);
    ask(30, 2, vec![other_message]);
    let shown = take(&mut *shown.lock().unwrap());
    assert_eq!(shown.iter().map(|observation| observation.tick.0).collect::<Vec<_>>(), [5, 30]);
    assert_eq!(shown[1].seen.free, [2, 4, 9]);
    let received = AgentMessage { peer: Peer::One(AgentId(1)), kind: 7, data: vec![3].into() };
    assert_eq!(shown[1].messages, [received.clone(), received]);
    assert_eq!(shown[1].events.bits(), 0b111);
    // Four cells seen, of which its own is covered, and one received.
    assert_eq!((agent.map().free(), agent.map().covered()), (5, 1));
}

#[test]
fn controllers_messages_have_priority_in_the_budget() {
    let message = |bytes| AgentMessage { peer: Peer::Broadcast, kind: 3, data: vec![0; bytes].into() };
    let mut command = Command::keep(WakeCondition::NEXT_TICK);
    assert_eq!(message_budget(&command), AGENT_MESSAGE_BYTES_MAX);
    command.messages = vec![message(50_000)];
    assert_eq!(message_budget(&command), AGENT_MESSAGE_BYTES_MAX - 50_000);
    command.motion = Motion::Path(vec![Point3::origin(); 1000]);
    assert_eq!(message_budget(&command), 0);
    command.messages = vec![message(10_000)];
    assert_eq!(message_budget(&command), LIST_BYTES_MAX - 24_000 - 10_016);
}

/// The observation of a tick in which the server announces this controller.
fn change_of_controller(tick: u64, controller: &str) -> Part {
    let scenario = maes_msgs::Scenario {
        size: [4, 4, 4],
        cell_m: 1.0,
        agents: 9,
        controller: controller.to_owned(),
        bodies: vec![maes_msgs::Body::default()],
        body_of: vec![0; 9],
        duration_ticks: 10_000,
        share_period_ticks: 10,
        ..Default::default()
    };
    let message = maes_msgs::AgentMessage {
        agent: maes_msgs::AgentMessage::SERVER,
        data: msgs::cdr::encode(&scenario).into(),
        kind: 0,
    };
    Part { messages: vec![message], ..part(tick, Part::RUNNING) }
}

#[test]
fn another_controller_takes_over_at_once_and_keeps_the_map() {
    let successors: Successors = Box::new(|now| {
        assert_eq!(now.controller, "other");
        Ok(Some(Box::new(Counting(100))))
    });
    let mut agent = agent().with_successors(successors);
    let distance_m = |agent: &mut Agent, part: Part| match observe(agent, part).unwrap() {
        Reaction::Reply(command) => command.motion.distance_m,
        other => panic!("{other:?}"),
    };
    assert_eq!(distance_m(&mut agent, part(3, Part::RUNNING)), 1.0);
    // The controller of this run is called "": nothing changes.
    assert_eq!(distance_m(&mut agent, change_of_controller(4, "")), 2.0);
    assert_eq!(distance_m(&mut agent, change_of_controller(5, "other")), 101.0);
    assert_eq!(agent.map().free(), 3, "what was learned stays");
    assert_eq!(distance_m(&mut agent, part(6, Part::RUNNING)), 102.0);
    let foreign = Part {
        messages: vec![maes_msgs::AgentMessage {
            data: vec![1, 2].into(),
            ..change_of_controller(7, "").messages[0].clone()
        }],
        ..change_of_controller(7, "")
    };
    assert!(
        observe(&mut agent, foreign).unwrap_err().to_string().contains("expected a scenario with the team and the map")
    );
}
