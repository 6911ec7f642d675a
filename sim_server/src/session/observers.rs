//! The visualisation output of a session: messages that are due for subscribed topics, and lines of
//! the log.
//!
//! Invariant: nothing here changes or delays the run.

use std::time::{Duration, Instant};

use msgs::ids::{AgentId, Tick};

use super::engine::{Engine, Shown};
use super::{Phase, PhaseTimes};
use simulation::scenario::{PointsField, RecordedView, Scenario};
use simulation::visualisation::{
    self, Equipment, LiveStatus, PublishTime, RunStatus, VisualisationMessage, VisualisationScheduler,
    VisualisationTopic,
};
use system::wall_clock::nanoseconds;
use transport::Transport;
use world::World;

/// The visualisation topics of a run, and its wall clock.
pub(super) struct Observers {
    views: VisualisationScheduler,
    points_fields: Vec<PointsField>,
    equipment: Equipment,
    /// Start of the first tick, wall time.
    started: Instant,
    /// Runs while `/sim/info` has subscribers.
    phase_times: PhaseTimes,
}

impl Observers {
    pub(super) fn new(scenario: &Scenario, now: Instant) -> Self {
        let mut views = scenario.views.clone();
        if scenario.event.iter().any(|event| event.map_change().is_some()) {
            // Replays show the walls of each time.
            views.record.push(RecordedView::Map);
        }
        let equipment = scenario.equipment();
        Self {
            points_fields: views.points_fields.clone(),
            views: VisualisationScheduler::new(views, &equipment, scenario.recording.poses_period_ticks),
            equipment,
            started: now,
            phase_times: PhaseTimes::default(),
        }
    }

    /// Starts the wall clock of the run.
    pub(super) fn start_clock(&mut self, now: Instant) {
        self.started = now;
    }

    /// The wall time of the phases of the loop.
    pub(super) fn phase_times(&mut self) -> &mut PhaseTimes {
        &mut self.phase_times
    }

    /// Wall time since the start.
    pub(super) fn elapsed(&self, now: Instant) -> Duration {
        now.duration_since(self.started)
    }

    /// The visualisation messages to record at the start of this tick.
    pub(super) fn due_for_recording(
        &mut self,
        engine: &mut Engine<'_>,
    ) -> Vec<(VisualisationTopic, VisualisationMessage)> {
        if !self.views.records() {
            return Vec::new();
        }
        let Shown { world, infos, lost } = engine.shown();
        self.views.due_for_recording(world, &RunStatus { infos, lost, live: None })
    }

    /// Publishes what is due to topics with subscribers. Works at any time, also while the clock is
    /// held.
    pub(super) fn publish(&mut self, engine: &mut Engine<'_>, may_tick: bool, transport: &mut dyn Transport) {
        let now = transport.now();
        let elapsed = self.elapsed(now);
        let Some(subscribers) = transport.subscribers() else {
            self.phase_times.stop();
            return;
        };
        match subscribers.contains_key(&VisualisationTopic::Info) {
            true if !self.phase_times.is_running() => self.phase_times.start(now),
            true => {}
            false => self.phase_times.stop(),
        }
        let rtf = (!elapsed.is_zero()).then(|| sim_time(engine.tick()).div_duration_f64(elapsed));
        let phases_s = Phase::ALL.map(|phase| (phase.name(), self.phase_times.of(phase).as_secs_f64()));
        let Shown { world, infos, lost } = engine.shown();
        let run_status = RunStatus { infos, lost, live: Some(LiveStatus { rtf, phases_s: &phases_s }) };
        let moment = PublishTime { wall_ns: nanoseconds(elapsed), is_paused: !may_tick };
        for (view, picture) in self.views.due_live(world, &run_status, subscribers, moment) {
            transport.publish(view, &picture);
        }
    }

    /// Whether to publish a message that the session makes itself: its topic has subscribers and
    /// its rate allows.
    pub(super) fn may_publish(&mut self, view: VisualisationTopic, transport: &mut dyn Transport) -> bool {
        let elapsed = self.elapsed(transport.now());
        let subscribers = transport.subscribers();
        subscribers.is_some_and(|subscribers| self.views.may_publish(view, subscribers, nanoseconds(elapsed)))
    }

    /// Sends the odometry and the scans of this tick to a teleoperated agent, and before them its
    /// transforms to observers.
    pub(super) fn send_sensors(&mut self, world: &World, agent: AgentId, transport: &mut dyn Transport) {
        let subscribers = transport.subscribers();
        let due = subscribers.map(|subscribers| self.views.due_before_sensors(world, agent, subscribers));
        for transform in due.unwrap_or_default() {
            transport.publish(VisualisationTopic::Transforms, &transform);
        }
        let has_scan = world.last_scan(agent).is_some_and(|(_, tick)| tick == world.tick());
        let of_agent = self.equipment.sensors_of(agent).filter(|_| has_scan).map(|(sensor, _)| sensor);
        let points =
            of_agent.filter_map(|sensor| Some((sensor, visualisation::points(world, sensor, &self.points_fields)?)));
        let points = points.collect();
        transport.set_sensors(agent, visualisation::measured_odometry(world, agent), points);
    }
}

fn sim_time(tick: Tick) -> Duration {
    Duration::from_nanos(tick.time_ns())
}
