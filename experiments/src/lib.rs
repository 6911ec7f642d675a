//! Many runs, their statistics and their pictures: so far, one run in one process.
//!
//! [`in_memory`] carries messages between a server and its agents without a network; [`single`] is a run over it. [`statistics`] is
//! what can be said about many runs, [`report`] says it.

pub mod in_memory;
pub mod report;
pub mod rows;
pub mod single;
pub mod statistics;
