//! Scenarios: the schema and the checks of the crate `simulation`, with Python values.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use recording::location::recording_at;
use sim_server::setup;
use simulation::scenario::{Override, Scenario};

use crate::convert::{from_toml, to_toml};
use crate::error::bad_input;
use crate::map::PyMap;

/// Everything that determines a run. A value of this class is always legal.
#[pyclass(name = "NativeScenario", module = "maes._maes", frozen)]
pub(crate) struct PyScenario {
    pub(crate) scenario: Scenario,
    /// The keys that were given. Further changes begin with these: what is filled in may follow
    /// from a key that changes.
    given: toml::Table,
}

impl PyScenario {
    /// The scenario of a recording, which does not say which keys were given.
    pub(crate) fn of_recording(scenario: &Scenario) -> PyResult<Self> {
        Ok(Self { scenario: scenario.clone(), given: scenario.to_toml().parse().map_err(bad_input)? })
    }

    fn read(name: &str, text: &str, overrides: &[Override], paths_from: &Path) -> PyResult<Self> {
        let scenario = setup::parse_with_paths_from(paths_from, name, text, overrides).map_err(bad_input)?;
        let mut given = Scenario::given(name, text, overrides).map_err(bad_input)?;
        // The paths of both the text and the changes, as they are found from the folder of the map.
        let resolved: toml::Table = scenario.to_toml().parse().map_err(bad_input)?;
        take_paths(&mut given, &resolved);
        Ok(Self { scenario, given })
    }
}

/// The tables with paths that start from the folder of a scenario, and these keys.
const PATHS: [(&[&str], &[&str]); 2] = [(&["map"], &["file"]), (&["map", "import"], &["trajectory", "model_path"])];

/// Sets the paths that are given to those of the resolved scenario.
fn take_paths(given: &mut toml::Table, resolved: &toml::Table) {
    for (tables, keys) in PATHS {
        let place = tables.iter().try_fold(&mut *given, |table, name| table.get_mut(*name)?.as_table_mut());
        let found = tables.iter().try_fold(resolved, |table, name| table.get(*name)?.as_table());
        let (Some(place), Some(found)) = (place, found) else { continue };
        for key in keys {
            if let (Some(path), Some(resolved)) = (place.get_mut(*key), found.get(*key)) {
                *path = resolved.clone();
            }
        }
    }
}

/// Changes of keys, by dotted path; `None` removes a key.
fn overrides(changes: Vec<(String, Bound<'_, PyAny>)>) -> PyResult<Vec<Override>> {
    changes
        .into_iter()
        .map(|(key, value)| {
            let value = if value.is_none() { None } else { Some(to_toml(&value)?) };
            let typed = value.as_ref().map_or_else(|| "None".to_owned(), ToString::to_string);
            Ok(Override { origin: format!("{key}={typed}"), key, value })
        })
        .collect()
}

#[pymethods]
impl PyScenario {
    /// Parses TOML with paths that start from a folder, changes keys, and checks the whole; `name`
    /// stands in errors.
    #[staticmethod]
    fn parse(name: &str, text: &str, changes: Vec<(String, Bound<'_, PyAny>)>, paths_from: PathBuf) -> PyResult<Self> {
        Self::read(name, text, &overrides(changes)?, &paths_from)
    }

    /// Reads a scenario file, or the scenario of a recording.
    #[staticmethod]
    fn load(file: PathBuf, changes: Vec<(String, Bound<'_, PyAny>)>) -> PyResult<Self> {
        let file = recording_at(file).map_err(bad_input)?;
        let text = setup::text(&file).map_err(bad_input)?;
        Self::read(&file.display().to_string(), &text, &overrides(changes)?, setup::folder_of(&file))
    }

    /// The keys that were given, as TOML; those that are left out are filled in.
    fn given(&self) -> PyResult<String> {
        toml::to_string(&self.given).map_err(bad_input)
    }

    /// The folder that its paths start from; empty: the working directory.
    #[getter]
    fn paths_from(&self) -> &OsStr {
        // As a text: Python's own type for paths makes `.` of the empty one.
        self.scenario.map.folder.as_os_str()
    }

    /// All keys as TOML.
    fn to_toml(&self) -> PyResult<String> {
        toml::to_string(&self.scenario.to_complete()).map_err(bad_input)
    }

    /// All keys as nested dictionaries.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        from_toml(py, &toml::Value::Table(self.scenario.to_complete()))
    }

    /// The true map: generated, or read from its file.
    fn map(&self, py: Python<'_>) -> PyResult<PyMap> {
        let generated = py.detach(|| setup::generate_map(&self.scenario)).map_err(bad_input)?;
        Ok(PyMap { terrain: generated.terrain })
    }

    /// Ticks of 20 ms after which the run ends at the latest.
    #[getter]
    fn duration_ticks(&self) -> u64 {
        self.scenario.duration_ticks().0
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.scenario == other.scenario
    }
}
