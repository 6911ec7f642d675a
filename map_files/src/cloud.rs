//! Point clouds: every cell with a point is wall.
//!
//! A cloud contains only what was hit. If it says from where, or an option does, the cells on the
//! way from the sensor to a point are free, and of all others nothing is known. If not, every other
//! cell in the box around the points is free. Space behind a wall is then free as well, and not
//! connected with the space in front of it: the repair of maps fills the smaller part, or
//! `free_from` decides.

mod connected;
mod groups;
mod points;
mod sight;
mod strays;
mod trajectory;

use std::cmp::Ordering;

use nalgebra::Point3;
use voxels::{Extent, Terrain};

use super::formats::joined;
use super::frame::{Bounds, Frame, Units};
use super::free_space::FreeSpace;
use super::options::Kind;
use super::work_budget::WorkBudget;
use super::{FormatError, ImportSpec, Imported, Note, new_grid};

pub(super) use connected::keep_from;
use groups::Groups;
pub(super) use points::{Points, Records};
use sight::{passes_through, way_between};
use strays::Strays;
use trajectory::Trajectory;

/// The import options of point clouds.
pub(super) const OPTIONS: &[&str] = &joined::<{ POINTS.len() + LIMITS.len() }>(&[POINTS, LIMITS]);

/// Those of them about the points: where they lie, from where they were seen, and which count.
pub(super) const POINTS: &[&str] = &[
    "up",
    "scale",
    "margin_cells",
    "crop",
    "free_from",
    "gap_cells",
    "sensor",
    "stations",
    "trajectory",
    "voxel_min_points",
    "outliers",
];

/// Those of them about the map that is made of the points.
pub(super) const LIMITS: &[&str] = &["unknown", "cells_max", "steps_max"];

/// Share of rays through cells with points, and of cells that no place of the sensor sees, in
/// percent, from which on these places are probably wrong.
const WRONG_PERCENT: f64 = 10.0;

/// Points of a file, and what it says about each of them.
#[derive(Default)]
pub(super) struct Cloud<'a> {
    /// In the coordinates of the file.
    pub(super) points: Points<'a>,
    /// From where they were seen.
    pub(super) sensors: Sensors,
    /// When each was seen, seconds; empty if the file does not say so.
    pub(super) times_s: Vec<f64>,
    /// Notes of the reader.
    pub(super) notes: Vec<Note>,
}

/// From where points were seen, in the coordinates of the file.
#[derive(Default)]
pub(super) enum Sensors {
    /// Nothing is known.
    #[default]
    None,
    /// All from one position.
    One([f64; 3]),
    /// Each from a position of its own; one that is not finite is unknown.
    Each(Vec<[f64; 3]>),
    /// Each from one of these positions, which [`Self::any_of`] has put in order.
    AnyOf(Vec<[f64; 3]>),
}

impl Sensors {
    /// Each from one of these positions.
    fn any_of(mut places: Vec<[f64; 3]>) -> Self {
        places.sort_by(in_order);
        Self::AnyOf(places)
    }

    /// The sensors of the options, if they name some.
    ///
    /// # Errors
    /// If the trajectory is malformed or missing.
    fn of_options(spec: &ImportSpec, times_s: &[f64], notes: &mut Vec<Note>) -> Result<Option<Self>, FormatError> {
        let options = &spec.options;
        if let Some(file) = &options.trajectory {
            let trajectory = Trajectory::read(file, spec.trajectory.as_deref().unwrap_or_default())?;
            let (sensors, note) = trajectory.sensors(times_s);
            notes.push(note);
            return Ok(Some(sensors));
        }
        Ok(options.sensor.map(Self::One).or_else(|| options.stations.clone().map(Self::any_of)))
    }

    /// From where a point was seen, if that is known without looking at others.
    fn of(&self, point: usize) -> Option<[f64; 3]> {
        match self {
            Self::None | Self::AnyOf(_) => None,
            Self::One(position) => Some(*position),
            Self::Each(positions) => positions.get(point).copied(),
        }
    }

    /// The positions of which each point has one.
    fn places(&self) -> &[[f64; 3]] {
        if let Self::AnyOf(places) = self { places } else { &[] }
    }

    /// What is free, in words, of a cloud with so many rays, or cells that are seen.
    fn space(&self, rays: u64, unknown: Terrain) -> String {
        let becomes = if unknown == Terrain::Wall { "wall" } else { "free" };
        match self {
            Self::None => "all cells without points, as no position of a sensor is known".to_owned(),
            Self::AnyOf(places) => format!(
                "cells between {rays} cells with points and the nearest of {} positions in sight; all others are unknown \
                 and become {becomes}",
                places.len()
            ),
            Self::One(_) | Self::Each(_) => {
                format!("cells on {rays} ways from the sensor to points; all others are unknown and become {becomes}")
            }
        }
    }

    /// Whether a point lies where its sensor is.
    fn is_at(&self, number: usize, point: [f64; 3]) -> bool {
        self.of(number) == Some(point) || self.places().binary_search_by(|place| in_order(place, &point)).is_ok()
    }
}

/// An order of positions.
fn in_order(one: &[f64; 3], other: &[f64; 3]) -> Ordering {
    let by_axis = one.iter().zip(other).map(|(one, other)| one.total_cmp(other));
    by_axis.fold(Ordering::Equal, Ordering::then)
}

/// A map of a cloud.
///
/// # Errors
/// If there is no finite point, or the box around them has too many cells.
pub(super) fn map(spec: &ImportSpec, cloud: Cloud<'_>) -> Result<Imported, FormatError> {
    map_with(spec, cloud, WorkBudget::new(spec))
}

/// As [`map`], with the steps that reading the points has left.
///
/// # Errors
/// See [`map`].
pub(super) fn map_with(spec: &ImportSpec, cloud: Cloud<'_>, mut work: WorkBudget) -> Result<Imported, FormatError> {
    let Cloud { points, sensors, times_s, mut notes } = cloud;
    let points = points.held_if_few()?;
    let units = Units::new(spec)?;
    let is_finite = |place: &[f64; 3]| place.iter().all(|along| along.is_finite());
    let sensors = Sensors::of_options(spec, &times_s, &mut notes)?.unwrap_or(sensors);
    let crop = units.crop(spec);
    let in_crop = |place: &[f64; 3]| crop.is_none_or(|crop| crop.holds(*place));
    // Drivers write rays that met nothing as points at 0 0 0, or where the sensor is.
    let at_zero = points.iter().filter(|&point| point == [0.0; 3]).count();
    let is_return =
        |number: usize, point: [f64; 3]| (at_zero < 2 || point != [0.0; 3]) && !sensors.is_at(number, point);
    let returns = || points.iter().enumerate().filter(|&(number, point)| is_return(number, point));
    let finite = || returns().map(|(_, point)| units.cells(point)).filter(is_finite);
    let strays = Strays::of(points.most(), || finite().filter(in_crop));
    let is_near = |place: &[f64; 3]| strays.as_ref().is_none_or(|strays| strays.holds(*place));
    let groups = Groups::of(&spec.options, finite().filter(in_crop).filter(is_near), &mut work)?;
    // Points outside the box are no walls, but what lies before them is free.
    let is_used = |place: &[f64; 3]| {
        !in_crop(place) || is_near(place) && groups.as_ref().is_none_or(|groups| groups.holds(*place))
    };
    // Without positions of their own, no pass over the points finds any ray.
    let with_rays = if matches!(sensors, Sensors::One(_) | Sensors::Each(_)) { usize::MAX } else { 0 };
    let rays = || {
        let ends = returns().take(with_rays).filter_map(|(number, point)| Some((sensors.of(number)?, point)));
        let ends = ends.map(|(from, to)| [from, to].map(|end| units.cells(end)));
        ends.filter(|ray| ray.iter().all(is_finite)).filter(|[_, point]| is_used(point))
    };
    let walls = || finite().filter(in_crop).filter(is_used);
    let places: Vec<[f64; 3]> = sensors.places().iter().map(|&place| units.cells(place)).filter(is_finite).collect();
    let lacks = if crop.is_some() { "point inside the box of crop" } else { "point with finite coordinates" };
    walls().next().ok_or(FormatError::Nothing(lacks))?;
    let all = finite().filter(is_used).chain(rays().map(|[sensor, _]| sensor)).chain(places.iter().copied());
    let bounds = match crop {
        None => Bounds::of(all),
        Some(_) if rays().next().is_none() => Bounds::of(walls().chain(places.iter().copied().filter(in_crop))),
        Some(crop) => Bounds::of(all).map(|bounds| bounds.within(crop)),
    };
    let bounds = bounds.ok_or(FormatError::Nothing(lacks))?;
    if spec.options.margin_cells.is_none() {
        units.check_span(spec, bounds)?;
    }
    let frame = Frame::around(units, bounds, true)?;
    let unknown = match (&sensors, spec.options.unknown) {
        (Sensors::None, _) | (_, Some(Kind::Free)) => Terrain::Free,
        _ => Terrain::Wall,
    };
    let mut terrain = frame.grid(unknown, spec)?;
    let extent = Extent::new(terrain.extent().size(), 1.0).map_err(FormatError::Extent)?;
    let has_rays = !places.is_empty() || rays().next().is_some();
    let mut is_hit = if has_rays { Some(new_grid(extent, false, spec)?) } else { None };
    if let Some(is_hit) = &mut is_hit {
        for place in walls() {
            is_hit.set(frame.cell(place), true);
        }
    }
    let (mut ray_count, mut through) = (0u64, 0u64);
    let mut way = Vec::new();
    for ray in rays() {
        ray_count += 1;
        let [sensor, point] = ray.map(|end| Point3::from(frame.in_map(end)));
        let is_hit = is_hit.as_ref().expect("there are rays");
        way_between(is_hit, sensor, point, &mut work, &mut way)?;
        for &(cell, _) in &way {
            terrain.set(cell, Terrain::Free);
        }
        through += u64::from(passes_through(&way));
    }
    let mut unseen = 0;
    if let Some(is_hit) = is_hit.filter(|_| !places.is_empty()) {
        let places: Vec<[f64; 3]> = places.iter().map(|&place| frame.in_map(place)).collect();
        let seen = sight::from_nearest(&is_hit, &places, &mut work, |cell| {
            terrain.set(cell, Terrain::Free);
        })?;
        (ray_count, unseen) = (seen.seen, seen.unseen);
    }
    voxels::close_shell(&mut terrain, 1);
    let (mut used, mut hit) = (0, 0);
    walls().for_each(|place| {
        used += 1;
        hit += u64::from(terrain.set(frame.cell(place), Terrain::Wall) == Some(Terrain::Free));
    });
    if spec.options.margin_cells.is_none() {
        units.check_free(spec, bounds, mapgen::free_cells(&terrain))?;
    }
    let (mut without_return, mut not_finite, mut outside) = (0, 0, 0);
    points.iter().enumerate().for_each(|(number, point)| {
        let place = units.cells(point);
        if !is_return(number, point) {
            without_return += 1;
        } else if !is_finite(&place) {
            not_finite += 1;
        } else if !in_crop(&place) {
            outside += 1;
        }
    });
    points.check()?;
    notes.push(Note::new("points", format!("{used} in {hit} cells, {not_finite} dropped because they are not finite")));
    if without_return > 0 {
        let text =
            format!("{without_return} points dropped, which lie at 0 0 0 or at their sensor: rays that met nothing");
        notes.push(Note::new("no return", text));
    }
    if crop.is_some() {
        notes.push(Note::new("crop", format!("{outside} points outside the box dropped")));
    }
    if let Some(Strays { first, count, .. }) = strays {
        let [x, y, z] = first.map(|along| along * units.length_m());
        let text = format!("{count} point(s) dropped that lie far from all others, the first at ({x}, {y}, {z}) m");
        notes.push(Note::new("stray", text));
    }
    notes.extend(groups.iter().flat_map(Groups::notes));
    notes.push(Note::new("free space", sensors.space(ray_count, unknown)));
    notes.extend(note_of_share(
        "rays",
        (through, ray_count),
        "of the rays pass through cells with points",
        "the points were not all seen from there: give all places of the sensor (stations, or trajectory), or remove it and \
         use free_from",
    ));
    notes.extend(note_of_share(
        "unseen",
        (unseen, ray_count + unseen),
        "of the cells with points are in sight of no position of the sensor",
        "some positions are missing, or have other coordinates than the points",
    ));
    notes.push(frame.note());
    if matches!(sensors, Sensors::None) {
        notes.extend(FreeSpace::of(&terrain).warning(&spec.options));
    }
    notes.extend(keep_from(&mut terrain, &spec.options, |place| frame.cell_of_place(place))?);
    Ok(Imported { terrain, notes, stores_cell_m: false, origin_m: Some(frame.origin_m()), yaw_rad: 0.0 })
}

/// A note on a share of something, if there is any: a warning, with its probable cause, if it is
/// large.
fn note_of_share(name: &'static str, (some, all): (u64, u64), what: &str, cause: &str) -> Option<Note> {
    let percent = 100.0 * some as f64 / all as f64;
    (some > 0).then(|| match percent >= WRONG_PERCENT {
        true => Note::warning(name, format!("{percent:.1} % {what}; {cause}")),
        false => Note::new(name, format!("{percent:.1} % {what}")),
    })
}

#[cfg(test)]
mod tests;
