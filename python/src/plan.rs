//! Plans of many runs, in this process.

use std::num::NonZero;
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use experiments::execute::{self, ExecuteError, OpenFolder, Options, Part, PlanObserver, Selection, Stop, Transport};
use experiments::plan::{BUILD, Plan, PlannedRun};
use experiments::rows::RunRow;
use experiments::store::{RUNS, Store};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::controller::PyControllers;
use crate::error::{bad_input, failed};
use crate::interrupt::{internal, interrupt_controllers};
use crate::result::{columns, table};

/// A plan, expanded to its runs.
#[pyclass(name = "NativePlan", module = "maes._maes", frozen)]
pub(crate) struct PyPlan {
    plan: Plan,
}

#[pymethods]
impl PyPlan {
    /// Parses a plan; its paths start from `folder`.
    #[staticmethod]
    fn parse(name: &str, text: &str, folder: PathBuf, controllers: &PyControllers) -> PyResult<Self> {
        let plan = Plan::parse_with(name, text, &folder, controllers.known()).map_err(bad_input)?;
        Ok(Self { plan })
    }

    /// Id, axes and seed of each run, in the order of execution.
    fn runs(&self) -> Vec<(String, Axes, u64)> {
        let run = |run: &PlannedRun| (run.id.clone(), run.axes.clone().into_iter().collect(), run.scenario.seed);
        self.plan.runs.iter().map(run).collect()
    }

    /// Opens the folder of the plan and locks it, until `close`: nothing is executed, nor stored,
    /// in a folder that is refused. Runs of classes without a version are removed from it.
    fn open(&self, folder: PathBuf, controllers: &PyControllers, jobs: usize, prune: bool) -> PyResult<PyPlanFolder> {
        let jobs = NonZero::new(jobs).ok_or_else(|| bad_input("jobs = 0: expected a number from 1"))?;
        let (transport, registry) = (Transport::Memory, controllers.registry);
        let options = Options { jobs, transport, part: Part::WHOLE, registry, prune };
        let opened = execute::open(&self.plan, &folder, &options).map_err(of_plan)?;
        Ok(PyPlanFolder { options, opened: Mutex::new(Some(opened)) })
    }
}

/// The exception for a plan that is refused, with the remedies of Python, or whose runs fail.
fn of_plan(error: ExecuteError) -> PyErr {
    match error {
        ExecuteError::OtherRuns { folder, count, example } => bad_input(format!(
            "{folder}: holds {count} runs that are not of this plan, this build ({BUILD}) and these versions of its \
             controllers, such as {example}: choose another folder, or remove them with prune=True"
        )),
        ExecuteError::Store(error) if error.is_failure() => failed(error),
        fault @ (ExecuteError::OtherOutcome { .. } | ExecuteError::Oracle(_) | ExecuteError::Statistics(_)) => {
            failed(fault)
        }
        other => bad_input(other),
    }
}

/// The folder of a plan, locked for as long as it is open.
#[pyclass(name = "PlanFolder", module = "maes._maes", frozen)]
pub(crate) struct PyPlanFolder {
    options: Options,
    opened: Mutex<Option<OpenFolder>>,
}

impl PyPlanFolder {
    fn opened(&self) -> MutexGuard<'_, Option<OpenFolder>> {
        self.opened.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn with<T>(&self, act: impl FnOnce(&OpenFolder) -> PyResult<T>) -> PyResult<T> {
        act(self.opened().as_ref().ok_or_else(|| failed("the folder of the plan is closed"))?)
    }
}

#[pymethods]
impl PyPlanFolder {
    /// The ids of the runs of a plan that have no record.
    fn missing(&self, plan: &PyPlan) -> PyResult<Vec<String>> {
        let done = self.with(|folder| folder.store.done().map_err(failed))?;
        Ok(plan.plan.runs.iter().map(|run| run.id.clone()).filter(|id| !done.contains(id)).collect())
    }

    /// Stores the record and the scenario of a run of which another process has made the files.
    fn store_run(&self, id: &str, record: &[u8], scenario: &[u8]) -> PyResult<()> {
        self.with(|OpenFolder { store, .. }| {
            // The record comes last, so that a run without it is missing.
            let files = [("toml", scenario), ("json", record)];
            let stored = files
                .into_iter()
                .try_for_each(|(ending, bytes)| store.write(&format!("{RUNS}/{id}.{ending}"), bytes).map(drop));
            stored.and_then(|()| store.forget_failure(id)).map_err(failed)
        })
    }

    /// Stores that a run of a plan has failed in another process.
    fn store_failure(&self, plan: &PyPlan, id: &str, reason: &str) -> PyResult<()> {
        let run = plan.plan.runs.iter().find(|run| run.id == id);
        let run = run.ok_or_else(|| failed(format!("run {id}: not of this plan")))?;
        self.with(|folder| execute::save_failure(&folder.store, run, reason).map_err(failed))
    }

    /// Writes the tables of the records.
    fn write_tables(&self, py: Python<'_>) -> PyResult<()> {
        py.detach(|| self.with(|folder| folder.store.write_tables().map_err(failed)))
    }

    /// Lets others work in the folder.
    fn close(&self) {
        self.opened().take();
    }
}

/// What sets a run apart, by axis.
type Axes = Vec<(String, String)>;

/// What happens to runs, for the thread that holds the GIL.
enum Event {
    Started { pending: usize },
    Completed { id: String },
    Failed { id: String, reason: String },
}

/// Passes what happens on.
struct Reports(Sender<Event>);

impl PlanObserver for Reports {
    fn started(&mut self, _runs: &[&PlannedRun], pending: &[&PlannedRun]) {
        let _ = self.0.send(Event::Started { pending: pending.len() });
    }

    fn completed(&mut self, run: &PlannedRun, _row: &RunRow) {
        let _ = self.0.send(Event::Completed { id: run.id.clone() });
    }

    fn failed(&mut self, run: &PlannedRun, reason: &str) {
        let _ = self.0.send(Event::Failed { id: run.id.clone(), reason: reason.to_owned() });
    }
}

/// The name of the table of verdicts, which single runs do not have.
const VERDICTS: &str = "verdicts";

/// Wall time between two looks for signals.
const PERIOD: Duration = Duration::from_millis(20);

/// Executes the runs of a plan that have no record in its folder; `report` is called with
/// `("started", count)`, `("completed", id)` and `("failed", id, reason)`.
#[pyfunction]
#[pyo3(signature = (plan, folder, *, only, report))]
pub(crate) fn execute_plan(
    py: Python<'_>,
    plan: &PyPlan,
    folder: &PyPlanFolder,
    only: Vec<String>,
    report: &Bound<'_, PyAny>,
) -> PyResult<()> {
    let selection = Selection { only: only.into_iter().collect(), ..Selection::default() };
    let stop = Stop::default();
    let report = report.clone().unbind();
    let raised: Mutex<Option<PyErr>> = Mutex::new(None);
    let executed = py.detach(|| {
        let opened = folder.opened();
        let opened = opened.as_ref().ok_or_else(|| failed("the folder of the plan is closed"))?;
        thread::scope(|scope| {
            let (sender, events) = channel();
            let (stop, options, selection) = (&stop, &folder.options, &selection);
            let worker = scope.spawn(move || {
                let mut reports = Reports(sender);
                execute::execute_in(opened, &plan.plan, options, selection, &mut reports, stop)
            });
            let handle = |event: Option<Event>| {
                Python::attach(|py| {
                    let outcome = match event {
                        None => Ok(()),
                        Some(Event::Started { pending }) => report.call1(py, ("started", pending)).map(drop),
                        Some(Event::Completed { id }) => report.call1(py, ("completed", id)).map(drop),
                        Some(Event::Failed { id, reason }) => report.call1(py, ("failed", id, reason)).map(drop),
                    };
                    let Err(error) = outcome.and_then(|()| py.check_signals()) else { return };
                    stop.soon.store(true, Ordering::Relaxed);
                    stop.at_once.store(true, Ordering::Relaxed);
                    let error = interrupt_controllers(py).err().unwrap_or(error);
                    raised.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
                });
            };
            loop {
                match events.recv_timeout(PERIOD) {
                    Ok(event) => handle(Some(event)),
                    Err(std::sync::mpsc::RecvTimeoutError::Timeout) => handle(None),
                    Err(std::sync::mpsc::RecvTimeoutError::Disconnected) => break,
                }
            }
            worker.join().map_err(|panic| internal(panic.as_ref()))
        })
    })?;
    if let Some(error) = raised.into_inner().unwrap_or_else(PoisonError::into_inner) {
        return Err(error);
    }
    executed.map(drop).map_err(of_plan)
}

/// A table of the runs in a folder, as lists by column: one of those of a run, or "verdicts".
#[pyfunction]
pub(crate) fn stored_table<'py>(py: Python<'py>, folder: PathBuf, name: &str) -> PyResult<Bound<'py, PyDict>> {
    if name == VERDICTS {
        return columns(py, py.detach(|| report::verdict_table(&folder)).map_err(bad_input)?);
    }
    let records = py.detach(|| Store::open(&folder).and_then(|store| store.records())).map_err(bad_input)?;
    columns(py, table(&records, name)?)
}

/// Writes the report of the runs in a folder, with figures as SVG; returns its page.
#[pyfunction]
pub(crate) fn write_report(py: Python<'_>, folder: PathBuf) -> PyResult<PathBuf> {
    py.detach(|| report::write(&folder)).map(|written| written.page).map_err(bad_input)
}
