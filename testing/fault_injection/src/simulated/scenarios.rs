//! The scenario of a seed: a small run, so that many fit into a minute.
//!
//! Invariant: a function of the seed.

use rand::RngExt;
use sim_server::setup::{self, SetupError};
use simulation::scenario::Scenario;

/// Controllers of the runs.
const CONTROLLERS: [&str; 7] =
    ["rbw", "lvd", "dsvp", "dsvp-auction", "nearest-frontier", "boustrophedon", "rbw-maes3d"];

/// When radios are in contact.
const RADIOS: [&str; 4] = ["line_of_sight_and_range", "range", "global", "attenuated"];

/// Edge of the cubic maps, cells.
const SIZE: u32 = 20;

/// Draws of a scenario; the error of the last one is reported.
const DRAWS_MAX: u64 = 10;

/// Most agents of a run.
pub(super) const AGENTS_MAX: u32 = 4;

/// The scenario of a seed: the first that is drawn whose map has room for its team.
pub(super) fn of_seed(seed: u64) -> Result<Scenario, SetupError> {
    let mut scenario = drawn(seed, 0)?;
    let mut draws = 1;
    while setup::build(&scenario).is_err() && draws < DRAWS_MAX {
        scenario = drawn(seed, draws)?;
        draws += 1;
    }
    Ok(scenario)
}

fn drawn(seed: u64, draw: u64) -> Result<Scenario, SetupError> {
    let random = &mut voxels::random_streams::stream(seed, draw, "simulated.scenario");
    let agents = random.random_range(1..=AGENTS_MAX);
    let controller = CONTROLLERS[random.random_range(0..CONTROLLERS.len())];
    let look_ahead = random.random_bool(0.8);
    // Without look-ahead, every agent is asked in every tick.
    let ticks = if look_ahead { random.random_range(50..=1000_u32) } else { random.random_range(20..=100_u32) };
    let map = if random.random_bool(0.7) { "spheres" } else { "noise" };
    let share_period = [0, 10, 50, 251][random.random_range(0..4_usize)];
    let radio = RADIOS[random.random_range(0..RADIOS.len())];
    let range = if radio.ends_with("range") { "range_m = 15.0\n" } else { "" };
    let radio_loss = if random.random_bool(0.3) { 0.2 } else { 0.0 };
    let schedule = if random.random_bool(0.8) { "on_request" } else { "maes3d" };
    // Lost agents are restarted under `wait` alone; elsewhere, none is lost.
    let policy = ["wait", "wait", "wait", "abort", "drop"][random.random_range(0..5_usize)];
    let decision_timeout = if policy == "wait" { 1.0 } else { 10.0 };
    let text = format!(
        "seed = {map_seed}
duration_s = {duration:?}
stop_when_explored = {stops}
[map]
kind = \"{map}\"
size = {SIZE}
[agents]
count = {agents}
controller = \"{controller}\"
share_period_ticks = {share_period}
[lidar]
rays = 300
schedule = \"{schedule}\"
[communication]
model = \"{radio}\"
{range}loss = {radio_loss:?}
[faults]
on_agent_loss = \"{policy}\"
[execution]
threads = 1
look_ahead = {look_ahead}
join_timeout_s = 120.0
decision_timeout_s = {decision_timeout:?}
",
        map_seed = seed.wrapping_add(draw << 32),
        duration = f64::from(ticks) / 50.0,
        stops = random.random_bool(0.5),
    );
    setup::parse(&format!("the scenario of seed {seed}"), &text, &[])
}
