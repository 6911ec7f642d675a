//! Starts and supervises the processes of one run: a world server, and a process for each agent.
//!
//! [`run::Run`] is one run; [`idle::IdleServer`] serves the runs that are started on the page, one
//! after the other. Both are made of the same parts: [`child`] processes in sessions of their own,
//! a [`domain`] lock, a [`ready`] pipe for the server's handshake, a [`team`] that says which
//! process runs which agents, programs from [`outside`] that run them, further [`hosts`], and a
//! folder of [`logs`].
//!
//! Invariants: the server starts first, because on one machine the processes that start first are
//! discovered by all others; an interruption goes to the server, which ends the run and sends the
//! agents their shutdown message; no process outlives its supervisor, unless that is killed.
//!
//! This crate decides nothing about the run itself. Wall time bounds waits, and nothing else
//! depends on it.

pub mod binaries;
pub mod child;
pub mod domain;
mod error;
pub mod hosts;
pub mod idle;
pub mod logs;
pub mod outside;
mod processes;
pub mod ready;
mod remote;
pub mod run;
pub mod team;

pub use error::SupervisorError;
