//! The exceptions of the package.

use std::fmt::Display;

use in_memory::in_process::InProcessError;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

pyo3::create_exception!(maes, BadInput, PyValueError, "An input is not legal: what, where, and the allowed values.");
pyo3::create_exception!(maes, RunFailed, PyRuntimeError, "A run has no result.");

/// Bad input, in the words of the Rust crates.
pub(crate) fn bad_input(reason: impl Display) -> PyErr {
    BadInput::new_err(reason.to_string())
}

/// A failure of the system, or of a run.
pub(crate) fn failed(reason: impl Display) -> PyErr {
    RunFailed::new_err(reason.to_string())
}

/// The exception for a run without a result: that of the controller, if it has raised one.
pub(crate) fn of_run(error: InProcessError) -> PyErr {
    match error {
        InProcessError::Agent(agent_node::host::RunError::Failed { agent, source }) => match source.downcast::<PyErr>()
        {
            Ok(raised) => *raised,
            Err(source) => failed(format!("agent {agent}: its controller has failed: {source}")),
        },
        InProcessError::Setup(_)
        | InProcessError::OverRosOnly { .. }
        | InProcessError::Record(_)
        | InProcessError::Agent(agent_node::host::RunError::Controller(_)) => bad_input(error),
        _ => failed(error),
    }
}
