//! Goes home in time: a wrapper of any controller, for bodies that need energy.
//!
//! Out of its bases, the wrapper lets its controller decide, and wakes up before the energy could
//! fall below that of the way home and the reserve, whatever the body does until then: the energy
//! that it draws in a time is bounded, and the way home grows by no more than the way back along
//! what it has travelled. Then it looks again, or goes home. At home it charges until the battery
//! is full. Its controller sees what was observed meanwhile in one observation afterwards, and
//! decides as after the end of a task.
//!
//! A controller that rests for [`REST_TICKS`] and waits for no time is brought home as well, and
//! goes on from there if it finds a goal. A trip that has shown nothing new, or bases that do not
//! charge, end the mission: the agent waits at home for good.
//!
//! Invariants: without energy in its observations, or where the scenario says not to go home, the
//! wrapper is not there; those of [`Wrapped`].

use std::ops::RangeInclusive;

use msgs::ids::Tick;
use protocol::energy::Energy;
use protocol::event_mask::EventMask;
use protocol::wake_condition::WakeCondition;
use rand_chacha::ChaCha8Rng;

use super::way_home::{WayHome, turning_back_j};
use super::wrapped::{Wrapped, rests};
use super::{Controller, Ctx, Failure, collision_recovery};
use agent::command::{Command, Motion, Stage};
use agent::observation::Observation;

/// The purpose of its random stream.
pub(super) const STREAM: &str = "go-home";

/// What the way home may grow by for each unit of energy that the body draws: it goes back along
/// what it has travelled, from cell to cell and with stops, which takes up to twice as long.
const GROWTH: f64 = 2.0;

/// It goes home if it could not look again for so long, seconds.
const LOOK_MIN_S: f64 = 1.0;

/// Ticks at rest after which a controller has nothing to do: 10 s.
const REST_TICKS: u64 = 500;

/// Ticks to hold after a collision on a way around another body: less than elsewhere, for energy is
/// short.
const HOLD_TICKS: RangeInclusive<u64> = 5..=40;

/// Ticks until it looks for a way home again if it knows none.
const RETRY_TICKS: u64 = 50;

/// No event, and no tick.
const NEVER: WakeCondition = WakeCondition { at: Tick(u64::MAX), events: EventMask::empty() };

/// A wrapped controller.
pub(super) struct GoHome {
    inner: Wrapped,
    rng: ChaCha8Rng,
    mode: Mode,
    /// Its own wake-up condition.
    wake: WakeCondition,
    /// Whether it is on a way around what it has met.
    has_collided: bool,
    /// Cells that its map had as seen, or visited if that is the aim, when it last left home, or at
    /// the start.
    known_before: usize,
}

/// What it is doing.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Mode {
    /// Its controller decides. It looks for the way home again at `look_at`; `resting_since`: the
    /// controller has had nothing to do since then.
    Out { look_at: Tick, resting_since: Option<Tick> },
    /// On the way home: because of the energy, or as there is nothing to do.
    Returning { is_idle: bool },
    /// At rest in a base until the battery is full.
    Charging,
    /// At home for good.
    Over,
}

impl GoHome {
    pub(super) fn around(inner: Box<dyn Controller>, rng: ChaCha8Rng) -> Self {
        Self {
            inner: Wrapped::new(inner),
            rng,
            mode: Mode::Out { look_at: Tick::ZERO, resting_since: None },
            wake: WakeCondition::NEXT_TICK,
            has_collided: false,
            known_before: 0,
        }
    }

    /// When it has to look for the way home again; `None`: it has to go home now.
    fn next_look(ctx: &Ctx<'_>, energy: &Energy, way: &WayHome) -> Option<Tick> {
        let (model, body) = (&energy.model, ctx.body());
        let spare_j = energy.left_j - model.reserve_j - way.cost_j - turning_back_j(body, model);
        let power_w = model.drawn_j(1.0, body.speed_max_m_s);
        let time_s = spare_j / (power_w * (1.0 + GROWTH));
        if time_s.is_nan() || time_s < LOOK_MIN_S {
            return (power_w == 0.0).then_some(Tick(u64::MAX));
        }
        // A number beyond the range of ticks is the last of them.
        Some(ctx.tick().after((time_s / Tick::TICK_S) as u64))
    }

    /// Out of its bases, or on the way out.
    fn out(&mut self, observation: &Observation, energy: &Energy, ctx: &mut Ctx<'_>, also: EventMask) -> Command {
        let Mode::Out { mut look_at, mut resting_since } = self.mode else { unreachable!("it is out") };
        let tick = observation.tick;
        if tick >= look_at {
            look_at = match ctx.way_home().map(|way| (Self::next_look(ctx, energy, &way), way)) {
                Some((Some(look_at), _)) => look_at,
                Some((None, way)) => return self.go_home(observation, energy, way, false, ctx),
                None => tick.after(RETRY_TICKS),
            };
        }
        let mut command = if also.is_empty() && !self.inner.is_due(observation) {
            self.inner.keep()
        } else {
            let command = self.inner.ask(observation, ctx, also);
            // One that waits for a time, such as that of a meeting, has something to do.
            let waits = tick.after(REST_TICKS) < command.wake.at && command.wake.at < ctx.run_info().duration;
            let rests = rests(&command, observation) && !waits;
            resting_since = rests.then(|| resting_since.unwrap_or(tick));
            command
        };
        if let Some(since) = resting_since
            && !ctx.is_in_base()
        {
            let until = since.after(REST_TICKS);
            if tick >= until
                && let Some(way) = ctx.way_home()
            {
                let home = self.go_home(observation, energy, way, true, ctx);
                return Command { messages: command.messages, lidar: command.lidar, ..home };
            }
            command.wake.at = command.wake.at.min(until.max(tick.after(RETRY_TICKS)));
        }
        self.mode = Mode::Out { look_at, resting_since };
        command.wake.at = command.wake.at.min(look_at);
        command
    }

    /// Begins the way home, or what follows if the body is there.
    fn go_home(
        &mut self,
        observation: &Observation,
        energy: &Energy,
        way: WayHome,
        is_idle: bool,
        ctx: &mut Ctx<'_>,
    ) -> Command {
        self.mode = Mode::Returning { is_idle };
        self.has_collided = false;
        if ctx.is_in_base() && !observation.is_active {
            return self.at_home(observation, energy, ctx);
        }
        self.homewards(way.motion, is_idle, "goes home")
    }

    /// A motion on the way home. One that stops the body in a base ends without an event.
    fn homewards(&self, motion: Motion, is_idle: bool, info: &str) -> Command {
        let wake = match motion {
            Motion::Stop => WakeCondition::NEXT_TICK,
            _ => self.wake_on_the_way(is_idle),
        };
        Command::new(motion, wake).with_stage(Stage::Relocating).with_info(info)
    }

    /// With the next decision of its controller, if that may find a goal.
    fn wake_on_the_way(&self, is_idle: bool) -> WakeCondition {
        WakeCondition::TASK_DONE.or(if is_idle { self.inner.wake() } else { NEVER })
    }

    fn returning(&mut self, observation: &Observation, energy: &Energy, is_idle: bool, ctx: &mut Ctx<'_>) -> Command {
        if is_idle && self.inner.is_due(observation) {
            let command = self.inner.ask(observation, ctx, EventMask::empty());
            if !matches!(command.motion, Motion::Keep | Motion::Stop) {
                self.mode = Mode::Out { look_at: observation.tick.after(1), resting_since: None };
                return Command { wake: command.wake.or(WakeCondition::NEXT_TICK), ..command };
            }
        }
        if ctx.is_in_base() && !observation.is_active {
            return self.at_home(observation, energy, ctx);
        }
        let has_collided = observation.events.intersects(EventMask::COLLISION);
        if has_collided && std::mem::replace(&mut self.has_collided, true) {
            self.has_collided = false;
            let aside = collision_recovery::step_aside_for(HOLD_TICKS, &mut self.rng, ctx);
            return aside.with_stage(Stage::Relocating);
        }
        let wake = self.wake_on_the_way(is_idle);
        if observation.is_active && !has_collided && !observation.events.intersects(EventMask::REVISED) {
            return Command::keep(wake);
        }
        match ctx.way_home_around_contacts().or_else(|| ctx.way_home()) {
            Some(way) => self.homewards(way.motion, is_idle, "goes home"),
            None => {
                let retry = wake.or(WakeCondition::at(observation.tick.after(RETRY_TICKS)));
                Command::new(Motion::Stop, retry).with_info("knows no way home")
            }
        }
    }

    /// At rest in a base.
    fn at_home(&mut self, observation: &Observation, energy: &Energy, ctx: &mut Ctx<'_>) -> Command {
        let Energy { left_j, model } = energy;
        if self.mode == (Mode::Returning { is_idle: true }) {
            // It rests here for its controller, which may find a goal.
            let resting_since = Some(observation.tick);
            self.mode = Mode::Out { look_at: observation.tick.after(RETRY_TICKS), resting_since };
            let wake = self.inner.wake().or(WakeCondition::at(observation.tick.after(RETRY_TICKS)));
            return Command::new(Motion::Stop, wake).with_stage(Stage::Waiting);
        }
        let visited = if self.inner.covers() { ctx.map().covered() } else { 0 };
        let known = ctx.map().free() + visited;
        if model.charge_w == 0.0 || (self.mode != Mode::Charging && known <= self.known_before) {
            return self.end("stays home");
        }
        if *left_j < model.capacity_j {
            self.mode = Mode::Charging;
            let charge_ticks = (model.capacity_j - left_j) / (model.charge_w * Tick::TICK_S);
            // Charging begins after this tick, and what is left of a tick is a whole one.
            let full_at = observation.tick.after((charge_ticks as u64).saturating_add(1));
            return Command::new(Motion::Stop, WakeCondition::at(full_at)).with_info("charges");
        }
        let way = WayHome { motion: Motion::Stop, cost_j: 0.0 };
        let Some(look_at) = Self::next_look(ctx, energy, &way) else {
            return self.end("stays home: its battery is too small to leave");
        };
        self.known_before = known;
        self.mode = Mode::Out { look_at, resting_since: None };
        self.out(observation, energy, ctx, EventMask::TASK_DONE)
    }

    fn end(&mut self, info: &str) -> Command {
        self.mode = Mode::Over;
        Command::new(Motion::Stop, NEVER).with_stage(Stage::Waiting).with_info(info)
    }

    fn decide_in_mode(&mut self, observation: &Observation, energy: &Energy, ctx: &mut Ctx<'_>) -> Command {
        match self.mode {
            Mode::Out { .. } => self.out(observation, energy, ctx, EventMask::empty()),
            Mode::Returning { is_idle } => self.returning(observation, energy, is_idle, ctx),
            Mode::Charging if ctx.is_in_base() => self.at_home(observation, energy, ctx),
            // It was put elsewhere.
            Mode::Charging => self.returning(observation, energy, false, ctx),
            Mode::Over => self.end(""),
        }
    }
}

impl Controller for GoHome {
    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let Some(energy) = observation.energy.as_deref().filter(|energy| energy.model.returns_home) else {
            return self.inner.decide(observation, ctx);
        };
        if !self.wake.is_met(observation.tick, observation.events) && self.inner.is_polled_between_wakes() {
            return self.poll(observation, ctx);
        }
        self.inner.note(observation);
        let command = self.decide_in_mode(observation, energy, ctx);
        self.wake = command.wake;
        command
    }

    fn covers(&self) -> bool {
        self.inner.covers()
    }

    fn is_polled_between_wakes(&self) -> bool {
        self.inner.is_polled_between_wakes()
    }

    fn failure(&mut self) -> Option<Failure> {
        self.inner.failure()
    }
}

impl GoHome {
    /// The reply between its wake-ups: what its controller does, if that is what counts.
    fn poll(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let Mode::Out { look_at, .. } = self.mode else { return Command::keep(self.wake) };
        let mut command = self.inner.poll(observation, ctx);
        if !command.is_noop() {
            command.wake.at = command.wake.at.min(look_at);
            self.wake = command.wake;
        }
        command
    }
}
