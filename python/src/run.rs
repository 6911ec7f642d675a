//! A run in this process, over the in-memory link.

use std::path::PathBuf;

use experiments::execute;
use experiments::measure::{self, Trace};
use experiments::plan::{KnownControllers, Plan};
use in_memory::in_process::{self, AgentOptions, ThreadLayout};
use msgs::ids::Tick;
use pyo3::prelude::*;
use recording::Recording;
use recording::location::recording_at;
use recording::recorder::may_be_named;
use sim_server::session::NullObserver;
use sim_server::setup::{self, SetupError};
use simulation::scenario::{Origins, Override, Scenario};

use crate::controller::PyControllers;
use crate::convert::to_toml;
use crate::error::{bad_input, of_run};
use crate::interrupt::interruptible;
use crate::result::PyRunResult;
use crate::scenario::PyScenario;

/// Options of the agents: Python decides on one thread, since the GIL lets one decide at a time.
fn options(controllers: &PyControllers, substitute: Option<String>, has_python: bool) -> AgentOptions {
    let threads = if has_python { ThreadLayout::Together } else { ThreadLayout::Team };
    AgentOptions { threads, registry: controllers.registry, substitute, ..AgentOptions::default() }
}

/// Writes a recording under this name, if there is one, whatever the scenario says.
fn record_as(scenario: &mut Scenario, record: Option<PathBuf>) -> PyResult<()> {
    let Some(file) = record else { return Ok(()) };
    if !may_be_named(&file) {
        let name = file.display();
        return Err(bad_input(format!("record = '{name}': expected a name that ends in .mcap, or in / for a folder")));
    }
    scenario.execution.record = Some(file);
    Ok(())
}

fn completed(
    scenario: &Scenario,
    known: KnownControllers<'_>,
    done: in_process::CompletedRun,
) -> PyResult<PyRunResult> {
    let plain = Scenario { execution: Default::default(), ..scenario.clone() };
    let planned = Plan::run_of(plain, known).map_err(bad_input)?;
    let result = done.outcome.result;
    let wall = measure::wall_row(Tick(result.tick), done.outcome.wall, &[], &execute::machine());
    let trace = Trace {
        size: done.size,
        cell_m: done.cell_m,
        progress: &done.course.progress,
        result: &result,
        stages: &done.course.stages,
        seen_again: done.course.seen_again,
        explored_m2: Some(done.outcome.explored_m2),
        wall,
    };
    let record = measure::record(&planned, trace);
    Ok(PyRunResult { record, result })
}

/// Runs a scenario.
#[pyfunction]
#[pyo3(signature = (scenario, controllers, *, has_python, substitute=None, record=None))]
pub(crate) fn run(
    py: Python<'_>,
    scenario: &PyScenario,
    controllers: &PyControllers,
    has_python: bool,
    substitute: Option<String>,
    record: Option<PathBuf>,
) -> PyResult<PyRunResult> {
    let mut scenario = scenario.scenario.clone();
    record_as(&mut scenario, record)?;
    let options = options(controllers, substitute, has_python);
    let done = interruptible(py, |stop| in_process::run(&scenario, &options, &mut NullObserver, stop))?;
    py.detach(|| {
        // The length of a cell may be that of the map file.
        let scenario = setup::resolve(scenario, &Origins::new("the scenario", "", &[])).map_err(bad_input)?;
        completed(&scenario, controllers.known(), done.map_err(of_run)?)
    })
}

/// The exception for a fork that cannot be, with the words of Python.
fn of_fork(error: SetupError) -> PyErr {
    match error {
        SetupError::NoSuchTick { file, at_s, ended, end_s } => {
            bad_input(format!("{file}: at_s = {at_s}: expected a time of the recorded run, which {ended} {end_s} s"))
        }
        other => bad_input(other),
    }
}

/// Forks a recorded run at a sim time, with other keys from there on.
#[pyfunction]
#[pyo3(signature = (recording, at_s, changes, controllers, *, has_python, record=None))]
pub(crate) fn fork(
    py: Python<'_>,
    recording: PathBuf,
    at_s: f64,
    changes: Vec<(String, Bound<'_, PyAny>)>,
    controllers: &PyControllers,
    has_python: bool,
    record: Option<PathBuf>,
) -> PyResult<PyRunResult> {
    let changes = changes.into_iter().map(|(key, value)| {
        let value = to_toml(&value)?;
        Ok(Override { origin: format!("{key}={value}"), key, value: Some(value) })
    });
    let changes = changes.collect::<PyResult<Vec<_>>>()?;
    let options = options(controllers, None, has_python);
    let recording = recording_at(recording).map_err(bad_input)?;
    let at = setup::tick_at(at_s).map_err(|allowed| bad_input(format!("at_s = {at_s}: {allowed}")))?;
    let (scenario, done) = interruptible(py, |stop| {
        let recording = Recording::open(&recording).map_err(bad_input)?;
        let mut scenario = setup::fork(&recording, at, &changes).map_err(of_fork)?;
        record_as(&mut scenario, record)?;
        let done = in_process::fork(&recording, at, &scenario, &options, &mut NullObserver, stop).map_err(of_run)?;
        Ok::<_, PyErr>((scenario, done))
    })??;
    py.detach(|| completed(&scenario, controllers.known(), done))
}
