//! A planned run in this process, over the in-memory transport.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use agent_node::controllers::Registry;
use agent_node::stopwatch::DecisionTimes;
use msgs::ids::{AgentId, Tick};
use msgs::rcl_interfaces::Level;
use sim_server::session::{EndReason, Phase, RunObserver};
use system::wall_clock;
use world::World;

use super::{RunFailure, machine};
use crate::measure::{self, Trace};
use crate::plan::PlannedRun;
use crate::rows::RunRecord;
use in_memory::in_process::{self, AgentOptions, ThreadLayout};

/// Performs a run on one thread: the other cores are for the other jobs. The run is recorded to
/// `recording`.
pub(super) fn carry_out(
    run: &PlannedRun,
    recording: Option<PathBuf>,
    registry: Registry,
    stop: &AtomicBool,
) -> Result<RunRecord, RunFailure> {
    let mut scenario = run.scenario.clone();
    scenario.execution.threads = 1;
    scenario.execution.record = recording;
    let times = DecisionTimes::new(wall_clock::now);
    let options = AgentOptions {
        threads: ThreadLayout::Together,
        decision_times: Some(times.clone()),
        registry,
        programs_from: Some(run.folder.clone()),
        ..AgentOptions::default()
    };
    let own_stop = AtomicBool::new(stop.load(Ordering::Relaxed));
    let mut end = EndOfPlan { plan: stop, run: &own_stop };
    let completed = in_process::run(&scenario, &options, &mut end, &own_stop)
        .map_err(|error| RunFailure::Failed(error.to_string()))?;
    let result = &completed.outcome.result;
    if completed.outcome.reason() == EndReason::Interrupted {
        return Err(RunFailure::Interrupted);
    }
    let wall = measure::wall_row(Tick(result.tick), completed.outcome.wall, &times.sorted(), &machine());
    let trace = Trace {
        size: completed.size,
        cell_m: completed.cell_m,
        progress: &completed.course.progress,
        result,
        stages: &completed.course.stages,
        seen_again: completed.course.seen_again,
        explored_m2: Some(completed.outcome.explored_m2),
        wall,
    };
    Ok(measure::record(run, trace))
}

/// Ends a run when its plan ends. The failure of an agent sets the stop flag of its run as well,
/// and must not end the plan.
struct EndOfPlan<'a> {
    plan: &'a AtomicBool,
    run: &'a AtomicBool,
}

impl RunObserver for EndOfPlan<'_> {
    fn waiting(&mut self, _missing: &[AgentId]) {}
    fn started(&mut self) {}
    fn progress(&mut self, _world: &World) {}
    fn note(&mut self, _level: Level, _text: &str) {}

    fn phase_ended(&mut self, _phase: Phase, _tick: Tick) {
        if self.plan.load(Ordering::Relaxed) {
            self.run.store(true, Ordering::Relaxed);
        }
    }
}
