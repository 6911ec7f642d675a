//! The result of a run, and its tables.

use experiments::columns::Values;
use experiments::rows::RunRecord;
use experiments::tables::{self, Table};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::convert::from_json;
use crate::error::bad_input;

/// The figures of a run that is over.
#[pyclass(name = "RunResult", module = "maes._maes", frozen)]
pub(crate) struct PyRunResult {
    pub(crate) record: RunRecord,
    pub(crate) result: msgs::maes_msgs::Result,
}

/// A table as lists by column.
pub(crate) fn columns<'py>(py: Python<'py>, table: Table) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    for column in table.columns {
        match column.values {
            Values::Text(values) => dict.set_item(column.name, values)?,
            Values::Whole(values) => dict.set_item(column.name, values)?,
            Values::Number(values) => dict.set_item(column.name, values)?,
        }
    }
    Ok(dict)
}

/// One of the tables of these runs by its name.
pub(crate) fn table(records: &[RunRecord], name: &str) -> PyResult<Table> {
    match name {
        "runs" => Ok(tables::runs(records)),
        "series" => Ok(tables::series(records)),
        "agents" => Ok(tables::agents(records)),
        other => Err(bad_input(format!(
            "table {other:?}: expected \"runs\", \"series\" or \"agents\", and of a plan \"verdicts\""
        ))),
    }
}

#[pymethods]
impl PyRunResult {
    /// The digest, hexadecimal.
    #[getter]
    fn digest(&self) -> &str {
        &self.record.row.digest
    }

    /// Why it ended.
    #[getter]
    fn reason(&self) -> &str {
        self.record.row.reason.text()
    }

    /// The last tick.
    #[getter]
    fn tick(&self) -> u64 {
        self.result.tick
    }

    /// All metrics by name, those of `runs.csv` and `docs/experiments.md`.
    fn metrics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        from_json(py, &serde_json::to_value(&self.record.row).map_err(bad_input)?)
    }

    /// Counters by name.
    #[getter]
    fn counters(&self) -> Vec<(String, u64)> {
        self.result.counters.iter().map(|counter| (counter.name.clone(), counter.value)).collect()
    }

    /// The columns of a table: "runs", "series" or "agents".
    fn table<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyDict>> {
        columns(py, table(std::slice::from_ref(&self.record), name)?)
    }
}
