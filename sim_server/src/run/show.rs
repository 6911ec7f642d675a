//! What onlookers get to see of a run: views when they are due, and what people are told.
//!
//! Invariant: nothing here changes what the run does, and nothing of it waits.

use std::time::Duration;

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs;

use super::{Run, RunError, now};
use crate::link::Level;
use simulation::digest::Digest;
use simulation::views::{self, Facts, Moment, Picture, View};
use simulation::wire;

impl Run<'_> {
    /// Records the views that the scenario has recorded, at the start of a tick.
    pub(super) fn record_views(&mut self) -> Result<(), RunError> {
        if !self.log.is_recording() {
            return Ok(());
        }
        let facts = Facts { infos: &self.infos, lost: &self.lost, pace: None };
        let tick = self.world.tick();
        for (view, picture) in self.views.to_record(&mut self.world, &facts) {
            self.log.write_view(view, tick, &picture)?;
        }
        Ok(())
    }

    /// Shows what is due to those who listen. May be called at any time, and so while the world stands still.
    pub(super) fn show(&mut self) {
        let Some(listeners) = self.exchange.listeners() else { return };
        let elapsed = self.started.elapsed();
        let pace = (!elapsed.is_zero()).then(|| sim_time(self.world.tick()).div_duration_f64(elapsed));
        let facts = Facts { infos: &self.infos, lost: &self.lost, pace };
        let moment = Moment { wall_ns: nanoseconds(elapsed), is_still: !self.desk.may_tick() };
        let pictures = self.views.to_show(&mut self.world, &facts, listeners, moment);
        for (view, picture) in pictures {
            self.exchange.show(view, &picture);
        }
    }

    /// Has an agent that is driven by standard messages told where it is, and what its scan of this tick has found.
    pub(super) fn drive(&mut self, agent: AgentId) {
        let has_scan = self.world.last_scan(agent).is_some_and(|(_, tick)| tick == self.world.tick());
        let points = if has_scan { views::points(&self.world, agent) } else { None };
        let mut odometry = views::odometry(&self.world, agent);
        odometry.pose.pose.position = wire::point(&self.world.told_position(agent));
        self.exchange.drive(agent, odometry, points);
    }

    /// Shows a message that the run loop has made by itself, if it may.
    pub(super) fn show_own(&mut self, view: View, picture: Picture) {
        let Some(listeners) = self.exchange.listeners() else { return };
        if self.views.may_show(view, listeners, nanoseconds(self.started.elapsed())) {
            self.exchange.show(view, &picture);
        }
    }

    /// Shows how the run has ended.
    pub(super) fn show_end(&mut self, result: &maes_msgs::Result, ended_well: bool) {
        self.exchange.show(View::Result, &Picture::Result(Box::new(result.clone())));
        let level = if ended_well { Level::Info } else { Level::Error };
        let digest = Digest(result.digest);
        self.exchange
            .log(level, &format!("the run has ended in tick {}: {}; digest {digest}", result.tick, result.reason));
    }

    /// Tells people something, on the terminal and over the link.
    pub(super) fn note(&mut self, level: Level, text: &str) {
        self.watcher.note(text);
        self.exchange.log(level, text);
    }

    /// Takes up the clock of what is shown and of the pace.
    pub(super) fn start_clock(&mut self) {
        self.started = now();
    }

    /// What it says, ns.
    pub(super) fn wall_ns(&self) -> u64 {
        nanoseconds(self.started.elapsed())
    }
}

fn sim_time(tick: Tick) -> Duration {
    Duration::from_nanos(tick.time_ns())
}

fn nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX)
}
