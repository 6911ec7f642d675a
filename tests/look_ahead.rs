//! Look-ahead is exact: agents that act only on their wake-up conditions have the same run with
//! requests at every tick.
//!
//! The agents here use every feature of the protocol at random, and their choices depend on
//! everything that they have observed: they send messages to each other, wait for every kind of
//! event, and request scans and views.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use agent_node::command::{AgentMessage, Command, Motion, Peer, ScanRequest, WakeCondition};
use agent_node::controllers::{Controller, Ctx};
use agent_node::observation::Observation;
use in_memory::AgentsEnd;
use msgs::ids::{AgentId, Tick};
use nalgebra::Vector3;
use protocol::event_mask::EventMask;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use simulation::scenario::Scenario;

use crate::support::memory::{FinishedRun, Play, serve};
use crate::support::recordings::counter;

/// Four neighbouring agents that lose contact now and then.
const SCENARIO: &str = "
seed = 11
duration_s = 120.0
stop_when_explored = false
[map]
kind = \"spheres\"
size = 30
[agents]
count = 4
[communication]
range_m = 5.0
";

/// Acts at random when it is due. Between its wake-up conditions it keeps its task, or turns with
/// `acts_between`.
struct Gossip {
    rng: ChaCha8Rng,
    wake: WakeCondition,
    observed: u64,
    acts_between: bool,
}

impl Gossip {
    fn new(agent: AgentId, acts_between: bool) -> Self {
        let rng = voxels::random_streams::stream(5, agent.0.into(), "gossip");
        Self { rng, wake: WakeCondition::NEXT_TICK, observed: 0, acts_between }
    }

    fn mix(&mut self, number: u64) {
        self.observed = (self.observed.rotate_left(5) ^ number).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }

    fn mix_all(&mut self, observation: &Observation, ctx: &Ctx<'_>) {
        let Observation { tick, pose, events, .. } = observation;
        self.mix(tick.0);
        self.mix(u64::from(events.bits()));
        self.mix(pose.position.x.to_bits() ^ pose.yaw_rad.to_bits());
        self.mix(u64::from(observation.is_active) + 2 * u64::from(observation.collision.is_some()));
        self.mix(observation.scan_tick.map_or(0, |tick| tick.0));
        self.mix((observation.seen.free.len() + 1000 * observation.seen.wall.len()) as u64);
        self.mix(observation.view.as_ref().map_or(0, |view| view.free.iter().map(|&cell| u64::from(cell)).sum()));
        self.mix(
            (ctx.map().free() * 100_000 + ctx.map().wall()) as u64 + (ctx.map().covered() as u64) * 10_000_000_000,
        );
        for contact in &observation.contacts {
            self.mix(u64::from(contact.agent.0) ^ contact.position.y.to_bits());
        }
        for message in &observation.messages {
            let Peer::One(from) = message.peer else { unreachable!("there are no relays") };
            self.mix(u64::from(from.0) + 100 * u64::from(message.kind));
            message.data.iter().for_each(|&byte| self.mix(byte.into()));
        }
    }

    fn motion(&mut self, observation: &Observation) -> Motion {
        let rng = &mut self.rng;
        let here = observation.pose.position;
        let mut beside = || here + Vector3::from_fn(|_, _| rng.random_range(-3.0..3.0));
        match self.observed % 8 {
            0 => Motion::Stop,
            1 => Motion::Turn { angle_rad: rng.random_range(-3.0..3.0) },
            2 => Motion::Path(vec![beside(), beside()]),
            3 => Motion::Velocity {
                linear_in_body_m_s: Vector3::new(rng.random_range(-1.0..2.0), 0.3, rng.random_range(-0.5..0.5)),
                yaw_rate_rad_s: rng.random_range(-1.0..1.0),
                path: Vec::new(),
            },
            4 | 5 => Motion::Move { pitch_rad: rng.random_range(-1.0..1.0), distance_m: rng.random_range(0.0..8.0) },
            _ => Motion::Keep,
        }
    }

    fn messages(&mut self, ctx: &Ctx<'_>) -> Vec<AgentMessage> {
        let rng = &mut self.rng;
        let count = rng.random_range(0..3);
        let mut message = || AgentMessage {
            peer: match rng.random_bool(0.5) {
                true => Peer::One(AgentId(rng.random_range(0..ctx.run_info().agents))),
                false => Peer::Broadcast,
            },
            kind: rng.random(),
            data: (0..rng.random_range(0..2000)).map(|_| rng.random()).collect::<Vec<u8>>().into(),
        };
        (0..count).map(|_| message()).collect()
    }
}

impl Controller for Gossip {
    fn is_polled_between_wakes(&self) -> bool {
        true
    }

    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let is_due = observation.tick >= self.wake.at || observation.events.intersects(self.wake.events);
        if !is_due {
            let turn = Motion::Turn { angle_rad: 0.1 };
            return if self.acts_between { Command::new(turn, self.wake) } else { Command::keep(self.wake) };
        }
        self.mix_all(observation, ctx);
        self.wake = WakeCondition {
            at: Tick(observation.tick.0 + self.rng.random_range(0..80)),
            // Each of the five kinds of events, and all of their combinations.
            events: EventMask::from_bits_retain(self.rng.random_range(0..32)),
        };
        Command {
            motion: self.motion(observation),
            lidar: match self.rng.random_range(0..12) {
                0 => ScanRequest::Never,
                1 => ScanRequest::Once,
                2 => ScanRequest::Every(self.rng.random_range(1..20)),
                _ => ScanRequest::Keep,
            },
            want_view: self.rng.random_bool(0.3),
            messages: self.messages(ctx),
            wake: self.wake,
            stage: None,
            info: if self.rng.random_bool(0.1) { format!("observed {:x}", self.observed) } else { String::new() },
        }
    }
}

#[derive(Clone, Copy)]
struct Setting {
    look_ahead: bool,
    groups: &'static [&'static [u32]],
    threads: u32,
    delays: bool,
    acts_between: bool,
}

const APART: &[&[u32]] = &[&[0], &[1], &[2], &[3]];
const PLAIN: Setting = Setting { look_ahead: true, groups: APART, threads: 1, delays: false, acts_between: false };

/// Records a run of such agents; its scenario.
pub(crate) fn record(file: PathBuf) -> Scenario {
    let mut play = prepare(PLAIN);
    play.record = Some(file);
    let scenario = play.scenario.clone();
    carry_out(play, PLAIN).outcome();
    scenario
}

fn play(setting: Setting) -> FinishedRun {
    carry_out(prepare(setting), setting)
}

fn prepare(setting: Setting) -> Play {
    let mut play = Play::new(SCENARIO);
    play.scenario.execution.look_ahead = setting.look_ahead;
    play.scenario.execution.threads = setting.threads;
    play.groups = setting.groups.iter().map(|group| group.to_vec()).collect();
    play
}

fn carry_out(play: Play, setting: Setting) -> FinishedRun {
    play.with(move |end: AgentsEnd, ids: Vec<AgentId>, is_over: &AtomicBool| {
        let controller = |id| Box::new(Gossip::new(id, setting.acts_between)) as Box<dyn Controller>;
        let mut rng = voxels::random_streams::stream(5, ids[0].0.into(), "delays");
        let pause = || {
            if setting.delays {
                disturb(Duration::from_micros(rng.random_range(0..2000)));
            }
        };
        serve(end, &ids, controller, pause, is_over);
    })
}

#[expect(clippy::disallowed_methods, reason = "disturbing the wall time is what this is for")]
fn disturb(delay: Duration) {
    std::thread::sleep(delay);
}

#[test]
fn look_ahead_does_not_change_the_run() {
    let first = play(PLAIN);
    let result = &first.outcome().result;
    for name in ["collisions", "messages_delivered", "messages_out_of_contact", "scans_cast", "decisions"] {
        assert!(counter(result, name) > 50, "the run has not enough {name}: {:?}", result.counters);
    }
    let ticks_of_all = 4 * result.tick;
    assert!(counter(result, "decisions") < ticks_of_all / 2, "look-ahead leaves ticks out: {:?}", result.counters);

    let together: &[&[u32]] = &[&[0, 1, 2, 3]];
    let mixed: &[&[u32]] = &[&[3, 1], &[2, 0]];
    for (what, setting) in [
        ("again", PLAIN),
        ("together", Setting { groups: together, ..PLAIN }),
        ("mixed", Setting { groups: mixed, threads: 8, ..PLAIN }),
        ("delays", Setting { delays: true, ..PLAIN }),
        ("no look-ahead", Setting { look_ahead: false, ..PLAIN }),
        ("no look-ahead, together", Setting { look_ahead: false, groups: together, threads: 2, ..PLAIN }),
        ("would act, but is never asked", Setting { acts_between: true, ..PLAIN }),
    ] {
        let other = play(setting);
        assert_eq!(&other.outcome().result, result, "{what}");
        assert_eq!(other.digest(), first.digest(), "{what}");
    }
}

#[test]
fn acting_between_triggers_changes_the_run() {
    let acting = Setting { acts_between: true, ..PLAIN };
    let asked_always = play(Setting { look_ahead: false, ..acting });
    assert_ne!(asked_always.digest(), play(acting).digest());
    assert_eq!(asked_always.digest(), play(Setting { look_ahead: false, ..acting }).digest());
}
