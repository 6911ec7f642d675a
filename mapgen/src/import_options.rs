//! Import options: the keys of `[map.import]`, and options of `map convert`.
//!
//! Each file format has some of them; an option that the format does not have is an error.

use serde::{Deserialize, Serialize};

use thiserror::Error;

/// Height of a floor plan in cells, floor and ceiling not counted, unless an option says otherwise.
pub const HEIGHT_CELLS: u32 = 5;

/// Brightness from which a pixel of a floor plan is free, unless an option says otherwise: grey
/// that stands for unknown is wall.
pub const THRESHOLD: f64 = 0.9;

/// The largest bounds that options may set: all cells that a map can have, and hours of work.
const CELLS_MOST: u64 = 1 << 30;
const STEPS_MOST: u64 = 1 << 40;

/// An import option with an illegal value.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{name} = {value}, allowed is {allowed}")]
pub struct OptionError {
    /// The option.
    pub name: &'static str,
    /// Its value.
    pub value: String,
    /// The allowed values.
    pub allowed: &'static str,
}

/// Import options of a map file; `None` is the default of the field.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::Args))]
#[serde(default, deny_unknown_fields)]
pub struct ImportOptions {
    /// Meshes: which cells are wall, the solid ones or those of the surface alone [default: solid].
    #[cfg_attr(feature = "clap", arg(long, value_enum))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fill: Option<Fill>,
    /// Meshes: what is inside; free makes a cave of a mesh [default: wall].
    #[cfg_attr(feature = "clap", arg(long, value_enum))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inside: Option<Kind>,
    /// OctoMap, map.yaml, and point clouds with a sensor: what cells are of which the file does not
    /// know whether they are free [default: wall].
    #[cfg_attr(feature = "clap", arg(long, value_enum))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unknown: Option<Kind>,
    /// Meshes and point clouds: the axis of the file that points upwards [default: z].
    #[cfg_attr(feature = "clap", arg(long, value_enum))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub up: Option<Up>,
    /// Meshes and point clouds: metres for each unit of the file [default: 1].
    #[cfg_attr(feature = "clap", arg(long, value_name = "M"))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// Meshes and point clouds: layers of free cells around what the file holds [default: 0].
    #[cfg_attr(feature = "clap", arg(long, value_name = "N"))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub margin_cells: Option<u32>,
    /// Meshes, point clouds and OctoMap: only cells that are connected with this place of the file
    /// stay free [default: all].
    #[cfg_attr(feature = "clap", arg(long, value_name = "X,Y,Z", value_parser = parse_place, allow_hyphen_values = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub free_from: Option<[f64; 3]>,
    /// Point clouds: position of the sensor in the file's own coordinates; cells between it and the
    /// points are free [default: that of the file, if it has one].
    #[cfg_attr(feature = "clap", arg(long, value_name = "X,Y,Z", value_parser = parse_place, allow_hyphen_values = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor: Option<[f64; 3]>,
    /// Floor plans: free cells from floor to ceiling [default: 5; of a map.yaml 2.5 m].
    #[cfg_attr(feature = "clap", arg(long, value_name = "N"))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub height_cells: Option<u32>,
    /// Floor plans: brightness from 0 to 1 from which a pixel is free [default: 0.9].
    #[cfg_attr(feature = "clap", arg(long, value_name = "SHARE"))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threshold: Option<f64>,
    /// Largest number of cells of the map, a bound on its memory [default: 2^24, or 1024 for each
    /// byte of the file, up to 2^27].
    #[cfg_attr(feature = "clap", arg(long, value_name = "N"))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells_max: Option<u64>,
    /// Meshes and point clouds: largest number of steps of work, a bound on the time [default:
    /// 2^28].
    #[cfg_attr(feature = "clap", arg(long, value_name = "N"))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps_max: Option<u64>,
}

/// Which cells of a mesh are wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum Fill {
    /// Those whose centres are inside.
    Solid,
    /// Those that a triangle touches.
    Shell,
}

/// The state of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Solid.
    Wall,
    /// Not solid.
    Free,
}

/// An axis that points upwards.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum Up {
    /// The file's y; its -z is our y.
    Y,
    /// The file's z, as ours.
    Z,
}

impl ImportOptions {
    /// Whether no option is given.
    #[must_use]
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Checks all values, whatever the format.
    ///
    /// # Errors
    /// Names the option, its value and the allowed values.
    pub fn check(&self) -> Result<(), OptionError> {
        let require = |name, value: Option<String>, holds: bool, allowed| match value {
            Some(value) if !holds => Err(OptionError { name, value, allowed }),
            _ => Ok(()),
        };
        let is_positive = |value: f64| value.is_finite() && value > 0.0;
        let text = |value: f64| value.to_string();
        require("scale", self.scale.map(text), self.scale.is_some_and(is_positive), "a finite number above 0")?;
        let is_margin = self.margin_cells.is_some_and(|cells| cells <= 500);
        require("margin_cells", self.margin_cells.map(|cells| cells.to_string()), is_margin, "0 to 500")?;
        let is_finite = self.free_from.is_some_and(|place| place.iter().all(|along| along.is_finite()));
        let place = self.free_from.map(|place| place.map(|along| along.to_string()).join(","));
        require("free_from", place, is_finite, "three finite numbers")?;
        let is_finite = self.sensor.is_some_and(|place| place.iter().all(|along| along.is_finite()));
        let place = self.sensor.map(|place| place.map(|along| along.to_string()).join(","));
        require("sensor", place, is_finite, "three finite numbers")?;
        let is_height = self.height_cells.is_some_and(|cells| (1..=1022).contains(&cells));
        require("height_cells", self.height_cells.map(|cells| cells.to_string()), is_height, "1 to 1022")?;
        let is_share = self.threshold.is_some_and(|share| (0.0..=1.0).contains(&share));
        require("threshold", self.threshold.map(text), is_share, "0 to 1")?;
        let is_size = self.cells_max.is_some_and(|cells| (1..=CELLS_MOST).contains(&cells));
        require("cells_max", self.cells_max.map(|cells| cells.to_string()), is_size, "1 to 1073741824")?;
        let is_work = self.steps_max.is_some_and(|steps| (1..=STEPS_MOST).contains(&steps));
        require("steps_max", self.steps_max.map(|steps| steps.to_string()), is_work, "1 to 1099511627776")
    }

    /// The names of the options that are given.
    pub fn given(&self) -> impl Iterator<Item = &'static str> {
        [
            ("fill", self.fill.is_some()),
            ("inside", self.inside.is_some()),
            ("unknown", self.unknown.is_some()),
            ("up", self.up.is_some()),
            ("scale", self.scale.is_some()),
            ("margin_cells", self.margin_cells.is_some()),
            ("free_from", self.free_from.is_some()),
            ("sensor", self.sensor.is_some()),
            ("height_cells", self.height_cells.is_some()),
            ("threshold", self.threshold.is_some()),
            ("cells_max", self.cells_max.is_some()),
            ("steps_max", self.steps_max.is_some()),
        ]
        .into_iter()
        .filter_map(|(name, is_given)| is_given.then_some(name))
    }
}

#[cfg(feature = "clap")]
fn parse_place(text: &str) -> Result<[f64; 3], String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|number| number.trim().parse().ok()).collect();
    numbers.try_into().map_err(|_| "a place is three numbers, as in 1.5,-2,0.3".to_owned())
}
