//! The periodic messages of a recording: poses, digest, progress and visualisation at the start of
//! a tick; and the observations of a tick that was given up.

use msgs::ids::Tick;
use msgs::maes_msgs;

use super::log::EntryKind;
use super::{RunError, Session};
use protocol::lockstep::ObservationRequest;
use protocol::observation::RequestKind;
use simulation::visualisation::{VisualisationMessage, VisualisationTopic};
use simulation::wire;

/// Sim time between two digests in the recording: one second.
const DIGEST_TICKS: u64 = 50;

/// Sim time between two progress messages: ten seconds, as in the reference.
const PROGRESS_TICKS: u64 = 500;

/// The ticks of the last messages, so that the end of a run does not repeat them.
#[derive(Default)]
pub(super) struct LastRecorded {
    digest: Option<Tick>,
    progress: Option<Tick>,
}

impl Session<'_, '_> {
    /// Records the state at the start of this tick, as far as messages are due.
    pub(super) fn record_state(&mut self) -> Result<(), RunError> {
        let tick = self.engine.tick();
        let poses_period = u64::from(self.scenario.recording.poses_period_ticks);
        if poses_period > 0 && tick.0.is_multiple_of(poses_period) && self.log.is_recording() {
            self.log.write(EntryKind::Transforms, tick, &wire::transforms(self.engine.world()))?;
        }
        if tick.0.is_multiple_of(DIGEST_TICKS) {
            self.record_digest()?;
        }
        if tick.0.is_multiple_of(PROGRESS_TICKS) {
            self.record_progress()?;
        }
        if self.log.is_recording() {
            for (view, picture) in self.observers.due_for_recording(&mut self.engine) {
                self.log.write_view(view, tick, &picture)?;
            }
        }
        Ok(())
    }

    pub(super) fn record_digest(&mut self) -> Result<(), RunError> {
        let tick = self.engine.tick();
        if self.recorded.digest.replace(tick) == Some(tick) {
            return Ok(());
        }
        let is_published = self.observers.may_publish(VisualisationTopic::Digest, self.transport);
        // Without a reader the run need not wait for scans and hashes.
        if is_published || self.log.is_recording() {
            let digest = self.engine.digest().0;
            let digest = maes_msgs::Digest { header: wire::header(tick), tick: tick.0, digest };
            self.log.write(EntryKind::Digest, tick, &digest)?;
            if is_published {
                self.transport.publish(VisualisationTopic::Digest, &VisualisationMessage::Digest(digest));
            }
        }
        Ok(())
    }

    pub(super) fn record_progress(&mut self) -> Result<(), RunError> {
        let tick = self.engine.tick();
        if self.recorded.progress != Some(tick) {
            self.recorded.progress = Some(tick);
            let progress = self.engine.progress();
            self.transport.progress(&progress);
            self.log.write(EntryKind::Progress, tick, &progress)?;
        }
        Ok(())
    }

    /// Records the observations of a tick that was given up. The digest does not cover them.
    pub(super) fn record_unanswered(&mut self, requests: &[ObservationRequest]) -> Result<(), RunError> {
        let tick = self.engine.tick();
        for request in requests.iter().filter(|request| request.kind == RequestKind::Scheduled) {
            for fragment in &*request.fragments {
                self.log.write(EntryKind::Observation(request.agent), tick, fragment)?;
            }
        }
        Ok(())
    }
}
