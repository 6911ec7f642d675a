//! Point clouds: every cell with a point is wall.
//!
//! A cloud contains only what was hit. If it says from where, or an option does, the cells on the
//! way from the sensor to a point are free, and of all others nothing is known. If not, every other
//! cell in the box around the points is free. Space behind a wall is then free as well, and not
//! connected with the space in front of it: the repair of maps fills the smaller part, or
//! `free_from` decides.

use std::collections::VecDeque;
use std::ops::ControlFlow;

use nalgebra::Point3;
use voxels::{Cell, Extent, FACES, Grid, Terrain, walk_segment};

use super::frame::{Bounds, Frame, Units};
use super::options::Kind;
use super::work::Work;
use super::{FormatError, ImportSpec, Imported, Note};

/// The import options of point clouds.
pub(super) const OPTIONS: &[&str] =
    &["up", "scale", "margin_cells", "free_from", "sensor", "unknown", "cells_max", "steps_max"];

/// From where points were seen, in the coordinates of the file.
pub(super) enum Sensors {
    /// Nothing is known.
    None,
    /// All from one position.
    One([f64; 3]),
    /// Each from a position of its own.
    Each(Vec<[f64; 3]>),
}

impl Sensors {
    /// From where a point was seen.
    fn of(&self, point: usize) -> Option<[f64; 3]> {
        match self {
            Self::None => None,
            Self::One(position) => Some(*position),
            Self::Each(positions) => positions.get(point).copied(),
        }
    }
}

/// A map of points of the file.
///
/// # Errors
/// If there is no finite point, or the box around them has too many cells.
pub(super) fn map(
    spec: &ImportSpec,
    points: &[[f64; 3]],
    sensors: &Sensors,
    notes: Vec<Note>,
) -> Result<Imported, FormatError> {
    map_with(spec, points, sensors, notes, Work::new(spec))
}

/// As [`map`], with the steps that reading the points has left.
///
/// # Errors
/// See [`map`].
pub(super) fn map_with(
    spec: &ImportSpec,
    points: &[[f64; 3]],
    sensors: &Sensors,
    mut notes: Vec<Note>,
    mut work: Work,
) -> Result<Imported, FormatError> {
    let units = Units::new(spec)?;
    let is_finite = |place: &[f64; 3]| place.iter().all(|along| along.is_finite());
    let asked = spec.options.sensor.map(Sensors::One);
    let sensors = asked.as_ref().unwrap_or(sensors);
    // Drivers write rays that met nothing as points at 0 0 0, or where the sensor is.
    let at_zero = points.iter().filter(|point| **point == [0.0; 3]).count();
    let is_return =
        |number: usize, point: [f64; 3]| (at_zero < 2 || point != [0.0; 3]) && sensors.of(number) != Some(point);
    let returns = || points.iter().copied().enumerate().filter(|&(number, point)| is_return(number, point));
    let finite = || returns().map(|(_, point)| units.cells(point)).filter(is_finite);
    let rays = || {
        let ends = returns().filter_map(|(number, point)| Some((sensors.of(number)?, point)));
        ends.map(|(from, to)| [from, to].map(|end| units.cells(end))).filter(|ray| ray.iter().all(is_finite))
    };
    let all = finite().chain(rays().map(|[sensor, _]| sensor));
    let bounds = Bounds::of(all).ok_or(FormatError::Nothing("point with finite coordinates"))?;
    let frame = Frame::around(units, bounds, true)?;
    let unknown = match (sensors, spec.options.unknown) {
        (Sensors::None, _) | (_, Some(Kind::Free)) => Terrain::Free,
        _ => Terrain::Wall,
    };
    let mut terrain = frame.grid(unknown, spec)?;
    let extent = Extent::new(terrain.extent().size(), 1.0).map_err(FormatError::Extent)?;
    for ray in rays() {
        let [sensor, point] = ray.map(|end| Point3::from(frame.in_map(end)));
        let crossed = walk_segment(extent, &sensor, &point, |cell| {
            terrain.set(cell, Terrain::Free);
            work.spend(1).map_or_else(ControlFlow::Break, ControlFlow::Continue)
        });
        if let ControlFlow::Break(error) = crossed {
            return Err(error);
        }
    }
    voxels::close_shell(&mut terrain, 1);
    let (mut used, mut hit) = (0, 0);
    for place in finite() {
        used += 1;
        hit += u64::from(terrain.set(frame.cell(place), Terrain::Wall) == Some(Terrain::Free));
    }
    let without_return = points.len() - returns().count();
    let dropped = points.len() - used - without_return;
    let becomes = if unknown == Terrain::Wall { "wall" } else { "free" };
    let rays = rays().count();
    let space = match sensors {
        Sensors::None => "all cells without points, as no position of a sensor is known".to_owned(),
        _ => format!("cells on {rays} ways from the sensor to points; all others are unknown and become {becomes}"),
    };
    notes.push(Note::new("points", format!("{used} in {hit} cells, {dropped} dropped because they are not finite")));
    if without_return > 0 {
        let text =
            format!("{without_return} points dropped, which lie at 0 0 0 or at their sensor: rays that met nothing");
        notes.push(Note::new("no return", text));
    }
    notes.push(Note::new("free space", space));
    notes.push(frame.note());
    notes.extend(keep_from(&mut terrain, spec.options.free_from, |place| frame.cell_of_place(place))?);
    Ok(Imported { terrain, notes, stores_cell_m: false, origin_m: Some(frame.origin_m()), yaw_rad: 0.0 })
}

/// Fills free cells that are not connected with the cell of the option `free_from`, if it is given.
///
/// # Errors
/// If that cell is wall or outside the map.
pub(super) fn keep_from(
    terrain: &mut Grid<Terrain>,
    place: Option<[f64; 3]>,
    cell_of: impl Fn([f64; 3]) -> Cell,
) -> Result<Option<Note>, FormatError> {
    let Some(place) = place else { return Ok(None) };
    let extent = terrain.extent();
    let start = cell_of(place);
    if terrain.get(start) != Some(&Terrain::Free) {
        return Err(FormatError::FreeFrom { place, is_outside: !extent.contains(start) });
    }
    // Kept cells are removed from the map and put into a solid one.
    let mut kept = Grid::new(extent, Terrain::Wall);
    let mut open = VecDeque::from([start]);
    terrain.set(start, Terrain::Wall);
    kept.set(start, Terrain::Free);
    while let Some(cell) = open.pop_front() {
        for next in FACES.map(|face| cell + face) {
            if terrain.get(next) == Some(&Terrain::Free) {
                terrain.set(next, Terrain::Wall);
                kept.set(next, Terrain::Free);
                open.push_back(next);
            }
        }
    }
    let filled = mapgen::free_cells(terrain);
    *terrain = kept;
    Ok(Some(Note::new("free_from", format!("{filled} free cells filled that are not connected with it"))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ImportOptions;

    fn spec(options: ImportOptions, cell_m: f64) -> ImportSpec {
        ImportSpec { options, cell_m: Some(cell_m), ..ImportSpec::new("a.pcd", Vec::new()) }
    }

    #[test]
    fn points_are_walls_and_the_rest_of_their_box_is_free() {
        let points = [[0.0, 0.0, 0.0], [1.2, 0.2, 0.1], [0.6, f64::NAN, 0.0], [1.4, 0.9, 0.4]];
        let Imported { terrain, notes, stores_cell_m, .. } =
            map(&spec(ImportOptions::default(), 0.5), &points, &Sensors::None, Vec::new()).unwrap();
        let wall = "#####\n#####\n#####\n#####\n";
        assert_eq!(terrain.to_text(), format!("{wall}\n#####\n#..##\n##.##\n#####\n\n{wall}"));
        assert_eq!(terrain.extent().cell_m(), 0.5);
        assert!(!stores_cell_m);
        assert_eq!(notes[0].text, "3 in 3 cells, 1 dropped because they are not finite");
        assert_eq!(notes[2].text, "the map begins at (-0.5, -0.5, -0.5) m of the file");
    }

    #[test]
    fn y_may_point_upwards_and_units_may_be_millimetres() {
        let options = ImportOptions { up: Some(crate::options::Up::Y), scale: Some(0.001), ..ImportOptions::default() };
        let points = [[0.0, 0.0, 0.0], [0.0, 2000.0, -1000.0]];
        let terrain = map(&spec(options, 1.0), &points, &Sensors::None, Vec::new()).unwrap().terrain;
        assert_eq!(terrain.extent().size(), [3, 4, 5]);
        assert_eq!(terrain.get(Cell::new(1, 2, 3)), Some(&Terrain::Wall));
        assert_eq!(terrain.get(Cell::new(1, 1, 2)), Some(&Terrain::Free));
    }

    #[test]
    fn unconnected_cells_are_filled() {
        let points: Vec<[f64; 3]> = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [2.0, 2.0], [5.0, 2.0]]
            .into_iter()
            .map(|[x, y]| [x, y, 0.0])
            .collect();
        let from = |place| spec(ImportOptions { free_from: Some(place), ..ImportOptions::default() }, 1.0);
        let Imported { terrain, notes, .. } = map(&from([1.5, 1.5, 0.5]), &points, &Sensors::None, Vec::new()).unwrap();
        assert_eq!(mapgen::free_cells(&terrain), 5);
        assert_eq!(notes[3].text, "8 free cells filled that are not connected with it");
        let refused = map(&from([2.5, 1.5, 0.5]), &points, &Sensors::None, Vec::new()).unwrap_err().to_string();
        assert_eq!(refused, "free_from = 2.5,1.5,0.5 lies in wall, expected a place in a free cell");
        let refused = map(&from([9.5, 1.5, 0.5]), &points, &Sensors::None, Vec::new()).unwrap_err().to_string();
        assert!(refused.contains("lies outside the map"), "{refused}");
    }

    #[test]
    fn ways_from_the_sensor_are_free() {
        // A sensor in a corridor of two walls, of which it sees one and the end.
        let points = [[4.5, 0.5, 0.5], [4.5, 1.5, 0.5], [2.5, 0.5, 0.5]];
        let sensor = ImportOptions { sensor: Some([0.5, 1.5, 0.5]), ..ImportOptions::default() };
        let Imported { terrain, notes, .. } = map(&spec(sensor, 1.0), &points, &Sensors::None, Vec::new()).unwrap();
        let wall = "#######\n".repeat(4);
        assert_eq!(terrain.to_text(), format!("{wall}\n#######\n#....##\n##.#.##\n#######\n\n{wall}"));
        assert!(notes[1].text.starts_with("cells on 3 ways from the sensor to points; all others are unknown"));
        let unknown = ImportOptions { unknown: Some(Kind::Free), ..sensor };
        let each = Sensors::Each(vec![[0.5, 1.5, 0.5]; 3]);
        let free = map(&spec(ImportOptions { sensor: None, ..unknown }, 1.0), &points, &each, Vec::new()).unwrap();
        assert_eq!(mapgen::free_cells(&free.terrain), 5 * 2 - 3);
        let far = ImportOptions { sensor: Some([0.5, 1.5, 0.5]), steps_max: Some(4), ..ImportOptions::default() };
        let error = map(&spec(far, 1.0), &points, &Sensors::None, Vec::new()).unwrap_err().to_string();
        assert!(error.starts_with("the file takes more than 4 steps of work"), "{error}");
    }

    #[test]
    fn a_cloud_without_an_extent_is_refused() {
        let refuse = |points: &[[f64; 3]]| {
            map(&spec(ImportOptions::default(), 0.1), points, &Sensors::None, Vec::new()).unwrap_err().to_string()
        };
        assert_eq!(refuse(&[[0.0, f64::INFINITY, 0.0]]), "the file has no point with finite coordinates");
        assert_eq!(
            refuse(&[[0.0; 3], [0.0, 1e300, 0.0]]),
            "map size along y is 4294967295 cells, allowed are 1 to 1024, with cells of 0.1 m; choose longer ones"
        );
    }
}
