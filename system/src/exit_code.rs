//! The exit codes of all programs, by number.

/// System failure: no network, a full disk.
pub const FAILED: u8 = 1;
/// A recording does not verify, or two recordings differ.
pub const DIFFERENT: u8 = 1;
/// Bad input: scenario, map, recording or argument.
pub const BAD_INPUT: u8 = 2;
/// Agents did not join in time.
pub const AGENTS_MISSING: u8 = 3;
/// An agent was lost and the scenario says `abort`.
pub const AGENTS_LOST: u8 = 4;
/// Interrupted by a signal (128 + SIGINT), or ended early by a service.
pub const BY_SIGNAL: u8 = 130;
