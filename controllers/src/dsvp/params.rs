//! The parameters of DSVP with their defaults and sources.

use protocol::body_model::BodyKind;

use super::super::settings::{SettingError, Settings};
use super::avoidance::Waypoints;
use super::scanning::ScanRange;
use super::team::TeamParams;
use super::tree::{Growth, Valuation};
use crate::auction::AuctionParams;

/// Parameters of the planner. Lengths in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// Half the side of the cube that contains the local tree. Reference and original: 15.
    pub horizon_m: f64,
    /// Length of an edge of the tree. Reference: 1; original: 0.8 to 1.3 where the robot is 0.5
    /// wide.
    pub extension_m: f64,
    /// Samples per plan. Reference: 200.
    pub samples: u32,
    /// Share of the samples near the chosen local frontiers. Reference: 0.3; original: 0.25.
    pub bias: f64,
    /// Greatest distance of such samples from their frontier along each axis. Reference: 1.
    pub jitter_m: f64,
    /// Number of chosen local frontiers. Reference: 5; original: 3.
    pub frontiers: u32,
    /// Discount of a gain with the path length to it, per metre: the papers' lambda 1. Reference:
    /// 0.01 for each edge of 1 m.
    pub lambda_distance_per_m: f64,
    /// Discount of a branch with its DTW distance from the last direction, per metre: the papers'
    /// lambda 2.
    pub lambda_direction_per_m: f64,
    /// Range of the rays of a viewpoint; limited by the range of the LiDAR. Original: 5.
    pub gain_range_m: f64,
    /// Rays of a viewpoint.
    pub gain_rays: u32,
    /// Most unexplored cells that one ray counts.
    pub gain_depth: u32,
    /// Viewpoints with a gain below this count as having none. Original: 5 to 10.
    pub gain_min: u32,
    /// Factor on an unexplored cell for each known wall beside it; 1: all cells count alike.
    pub wall_adjacency_factor: f64,
    /// A viewpoint is dropped once its gain has fallen below this share of its gain when chosen.
    pub gain_left: f64,
    /// Which waypoints are taken along a path.
    pub waypoints: Waypoints,
    /// Where an agent under way scans.
    pub scan_range: ScanRange,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            horizon_m: 15.0,
            extension_m: 5.0,
            samples: 200,
            bias: 0.3,
            jitter_m: 1.0,
            frontiers: 5,
            lambda_distance_per_m: 0.03,
            lambda_direction_per_m: 0.003,
            gain_range_m: 15.0,
            gain_rays: 200,
            gain_depth: 3,
            gain_min: 3,
            wall_adjacency_factor: 1.0,
            gain_left: 0.1,
            waypoints: Waypoints::Fewest,
            scan_range: ScanRange { start_m: 0.0, stop_m: 12.0 },
        }
    }
}

impl Params {
    /// Takes the parameters from settings of the same names.
    ///
    /// # Errors
    /// If a value is out of range.
    pub fn from_settings(settings: &mut Settings, default: Self) -> Result<Self, SettingError> {
        let mut whole = |key, default: u32, low: u32, high: u32| {
            settings.integer(key, default.into(), low.into(), high.into()).map(|number| number as u32)
        };
        let samples = whole("samples", default.samples, 1, 10_000)?;
        let frontiers = whole("frontiers", default.frontiers, 1, 1000)?;
        let gain_rays = whole("gain_rays", default.gain_rays, 6, 10_000)?;
        let gain_depth = whole("gain_depth", default.gain_depth, 1, 1000)?;
        let gain_min = whole("gain_min", default.gain_min, 1, 100_000)?;
        // The first word is the default.
        let mut choices = [Waypoints::Fewest, Waypoints::Quickest, Waypoints::Passed];
        choices.sort_by_key(|&choice| choice != default.waypoints);
        let waypoints = choices[settings.word("waypoints", &choices.map(Waypoints::word))?];
        Ok(Self {
            horizon_m: settings.number("horizon_m", default.horizon_m, 1.0, 1000.0)?,
            extension_m: settings.number("extension_m", default.extension_m, 0.1, 1000.0)?,
            samples,
            bias: settings.number("bias", default.bias, 0.0, 1.0)?,
            jitter_m: settings.number("jitter_m", default.jitter_m, 0.0, 100.0)?,
            frontiers,
            lambda_distance_per_m: settings.number(
                "lambda_distance_per_m",
                default.lambda_distance_per_m,
                0.0,
                100.0,
            )?,
            lambda_direction_per_m: settings.number(
                "lambda_direction_per_m",
                default.lambda_direction_per_m,
                0.0,
                100.0,
            )?,
            gain_range_m: settings.number("gain_range_m", default.gain_range_m, 0.1, 100.0)?,
            gain_rays,
            gain_depth,
            gain_min,
            wall_adjacency_factor: settings.number("wall_adjacency_factor", default.wall_adjacency_factor, 0.0, 1.0)?,
            gain_left: settings.number("gain_left", default.gain_left, 0.0, 1.0)?,
            waypoints,
            scan_range: ScanRange {
                start_m: settings.number("scan_start_m", default.scan_range.start_m, 0.0, 100.0)?,
                stop_m: settings.number("scan_stop_m", default.scan_range.stop_m, 0.0, 100.0)?,
            },
        })
    }

    pub(super) fn growth(&self, cell_m: f64) -> Growth {
        Growth {
            horizon: (self.horizon_m / cell_m).round().max(1.0) as i32,
            extension: (self.extension_m / cell_m).max(1.0),
            samples: self.samples,
            bias: self.bias,
            jitter: (self.jitter_m / cell_m).round() as i32,
        }
    }

    pub(super) fn valuation(&self) -> Valuation {
        Valuation {
            lambda_distance: self.lambda_distance_per_m,
            lambda_direction: self.lambda_direction_per_m,
            gain_min: self.gain_min,
        }
    }
}

impl TeamParams {
    /// Takes the parameters from settings of the same names.
    pub(super) fn from_settings(settings: &mut Settings) -> Result<Self, SettingError> {
        Ok(Self {
            auction: AuctionParams::from_settings(settings)?,
            regions: settings.integer("regions", 120, 1, 10_000)? as usize,
            tasks: settings.integer("tasks", 40, 1, 1000)? as usize,
            aerial_tasks: settings.integer("aerial_tasks", 90, 1, 1000)? as usize,
            expected_min: settings.number("expected_min", 4.0, 0.0, 10_000.0)?,
            exponent: settings.number("exponent", 1.5, 0.0, 10.0)?,
            latency_weight: settings.number("latency_weight", 5.0, 0.0, 1000.0)?,
            leg_s: settings.number("leg_s", 7.0, 0.0, 100.0)?,
            aerial_latency_weight: settings.number("aerial_latency_weight", 0.5, 0.0, 1000.0)?,
            aerial_leg_s: settings.number("aerial_leg_s", 4.0, 0.0, 100.0)?,
            memory_s: settings.number("memory_s", 60.0, 0.0, 10_000.0)?,
        })
    }

    /// Those of an agent with a body of this kind.
    pub(super) fn of(self, kind: BodyKind) -> Self {
        match kind {
            BodyKind::Submarine | BodyKind::Ground => self,
            BodyKind::Aerial => Self {
                tasks: self.aerial_tasks,
                latency_weight: self.aerial_latency_weight,
                leg_s: self.aerial_leg_s,
                ..self
            },
        }
    }
}
