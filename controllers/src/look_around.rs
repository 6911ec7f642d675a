//! Looks around: a wrapper of any controller, for bodies whose LiDAR does not see all around.
//!
//! Controllers take a place where the body has been at rest as seen. So when a controller is to
//! decide at rest in another cell than before, the wrapper first turns the body towards whatever is
//! unexplored in reach of the LiDAR ([`turns`]); with a band of elevations alone it need not turn.
//!
//! A controller that rests may still have left out what its frontiers do not show: a cell above a
//! frontier is out of the band there, and in it from farther away. After [`REST_TICKS`] the wrapper
//! goes to the viewpoints that remain ([`Viewpoints`]), and asks its controller again from each.
//! One that waits for a body in its way is left alone.
//!
//! Invariants: without a field of view in the run info the wrapper is not there; those of
//! [`Wrapped`].

mod turns;

use std::collections::VecDeque;
use std::task::Poll;

use msgs::ids::Tick;
use protocol::event_mask::EventMask;
use protocol::field_of_view::FieldOfView;
use protocol::wake_condition::WakeCondition;
use rand_chacha::ChaCha8Rng;
use voxels::{BodyLattice, Cell};

use super::blockage::{Blockages, Yield};
use super::dsvp::avoidance::{Waypoints, way_round};
use super::dsvp::gain::{GainEstimator, Likelihood};
use super::dsvp::obstacles::Obstacles;
use super::viewpoints::Viewpoints;
use super::wrapped::{Wrapped, rests};
use super::{Controller, Ctx, Failure, collision_recovery};
use agent::command::{Command, Motion, ScanRequest, Stage};
use agent::navigation::{NavigationStatus, SearchTime};
use agent::observation::Observation;

/// The purpose of its random stream.
pub(super) const STREAM: &str = "look-around";

/// Ticks at rest after which a controller has nothing to do: 1 s.
const REST_TICKS: u64 = 50;

/// Ticks until a scan that was requested is no longer waited for.
const SCAN_TIMEOUT_TICKS: u64 = 100;

/// Rays by which it finds what is unexplored around the body.
const RAYS: u32 = 2000;

/// Longest of these rays, cells.
const RAY_CELLS_MAX: f64 = 40.0;

/// What is nearer to the end of the range than this share of it is no reason to turn: there is
/// always something unexplored beyond.
const NEAR: f64 = 0.75;

/// A controller that does not see all around.
pub(super) struct LookAround {
    inner: Wrapped,
    rng: ChaCha8Rng,
    mode: Mode,
    /// Its own wake-up condition.
    wake: WakeCondition,
    /// Where it has looked around last.
    looked_from: Option<Cell>,
    /// Since when its controller has had nothing to do.
    resting_since: Option<Tick>,
    /// The stage that its controller has named last, and whether the wrapper has named another
    /// since.
    stage: Option<Stage>,
    has_gone: bool,
    /// Finds what is unexplored around the body.
    rays: Option<GainEstimator>,
    viewpoints: Option<Viewpoints>,
    /// The agents that it has run into on the way to them.
    blockages: Blockages,
}

/// What it is doing.
#[derive(Debug, Clone, PartialEq)]
enum Mode {
    /// Its controller decides.
    Inner,
    /// It turns; these turns follow, in radians.
    Turning(VecDeque<f64>),
    /// It waits at rest for a scan since this tick; these turns follow.
    Scanning(Tick, VecDeque<f64>),
    /// It goes to a viewpoint that its controller has left out.
    Going,
    /// It makes way after a collision on the way there.
    Aside,
    /// It waits for a body that stays in the way there.
    Blocked,
}

impl LookAround {
    pub(super) fn around(inner: Box<dyn Controller>, rng: ChaCha8Rng) -> Self {
        Self {
            inner: Wrapped::new(inner),
            rng,
            mode: Mode::Inner,
            wake: WakeCondition::NEXT_TICK,
            looked_from: None,
            resting_since: None,
            stage: None,
            has_gone: false,
            rays: None,
            viewpoints: None,
            blockages: Blockages::default(),
        }
    }

    /// The decision of its controller, which sees all that it has not seen.
    fn ask(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        self.mode = Mode::Inner;
        let mut command = self.inner.ask(observation, ctx, EventMask::empty());
        self.stage = command.stage.or(self.stage);
        if std::mem::take(&mut self.has_gone) {
            command.stage = self.stage;
        }
        let tick = observation.tick;
        // One that waits for a time soon, such as that of a search, has something to do.
        let has_time = command.wake.at > tick.after(REST_TICKS);
        let is_idle = self.stage == Some(Stage::Waiting) && has_time && !self.inner.is_blocked();
        self.resting_since = (rests(&command, observation) && is_idle).then(|| self.resting_since.unwrap_or(tick));
        if let Some(since) = self.resting_since {
            command.wake.at = command.wake.at.min(since.after(REST_TICKS).max(tick.next()));
        }
        command
    }

    /// The turns that show what is unexplored around the body.
    fn turns(&mut self, view: &FieldOfView, ctx: &Ctx<'_>) -> VecDeque<f64> {
        if view.is_all_around() {
            return VecDeque::new();
        }
        let map = ctx.map();
        let cell_m = map.extent().cell_m();
        let range_m = ctx.run_info().lidar_range_m.min(view.dense_range_m(cell_m)) * NEAR;
        let lattice = BodyLattice::of(ctx.body().radius_m, cell_m);
        let rays = self.rays.get_or_insert_with(|| {
            GainEstimator::new(RAYS, (range_m / cell_m).clamp(1.0, RAY_CELLS_MAX), 1, Likelihood::new(1.0))
                .from(lattice)
        });
        rays.limit_to(Some(view));
        let mut azimuths_rad = Vec::new();
        rays.each_first_unexplored(map, ctx.cell(), |by| {
            azimuths_rad.push(libm::atan2(f64::from(by.y), f64::from(by.x)));
        });
        // Scans on the way are close enough to each other, or each turn ends with one.
        let period_s = f64::from(ctx.run_info().lidar_period_ticks) * Tick::TICK_S;
        let is_swept = ctx.body().turn_rate_max_rad_s * period_s <= view.horizontal_rad / 2.0;
        let turns = turns::towards(&azimuths_rad, ctx.yaw_rad(), view.horizontal_rad);
        let step_rad = if is_swept { f64::INFINITY } else { view.horizontal_rad * turns::REACH };
        turns.into_iter().flat_map(|turn_rad| turns::in_steps(turn_rad, step_rad)).collect()
    }

    /// Begins the next turn, or lets the controller decide.
    fn next_turn(&mut self, mut turns: VecDeque<f64>, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let Some(angle_rad) = turns.pop_front() else { return self.ask(observation, ctx) };
        self.mode = Mode::Turning(turns);
        let wake = WakeCondition::TASK_DONE.or(WakeCondition::on(EventMask::COLLISION));
        scanning(Command::new(Motion::Turn { angle_rad }, wake), ctx).with_info("looks around")
    }

    /// Its controller is to decide: at rest in another cell, it looks around before.
    fn inner(&mut self, view: &FieldOfView, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let is_due = self.inner.is_due(observation);
        let is_at_rest = !observation.is_active && observation.scan_tick.is_some();
        let has_arrived = is_at_rest && self.looked_from != Some(ctx.cell());
        if is_due && has_arrived && !observation.events.intersects(EventMask::COLLISION) {
            self.looked_from = Some(ctx.cell());
            let turns = self.turns(view, ctx);
            return self.next_turn(turns, observation, ctx);
        }
        let has_rested = self.resting_since.is_some_and(|since| observation.tick >= since.after(REST_TICKS));
        if is_due && !has_rested {
            return self.ask(observation, ctx);
        }
        if has_rested && is_at_rest {
            return self.go_to_viewpoint(observation, ctx);
        }
        self.inner.keep()
    }

    /// Its controller rests: goes to where the LiDAR sees what it has left out.
    fn go_to_viewpoint(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let tick = observation.tick;
        let viewpoints = self.viewpoints.get_or_insert_with(|| Viewpoints::new(ctx.run_info(), ctx.body().radius_m));
        viewpoints.visit(ctx.map().extent(), ctx.cell());
        let viewpoint = match viewpoints.next(ctx) {
            Poll::Ready(Some(viewpoint)) => viewpoint,
            Poll::Ready(None) => {
                self.resting_since = Some(tick);
                if self.inner.is_due(observation) {
                    return self.ask(observation, ctx);
                }
                let wake = self.inner.wake().or(WakeCondition::at(tick.after(REST_TICKS)));
                return Command { wake, ..self.inner.keep() };
            }
            Poll::Pending => {
                let wake = WakeCondition::NEXT_TICK;
                return Command::keep(wake).with_stage(Stage::Waiting).with_info("looks for a viewpoint");
            }
        };
        match ctx.go_to_cell(viewpoint.cell, SearchTime::Instant) {
            NavigationStatus::Go(motion) => {
                (self.mode, self.has_gone) = (Mode::Going, true);
                goes(motion, viewpoint.cell, ctx)
            }
            NavigationStatus::Searching(wake) => Command::keep(wake),
            NavigationStatus::NoPath => {
                viewpoints.visit(ctx.map().extent(), viewpoint.cell);
                Command::keep(WakeCondition::NEXT_TICK)
            }
        }
    }

    /// A body is in the way to a viewpoint: goes to another one, makes way, or waits for it.
    fn give_way(&mut self, observation: &Observation, ctx: &Ctx<'_>) -> Command {
        let Self { blockages, viewpoints, .. } = self;
        let standing = blockages.note_between_steps(observation, ctx, |obstacles: &Obstacles| {
            let found = viewpoints.as_mut()?.next_within(ctx, &|cell| !obstacles.occupy(cell));
            let Poll::Ready(Some(viewpoint)) = found else { return None };
            let motion = way_round(ctx, viewpoint.cell, obstacles, Waypoints::Fewest)?;
            Some(goes(motion, viewpoint.cell, ctx))
        });
        match standing {
            Some(Yield::Detour(command)) => {
                self.mode = Mode::Going;
                command
            }
            Some(Yield::Rest(command)) => {
                self.mode = Mode::Blocked;
                command
            }
            Some(Yield::StepAside) | None => {
                self.mode = Mode::Aside;
                collision_recovery::step_aside(&mut self.rng, ctx)
            }
        }
    }

    fn decide_in_mode(&mut self, view: &FieldOfView, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let is_revised = observation.events.intersects(EventMask::REVISED);
        match std::mem::replace(&mut self.mode, Mode::Inner) {
            Mode::Inner => self.inner(view, observation, ctx),
            Mode::Turning(_) if observation.events.intersects(EventMask::COLLISION) => self.ask(observation, ctx),
            Mode::Turning(turns) if observation.is_active => {
                self.mode = Mode::Turning(turns);
                Command::keep(self.wake)
            }
            Mode::Turning(turns) => {
                self.mode = Mode::Scanning(observation.tick.next(), turns);
                scanning(Command::keep(WakeCondition::NEXT_TICK), ctx)
            }
            Mode::Scanning(since, turns) => {
                let has_scanned = observation.scan_tick.is_some_and(|scan| scan >= since);
                if has_scanned || observation.tick >= since.after(SCAN_TIMEOUT_TICKS) {
                    return self.next_turn(turns, observation, ctx);
                }
                self.mode = Mode::Scanning(since, turns);
                Command::keep(WakeCondition::NEXT_TICK)
            }
            Mode::Going if observation.events.intersects(EventMask::COLLISION) => self.give_way(observation, ctx),
            Mode::Going if observation.is_active && !is_revised => {
                self.mode = Mode::Going;
                Command::keep(self.wake)
            }
            mode @ (Mode::Going | Mode::Aside | Mode::Blocked) => {
                if mode == Mode::Blocked
                    && let Some(command) = self.blockages.still_waits(observation, ctx)
                {
                    self.mode = Mode::Blocked;
                    return command;
                }
                if observation.is_active {
                    self.looked_from = None;
                    return self.ask(observation, ctx);
                }
                self.looked_from = Some(ctx.cell());
                let turns = self.turns(view, ctx);
                self.next_turn(turns, observation, ctx)
            }
        }
    }
}

/// The command of an agent that goes to a viewpoint.
fn goes(motion: Motion, to: Cell, ctx: &Ctx<'_>) -> Command {
    let Cell { x, y, z } = to;
    let wake = WakeCondition::TASK_DONE.or(WakeCondition::on(EventMask::COLLISION));
    scanning(Command::new(motion, wake), ctx)
        .with_stage(Stage::Relocating)
        .with_info(format!("goes to the viewpoint {x} {y} {z}"))
}

/// The command with a request for scans by the period of the scenario.
fn scanning(command: Command, ctx: &Ctx<'_>) -> Command {
    Command { lidar: ScanRequest::Every(ctx.run_info().lidar_period_ticks.max(1)), ..command }
}

impl Controller for LookAround {
    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        let Some(view) = ctx.run_info().field_of_view else { return self.inner.decide(observation, ctx) };
        if !self.wake.is_met(observation.tick, observation.events) && self.inner.is_polled_between_wakes() {
            return self.poll(observation, ctx);
        }
        if observation.events.intersects(EventMask::REVISED) {
            (self.viewpoints, self.looked_from) = (None, None);
        }
        self.inner.note(observation);
        let command = self.decide_in_mode(&view, observation, ctx);
        self.wake = command.wake;
        command
    }

    fn covers(&self) -> bool {
        self.inner.covers()
    }

    fn is_blocked(&self) -> bool {
        self.mode == Mode::Blocked || self.inner.is_blocked()
    }

    fn is_polled_between_wakes(&self) -> bool {
        self.inner.is_polled_between_wakes()
    }

    fn failure(&mut self) -> Option<Failure> {
        self.inner.failure()
    }
}

impl LookAround {
    /// The reply between its wake-ups: what its controller does, if that is what counts.
    fn poll(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command {
        if self.mode != Mode::Inner {
            return Command::keep(self.wake);
        }
        let command = self.inner.poll(observation, ctx);
        if !command.is_noop() {
            self.resting_since = None;
            self.wake = command.wake;
        }
        command
    }
}

#[cfg(test)]
mod tests;
