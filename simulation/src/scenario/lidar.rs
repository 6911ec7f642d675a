//! The table `[lidar]`: the LiDAR of every agent, as a pattern of rays or as a ready preset. An
//! entry of [`super::lidars`] has the same keys.
//!
//! A preset stands for its keys: the identity of a scenario has these and not the preset. Keys of a
//! pattern that the scenario does not use are refused, and are no part of its identity.

use std::f64::consts::{FRAC_PI_2, TAU};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::radio::is_default;
use super::{Checker, Scenario, ScenarioError};
use world::lidar::{Elevations, Mount, Pattern, PlaceOnBody, Projection, RayGrid, Scanner};

/// The patterns with rows and columns.
const GRIDS: [LidarPattern; 2] = [LidarPattern::Ring, LidarPattern::Frustum];

/// Most rays of a ring or a frustum.
pub(super) const GRID_RAYS_MAX: u32 = 1 << 20;

/// Most lines of a ring, as of the key `rows`.
const ROWS_MAX: usize = 1024;

/// Widest angle of a frustum, radians: its rays go through a plane.
const FRUSTUM_RAD_MAX: f64 = 3.0;

/// `[lidar]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "LidarKeys")]
pub struct LidarSection {
    /// How rays are spread.
    pub pattern: LidarPattern,
    /// Rays of the lattice. Reference: 5124.
    pub rays: u32,
    /// Radius of the shell pattern, cells. Reference: 5.
    pub shell_radius_cells: u32,
    /// Range of all patterns but the shell, metres; `inf`: unlimited (reference).
    pub range_m: f64,
    /// Full opening angle of the cone about the heading, radians. Reference: all directions.
    pub fov_rad: f64,
    /// Who decides when to scan.
    pub schedule: LidarSchedule,
    /// Ticks between two scans until an agent requests otherwise. Reference: what each of ten
    /// agents gets.
    pub period_ticks: u32,
    /// Whether rays end at the bodies of other agents.
    #[serde(skip_serializing_if = "is_default")]
    pub sees_agents: bool,
    /// The keys of rings and frustums.
    #[serde(flatten)]
    pub grid: GridKeys,
}

/// The keys of rings and frustums; with these patterns all that the pattern has are given.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct GridKeys {
    /// Full horizontal angle about the heading, radians.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub horizontal_rad: Option<f64>,
    /// Full vertical angle of a frustum, radians.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vertical_rad: Option<f64>,
    /// Elevation of the lowest line of a ring, radians.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lowest_rad: Option<f64>,
    /// Elevation of its highest line, radians.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub highest_rad: Option<f64>,
    /// Elevations of the lines of a ring that has them at other than equal distances, radians,
    /// from the lowest to the highest; then it has neither the two keys before nor `rows`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elevations_rad: Option<Vec<f64>>,
    /// Rays of a row.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub columns: Option<u32>,
    /// Rows of a frustum, lines of a ring.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rows: Option<u32>,
    /// Distance up to which a wall has no return, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_range_m: Option<f64>,
    /// Height above the centre of the body, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mount_height_m: Option<f64>,
    /// By how much it looks up, radians.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mount_pitch_rad: Option<f64>,
}

/// How rays are spread.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LidarPattern {
    /// A Fibonacci lattice of `rays` rays.
    Lattice,
    /// One ray to every cell on the edge of a sphere of `shell_radius_cells` (the reference's older
    /// sensing).
    Shell,
    /// Lines of equal elevation about the vertical: a spinning LiDAR.
    Ring,
    /// The pixels of a depth camera.
    Frustum,
}

/// Who decides when to scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LidarSchedule {
    /// Each agent; at the start every `period_ticks`.
    OnRequest,
    /// One agent in each tick, in turn, as in the reference.
    Maes3d,
}

/// A ready LiDAR with the figures that its maker has published: docs/sensors.md has the sources.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Preset {
    /// Velodyne VLP-16 (Puck) at 10 Hz.
    #[serde(rename = "vlp-16")]
    Vlp16,
    /// Ouster OS1-64, first generation, 1024 columns.
    #[serde(rename = "os1-64")]
    Os1With64Lines,
    /// Livox Mid-360: as many rays as it has points in 0.1 s.
    #[serde(rename = "mid-360")]
    Mid360,
    /// What planners for quadrotors assume.
    DepthCamera,
}

impl Preset {
    const ALL: [Self; 4] = [Self::Vlp16, Self::Os1With64Lines, Self::Mid360, Self::DepthCamera];

    fn name(self) -> &'static str {
        match self {
            Self::Vlp16 => "vlp-16",
            Self::Os1With64Lines => "os1-64",
            Self::Mid360 => "mid-360",
            Self::DepthCamera => "depth-camera",
        }
    }

    fn pattern(self) -> LidarPattern {
        match self {
            Self::Vlp16 | Self::Os1With64Lines | Self::Mid360 => LidarPattern::Ring,
            Self::DepthCamera => LidarPattern::Frustum,
        }
    }

    /// The range, metres, and the other keys.
    fn keys(self) -> (f64, GridKeys) {
        let ring = |lowest: f64, highest: f64, rows, columns, min_range_m: Option<f64>| GridKeys {
            lowest_rad: Some(lowest.to_radians()),
            highest_rad: Some(highest.to_radians()),
            rows: Some(rows),
            columns: Some(columns),
            min_range_m,
            ..GridKeys::default()
        };
        match self {
            Self::Vlp16 => (100.0, ring(-15.0, 15.0, 16, 1800, None)),
            Self::Os1With64Lines => (120.0, ring(-16.6, 16.6, 64, 1024, Some(0.8))),
            Self::Mid360 => (70.0, ring(-7.0, 52.0, 40, 500, Some(0.1))),
            Self::DepthCamera => (FRUSTUM_RANGE_M, GridKeys::default()),
        }
    }
}

/// Range of a frustum that names none, metres.
const FRUSTUM_RANGE_M: f64 = 4.5;

/// The keys of the table, all of them optional.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct LidarKeys {
    preset: Option<Preset>,
    pattern: Option<LidarPattern>,
    rays: Option<u32>,
    shell_radius_cells: Option<u32>,
    range_m: Option<f64>,
    fov_rad: Option<f64>,
    schedule: Option<LidarSchedule>,
    period_ticks: Option<u32>,
    sees_agents: Option<bool>,
    horizontal_rad: Option<f64>,
    vertical_rad: Option<f64>,
    lowest_rad: Option<f64>,
    highest_rad: Option<f64>,
    elevations_rad: Option<Vec<f64>>,
    columns: Option<u32>,
    rows: Option<u32>,
    min_range_m: Option<f64>,
    mount_height_m: Option<f64>,
    mount_pitch_rad: Option<f64>,
}

/// A preset with the pattern of another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("lidar.preset = \"{preset}\": not with the lidar.pattern that is given; expected no pattern beside a preset")]
pub(super) struct PatternOfPreset {
    pub(super) preset: &'static str,
}

impl TryFrom<LidarKeys> for LidarSection {
    type Error = PatternOfPreset;

    fn try_from(keys: LidarKeys) -> Result<Self, PatternOfPreset> {
        if let (Some(preset), Some(pattern)) = (keys.preset, keys.pattern)
            && pattern != preset.pattern()
        {
            return Err(PatternOfPreset { preset: preset.name() });
        }
        let pattern = keys.pattern.or(keys.preset.map(Preset::pattern)).unwrap_or(LidarPattern::Lattice);
        let usual_range_m = if pattern == LidarPattern::Frustum { FRUSTUM_RANGE_M } else { f64::INFINITY };
        let (preset_range_m, mut preset) = keys.preset.map_or((usual_range_m, GridKeys::default()), Preset::keys);
        let mut elevations_rad = keys.elevations_rad;
        if let Some(elevations_rad) = &mut elevations_rad {
            // In one order, since the identity of the scenario has them.
            elevations_rad.sort_by(f64::total_cmp);
            preset = GridKeys { lowest_rad: None, highest_rad: None, rows: None, ..preset };
        }
        let grid = GridKeys {
            horizontal_rad: keys.horizontal_rad.or(preset.horizontal_rad),
            vertical_rad: keys.vertical_rad.or(preset.vertical_rad),
            lowest_rad: keys.lowest_rad.or(preset.lowest_rad),
            highest_rad: keys.highest_rad.or(preset.highest_rad),
            elevations_rad,
            columns: keys.columns.or(preset.columns),
            rows: keys.rows.or(preset.rows),
            min_range_m: keys.min_range_m.or(preset.min_range_m),
            mount_height_m: keys.mount_height_m,
            mount_pitch_rad: keys.mount_pitch_rad,
        };
        Ok(Self {
            pattern,
            rays: keys.rays.unwrap_or(RAYS),
            shell_radius_cells: keys.shell_radius_cells.unwrap_or(SHELL_RADIUS_CELLS),
            range_m: keys.range_m.unwrap_or(preset_range_m),
            fov_rad: keys.fov_rad.unwrap_or(TAU),
            schedule: keys.schedule.unwrap_or(LidarSchedule::OnRequest),
            period_ticks: keys.period_ticks.unwrap_or(10),
            sees_agents: keys.sees_agents.unwrap_or_default(),
            grid: grid.completed(pattern),
        })
    }
}

/// Rays of the lattice, and cells to the edge of the shell (reference).
const RAYS: u32 = 5124;
const SHELL_RADIUS_CELLS: u32 = 5;

impl Default for LidarSection {
    fn default() -> Self {
        Self::try_from(LidarKeys::default()).expect("there is no preset")
    }
}

impl GridKeys {
    /// With the defaults of a pattern.
    fn completed(self, pattern: LidarPattern) -> Self {
        let placed = |keys: Self| Self {
            min_range_m: keys.min_range_m.or(Some(0.0)),
            mount_height_m: keys.mount_height_m.or(Some(0.0)),
            mount_pitch_rad: keys.mount_pitch_rad.or(Some(0.0)),
            ..keys
        };
        match pattern {
            LidarPattern::Lattice | LidarPattern::Shell => self,
            LidarPattern::Ring => {
                let placed = placed(self);
                let around = Self {
                    horizontal_rad: placed.horizontal_rad.or(Some(TAU)),
                    columns: placed.columns.or(Some(1024)),
                    ..placed
                };
                if around.elevations_rad.is_some() {
                    return around;
                }
                Self {
                    lowest_rad: around.lowest_rad.or(Some((-15.0_f64).to_radians())),
                    highest_rad: around.highest_rad.or(Some(15.0_f64.to_radians())),
                    rows: around.rows.or(Some(16)),
                    ..around
                }
            }
            LidarPattern::Frustum => {
                let placed = placed(self);
                Self {
                    horizontal_rad: placed.horizontal_rad.or(Some(80.0_f64.to_radians())),
                    vertical_rad: placed.vertical_rad.or(Some(60.0_f64.to_radians())),
                    columns: placed.columns.or(Some(80)),
                    rows: placed.rows.or(Some(60)),
                    ..placed
                }
            }
        }
    }

    /// Number of its rows.
    fn rows(&self) -> u32 {
        let lines = self.elevations_rad.as_ref().map(|elevations_rad| elevations_rad.len() as u32);
        lines.or(self.rows).unwrap_or(1)
    }

    /// The keys that are given, with their values; of a list its length.
    fn given(&self) -> impl Iterator<Item = (&'static str, String)> {
        let count = self.elevations_rad.as_ref().map(|elevations_rad| format!("{} elevations", elevations_rad.len()));
        let numbers = [
            ("horizontal_rad", self.horizontal_rad),
            ("vertical_rad", self.vertical_rad),
            ("lowest_rad", self.lowest_rad),
            ("highest_rad", self.highest_rad),
            ("columns", self.columns.map(f64::from)),
            ("rows", self.rows.map(f64::from)),
            ("min_range_m", self.min_range_m),
            ("mount_height_m", self.mount_height_m),
            ("mount_pitch_rad", self.mount_pitch_rad),
        ];
        let numbers = numbers.into_iter().filter_map(|(name, value)| Some((name, value?.to_string())));
        count.map(|count| ("elevations_rad", count)).into_iter().chain(numbers)
    }
}

impl LidarSection {
    /// The sections that name this pattern and nothing else, or a preset with it and nothing else.
    pub(super) fn with_pattern(pattern: LidarPattern) -> impl Iterator<Item = Self> {
        let presets = Preset::ALL.into_iter().filter(move |preset| preset.pattern() == pattern).map(Some);
        let alone = move |preset| LidarKeys { pattern: Some(pattern), preset, ..LidarKeys::default() }.try_into().ok();
        std::iter::once(None).chain(presets).filter_map(alone)
    }

    /// Where the LiDAR is on its body.
    #[must_use]
    pub fn place_on_body(&self) -> PlaceOnBody {
        PlaceOnBody {
            height_m: self.grid.mount_height_m.unwrap_or_default(),
            pitch_rad: self.grid.mount_pitch_rad.unwrap_or_default(),
            is_camera: self.pattern == LidarPattern::Frustum,
        }
    }

    /// Number of its rays.
    #[must_use]
    pub fn rays(&self) -> u32 {
        match self.pattern {
            LidarPattern::Lattice => self.rays,
            LidarPattern::Shell => self.scanner().rays(),
            LidarPattern::Ring | LidarPattern::Frustum => {
                self.grid.columns.unwrap_or(1).saturating_mul(self.grid.rows())
            }
        }
    }

    /// The LiDAR of the world.
    #[must_use]
    pub fn scanner(&self) -> Scanner {
        let grid = &self.grid;
        let of_grid = |projection| {
            Pattern::Grid(RayGrid {
                projection,
                columns: grid.columns.unwrap_or(1),
                horizontal_rad: grid.horizontal_rad.unwrap_or(TAU),
                pitch_rad: grid.mount_pitch_rad.unwrap_or_default(),
            })
        };
        let pattern = match self.pattern {
            LidarPattern::Lattice => Pattern::Lattice { rays: self.rays },
            LidarPattern::Shell => Pattern::Shell { radius_cells: self.shell_radius_cells },
            LidarPattern::Ring => of_grid(match grid.elevations_rad.clone().and_then(Elevations::new) {
                Some(elevations) => Projection::Lines(elevations),
                None => Projection::Spherical {
                    lowest_rad: grid.lowest_rad.unwrap_or_default(),
                    highest_rad: grid.highest_rad.unwrap_or_default(),
                    rows: grid.rows(),
                },
            }),
            LidarPattern::Frustum => {
                of_grid(Projection::Pinhole { vertical_rad: grid.vertical_rad.unwrap_or_default(), rows: grid.rows() })
            }
        };
        Scanner::new(pattern, self.range_m, self.fov_rad).seeing_agents(self.sees_agents).on(Mount {
            height_m: grid.mount_height_m.unwrap_or_default(),
            min_range_m: grid.min_range_m.unwrap_or_default(),
        })
    }
}

impl Scenario {
    /// Checks a LiDAR that is declared at a path, on bodies of which the smallest has a radius.
    pub(super) fn check_lidar(
        checker: &Checker<'_>,
        path: &str,
        lidar: &LidarSection,
        radius_m: f64,
    ) -> Result<(), ScenarioError> {
        let LidarSection { pattern, rays, shell_radius_cells, range_m, fov_rad, grid, .. } = lidar;
        let require = |key: &str, value: f64, holds: bool, allowed: &str| {
            checker.require(&format!("{path}.{key}"), value, holds, allowed)
        };
        for (name, value) in grid.given() {
            let (patterns, words) = match name {
                "vertical_rad" => (&[LidarPattern::Frustum][..], "\"frustum\""),
                "lowest_rad" | "highest_rad" | "elevations_rad" => (&[LidarPattern::Ring][..], "\"ring\""),
                _ => (&GRIDS[..], "\"ring\" or \"frustum\""),
            };
            let allowed = format!("expected only with {path}.pattern = {words}");
            checker.require(&format!("{path}.{name}"), value, patterns.contains(pattern), &allowed)?;
        }
        if !GRIDS.contains(pattern) {
            return Ok(());
        }
        let only_with = |pattern: &str| format!("expected only with {path}.pattern = \"{pattern}\"");
        require("rays", (*rays).into(), *rays == RAYS, &only_with("lattice"))?;
        let is_usual = *shell_radius_cells == SHELL_RADIUS_CELLS;
        require("shell_radius_cells", (*shell_radius_cells).into(), is_usual, &only_with("shell"))?;
        let of_others = format!("expected {path}.horizontal_rad instead with {path}.pattern = \"ring\" or \"frustum\"");
        require("fov_rad", *fov_rad, *fov_rad == TAU, &of_others)?;
        let number = |value: Option<f64>| value.unwrap_or_default();
        if let Some(elevations_rad) = &grid.elevations_rad {
            Self::check_elevations(checker, path, grid, elevations_rad)?;
        }
        let (columns, rows) = (grid.columns.unwrap_or_default(), grid.rows());
        let allowed = format!("expected at most {GRID_RAYS_MAX} rays, and {path}.columns = {columns}");
        let count = u64::from(columns) * u64::from(rows);
        let (key, value) = match grid.elevations_rad {
            Some(_) => ("elevations_rad", format!("{rows} elevations")),
            None => ("rows", rows.to_string()),
        };
        checker.require(&format!("{path}.{key}"), value, count <= GRID_RAYS_MAX.into(), &allowed)?;
        let lowest_rad = number(grid.lowest_rad);
        let allowed = format!("expected at most pi/2, and at least {path}.lowest_rad = {lowest_rad}");
        let highest_rad = number(grid.highest_rad);
        require("highest_rad", highest_rad, lowest_rad <= highest_rad, &allowed)?;
        if *pattern == LidarPattern::Frustum {
            for (key, angle_rad) in [("horizontal_rad", grid.horizontal_rad), ("vertical_rad", grid.vertical_rad)] {
                let angle_rad = number(angle_rad);
                let allowed = format!("expected up to {FRUSTUM_RAD_MAX} with {path}.pattern = \"frustum\"");
                require(key, angle_rad, angle_rad <= FRUSTUM_RAD_MAX, &allowed)?;
            }
        }
        let min_range_m = number(grid.min_range_m);
        let allowed = format!("expected less than {path}.range_m = {range_m}");
        require("min_range_m", min_range_m, min_range_m < *range_m, &allowed)?;
        let height_m = number(grid.mount_height_m);
        let allowed = format!("expected less than the radius of the smallest body, {radius_m} m, up or down");
        require("mount_height_m", height_m, height_m.abs() < radius_m, &allowed)
    }

    /// Checks the elevations of the lines of a ring, which are sorted.
    fn check_elevations(
        checker: &Checker<'_>,
        path: &str,
        grid: &GridKeys,
        elevations_rad: &[f64],
    ) -> Result<(), ScenarioError> {
        let key = format!("{path}.elevations_rad");
        let beside =
            [("lowest_rad", grid.lowest_rad), ("highest_rad", grid.highest_rad), ("rows", grid.rows.map(f64::from))];
        for (name, value) in beside {
            let allowed = format!("expected only without {key}");
            checker.require(&format!("{path}.{name}"), value.unwrap_or_default(), value.is_none(), &allowed)?;
        }
        let count = elevations_rad.len();
        let allowed = format!("expected 1 to {ROWS_MAX} elevations");
        checker.require(&key, format!("{count} elevations"), (1..=ROWS_MAX).contains(&count), &allowed)?;
        for &elevation_rad in elevations_rad {
            let holds = elevation_rad.abs() <= FRAC_PI_2;
            checker.require(&key, elevation_rad, holds, "expected elevations from -pi/2 to pi/2")?;
        }
        for pair in elevations_rad.windows(2) {
            checker.require(&key, pair[0], pair[0] < pair[1], "expected each elevation once")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
