//! What the programs of the workspace share of the operating system.
//!
//! [`input_file`] reads the files that a user names; [`os`] has what operating systems name
//! differently; [`program`] starts the programs that they name; [`exit_code`] and [`summary`] are
//! what the server tells the program that has started it, which therefore need not link the server;
//! [`results`] go to stdout, [`diagnostics`] and a [`progress_bar`] to stderr; [`file_lock`] keeps
//! other processes out; [`wall_clock`] is the only clock; [`memory`] that is refused ends a process
//! in order.

#![warn(missing_docs)]

#[cfg(feature = "diagnostics")]
pub mod diagnostics;
pub mod exit_code;
pub mod file_lock;
pub mod input_file;
pub mod memory;
pub mod os;
pub mod program;
#[cfg(feature = "progress_bar")]
pub mod progress_bar;
pub mod results;
pub mod summary;
pub mod wall_clock;
