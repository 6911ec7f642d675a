//! The extension module `maes._maes`: what Python can do with scenarios, runs, maps, recordings,
//! controllers, environments and plans.
//!
//! In reading order: [`scenario`] and [`map`] are inputs, [`run`] executes a scenario in this
//! process, [`result`] and [`recording`] are what comes out. [`controller`] lets a Python class
//! decide, with [`observation`], [`ctx`] and [`command`] as its vocabulary. [`plan`] runs many
//! scenarios, [`environment`] steps many [`worlds`] by hand, and [`node`] is a ROS 2 process.
//!
//! Invariants: every call that computes releases the GIL; bad input is a Python exception that
//! names the thing and the allowed values, and nothing that Python code does aborts the process.
//!
//! Only marshalling is here: schema, checks, world and agents are those of the Rust crates.

mod auction;
mod borrowed;
mod command;
mod controller;
mod convert;
mod ctx;
mod environment;
mod error;
mod frontiers;
mod interrupt;
mod map;
mod node;
mod observation;
mod plan;
mod recording;
mod result;
mod rng;
mod run;
mod scenario;
mod search;
mod worlds;

/// The native part of the package `maes`.
#[pyo3::pymodule]
mod _maes {
    #[pymodule_export]
    use crate::auction::PyAuction;
    #[pymodule_export]
    use crate::command::{PyCommand, PyMotion, PyWakeCondition};
    #[pymodule_export]
    use crate::controller::PyControllers;
    #[pymodule_export]
    use crate::ctx::{PyCtx, PyExplorationMap};
    #[pymodule_export]
    use crate::environment::PyWorlds;
    #[pymodule_export]
    use crate::error::{BadInput, RunFailed};
    #[pymodule_export]
    use crate::map::PyMap;
    #[pymodule_export]
    use crate::node::run_node;
    #[pymodule_export]
    use crate::observation::PyObservation;
    #[pymodule_export]
    use crate::plan::{PyPlan, PyPlanFolder, execute_plan, stored_table, write_report};
    #[pymodule_export]
    use crate::recording::{PyFollower, PyRecording};
    #[pymodule_export]
    use crate::result::PyRunResult;
    #[pymodule_export]
    use crate::rng::PyRng;
    #[pymodule_export]
    use crate::run::{fork, run};
    #[pymodule_export]
    use crate::scenario::PyScenario;
    #[pymodule_export]
    use crate::search::PyPath;

    /// The version of the package, and the hash of the sources that determine a result.
    #[pymodule_export]
    const BUILD: &str = experiments::plan::BUILD;
}
