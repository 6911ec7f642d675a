//! A planned run in this process, over the in-memory transport.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use agent_node::stopwatch::DecisionTimes;
use msgs::ids::Tick;
use sim_server::session::{INTERRUPTED, NullObserver};

use super::{RunFailure, machine};
use crate::in_process::{self, AgentOptions, ThreadLayout};
use crate::measure::{self, Trace};
use crate::plan::PlannedRun;
use crate::rows::RunRecord;

/// Performs a run on one thread: the other cores are for the other jobs. The run is recorded to
/// `recording`.
pub(super) fn carry_out(
    run: &PlannedRun,
    recording: Option<PathBuf>,
    stop: &AtomicBool,
) -> Result<RunRecord, RunFailure> {
    let mut scenario = run.scenario.clone();
    scenario.execution.threads = 1;
    scenario.execution.record = recording;
    let times = DecisionTimes::default();
    let options = AgentOptions {
        threads: ThreadLayout::Together,
        chaos_delay: Duration::ZERO,
        decision_times: Some(times.clone()),
    };
    let completed = in_process::run(&scenario, &options, &mut NullObserver, stop)
        .map_err(|error| RunFailure::Failed(error.to_string()))?;
    let result = &completed.outcome.result;
    if result.reason == INTERRUPTED {
        return Err(RunFailure::Interrupted);
    }
    let wall = measure::wall_row(Tick(result.tick), completed.outcome.wall, &times.sorted(), &machine());
    Ok(measure::record(run, Trace { size: completed.size, progress: &completed.progress, result, wall }))
}
