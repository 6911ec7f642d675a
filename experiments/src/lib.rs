//! Many runs: from one plan file to a row of figures for each of its runs, and to what can be said about them.
//!
//! [`in_memory`] carries messages between a server and its agents without a network; [`single`] is a run over it. A [`plan`] says
//! which runs there are, [`execute`] carries out those that are not done, [`measure`] makes [`rows`] of them, [`store`] keeps these
//! in a folder, and [`tables`] writes them as CSV and Parquet. [`merge`] joins folders; [`cluster`] writes jobs for other machines.
//! [`faults`] disturbs runs and compares them with the undisturbed one.
//! [`statistics`] is what can be said about many runs, and a [`report`] says it in figures and tables.
//! [`diff`] says in what two recordings differ.
//!
//! Invariant: what is kept of a run is a function of scenario, seed and build, but for the figures of wall time.

pub mod cluster;
pub mod diff;
pub mod execute;
pub mod faults;
pub mod in_memory;
pub mod measure;
pub mod merge;
pub mod plan;
mod processes;
pub mod report;
pub mod rows;
pub mod single;
pub mod statistics;
pub mod store;
pub mod tables;
