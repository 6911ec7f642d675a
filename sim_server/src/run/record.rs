//! What a run writes down by itself: the state at the start of a tick, and what was said in one that was given up.

use msgs::maes_msgs;

use super::exchange::Asked;
use super::log::Kind;
use super::{Run, RunError};
use simulation::visualisation::{VisualisationMessage, VisualisationTopic};
use simulation::wire;
use simulation::world::Commit;

/// Sim time between two digests in the recording: a second.
const DIGEST_TICKS: u64 = 50;

/// Sim time between two progress messages: ten seconds, as in the reference.
const PROGRESS_TICKS: u64 = 500;

impl Run<'_> {
    /// Records what is recorded of the state at the start of this tick.
    pub(super) fn record_state(&mut self) -> Result<(), RunError> {
        let tick = self.world.tick();
        let poses_period = u64::from(self.scenario.recording.poses_period_ticks);
        if poses_period > 0 && tick.0.is_multiple_of(poses_period) && self.log.is_recording() {
            self.log.write(Kind::Transforms, tick, &wire::transforms(&self.world))?;
        }
        if tick.0.is_multiple_of(DIGEST_TICKS) {
            self.record_digest()?;
        }
        if tick.0.is_multiple_of(PROGRESS_TICKS) {
            self.record_progress()?;
        }
        self.record_views()
    }

    pub(super) fn record_digest(&mut self) -> Result<(), RunError> {
        let tick = self.world.tick();
        if self.digest_recorded != Some(tick) {
            self.digest_recorded = Some(tick);
            let digest = maes_msgs::Digest { header: wire::header(tick), tick: tick.0, digest: self.chain.digest().0 };
            self.log.write(Kind::Digest, tick, &digest)?;
            self.show_own(VisualisationTopic::Digest, VisualisationMessage::Digest(digest));
        }
        Ok(())
    }

    pub(super) fn record_progress(&mut self) -> Result<(), RunError> {
        let tick = self.world.tick();
        if self.progress_recorded != Some(tick) {
            self.progress_recorded = Some(tick);
            let progress = wire::progress(&mut self.world);
            self.exchange.progress(&progress);
            self.log.write(Kind::Progress, tick, &progress)?;
        }
        Ok(())
    }

    /// Records what agents were told in a tick that was given up. It is not part of the digest.
    pub(super) fn record_unanswered(&mut self, asked: &[Asked]) -> Result<(), RunError> {
        let tick = self.world.tick();
        for Asked { agent, parts, .. } in asked.iter().filter(|asked| asked.since == Commit::Committed) {
            for part in parts {
                self.log.write(Kind::Observation(*agent), tick, part)?;
            }
        }
        Ok(())
    }
}
