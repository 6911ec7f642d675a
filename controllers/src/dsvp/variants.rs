//! The variants of the planner by their settings, one for each controller of the registry that is
//! made of it.

use super::avoidance::Waypoints;
use super::coordination::Alone;
use super::scanning::ScanRange;
use super::team::{TeamParams, TourCoordination};
use super::{Dsvp, Params};
use crate::auction::{Auction, AuctionParams};
use crate::settings::{SettingError, Settings};
use crate::{Controller, Setup};

/// A planner that leaves the others out of account. Settings: those of [`Params`].
///
/// # Errors
/// If a setting is out of range.
pub fn alone(settings: &mut Settings, setup: Setup<'_>) -> Result<impl Controller + use<>, SettingError> {
    let params = Params::from_settings(settings, Params::default())?;
    Ok(Dsvp::new(params, Alone, setup))
}

/// The planner with an auction of goals. Settings: those of [`Params`], and `spread_m`,
/// `discount`, `conflict_penalty_m`, `detour`, `cruise_speed_m_s`, `lease_s` (see
/// docs/controllers.md).
///
/// # Errors
/// If a setting is out of range.
pub fn with_auction(settings: &mut Settings, setup: Setup<'_>) -> Result<impl Controller + use<>, SettingError> {
    let params = Params::from_settings(settings, Params::default())?;
    let auction_params = AuctionParams::from_settings(settings)?;
    let auction = Auction::new(auction_params, &setup.run_info.bodies, setup.agent, setup.run_info.extent);
    Ok(Dsvp::new(params, auction, setup))
}

/// The planner with tours for the whole team. Settings: those of [`with_auction`], and `regions`,
/// `tasks`, `aerial_tasks`, `expected_min`, `exponent`, `latency_weight`, `leg_s`,
/// `aerial_latency_weight`, `aerial_leg_s`, `memory_s` (see docs/controllers.md).
///
/// # Errors
/// If a setting is out of range.
pub fn with_team(settings: &mut Settings, setup: Setup<'_>) -> Result<impl Controller + use<>, SettingError> {
    let default = Params::default();
    let scan_range = ScanRange { start_m: 1.0, ..default.scan_range };
    let default = Params { gain_min: 5, waypoints: Waypoints::Passed, scan_range, ..default };
    let params = Params::from_settings(settings, default)?;
    let team = TourCoordination::new(TeamParams::from_settings(settings)?, setup.agent, setup.run_info);
    Ok(Dsvp::new(params, team, setup))
}
