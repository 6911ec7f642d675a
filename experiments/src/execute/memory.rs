//! A run of a plan in this process.

use std::sync::atomic::AtomicBool;
use std::time::Duration;

use agent_node::stopwatch::DecisionTimes;
use msgs::ids::Tick;
use sim_server::session::{INTERRUPTED, NullObserver};

use super::{RunFailure, machine};
use crate::measure::{self, Trace};
use crate::plan::PlannedRun;
use crate::rows::RunRecord;
use crate::single::{self, Grouping, Team};

/// Carries out a run, with one thread for the server and one for all agents: other runs have the other cores.
pub(super) fn carry_out(run: &PlannedRun, stop: &AtomicBool) -> Result<RunRecord, RunFailure> {
    let mut scenario = run.scenario.clone();
    scenario.execution.threads = 1;
    scenario.execution.record = None;
    let times = DecisionTimes::default();
    let team = Team { grouping: Grouping::Together, chaos_delay: Duration::ZERO, decision_times: Some(times.clone()) };
    let finished = single::run(&scenario, &team, &mut NullObserver, stop)
        .map_err(|error| RunFailure::Failed(error.to_string()))?;
    let result = &finished.outcome.result;
    if result.reason == INTERRUPTED {
        return Err(RunFailure::Interrupted);
    }
    let wall = measure::wall_row(Tick(result.tick), finished.outcome.wall, &times.sorted(), &machine());
    Ok(measure::record(run, Trace { size: finished.size, progress: &finished.progress, result, wall }))
}
