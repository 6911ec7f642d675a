//! The oracle: how fast a team could be that knows the map in advance.
//!
//! It gives two answers for a scenario, each for the times at which 90, 99 and 100 % of the free
//! cells are seen. `bound` is a time that no team can beat, whatever its controller. `flight`
//! is a plan that was flown: viewpoints that see everything (`viewpoints`), shared out over the
//! team as tours (`tours`), and followed by the bodies of the scenario in its world, with their
//! kinematics, collisions and scans. The best possible time lies between the two.
//!
//! Both are functions of the scenario. They are not affected by controllers, radios or map sharing:
//! the oracle knows everything. Events are left out (the whole team is there from the start), and
//! so is sensor noise. A LiDAR with a limited field of view has no flight, nor has a team with a
//! ground body or with `[[lidars]]`. One with noise in its ranges has no bound: its rays seem to go
//! on behind walls.
//!
//! This module knows no plans and no reports.

mod bound;
mod flight;
mod tours;
mod viewpoints;

use std::collections::BTreeMap;

use protocol::body_model::BodyKind;
use sim_server::setup::{self, SetupError};
use simulation::scenario::{
    AgentsSection, CommunicationSection, LidarSection, LocalisationSection, Scenario, SensorSection,
};

use crate::rows::{Marks, OracleRow};

/// The controller of the scenario that the oracle knows, whose agents decide nothing.
const CONTROLLER: &str = "rbw";

/// The oracle of a scenario, whose map and start poses are those of a run of it.
///
/// # Errors
/// If the world cannot be made.
pub fn of(scenario: &Scenario) -> Result<OracleRow, SetupError> {
    let known = known(scenario);
    // No ray is measured longer than it is.
    let is_exact = known.sensor.range_sigma_m == 0.0;
    let scenario = Scenario { sensor: SensorSection::default(), ..known };
    let (world, _report) = setup::build(&scenario)?;
    let bound = if is_exact { bound::of(&world) } else { Marks::default() };
    let can_fly = scenario.bodies_by_agent().iter().all(|body| body.kind != BodyKind::Ground);
    let scanner = scenario.lidar.as_ref().map(LidarSection::scanner);
    let flown = scanner
        .filter(|scanner| can_fly && scanner.sees_all_around())
        .map(|scanner| flight::fly(world, &scanner, scenario.scan_timing().period_ticks, scenario.duration_ticks()));
    Ok(OracleRow { bound, flown: flown.unwrap_or_default() })
}

/// Names what the oracle of a scenario depends on: scenarios with the same name have the same one.
#[must_use]
pub fn world(scenario: &Scenario) -> String {
    known(scenario).identity()
}

/// The scenario without what the oracle leaves out.
fn known(scenario: &Scenario) -> Scenario {
    let mut known = scenario.clone();
    known.event.clear();
    known.communication = CommunicationSection::default();
    known.agents = AgentsSection {
        controller: CONTROLLER.to_owned(),
        share_period_ticks: 0,
        set: BTreeMap::new(),
        command: Vec::new(),
        command_ids: Vec::new(),
        cmd_vel: Vec::new(),
        mix: Vec::new(),
        reserve: Vec::new(),
        base_stations: Vec::new(),
        ..known.agents
    };
    (known.stop_when_explored, known.stop_when_covered, known.stop_when_back) = (true, false, false);
    known.stop_when_known_at_base = false;
    known.energy = None;
    known.localisation = LocalisationSection::default();
    known.sensor = SensorSection { range_sigma_m: scenario.sensor.range_sigma_m, ..SensorSection::default() };
    known
}
