//! Values of TOML and JSON from and to Python objects.

use pyo3::IntoPyObjectExt;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyList, PyString};

/// Deepest nesting of dictionaries and lists; a scenario needs four.
const DEPTH_MAX: u32 = 16;

/// The TOML value of a Python object: bool, int, float, str, path, list, tuple, array, or dict.
pub(crate) fn to_toml(value: &Bound<'_, PyAny>) -> PyResult<toml::Value> {
    nested(value, DEPTH_MAX)
}

fn nested(value: &Bound<'_, PyAny>, depth: u32) -> PyResult<toml::Value> {
    let unfit = |why: &str| {
        let name = value.get_type().name().map_or_else(|_| "object".to_owned(), |name| name.to_string());
        PyTypeError::new_err(format!("a value of type {name} {why}: expected bool, int, float, str, list or dict"))
    };
    let Some(depth) = depth.checked_sub(1) else { return Err(unfit("is nested too deeply")) };
    if value.is_instance_of::<PyBool>() {
        return Ok(toml::Value::Boolean(value.extract()?));
    }
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(toml::Value::String(text.to_string()));
    }
    if let Ok(dict) = value.cast::<PyDict>() {
        let mut table = toml::Table::new();
        for (key, value) in dict {
            table.insert(key.extract::<String>()?, nested(&value, depth)?);
        }
        return Ok(toml::Value::Table(table));
    }
    // NumPy has numbers of its own: an integer has `__index__`, a float `__float__`.
    if !value.is_instance_of::<PyFloat>()
        && let Ok(whole) = value.extract::<i64>()
    {
        return Ok(toml::Value::Integer(whole));
    }
    if let Ok(number) = value.extract::<f64>() {
        return Ok(toml::Value::Float(number));
    }
    if let Ok(path) = value.extract::<std::path::PathBuf>() {
        return Ok(toml::Value::String(path.display().to_string()));
    }
    if let Ok(items) = value.try_iter() {
        return items.map(|item| nested(&item?, depth)).collect::<PyResult<Vec<_>>>().map(toml::Value::Array);
    }
    Err(unfit("has no place in a scenario"))
}

/// The Python object of a JSON value.
pub(crate) fn from_json<'py>(py: Python<'py>, value: &serde_json::Value) -> PyResult<Bound<'py, PyAny>> {
    use serde_json::Value;
    match value {
        Value::Null => Ok(py.None().into_bound(py)),
        Value::Bool(value) => value.into_bound_py_any(py),
        Value::Number(number) => match (number.as_u64(), number.as_i64()) {
            (Some(whole), _) => whole.into_bound_py_any(py),
            (None, Some(whole)) => whole.into_bound_py_any(py),
            (None, None) => number.as_f64().into_bound_py_any(py),
        },
        Value::String(text) => text.into_bound_py_any(py),
        Value::Array(values) => {
            let list = PyList::empty(py);
            for value in values {
                list.append(from_json(py, value)?)?;
            }
            Ok(list.into_any())
        }
        Value::Object(fields) => {
            let dict = PyDict::new(py);
            for (name, value) in fields {
                dict.set_item(name, from_json(py, value)?)?;
            }
            Ok(dict.into_any())
        }
    }
}

/// The Python object of a TOML value.
pub(crate) fn from_toml<'py>(py: Python<'py>, value: &toml::Value) -> PyResult<Bound<'py, PyAny>> {
    match value {
        toml::Value::String(text) => text.into_bound_py_any(py),
        toml::Value::Integer(whole) => whole.into_bound_py_any(py),
        toml::Value::Float(number) => number.into_bound_py_any(py),
        toml::Value::Boolean(value) => value.into_bound_py_any(py),
        toml::Value::Datetime(time) => time.to_string().into_bound_py_any(py),
        toml::Value::Array(values) => {
            let list = PyList::empty(py);
            for value in values {
                list.append(from_toml(py, value)?)?;
            }
            Ok(list.into_any())
        }
        toml::Value::Table(fields) => {
            let dict = PyDict::new(py);
            for (name, value) in fields {
                dict.set_item(name, from_toml(py, value)?)?;
            }
            Ok(dict.into_any())
        }
    }
}
