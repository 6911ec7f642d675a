//! Planners of the literature as baselines: how their papers divide the work of a team, over the
//! same parts (docs/baselines.md).
//!
//! Each is a [`Coordination`] of the planner: a file of its own with the rule of its paper. Bodies,
//! paths, viewpoints, scans, the way around other agents, and what an agent does without a task are
//! those of `dsvp-team`, with its settings, so that runs differ by the division alone.
//!
//! Invariants: an agent without a task in the division of its planner goes to the nearest frontier,
//! so that none rests while it knows something to see.

mod c2_explorer;
mod hungarian;
mod parts;
mod racer;
mod rendezvous;

use super::coordination::Coordination;
use super::scanning::ScanRange;
use super::tasks::TaskSearch;
use super::{Dsvp, Params, Waypoints};
use crate::settings::{SettingError, Settings};
use crate::{Controller, Setup};
use agent::observation::RunInfo;
use voxels::Extent;

pub use c2_explorer::c2_explorer;
pub use hungarian::hungarian;
pub use racer::racer;
pub use rendezvous::rendezvous;

/// The planner with the settings of `dsvp-team` and another coordination.
fn planner<C: Coordination + 'static>(coordination: C, setup: Setup<'_>) -> impl Controller + use<C> {
    let default = Params::default();
    let scan_range = ScanRange { start_m: 1.0, ..default.scan_range };
    let params = Params { gain_min: 5, waypoints: Waypoints::Passed, scan_range, ..default };
    Dsvp::new(params, coordination, setup)
}

/// The search for tasks, with the settings `regions` (most regions with frontiers of a plan) and
/// `expected_min` (expected free cells from which on a viewpoint is a task).
fn task_search(settings: &mut Settings, run_info: &RunInfo) -> Result<TaskSearch, SettingError> {
    let regions = settings.integer("regions", 120, 1, 10_000)? as usize;
    let expected_min = settings.number("expected_min", 4.0, 0.0, 10_000.0)?;
    Ok(TaskSearch::new(run_info.extent, regions, expected_min))
}

/// The length of a path in metres, by its length in cells.
fn metres(length: Option<f64>, extent: Extent) -> f64 {
    length.map_or(UNREACHABLE_M, |cells| cells * extent.cell_m())
}

/// Length of a path that there is not: more than any tour.
const UNREACHABLE_M: f64 = 1e6;

#[cfg(test)]
mod tests;
