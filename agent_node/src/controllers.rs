//! The algorithms: the trait they share, and the list of them.
//!
//! Invariants: a controller decides from what it is given alone, draws from its own random stream, and ends; the same
//! observations give the same commands. This module knows no transport and no wall clock.

pub mod aside;
pub mod boustrophedon;
pub mod ctx;
pub mod dsvp;
pub mod dsvp_maes3d;
pub mod lvd;
pub mod lvd_maes3d;
pub mod nearest_frontier;
pub mod rbw;
pub mod rbw_maes3d;
pub mod relays;
pub mod settings;
#[cfg(test)]
pub(crate) mod testing;

use msgs::ids::AgentId;
use thiserror::Error;

use crate::command::Command;
use crate::observation::Observation;
pub use ctx::Ctx;
use settings::{SettingError, Settings, Taken};

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
pub const NAMES: [&str; 9] = [
    "rbw",
    "rbw-maes3d",
    "lvd",
    "lvd-maes3d",
    "dsvp",
    "dsvp-maes3d",
    "dsvp-auction",
    "nearest-frontier",
    "boustrophedon",
];

/// Whether there is such a controller, and its settings are allowed.
///
/// # Errors
/// If the name or a setting is unknown, or a value is not allowed.
pub fn check(name: &str, settings: &[String]) -> Result<(), ControllerError> {
    taken(name, settings).map(drop)
}

/// The settings of a controller with their values, be they given or not.
///
/// # Errors
/// If the name or a setting is unknown, or a value is not allowed.
pub fn taken(name: &str, settings: &[String]) -> Result<Vec<Taken>, ControllerError> {
    build_and_list(name, settings, AgentId(0), 0).map(|(_, taken)| taken)
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
    build_and_list(name, settings, agent, agents_seed).map(|(controller, _)| controller)
}

/// A controller, and the settings that it has taken.
fn build_and_list(
    name: &str,
    settings: &[String],
    agent: AgentId,
    agents_seed: u64,
) -> Result<(Box<dyn Controller>, Vec<Taken>), ControllerError> {
    let unfit = |source| ControllerError::Setting { name: name.to_owned(), source };
    let mut settings = Settings::parse(settings).map_err(unfit)?;
    let stream = |purpose| random_streams::stream(agents_seed, agent.0.into(), purpose);
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
        "boustrophedon" => {
            Box::new(boustrophedon::Boustrophedon::new(&mut settings, stream("boustrophedon")).map_err(unfit)?)
        }
        "dsvp-maes3d" => Box::new(dsvp_maes3d::DsvpMaes3d::new(stream("dsvp-maes3d"))),
        _ => return Err(ControllerError::Unknown { name: name.to_owned() }),
    };
    let taken = settings.finish().map_err(unfit)?;
    Ok((controller, taken))
}

#[cfg(test)]
mod tests {
    use super::*;

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
