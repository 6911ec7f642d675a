//! An agent process over ROS 2 with controllers in Python: the program `agent_node`, which knows
//! them beside the built-in ones.

use std::ffi::OsString;

use pyo3::prelude::*;

use crate::controller::PyControllers;

/// Runs the agents that the arguments of `agent_node` name; returns its exit code.
#[pyfunction]
pub(crate) fn run_node(py: Python<'_>, controllers: &PyControllers, arguments: Vec<OsString>) -> u8 {
    py.detach(|| agent_node::program::run_with(arguments, controllers.registry))
}
