//! A recording on its ROS 2 topics: one participant with one node `replay`, its services, and a publisher for each topic.
//!
//! Invariants: everything is published with the type and the quality of service that it has in a run, as it stands in the file;
//! readers are waited for, but each topic only for a moment (see [`ros_node::PatientOutlet`]); a late reader of a latched topic
//! is told all that holds. When something is due is decided in [`crate::replay`].

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use msgs::cdr::Encoded;
use msgs::ids::Tick;
use msgs::rosgraph_msgs::Clock;
use msgs::topics;
use ros_node::audience::Audience;
use ros_node::ros_env::RosEnv;
use ros_node::{Inbox, PatientOutlet, RosError, Sent, Workshop, linger, now};
use ros2_client::{Context, Node};

use super::services::{Asked, Services};
use crate::recording::Recording;
use crate::replay::{Cue, Manner, Pass, Player, Programme, Shelf, Turn};
use crate::terminal::{self, Terminal};
use simulation::parameters;

/// The name of the node.
const NODE: &str = "replay";

/// Wall time that those who were there first get to be found, before anything is said: at the least, and at the most.
const OPENING: Duration = Duration::from_millis(300);
const OPENING_MAX: Duration = Duration::from_secs(3);

/// Wall time between two looks for requests and for late readers while there is something to publish.
const LOOK_PERIOD: Duration = Duration::from_millis(5);

/// Wall time for which requests are awaited at the most, before it is looked who listens and whether to end.
const PATIENCE: Duration = Duration::from_millis(20);

/// Wall time between two messages that late readers are told again, so that they can take each.
const PIECE_PERIOD: Duration = Duration::from_millis(10);

/// Wall time between two reports.
const REPORT_PERIOD: Duration = Duration::from_millis(500);

/// Publishers that take as many files as an agent of a run at the most.
const TOPICS_OF_AGENT: usize = 8;

/// What became of a replay.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Played {
    /// Messages of the programme that were published, `/clock` not among them.
    pub messages: u64,
    /// Sim time that has passed, ticks.
    pub sim_ticks: u64,
    /// Whether it was ended from outside.
    pub is_interrupted: bool,
}

/// Plays a recording until its end, or until `stop` is set.
///
/// # Errors
/// If the network cannot be joined, or the system has not enough of something.
pub fn play(
    recording: &Recording,
    programme: &Programme,
    manner: Manner,
    env: &RosEnv,
    terminal: &mut Terminal,
    stop: &AtomicBool,
) -> Result<Played, RosError> {
    let mut stage = Stage::new(programme, manner, env)?;
    stage.open(stop);
    let mut player = Player::new(programme, manner, stage.wall_ns());
    let mut pass = Pass::begin(recording, programme);
    stage.say_opening(&mut pass, stop);
    let mut reported = None;
    let is_stopped = || stop.load(Ordering::Relaxed);
    while !is_stopped() {
        stage.look(&mut player, Duration::ZERO);
        if reported.is_none_or(|reported: Instant| reported.elapsed() >= REPORT_PERIOD) {
            reported = Some(now());
            terminal.status(player.position(), stage.status(&player));
        }
        match player.turn(stage.wall_ns()) {
            Turn::Play(tick) => {
                stage.say_tick(tick, &mut pass, stop);
                player.played();
            }
            Turn::Wait(wait_ns) => stage.look(&mut player, Duration::from_nanos(wait_ns)),
            Turn::Rest => stage.look(&mut player, PATIENCE),
            Turn::Rewind => {
                pass = Pass::begin(recording, programme);
                stage.say_opening(&mut pass, stop);
            }
            Turn::End => break,
        }
    }
    player.end();
    let is_interrupted = is_stopped() || player.is_quitting();
    Ok(Played { messages: stage.messages, sim_ticks: player.sim_ticks(), is_interrupted })
}

/// A replay in a ROS network.
struct Stage {
    inbox: Inbox<Asked>,
    services: Services,
    clock: PatientOutlet,
    seats: Vec<Seat>,
    audience: Audience,
    looked: Instant,
    /// When late readers may be told the next thing.
    piece: Instant,
    begun: Instant,
    messages: u64,
    node: Node,
    context: Context,
}

/// A topic.
struct Seat {
    outlet: PatientOutlet,
    shelf: Option<Shelf>,
    /// Readers that have ever come.
    arrivals: u64,
}

impl Stage {
    fn new(programme: &Programme, manner: Manner, env: &RosEnv) -> Result<Self, RosError> {
        // So many publishers take no more files than an agent of a run.
        ros_node::allow_open_files(
            u32::try_from(programme.topics().len().div_ceil(TOPICS_OF_AGENT)).unwrap_or(u32::MAX),
        )?;
        let context = ros_node::join(env, true)?;
        let mut node = ros_node::node(&context, NODE)?;
        let mut workshop = Workshop::of(&context);
        let clock = workshop.patient_outlet(&context, &mut node, &topics::clock())?;
        let mut seats = Vec::new();
        for topic in programme.topics() {
            let outlet = workshop.patient_outlet(&context, &mut node, topic)?;
            seats.push(Seat { outlet, shelf: Shelf::of(topic), arrivals: 0 });
        }
        let mut inbox = Inbox::default();
        let declared = parameters::of_replay(manner.rate);
        let services = Services::of_replay(&mut node, &mut workshop, &mut inbox, declared)?;
        let audience = Audience::new(programme.topics());
        let born = now();
        Ok(Self {
            inbox,
            services,
            clock,
            seats,
            audience,
            looked: born,
            piece: born,
            begun: born,
            messages: 0,
            node,
            context,
        })
    }

    /// Waits until those who were there first can hear everything. Requests wait meanwhile.
    fn open(&mut self, stop: &AtomicBool) {
        let begun = now();
        let is_open = |audience: &Audience| begun.elapsed() >= OPENING && audience.has_settled();
        while !stop.load(Ordering::Relaxed) && !is_open(&self.audience) && begun.elapsed() < OPENING_MAX {
            self.receive(PATIENCE);
            self.audience.look(&self.context);
        }
        // They are no late readers.
        self.greet_new_readers(false);
        self.begun = now();
    }

    fn wall_ns(&self) -> u64 {
        u64::try_from(self.begun.elapsed().as_nanos()).unwrap_or(u64::MAX)
    }

    fn receive(&mut self, timeout: Duration) -> bool {
        let asked = self.inbox.receive(timeout);
        let is_there = asked.is_some();
        if let Some(asked) = asked {
            self.services.take_in(&mut self.node, asked);
        }
        is_there
    }

    /// Answers requests and tells late readers what they have missed; waits so long for a request if there is none.
    fn look(&mut self, player: &mut Player, wait: Duration) {
        if wait.is_zero() && self.looked.elapsed() < LOOK_PERIOD {
            return;
        }
        self.looked = now();
        let mut wait = wait.min(PATIENCE);
        while self.services.has_room() && self.receive(std::mem::take(&mut wait)) {}
        while let Some(request) = self.services.next() {
            player.answer(request, self.wall_ns());
        }
        if self.audience.look(&self.context) {
            self.greet_new_readers(true);
        }
        if now() >= self.piece {
            self.say_again();
        }
    }

    fn greet_new_readers(&mut self, are_late: bool) {
        for (number, seat) in self.seats.iter_mut().enumerate() {
            let arrivals = self.audience.arrivals(number).unwrap_or(seat.arrivals);
            if std::mem::replace(&mut seat.arrivals, arrivals) < arrivals
                && are_late
                && let Some(shelf) = &mut seat.shelf
            {
                shelf.greet();
            }
        }
    }

    /// Tells late readers of each topic one thing that they have missed.
    fn say_again(&mut self) {
        for seat in &mut self.seats {
            let Some(shelf) = &mut seat.shelf else { continue };
            if let Some(message) = shelf.wanted().cloned() {
                self.piece = now() + PIECE_PERIOD;
                match seat.outlet.publish(&mut self.node, &message) {
                    Sent::Yes => shelf.note(&message),
                    Sent::NotYet => {}
                    Sent::Anew => shelf.forget_history(),
                }
            }
        }
    }

    fn say_opening(&mut self, pass: &mut Pass<'_>, stop: &AtomicBool) {
        while let Some(cue) = pass.opening() {
            self.say(&cue, stop);
        }
    }

    /// Says what belongs to a tick, the clock first.
    fn say_tick(&mut self, tick: Tick, pass: &mut Pass<'_>, stop: &AtomicBool) {
        let clock = Encoded::of(&Clock { clock: tick.into() });
        while self.clock.publish(&mut self.node, &clock) != Sent::Yes && !stop.load(Ordering::Relaxed) {
            self.receive(LOOK_PERIOD);
        }
        while let Some(cue) = pass.until(tick) {
            self.say(&cue, stop);
        }
    }

    fn say(&mut self, cue: &Cue, stop: &AtomicBool) {
        while !stop.load(Ordering::Relaxed) {
            let seat = &mut self.seats[cue.topic];
            match seat.outlet.publish(&mut self.node, &cue.message) {
                Sent::Yes => {
                    self.messages += 1;
                    return seat.shelf.iter_mut().for_each(|shelf| shelf.note(&cue.message));
                }
                Sent::NotYet => {}
                Sent::Anew => seat.shelf.iter_mut().for_each(Shelf::forget_history),
            }
            self.receive(LOOK_PERIOD);
        }
    }

    fn status(&self, player: &Player) -> String {
        let passed_s = Tick(player.sim_ticks()).time_ns() as f64 * 1e-9;
        let wall_s = self.begun.elapsed().as_secs_f64();
        format!(
            "{} | {:6.1} x real time | {} messages",
            terminal::clock(player.position()),
            if wall_s > 0.0 { passed_s / wall_s } else { 0.0 },
            self.messages
        )
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        linger(true);
    }
}
