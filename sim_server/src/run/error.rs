//! Why a run has no full result.

use msgs::ids::{AgentId, Tick};
use thiserror::Error;

use super::Start;
use crate::playback::PlaybackError;
use crate::recorder::RecordError;
use simulation::lockstep::listed;

/// Why a run has no full result.
#[derive(Debug, Error)]
pub enum RunError {
    /// Not all agents have joined in time.
    #[error("agents missing after {seconds} s: {}", listed(missing.iter().copied()))]
    AgentsMissing {
        /// Who.
        missing: Vec<AgentId>,
        /// How long they were waited for, wall time.
        seconds: f64,
    },
    /// An agent has not answered in time, and the scenario says `abort`.
    #[error("no answer within {seconds} s to tick {tick} from: {}", listed(lost.iter().copied()))]
    AgentsLost {
        /// Who.
        lost: Vec<AgentId>,
        /// The tick that was not answered.
        tick: Tick,
        /// How long they were waited for, wall time.
        seconds: f64,
    },
    /// Another server is there, and the agents could not tell whom to follow.
    #[error("another server is in this network, with run {other:016x}: wait for its end, or set another ROS_DOMAIN_ID")]
    OtherServer {
        /// Number of its run.
        other: u64,
    },
    /// The run is to begin paused, and nobody could resume it.
    #[error("execution.paused = true: over this transport nobody could resume the run; it needs ROS 2")]
    NobodyResumes,
    /// Somebody has asked for the run to begin again. It is no failure: whoever carries it out goes on with [`super::begin_again`].
    #[error("the run is to begin again")]
    Reset(Start),
    /// The system has no random number for the run.
    #[error("drawing a number for the run: {0}")]
    Random(#[from] getrandom::Error),
    /// An agent that was told its past gave another answer than before.
    #[error("agent {agent} does not decide the same way again: in tick {tick} {what}")]
    Diverged {
        /// Who.
        agent: AgentId,
        /// When.
        tick: Tick,
        /// Field, and both values.
        what: String,
    },
    /// An agent of a run that goes on runs something else than before.
    #[error("agent {agent} runs {now}, and {before} in the run that is to go on")]
    OtherController {
        /// Who.
        agent: AgentId,
        /// What it ran.
        before: String,
        /// What it runs.
        now: String,
    },
    /// The recording of the run that is to go on cannot be carried out again.
    #[error(transparent)]
    Playback(#[from] PlaybackError),
    /// The recording of the run that is to go on has something else than what comes of it here.
    #[error("tick {tick}: {reason}")]
    OtherRun {
        /// When.
        tick: Tick,
        /// What is different.
        reason: String,
    },
    /// The recording cannot be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The worker threads cannot be started.
    #[error("starting worker threads: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}
