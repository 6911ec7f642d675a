//! The end of a run: the agents get the shutdown message, and the result is recorded.

use std::sync::atomic::AtomicBool;
use std::time::Duration;

use msgs::maes_msgs::{self, Counter, Observation as Fragment};

use super::agents::WaitContext;
use super::log::EntryKind;
use super::{EndReason, Outcome, RunError, SHUTDOWN_TIMEOUT, Session};
use protocol::lockstep::ObservationRequest;
use protocol::observation::RequestKind;
use simulation::digest::Digest;
use simulation::visualisation::{VisualisationMessage, VisualisationTopic};
use transport::Level;

impl Session<'_, '_> {
    /// Shuts the agents down, and completes the recording.
    pub(super) fn finish(mut self, reason: &EndReason, ended_well: bool, wall: Duration) -> Result<Outcome, RunError> {
        let tick = self.engine.tick();
        let mut last: Vec<ObservationRequest> = Vec::new();
        for agent in self.engine.world().agents() {
            last.push(self.engine.request(agent, RequestKind::Scheduled, Fragment::ENDED));
        }
        self.control.end_steps("the run has ended");
        let is_present = |request: &&ObservationRequest| !self.engine.is_lost(request.agent);
        let present: Vec<ObservationRequest> = last.iter().filter(is_present).cloned().collect();
        // The agents come first: an error of the recording does not concern them. The stop flag
        // does not cut this wait short.
        let Self { begun, agents, transport, observer, observers, log, .. } = &mut self;
        let never = AtomicBool::new(false);
        let (transport, observer, phase_times) = (&mut **transport, &mut **observer, observers.phase_times());
        let mut context = WaitContext { begun: *begun, transport, observer, phase_times, log, stop: &never };
        agents.shut_down(tick, &present, SHUTDOWN_TIMEOUT, &mut context)?;
        for request in &last {
            for fragment in &*request.fragments {
                self.log.write(EntryKind::Observation(request.agent), tick, fragment)?;
            }
        }
        let digest = self.engine.digest();
        let progress = self.engine.progress();
        let world = self.engine.world();
        let explored_m2 = world.coverage().explored_surface_m2(world.terrain());
        let mut counters = self.engine.counters();
        counters.extend(self.agents.sessions().refusals().map(|(name, value)| Counter::new(name, value)));
        let result = maes_msgs::Result {
            header: progress.header,
            tick: tick.0,
            reason: reason.text().to_owned(),
            explored: progress.explored,
            covered: progress.covered,
            explored_by: progress.explored_by,
            covered_by: progress.covered_by,
            distance_m: progress.distance_m,
            believed_by: progress.believed_by,
            counters,
            digest: digest.0,
        };
        self.record_digest()?;
        self.record_progress()?;
        self.log.write(EntryKind::Result, tick, &result)?;
        self.publish_result(&result, ended_well);
        let restarted = self.agents.sessions().restarted();
        self.log.finish()?;
        Ok(Outcome { result, digest, wall, explored_m2, restarted })
    }

    fn publish_result(&mut self, result: &maes_msgs::Result, ended_well: bool) {
        self.transport.publish(VisualisationTopic::Result, &VisualisationMessage::Result(Box::new(result.clone())));
        let level = if ended_well { Level::Info } else { Level::Error };
        let (tick, reason, digest) = (result.tick, &result.reason, Digest(result.digest));
        self.transport.log(level, &format!("the run has ended in tick {tick}: {reason}; digest {digest}"));
    }
}
