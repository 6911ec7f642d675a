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
use super::{FormatError, ImportSpec, Imported, Note, new_grid};

/// The import options of point clouds.
pub(super) const OPTIONS: &[&str] =
    &["up", "scale", "margin_cells", "free_from", "sensor", "unknown", "cells_max", "steps_max"];

/// Cells without a point, behind one with a point, from which on a ray has passed through it: rays
/// that graze a surface leave its cells for shorter stretches.
const BEHIND_CELLS: u32 = 2;

/// Share of such rays, in percent, from which on the place of the sensor is probably wrong.
const THROUGH_PERCENT: f64 = 10.0;

/// Most points, as a share of all, that can be strays.
const STRAYS_SHARE: f64 = 0.005;

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

/// A few points that lie farther from the others than these from each other, along some axis.
struct Strays {
    /// What the others span, in lengths of cells.
    low: [f64; 3],
    high: [f64; 3],
    /// The first of them.
    first: [f64; 3],
    count: usize,
}

impl Strays {
    /// The strays among finite points in lengths of cells; `None` if there are none.
    fn of(points: impl Iterator<Item = [f64; 3]> + Clone) -> Option<Self> {
        let total = points.clone().count();
        let most = (total as f64 * STRAYS_SHARE) as usize;
        if most == 0 {
            return None;
        }
        let (mut low, mut high) = ([f64::NEG_INFINITY; 3], [f64::INFINITY; 3]);
        for axis in 0..3 {
            let mut along: Vec<f64> = points.clone().map(|point| point[axis]).collect();
            along.sort_unstable_by(f64::total_cmp);
            // Most points lie between these; from there outwards, a gap longer than all of that
            // has strays behind it.
            let (mut first, mut last) = (most, total - 1 - most);
            let span = (along[last] - along[first]).max(1.0);
            while first > 0 && along[first] - along[first - 1] <= span {
                first -= 1;
            }
            while last + 1 < total && along[last + 1] - along[last] <= span {
                last += 1;
            }
            if first > 0 {
                low[axis] = along[first];
            }
            if last + 1 < total {
                high[axis] = along[last];
            }
        }
        let mut strays = Self { low, high, first: [0.0; 3], count: 0 };
        let mut outside = points.filter(|&point| !strays.holds(point));
        let first = outside.next()?;
        let count = 1 + outside.count();
        (strays.first, strays.count) = (first, count);
        (count <= most).then_some(strays)
    }

    /// Whether a point is none of them.
    fn holds(&self, point: [f64; 3]) -> bool {
        (0..3).all(|axis| (self.low[axis]..=self.high[axis]).contains(&point[axis]))
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
    let strays = Strays::of(finite());
    let is_near = |place: &[f64; 3]| strays.as_ref().is_none_or(|strays| strays.holds(*place));
    let rays = || rays().filter(|[_, point]| is_near(point));
    let near = || finite().filter(is_near);
    let all = near().chain(rays().map(|[sensor, _]| sensor));
    let bounds = Bounds::of(all).ok_or(FormatError::Nothing("point with finite coordinates"))?;
    if spec.options.margin_cells.is_none() {
        units.check_span(spec, bounds)?;
    }
    let frame = Frame::around(units, bounds, true)?;
    let unknown = match (sensors, spec.options.unknown) {
        (Sensors::None, _) | (_, Some(Kind::Free)) => Terrain::Free,
        _ => Terrain::Wall,
    };
    let mut terrain = frame.grid(unknown, spec)?;
    let extent = Extent::new(terrain.extent().size(), 1.0).map_err(FormatError::Extent)?;
    let mut is_hit = rays().next().map(|_| new_grid(extent, false, spec)).transpose()?;
    for place in near() {
        if let Some(is_hit) = &mut is_hit {
            is_hit.set(frame.cell(place), true);
        }
    }
    let (mut ray_count, mut through) = (0u64, 0u64);
    let mut way = Vec::new();
    for ray in rays() {
        ray_count += 1;
        let [sensor, point] = ray.map(|end| Point3::from(frame.in_map(end)));
        way.clear();
        let crossed = walk_segment(extent, &sensor, &point, |cell| {
            terrain.set(cell, Terrain::Free);
            way.push((cell, is_hit.as_ref().and_then(|is_hit| is_hit.get(cell)) == Some(&true)));
            work.spend(1).map_or_else(ControlFlow::Break, ControlFlow::Continue)
        });
        if let ControlFlow::Break(error) = crossed {
            return Err(error);
        }
        // A segment is walked from the end with the lower coordinates.
        if way.first().map(|&(cell, _)| cell) == Some(frame.cell(ray[1])) {
            way.reverse();
        }
        through += u64::from(passes_through(&way));
    }
    voxels::close_shell(&mut terrain, 1);
    let (mut used, mut hit) = (0, 0);
    for place in near() {
        used += 1;
        hit += u64::from(terrain.set(frame.cell(place), Terrain::Wall) == Some(Terrain::Free));
    }
    if spec.options.margin_cells.is_none() {
        units.check_free(spec, bounds, mapgen::free_cells(&terrain))?;
    }
    let without_return = points.len() - returns().count();
    let stray = strays.as_ref().map_or(0, |strays| strays.count);
    let dropped = points.len() - used - without_return - stray;
    let becomes = if unknown == Terrain::Wall { "wall" } else { "free" };
    let space = match sensors {
        Sensors::None => "all cells without points, as no position of a sensor is known".to_owned(),
        _ => {
            format!("cells on {ray_count} ways from the sensor to points; all others are unknown and become {becomes}")
        }
    };
    notes.push(Note::new("points", format!("{used} in {hit} cells, {dropped} dropped because they are not finite")));
    if without_return > 0 {
        let text =
            format!("{without_return} points dropped, which lie at 0 0 0 or at their sensor: rays that met nothing");
        notes.push(Note::new("no return", text));
    }
    if let Some(Strays { first, count, .. }) = strays {
        let [x, y, z] = first.map(|along| along * units.length_m());
        let text = format!("{count} point(s) dropped that lie far from all others, the first at ({x}, {y}, {z}) m");
        notes.push(Note::new("stray", text));
    }
    notes.push(Note::new("free space", space));
    if through > 0 {
        let percent = 100.0 * through as f64 / ray_count as f64;
        let text = format!("{percent:.1} % of the rays pass through cells with points");
        notes.push(if percent >= THROUGH_PERCENT {
            let why = "the points were not all seen from there: part the file by places of its sensor, give another one \
                       (sensor), or remove it and use free_from";
            Note::warning("rays", format!("{text}; {why}"))
        } else {
            Note::new("rays", text)
        });
    }
    notes.push(frame.note());
    notes.extend(keep_from(&mut terrain, spec.options.free_from, |place| frame.cell_of_place(place))?);
    Ok(Imported { terrain, notes, stores_cell_m: false, origin_m: Some(frame.origin_m()), yaw_rad: 0.0 })
}

/// Whether a ray leaves cells with points again, of its cells from the sensor on and whether they
/// have points.
fn passes_through(way: &[(Cell, bool)]) -> bool {
    let from_first = way.iter().skip_while(|&&(_, is_hit)| !is_hit);
    let mut behind = 0;
    for &(_, is_hit) in from_first {
        behind = if is_hit { 0 } else { behind + 1 };
        if behind >= BEHIND_CELLS {
            return true;
        }
    }
    false
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
            "map size along y is 4294967295 cells, allowed are 1 to 1024, with cells of 0.1 m; it spans 0 m x 1.000e300 m x \
             0 m, with scale = 1: millimetres? --scale 0.001; else choose cells of 9.90e296 m or longer (--cell-m)"
        );
        assert_eq!(
            refuse(&[[0.0; 3], [0.04, 0.05, 0.0]]),
            "the file spans 0.04000 m x 0.05000 m x 0 m, with scale = 1: less than a cell of 0.1 m; choose shorter cells \
             (--cell-m), or give the unit of the file (--scale)"
        );
    }

    /// A room of 6 x 4 x 3 m, with points every half metre on its walls, floor and ceiling.
    fn room() -> Vec<[f64; 3]> {
        let all = (0..=12).flat_map(|x| (0..=8).flat_map(move |y| (0..=6).map(move |z| [x, y, z])));
        let is_wall = |&[x, y, z]: &[i32; 3]| x % 12 == 0 || y % 8 == 0 || z % 6 == 0;
        all.filter(is_wall).map(|place| place.map(|along| f64::from(along) / 2.0)).collect()
    }

    #[test]
    fn stray_points_are_dropped_and_counted() {
        let of = |points: &[[f64; 3]]| map(&spec(ImportOptions::default(), 0.5), points, &Sensors::None, Vec::new());
        let clean = of(&room()).unwrap();
        assert!(clean.notes.iter().all(|note| note.name != "stray"));
        for stray in [[40.0, 1.0, 1.0], [3.0, 1.0, -500.0], [1e30, 1e30, 1e30]] {
            let with_stray = of(&[room(), vec![stray]].concat()).unwrap();
            assert_eq!(with_stray.terrain, clean.terrain, "{stray:?}");
            let note = with_stray.notes.iter().find(|note| note.name == "stray").unwrap();
            assert!(note.text.starts_with("1 point(s) dropped that lie far from all others"), "{}", note.text);
        }
        // Another room is no stray, and neither is a point that is near.
        let moved = room().into_iter().map(|[x, y, z]| [x + 40.0, y, z]).collect();
        assert_eq!(of(&[room(), moved].concat()).unwrap().terrain.extent().size()[0], 95);
        assert_eq!(of(&[room(), vec![[9.0, 1.0, 1.0]]].concat()).unwrap().terrain.extent().size()[0], 21);
    }

    #[test]
    fn rays_through_points_are_counted() {
        let seen_from = |sensor| {
            let options = ImportOptions { sensor: Some(sensor), ..ImportOptions::default() };
            let notes = map(&spec(options, 0.5), &room(), &Sensors::None, Vec::new()).unwrap().notes;
            notes.into_iter().find(|note| note.name == "rays")
        };
        assert_eq!(seen_from([3.0, 2.0, 1.5]), None);
        let outside = seen_from([-4.0, 2.0, 1.5]).unwrap();
        assert!(
            outside.is_warning && outside.text.contains("% of the rays pass through cells with points"),
            "{outside:?}"
        );
    }
}
