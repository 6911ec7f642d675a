//! The variants of the planner by their settings, one for each controller of the registry that is
//! made of it.

use rand_chacha::ChaCha8Rng;

use super::avoidance::Waypoints;
use super::coordination::Scheme;
use super::scanning::ScanRange;
use super::team::TeamParams;
use super::tours::ToursParams;
use super::{Dsvp, Params};
use crate::controllers::auction::AuctionParams;
use crate::controllers::settings::{SettingError, Settings};

impl Dsvp {
    /// Settings: those of [`Params`].
    ///
    /// # Errors
    /// If a setting is out of range.
    pub fn new(settings: &mut Settings, rng: ChaCha8Rng) -> Result<Self, SettingError> {
        Ok(Self::with(Params::from_settings(settings, Params::default())?, Scheme::Alone, rng))
    }

    /// The planner with an auction of goals. Settings: those of [`Params`], and `spread_m`,
    /// `discount`, `trespass_m`, `detour`, `pace_m_s`, `lease_s` (see docs/controllers.md).
    ///
    /// # Errors
    /// If a setting is out of range.
    pub fn with_auction(settings: &mut Settings, rng: ChaCha8Rng) -> Result<Self, SettingError> {
        let params = Params::from_settings(settings, Params::default())?;
        Ok(Self::with(params, Scheme::Auction(AuctionParams::from_settings(settings)?), rng))
    }

    /// The planner with an auction and tours over shared-out tasks. Settings: those of
    /// [`Dsvp::with_auction`], and `visit_s`, `cut_s`, `meeting_s`, `promising_min`, `remnant_m`,
    /// `explores`, `relocates` (see docs/controllers.md).
    ///
    /// # Errors
    /// If a setting is out of range.
    pub fn with_tours(settings: &mut Settings, rng: ChaCha8Rng) -> Result<Self, SettingError> {
        let params = Params::from_settings(settings, Params { beside_wall: 0.1, ..Params::default() })?;
        Ok(Self::with(params, Scheme::Tours(ToursParams::from_settings(settings)?), rng))
    }

    /// The planner with a Voronoi decomposition of the map. Settings: those of
    /// [`Dsvp::with_auction`], and `clump_m` (see docs/controllers.md).
    ///
    /// # Errors
    /// If a setting is out of range.
    pub fn with_voronoi(settings: &mut Settings, rng: ChaCha8Rng) -> Result<Self, SettingError> {
        let params = Params::from_settings(settings, Params::default())?;
        let auction = AuctionParams::from_settings(settings)?;
        let clump_m = settings.number("clump_m", 6.0, 0.0, 1000.0)?;
        Ok(Self::with(params, Scheme::Voronoi(auction, clump_m), rng))
    }

    /// The planner with an auction that counts seconds. Settings: those of [`Dsvp::with_auction`],
    /// and `lambda_time_per_s`, `share_min`, `hope`, `start_m` (see docs/controllers.md).
    ///
    /// # Errors
    /// If a setting is out of range.
    pub fn with_time(settings: &mut Settings, rng: ChaCha8Rng) -> Result<Self, SettingError> {
        let default = Params { lambda_time_per_s: 0.03, ..Params::default() };
        let params = Params::with_time(settings, default)?;
        Ok(Self::with(params, Scheme::Auction(AuctionParams::from_settings(settings)?), rng))
    }

    /// The planner with tours for the whole team. Settings: those of [`Dsvp::with_auction`], and
    /// `regions`, `tasks`, `aerial_tasks`, `expected_min`, `exponent`, `urgency`, `leg_s`,
    /// `aerial_urgency`, `aerial_leg_s`, `memory_s` (see docs/controllers.md).
    ///
    /// # Errors
    /// If a setting is out of range.
    pub fn with_team(settings: &mut Settings, rng: ChaCha8Rng) -> Result<Self, SettingError> {
        let default = Params::default();
        let scan_range = ScanRange { start_m: 1.0, ..default.scan_range };
        let default = Params { gain_min: 5, waypoints: Waypoints::Passed, scan_range, ..default };
        let params = Params::from_settings(settings, default)?;
        Ok(Self::with(params, Scheme::Team(TeamParams::from_settings(settings)?), rng))
    }
}
