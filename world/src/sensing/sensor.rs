//! The LiDARs of one agent. The loop requests their scans; the loop or a helper casts them.
//!
//! While no scan is due, helpers cast scans ahead ([`SpeculativeEngine`]): those that are due next
//! if the task of the body does not change and nothing is in its way.
//!
//! Invariants: scans are cast in the order in which they became due; nothing waits for a thread
//! that casts ahead, except a scan that is due.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError, Weak};

use msgs::ids::{AgentId, Tick};

use crate::body::{Body, Pose};
use crate::lidar::{
    Bodies, Engine, NaiveEngine, NewCells, NoisyScan, Scanner, SensorMemory, SensorSuite, SpeculativeEngine,
};
use crate::noise::SensorNoise;
use crate::workers::Workers;

/// Scans that one sensor casts ahead at most. More are rarely due before the agent decides again.
const AHEAD_MAX: u32 = 10;

/// Scans that all sensors together cast ahead, about: with many agents the helpers have enough to
/// do, and what they cast too early is taken back.
const TEAM_AHEAD: u32 = 100;

/// Ticks before a scan from which on it is cast ahead: to foresee a body takes time for each tick,
/// and by then the agent mostly has decided otherwise.
const FORESEEN_TICKS_MAX: u64 = 100;

/// What is common to the LiDARs of all agents that have the same ones.
#[derive(Debug)]
pub(crate) struct Lidar {
    pub(crate) sensors: SensorSuite,
    noise: SensorNoise,
    /// Scans that each sensor casts ahead at most.
    ahead_max: u32,
    /// The sensors with scans to cast ahead. Those that have waited longest come first.
    ahead: Mutex<VecDeque<Weak<SensorCell>>>,
}

/// The LiDARs of one agent, which scan together; clones are the same ones.
#[derive(Debug, Clone)]
pub(crate) struct Sensor(Arc<SensorCell>);

#[derive(Debug)]
struct SensorCell {
    agent: AgentId,
    lidar: Arc<Lidar>,
    schedule: Mutex<Schedule>,
    /// Whether a helper will look at the schedule.
    is_announced: AtomicBool,
    state: Mutex<State>,
    /// Locked after the state.
    found: Mutex<ScanResult>,
}

/// The scans to cast.
#[derive(Debug, Default)]
struct Schedule {
    /// Poses and ticks of the scans that no thread has begun, and the bodies that they meet.
    due: VecDeque<(Pose, Tick, Bodies)>,
    /// Whether a thread casts one that was due.
    is_casting: bool,
    expected: Option<Expected>,
    /// Whether the sensor is among those with scans to cast ahead.
    is_listed: bool,
}

/// The scans that are due next if the task of the body does not change and nothing is in its way.
#[derive(Debug)]
struct Expected {
    body: Body,
    /// The pose of the one before the next of them, if there is one.
    previous: Option<Pose>,
    /// In how many ticks the next of them is due.
    ticks: u64,
    /// In how many ticks each later one is.
    period_ticks: u64,
    /// How many may still be cast ahead.
    left: u32,
}

/// Held by the thread that casts.
#[derive(Debug)]
pub(crate) struct State {
    pub(crate) memory: SensorMemory,
    engine: SpeculativeEngine,
}

impl State {
    /// The memory without the scans that were cast ahead.
    pub(crate) fn without_scans_ahead(&mut self) -> &mut SensorMemory {
        self.engine.take_all_back(&mut self.memory);
        &mut self.memory
    }
}

/// The results of scans that were not collected yet.
#[derive(Debug, Default)]
pub(super) struct ScanResult {
    /// New cells for the observation of the agent.
    pub(super) free: Vec<u32>,
    pub(super) wall: Vec<u32>,
    /// New free cells for the coverage, and where those of each tick end.
    pub(super) explored: Vec<u32>,
    pub(super) ends: Vec<(Tick, usize)>,
}

impl Lidar {
    /// The LiDARs of a team of `agents`.
    pub(crate) fn new(sensors: SensorSuite, noise: SensorNoise, agents: u32) -> Self {
        let ahead_max = (TEAM_AHEAD / agents.max(1)).clamp(1, AHEAD_MAX);
        Self { sensors, noise, ahead_max, ahead: Mutex::default() }
    }

    /// Whether two scans from one pose may see different things, by noise or by bodies in the way.
    pub(crate) fn scans_differ(&self) -> bool {
        self.noise.affects_scans() || self.sensors.meets_bodies()
    }

    /// The only LiDAR, whose scans may be cast ahead if they do not differ.
    fn only_scanner(&self) -> Option<&Scanner> {
        if let [only] = self.sensors.lidars() { Some(&only.scanner) } else { None }
    }

    fn ahead(&self) -> MutexGuard<'_, VecDeque<Weak<SensorCell>>> {
        self.ahead.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Removes the first sensor with scans to cast ahead that is still in use.
    fn next_ahead(&self) -> Option<Arc<SensorCell>> {
        let mut ahead = self.ahead();
        std::iter::from_fn(|| ahead.pop_front()).find_map(|sensor| sensor.upgrade())
    }
}

impl Sensor {
    pub(crate) fn new(agent: AgentId, lidar: &Arc<Lidar>, memory: SensorMemory) -> Self {
        let state = Mutex::new(State { memory, engine: SpeculativeEngine::default() });
        let (schedule, is_announced, found) = Default::default();
        Self(Arc::new(SensorCell { agent, lidar: Arc::clone(lidar), schedule, is_announced, state, found }))
    }

    /// What the LiDARs are.
    pub(crate) fn lidar(&self) -> &Lidar {
        &self.0.lidar
    }

    /// Has a scan cast once its results are collected, or by a helper that it is announced to.
    pub(super) fn request(&self, pose: Pose, tick: Tick, bodies: Bodies) {
        self.0.schedule().due.push_back((pose, tick, bodies));
    }

    /// Names the scans that are due next: in so many ticks, and then one in each period. `last` is
    /// the pose of the last one. Returns whether any are cast ahead: with noise, of several LiDARs,
    /// and long before they are due, none are.
    pub(super) fn expect(&self, body: &Body, last: Option<Pose>, ticks: u64, period_ticks: u32) -> bool {
        if self.0.lidar.scans_differ() || self.0.lidar.only_scanner().is_none() {
            return false;
        }
        let is_near = ticks <= FORESEEN_TICKS_MAX;
        self.0.schedule().expected = is_near.then(|| {
            let (body, period_ticks) = (body.clone(), period_ticks.into());
            Expected { body, previous: last, ticks, period_ticks, left: self.0.lidar.ahead_max }
        });
        is_near
    }

    /// Has a helper cast what is due, if one is free before it is collected, and then ahead.
    pub(super) fn announce(&self, workers: &Workers) {
        if self.0.is_announced.swap(true, Ordering::AcqRel) {
            return;
        }
        let shared = Arc::clone(&self.0);
        workers.spawn(move |backlog| {
            // First, so that what becomes due from now on is announced anew.
            shared.is_announced.store(false, Ordering::Release);
            shared.try_cast();
            shared.list();
            while backlog.is_empty()
                && let Some(sensor) = shared.lidar.next_ahead()
            {
                sensor.cast_ahead();
                sensor.list();
            }
        });
    }

    /// Casts all scans, unless another thread is casting at present; returns whether all are cast.
    /// What that thread does not cast either is cast once the results are collected.
    pub(super) fn try_cast(&self) -> bool {
        self.0.try_cast()
    }

    /// The state with all scans cast.
    pub(crate) fn state(&self) -> MutexGuard<'_, State> {
        let mut state = self.0.state.lock().unwrap_or_else(PoisonError::into_inner);
        self.0.cast_due(&mut state);
        state
    }

    /// Forgets what has been seen, once all scans are cast.
    pub(crate) fn forget_all(&self) {
        let mut state = self.state();
        let memory = state.without_scans_ahead();
        *memory = memory.unused();
        self.0.schedule().expected = None;
    }

    /// The results of all scans.
    pub(super) fn found(&self) -> MutexGuard<'_, ScanResult> {
        if !self.0.is_done() {
            drop(self.state());
        }
        self.0.found()
    }
}

impl SensorCell {
    fn schedule(&self) -> MutexGuard<'_, Schedule> {
        self.schedule.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn found(&self) -> MutexGuard<'_, ScanResult> {
        self.found.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether all scans that were due are cast.
    fn is_done(&self) -> bool {
        let schedule = self.schedule();
        schedule.due.is_empty() && !schedule.is_casting
    }

    /// See [`Sensor::try_cast`].
    fn try_cast(&self) -> bool {
        match self.state.try_lock() {
            Ok(mut state) => self.cast_due(&mut state),
            Err(TryLockError::Poisoned(poisoned)) => self.cast_due(&mut poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => return self.is_done(),
        }
        true
    }

    fn cast_due(&self, state: &mut State) {
        loop {
            let mut schedule = self.schedule();
            let next = schedule.due.pop_front();
            schedule.is_casting = next.is_some();
            // Not held while casting.
            drop(schedule);
            let Some((pose, tick, bodies)) = next else { return };
            self.found().add(tick, |new| {
                for (number, scanner) in self.lidar.sensors.scanners().enumerate() {
                    let new = NewCells { free: &mut *new.free, wall: &mut *new.wall };
                    self.cast(state, (number, scanner), (&pose, tick), &bodies, new);
                }
            });
        }
    }

    /// Casts the scan of one of the LiDARs.
    fn cast(
        &self,
        State { memory, engine }: &mut State,
        (lidar, scanner): (usize, &Scanner),
        (pose, tick): (&Pose, Tick),
        bodies: &Bodies,
        new: NewCells<'_>,
    ) {
        let noise = &self.lidar.noise;
        let bodies = bodies.met_by(scanner);
        let mut noisy = NoisyScan { noise, agent: self.agent, lidar, tick, bodies: &bodies };
        let mut naive = NaiveEngine::past(bodies.clone());
        let engine: &mut dyn Engine = if noise.affects_scans() {
            &mut noisy
        } else if scanner.meets_bodies() {
            &mut naive
        } else {
            engine
        };
        engine.cast(scanner, memory, pose, new);
    }

    /// Adds this sensor to those with scans to cast ahead, if it has any.
    fn list(self: &Arc<Self>) {
        let mut schedule = self.schedule();
        if schedule.expected.is_some() && !std::mem::replace(&mut schedule.is_listed, true) {
            drop(schedule);
            self.lidar.ahead().push_back(Arc::downgrade(self));
        }
    }

    /// Casts the next expected scan ahead.
    fn cast_ahead(&self) {
        let mut schedule = self.schedule();
        schedule.is_listed = false;
        let Some(mut expected) = schedule.expected.take() else { return };
        let Some(scanner) = self.lidar.only_scanner() else { return };
        drop(schedule);
        let is_at_end = expected.body.foresee(expected.ticks, Tick::TICK_S);
        let pose = *expected.body.pose();
        // A thread that casts now comes from the loop, which is ahead of this one.
        let Ok(mut state) = self.state.try_lock() else { return };
        self.cast_due(&mut state);
        let State { memory, engine } = &mut *state;
        if engine.cast_ahead(scanner, memory, expected.previous.as_ref(), &pose) {
            expected.left -= 1;
        }
        drop(state);
        if expected.left > 0 && !is_at_end && expected.period_ticks <= FORESEEN_TICKS_MAX {
            let later = Expected { previous: Some(pose), ticks: expected.period_ticks, ..expected };
            // Unless something else is expected by now.
            self.schedule().expected.get_or_insert(later);
        }
    }
}

impl ScanResult {
    /// Adds what a scan of a tick finds.
    fn add(&mut self, tick: Tick, scan: impl FnOnce(NewCells<'_>)) {
        let Self { free, wall, explored, ends } = self;
        let first = free.len();
        scan(NewCells { free, wall });
        explored.extend_from_slice(&free[first..]);
        ends.push((tick, explored.len()));
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use nalgebra::Point3;
    use protocol::body_model::BodyModel;
    use voxels::{Extent, Grid, Terrain};

    use super::*;
    use crate::body::Motion;
    use crate::collision::Obstacles;
    use crate::lidar::Pattern;

    const PERIOD_TICKS: u32 = 5;

    /// A sensor in a hall with a pillar.
    fn sensor() -> Sensor {
        let mut hall = Grid::new(Extent::new([30, 8, 8], 1.0).unwrap(), Terrain::Free);
        voxels::close_shell(&mut hall, 1);
        for z in 1..7 {
            hall.set(voxels::Cell::new(12, 4, z), Terrain::Wall);
        }
        let scanner = Scanner::new(Pattern::Lattice { rays: 1500 }, 20.0, TAU);
        let lidar = Arc::new(Lidar::new(scanner.into(), SensorNoise::default(), 1));
        Sensor::new(AgentId(0), &lidar, SensorMemory::new(&hall))
    }

    fn at(x: f64) -> Pose {
        Pose { position: Point3::new(x, 2.5, 3.5), yaw_rad: 0.0 }
    }

    /// What a scan finds, ascending.
    fn scanned(sensor: &Sensor, pose: Pose) -> [Vec<u32>; 2] {
        sensor.request(pose, Tick::ZERO, Bodies::default());
        let mut found = sensor.found();
        let mut cells = [std::mem::take(&mut found.free), std::mem::take(&mut found.wall)];
        cells.iter_mut().for_each(|cells| cells.sort_unstable());
        cells
    }

    /// Casts all scans ahead that are expected.
    fn cast_ahead(sensor: &Sensor) {
        while sensor.0.schedule().expected.is_some() {
            sensor.0.cast_ahead();
        }
    }

    fn scans_ahead(sensor: &Sensor) -> usize {
        sensor.0.state.lock().unwrap().engine.scans_ahead()
    }

    #[test]
    fn scans_on_the_way_use_what_was_cast_ahead() {
        let [ahead, reference] = [(); 2].map(|()| sensor());
        let mut body = Body::at_rest(BodyModel::default(), at(3.5));
        body.set_task(Motion::Path(vec![at(25.5).position]));
        assert_eq!(scanned(&ahead, at(3.5)), scanned(&reference, at(3.5)));
        assert!(ahead.expect(&body, Some(at(3.5)), PERIOD_TICKS.into(), PERIOD_TICKS));
        cast_ahead(&ahead);
        for left in (0..AHEAD_MAX as usize).rev() {
            for _ in 0..PERIOD_TICKS {
                body.advance(&Obstacles::none(), Tick::TICK_S);
            }
            assert_eq!(scanned(&ahead, *body.pose()), scanned(&reference, *body.pose()));
            assert_eq!(scans_ahead(&ahead), left);
        }
        // Nothing was cast ahead for these.
        for x in [20.5, 5.5] {
            assert_eq!(scanned(&ahead, at(x)), scanned(&reference, at(x)));
        }
    }

    #[test]
    fn scans_that_are_due_much_later_are_not_cast_ahead() {
        let sensor = sensor();
        let mut body = Body::at_rest(BodyModel::default(), at(3.5));
        body.set_task(Motion::Path(vec![at(25.5).position]));
        scanned(&sensor, at(3.5));
        let last = Some(at(3.5));
        assert!(!sensor.expect(&body, last, FORESEEN_TICKS_MAX + 1, PERIOD_TICKS));
        cast_ahead(&sensor);
        assert_eq!(scans_ahead(&sensor), 0);
        assert!(sensor.expect(&body, last, PERIOD_TICKS.into(), 1_000_000));
        cast_ahead(&sensor);
        assert_eq!(scans_ahead(&sensor), 1);
    }

    #[test]
    fn other_tasks_make_what_was_cast_ahead_useless() {
        let [ahead, reference] = [(); 2].map(|()| sensor());
        let mut body = Body::at_rest(BodyModel::default(), at(3.5));
        body.set_task(Motion::Path(vec![at(3.8).position]));
        assert!(ahead.expect(&body, Some(at(3.5)), PERIOD_TICKS.into(), PERIOD_TICKS));
        cast_ahead(&ahead);
        let on_the_way = scans_ahead(&ahead);
        assert!((1..=AHEAD_MAX as usize).contains(&on_the_way), "up to the end of the task: {on_the_way}");
        assert_eq!(scanned(&ahead, at(9.5)), scanned(&reference, at(9.5)));
        assert_eq!(scans_ahead(&ahead), 0);
    }

    #[test]
    fn scans_on_a_new_way_are_cast_ahead_in_the_place_of_others() {
        let [ahead, reference] = [(); 2].map(|()| sensor());
        let mut body = Body::at_rest(BodyModel::default(), at(3.5));
        for goal in [at(25.5), Pose { position: Point3::new(25.5, 3.5, 3.5), yaw_rad: 0.0 }] {
            body.set_task(Motion::Path(vec![goal.position]));
            assert!(ahead.expect(&body, Some(at(3.5)), PERIOD_TICKS.into(), PERIOD_TICKS));
            cast_ahead(&ahead);
            assert_eq!(scans_ahead(&ahead), AHEAD_MAX as usize);
        }
        let mut left = AHEAD_MAX as usize;
        let mut last = at(3.5);
        while left > 0 {
            for _ in 0..PERIOD_TICKS {
                body.advance(&Obstacles::none(), Tick::TICK_S);
            }
            // The body turns first.
            if body.pose().position != last.position {
                last = *body.pose();
                assert_eq!(scanned(&ahead, last), scanned(&reference, last));
                left -= 1;
            }
            assert_eq!(scans_ahead(&ahead), left);
        }
    }
}
