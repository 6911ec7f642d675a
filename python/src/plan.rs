//! Plans of many runs, in this process.

use std::num::NonZero;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Sender, channel};
use std::thread;
use std::time::Duration;

use experiments::execute::{self, Options, Part, PlanObserver, Selection, Stop, Transport};
use experiments::plan::{Plan, PlannedRun};
use experiments::rows::RunRow;
use experiments::store::Store;
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
        let plan = Plan::parse_with(name, text, &folder, controllers.registry).map_err(bad_input)?;
        Ok(Self { plan })
    }

    /// Id, axes and seed of each run, in the order of execution.
    fn runs(&self) -> Vec<(String, Axes, u64)> {
        let run = |run: &PlannedRun| (run.id.clone(), run.axes.clone().into_iter().collect(), run.scenario.seed);
        self.plan.runs.iter().map(run).collect()
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

/// Executes the runs of a plan without a record, all or those with these ids; `report` is called
/// with `("started", count)`, `("completed", id)` and `("failed", id, reason)`.
#[pyfunction]
#[pyo3(signature = (plan, folder, controllers, *, jobs, only, prune, report))]
#[allow(clippy::too_many_arguments, reason = "they are named in Python")]
pub(crate) fn execute_plan(
    py: Python<'_>,
    plan: &PyPlan,
    folder: PathBuf,
    controllers: &PyControllers,
    jobs: usize,
    only: Vec<String>,
    prune: bool,
    report: &Bound<'_, PyAny>,
) -> PyResult<()> {
    let jobs = NonZero::new(jobs).ok_or_else(|| bad_input("jobs = 0: expected a number from 1"))?;
    let transport = Transport::Memory;
    let options = Options { jobs, transport, part: Part::WHOLE, registry: controllers.registry, prune };
    let selection = Selection { only: only.into_iter().collect(), ..Selection::default() };
    let stop = Stop::default();
    let report = report.clone().unbind();
    let raised: Mutex<Option<PyErr>> = Mutex::new(None);
    let executed = py.detach(|| {
        thread::scope(|scope| {
            let (sender, events) = channel();
            let (stop, options, selection) = (&stop, &options, &selection);
            let worker = scope.spawn(move || {
                let mut reports = Reports(sender);
                execute::execute_selected(&plan.plan, folder, options, selection, &mut reports, stop)
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
                    raised.lock().unwrap_or_else(std::sync::PoisonError::into_inner).get_or_insert(error);
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
    if let Some(error) = raised.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner) {
        return Err(error);
    }
    executed.map(drop).map_err(failed)
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
