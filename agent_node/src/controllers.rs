//! The algorithms: the trait they share, and the list of them.
//!
//! Invariants: a controller decides from what it is given alone, draws from its own random stream, and ends; the same
//! observations give the same commands. This module knows no transport and no wall clock.

pub mod ctx;
pub mod dsvp;
pub mod dsvp_maes3d;
#[cfg(test)]
mod legal;
pub mod lvd;
pub mod lvd_maes3d;
pub mod nearest_frontier;
pub mod rbw;
pub mod rbw_maes3d;
#[cfg(test)]
pub(crate) mod scene;
pub mod settings;
#[cfg(test)]
mod tests_world;

use msgs::ids::AgentId;
use thiserror::Error;

use crate::command::Command;
use crate::observation::Observation;
pub use ctx::Ctx;
use settings::{SettingError, Settings};

/// An algorithm that controls one agent. How to write one: docs/controllers.md.
pub trait Controller {
    /// Answers an observation.
    ///
    /// It is asked when the wake condition of its last answer is met, whether the server looks ahead or not.
    fn decide(&mut self, observation: &Observation, ctx: &mut Ctx<'_>) -> Command;

    /// Whether a server that does not look ahead is to ask it in between as well, which makes for another run if it then acts.
    /// An answer in between that does nothing ([`Command::does_nothing`]) must leave the controller and the map as they were.
    fn is_asked_between(&self) -> bool {
        false
    }
}

/// Why there is no such controller.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ControllerError {
    /// Nothing has this name.
    #[error("controller {name}: unknown; known are {}", NAMES.join(", "))]
    Unknown {
        /// The name.
        name: String,
    },
    /// A setting does not fit.
    #[error("controller {name}: {source}")]
    Setting {
        /// The controller.
        name: String,
        /// What is wrong.
        source: SettingError,
    },
}

/// The names of all controllers.
pub const NAMES: [&str; 8] =
    ["rbw", "rbw-maes3d", "lvd", "lvd-maes3d", "dsvp", "dsvp-maes3d", "dsvp-auction", "nearest-frontier"];

/// Whether there is such a controller, and its settings are allowed.
///
/// # Errors
/// If the name or a setting is unknown, or a value is not allowed.
pub fn check(name: &str, settings: &[String]) -> Result<(), ControllerError> {
    build(name, settings, AgentId(0), 0).map(drop)
}

/// Makes a controller by name, with settings `KEY=VALUE`, for one agent of a run.
///
/// # Errors
/// If the name or a setting is unknown, or a value is not allowed.
pub fn build(
    name: &str,
    settings: &[String],
    agent: AgentId,
    agents_seed: u64,
) -> Result<Box<dyn Controller>, ControllerError> {
    let unfit = |source| ControllerError::Setting { name: name.to_owned(), source };
    let mut settings = Settings::parse(settings).map_err(unfit)?;
    let stream = |purpose| msgs::seed::stream(agents_seed, agent.0.into(), purpose);
    let controller: Box<dyn Controller> = match name {
        "lvd" => Box::new(lvd::Lvd::new(&mut settings, stream("lvd")).map_err(unfit)?),
        "lvd-maes3d" => Box::new(lvd_maes3d::LvdMaes3d::new()),
        "rbw" => Box::new(rbw::Rbw::new(&mut settings, stream("rbw")).map_err(unfit)?),
        "rbw-maes3d" => Box::new(rbw_maes3d::RbwMaes3d::new(stream("rbw-maes3d"))),
        "dsvp" => Box::new(dsvp::Dsvp::new(&mut settings, stream("dsvp")).map_err(unfit)?),
        "dsvp-auction" => Box::new(dsvp::Dsvp::with_auction(&mut settings, stream("dsvp")).map_err(unfit)?),
        "nearest-frontier" => {
            let stream = stream("nearest-frontier");
            Box::new(nearest_frontier::NearestFrontier::new(&mut settings, stream).map_err(unfit)?)
        }
        "dsvp-maes3d" => Box::new(dsvp_maes3d::DsvpMaes3d::new(stream("dsvp-maes3d"))),
        _ => return Err(ControllerError::Unknown { name: name.to_owned() }),
    };
    settings.finish().map_err(unfit)?;
    Ok(controller)
}

#[cfg(test)]
pub(crate) mod tests {
    use nalgebra::{Point3, Vector3};
    use voxels::Extent;

    use super::*;
    use crate::exploration_map::ExplorationMap;
    use crate::observation::{Briefing, Cells, Collision, Pose, Surface};
    use crate::travel::Travel;
    use msgs::ids::Tick;

    /// What a controller needs to be asked.
    pub(crate) struct Stage {
        briefing: Briefing,
        map: ExplorationMap,
        travel: Travel,
    }

    impl Stage {
        pub(crate) fn new() -> Self {
            let extent = Extent::new([10, 10, 10], 1.0).unwrap();
            let briefing = Briefing {
                duration: Tick(1000),
                extent,
                agents: 2,
                agents_seed: 1,
                controller: "rbw".to_owned(),
                settings: Vec::new(),
                body_radius_m: 0.4,
                lidar_range_m: f64::INFINITY,
                lidar_period_ticks: 10,
                communication_range_m: f64::INFINITY,
                share_period_ticks: 251,
            };
            Self { briefing, map: ExplorationMap::new(extent), travel: Travel::new(0.4, 1.0) }
        }

        /// Asks a controller.
        pub(crate) fn ask(&mut self, controller: &mut dyn Controller, observation: &Observation) -> Command {
            let Self { briefing, map, travel } = self;
            controller.decide(observation, &mut Ctx::new(AgentId(0), briefing, observation, map, travel))
        }
    }

    pub(crate) fn idle() -> Observation {
        Observation {
            tick: Tick::ZERO,
            pose: Pose { position: Point3::new(5.5, 5.5, 5.5), yaw_rad: 0.0 },
            velocity_m_s: Vector3::zeros(),
            yaw_rate_rad_s: 0.0,
            is_active: false,
            collision: None,
            events: 0,
            contacts: Vec::new(),
            parcels: Vec::new(),
            scan_tick: None,
            seen: Cells::default(),
            view: None,
        }
    }

    pub(crate) fn collided(observation: Observation, surface: Surface) -> Observation {
        Observation { collision: Some(Collision { surface, with_agent: false }), ..observation }
    }

    #[test]
    fn every_name_builds_and_others_are_refused() {
        for name in NAMES {
            assert!(check(name, &[]).is_ok(), "{name}");
        }
        let refused = |name: &str, settings: &[String]| check(name, settings).unwrap_err().to_string();
        let known = NAMES.join(", ");
        assert_eq!(refused("rwb", &[]), format!("controller rwb: unknown; known are {known}"));
        assert_eq!(
            refused("rbw", &["speed=1".to_owned()]),
            "controller rbw: setting `speed`: unknown; known are pitch_min_rad, pitch_max_rad, turn_min_rad, turn_max_rad"
        );
        assert_eq!(
            refused("rbw-maes3d", &["speed=1".to_owned()]),
            "controller rbw-maes3d: setting `speed`: unknown; there are none"
        );
        assert_eq!(
            refused("rbw", &["pitch_min_rad=9".to_owned()]),
            "controller rbw: setting pitch_min_rad = 9: expected a number from 0 to 1.5707963267948966"
        );
    }
}
