//! The errors of a run.

use msgs::ids::{AgentId, Tick};
use thiserror::Error;

use super::RunStart;
use protocol::lockstep::listed;
use recording::playback::PlaybackError;
use recording::recorder::RecordError;

/// The reason why a run has no complete result.
#[derive(Debug, Error)]
pub enum RunError {
    /// Not all agents have joined in time.
    #[error("agents missing after {seconds} s: {}", listed(missing.iter().copied()))]
    AgentsMissing {
        missing: Vec<AgentId>,
        /// Timeout, wall time.
        seconds: f64,
    },
    /// An agent has not answered in time, and the scenario says `abort`.
    #[error(
        "no answer within {seconds} s to tick {tick} from: {}{}",
        listed(lost.iter().copied()),
        refused.as_ref().map_or_else(String::new, |reason| format!("; {reason}"))
    )]
    AgentsLost {
        lost: Vec<AgentId>,
        /// The illegal answer of one of them, if there was one.
        refused: Option<String>,
        /// The tick without their replies.
        tick: Tick,
        /// Timeout, wall time.
        seconds: f64,
    },
    /// Another server is in the network, so that agents cannot tell which one to join.
    #[error("another server is in this network, with run {other:016x}: wait for its end, or set another ROS_DOMAIN_ID")]
    OtherServer {
        /// Number of its run.
        other: u64,
    },
    /// The run would start paused over a transport without control input.
    #[error("execution.paused = true: this transport has no control input to resume the run; use ROS 2")]
    PausedForEver,
    /// A control request has reset the run. No failure: the caller continues with
    /// [`super::RunConfig::after_reset`].
    #[error("the simulation was reset")]
    Reset {
        start: RunStart,
        /// Agents that have left, so that their processes have ended, ascending.
        departed: Vec<AgentId>,
    },
    /// The system provides no random number for the identity of the run.
    #[error("no random number for the run: {0}")]
    Random(#[from] getrandom::Error),
    /// An agent answered a replayed observation differently.
    #[error("agent {agent} diverges from its observation log: in tick {tick} {what}")]
    Diverged {
        agent: AgentId,
        tick: Tick,
        /// The field, and both values.
        what: String,
    },
    /// An agent of a resumed run runs another controller than in the recording.
    #[error("agent {agent} runs {now}, and {before} in the recording that is resumed")]
    OtherController { agent: AgentId, before: String, now: String },
    /// The recording cannot be re-executed.
    #[error(transparent)]
    Playback(#[from] PlaybackError),
    /// The recording differs from what its re-execution gives.
    #[error("tick {tick}: {reason}")]
    OtherRun {
        tick: Tick,
        /// The difference.
        reason: String,
    },
    /// The recording cannot be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The worker threads cannot be started.
    #[error("starting worker threads: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}
