//! Import options: the keys of `[map.import]`, and options of `map convert`.
//!
//! Each file format has some of them; an option that the format does not have is an error.

use std::path::{Path, PathBuf};

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

/// Most cells of an opening that is closed, and of a group of cells that is dropped.
const GAP_MOST: u32 = 100;
const OUTLIERS_MOST: u32 = 1_000_000;

/// Most positions of a sensor, and folders of models.
const STATIONS_MOST: usize = 10_000;
const MODEL_PATHS_MOST: usize = 16;

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
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
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
    #[cfg_attr(feature = "clap", arg(long, value_name = "M", allow_negative_numbers = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// Meshes and point clouds: layers of free cells around what the file holds [default: 0].
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", allow_negative_numbers = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub margin_cells: Option<u32>,
    /// Meshes, point clouds and OctoMap: what lies outside this box is left out; its lowest and its
    /// highest corner in metres, in the coordinates in which the report gives the origin of the map
    /// [default: nothing].
    #[cfg_attr(feature = "clap", arg(long, value_name = "X,Y,Z,X,Y,Z", value_parser = parse_box, allow_hyphen_values = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub crop: Option<[f64; 6]>,
    /// Meshes, point clouds and OctoMap: only cells that are connected with this place of the file
    /// stay free [default: all].
    #[cfg_attr(feature = "clap", arg(long, value_name = "X,Y,Z", value_parser = parse_place, allow_hyphen_values = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub free_from: Option<[f64; 3]>,
    /// With free_from: openings of at most so many cells are closed, so that free space ends at
    /// them [default: 0].
    #[cfg_attr(feature = "clap", arg(long, value_name = "N", allow_negative_numbers = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gap_cells: Option<u32>,
    /// Point clouds: position of the sensor in the file's own coordinates; cells between it and the
    /// points are free [default: that of the file, if it has one].
    #[cfg_attr(feature = "clap", arg(long, value_name = "X,Y,Z", value_parser = parse_place, allow_hyphen_values = true))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor: Option<[f64; 3]>,
    /// Point clouds: positions of the sensor in the file's own coordinates, separated by
    /// semicolons; each point counts as seen from the nearest one in sight [default: none].
    #[cfg_attr(feature = "clap", arg(
        long, value_name = "X,Y,Z;X,Y,Z", value_parser = parse_place, value_delimiter = ';', allow_hyphen_values = true
    ))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stations: Option<Vec<[f64; 3]>>,
    /// Point clouds: file with the positions of the sensor over time, in the format of TUM; of each
    /// point that at its time if the cloud has times, else the nearest one in sight [default:
    /// none].
    #[cfg_attr(feature = "clap", arg(long, value_name = "FILE"))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trajectory: Option<PathBuf>,
    /// Point clouds: cells with fewer points count as empty, and these points as absent [default:
    /// 1].
    #[cfg_attr(feature = "clap", arg(long, value_name = "N"))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voxel_min_points: Option<u32>,
    /// Point clouds: the points of groups of at most so many cells are dropped; the cells of a
    /// group touch each other, if only at a corner [default: 0].
    #[cfg_attr(feature = "clap", arg(long, value_name = "N"))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outliers: Option<u32>,
    /// LAS: only points of these classes are used, for instance 2,6 [default: all].
    #[cfg_attr(feature = "clap", arg(long, value_name = "CLASSES", value_delimiter = ','))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub classes: Option<Vec<u8>>,
    /// LAS: points with one of these flags are dropped [default: withheld].
    #[cfg_attr(feature = "clap", arg(long, value_enum, value_name = "FLAGS", value_delimiter = ','))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drop_flags: Option<Vec<PointFlag>>,
    /// SDF: folders in which model://NAME is looked for, beside that of the file [default: none].
    #[cfg_attr(feature = "clap", arg(long, value_name = "DIR"))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model_path: Option<Vec<PathBuf>>,
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

/// A flag of a point of a LAS file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
#[cfg_attr(feature = "clap", value(rename_all = "snake_case"))]
pub enum PointFlag {
    /// Deleted, but left in the file.
    Withheld,
    /// Not measured by the scanner.
    Synthetic,
    /// A key point of a model.
    KeyPoint,
    /// In the overlap of two swaths.
    Overlap,
    /// No point has it: as the only one of a list, it keeps all points.
    None,
}

impl ImportOptions {
    /// The same options with paths that start from a folder.
    #[must_use]
    pub fn from_folder(self, folder: &Path) -> Self {
        let trajectory = self.trajectory.map(|file| folder.join(file));
        let join = |paths: Vec<PathBuf>| paths.into_iter().map(|path| folder.join(path)).collect();
        Self { trajectory, model_path: self.model_path.map(join), ..self }
    }

    /// Whether an option names files or folders.
    #[must_use]
    pub fn has_paths(&self) -> bool {
        self.trajectory.is_some() || self.model_path.is_some()
    }

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
        let crop = self.crop.map(|corners| corners.map(|along| along.to_string()).join(","));
        let is_box = self.crop.is_some_and(|corners| {
            corners.iter().all(|along| along.is_finite()) && (0..3).all(|axis| corners[axis] < corners[axis + 3])
        });
        require("crop", crop, is_box, "six finite numbers, the lowest corner before the highest")?;
        let number = |value: Option<u32>| value.map(|number| number.to_string());
        let is_gap = self.gap_cells.is_some_and(|cells| cells <= GAP_MOST);
        require("gap_cells", number(self.gap_cells), is_gap, "0 to 100")?;
        let has_start = self.gap_cells.is_none() || self.free_from.is_some();
        require("gap_cells", number(self.gap_cells), has_start, "with free_from only, from which the space grows")?;
        let is_group = self.outliers.is_some_and(|cells| cells <= OUTLIERS_MOST);
        require("outliers", number(self.outliers), is_group, "0 to 1000000")?;
        let is_count = self.voxel_min_points.is_some_and(|points| (1..=OUTLIERS_MOST).contains(&points));
        require("voxel_min_points", number(self.voxel_min_points), is_count, "1 to 1000000")?;
        if let Some(stations) = &self.stations {
            let are_finite = stations.iter().flatten().all(|along| along.is_finite());
            let holds = are_finite && (1..=STATIONS_MOST).contains(&stations.len());
            let value = format!("{} positions", stations.len());
            require("stations", Some(value), holds, "1 to 10000 positions of three finite numbers")?;
        }
        let places = [self.sensor.is_some(), self.stations.is_some(), self.trajectory.is_some()];
        let is_one = places.into_iter().filter(|&is_given| is_given).count() <= 1;
        let names = ["sensor", "stations", "trajectory"].into_iter().zip(places);
        let last = names.filter_map(|(name, is_given)| is_given.then_some(name)).next_back().unwrap_or("sensor");
        require(last, Some("given".to_owned()), is_one, "one of sensor, stations and trajectory")?;
        let paths = self.model_path.as_ref().map(Vec::len);
        let are_few = paths.is_some_and(|paths| paths <= MODEL_PATHS_MOST);
        require("model_path", paths.map(|paths| format!("{paths} folders")), are_few, "0 to 16 folders")?;
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
            ("crop", self.crop.is_some()),
            ("free_from", self.free_from.is_some()),
            ("gap_cells", self.gap_cells.is_some()),
            ("sensor", self.sensor.is_some()),
            ("stations", self.stations.is_some()),
            ("trajectory", self.trajectory.is_some()),
            ("voxel_min_points", self.voxel_min_points.is_some()),
            ("outliers", self.outliers.is_some()),
            ("classes", self.classes.is_some()),
            ("drop_flags", self.drop_flags.is_some()),
            ("model_path", self.model_path.is_some()),
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

#[cfg(feature = "clap")]
fn parse_box(text: &str) -> Result<[f64; 6], String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|number| number.trim().parse().ok()).collect();
    numbers.try_into().map_err(|_| "a box is six numbers, the lowest corner first, as in 0,0,0,20,10,3".to_owned())
}
