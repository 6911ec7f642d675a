//! Where a body that drives on the ground finds footing, and which moves between places it can
//! make.
//!
//! A body stands at the place of a cell ([`BodyLattice`]) if it would touch a wall one cell lower.
//! It climbs upright: first up, then on, and on before down. So while it moves it may be some cells
//! above the floor: as many as its highest step has, and one where the floor rises as a slope does.
//!
//! A map of cells has no slopes, but rises of one cell. Such a rise is *gentle* for a body if the
//! floor before and behind it, along an axis, is as long as that of the steepest slope that the
//! body climbs. What is not known to be wall carries nothing.

use std::f64::consts::FRAC_PI_4;

use crate::{BodyLattice, Cell, Grid, Terrain};

/// Lengths this little below a whole number of cells are rounded up to it, cells.
const SNAP_CELLS: f64 = 2e-9;

/// How much nearer than its radius a body may be to what it does not touch, as a difference of
/// squares, square cells.
const SLACK_SQUARED: f64 = 1e-9;

/// Longest floor before or behind a rise that is looked at, cells: that of a slope of 1 in 32.
const RUN_CELLS_MAX: i32 = 64;

/// The directions in which a floor rises.
const ALONG: [Cell; 4] = [Cell::new(1, 0, 0), Cell::new(-1, 0, 0), Cell::new(0, 1, 0), Cell::new(0, -1, 0)];

/// What is known of cells.
pub trait Ground {
    /// Whether a cell is known to be free.
    fn is_free(&self, cell: Cell) -> bool;

    /// Whether a cell is known to be wall, as all outside the map is.
    fn is_wall(&self, cell: Cell) -> bool;
}

impl Ground for Grid<Terrain> {
    fn is_free(&self, cell: Cell) -> bool {
        self.get(cell) == Some(&Terrain::Free)
    }

    fn is_wall(&self, cell: Cell) -> bool {
        !self.is_free(cell)
    }
}

/// The rises that a body climbs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Climb {
    /// Cells of the highest step.
    step_cells: i32,
    /// `None`: it climbs no slopes.
    slope: Option<Run>,
}

/// Least lengths of floor on a slope, cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Run {
    /// Between two rises.
    each: i32,
    /// From the rise before one to the rise after it.
    both: i32,
}

impl Climb {
    /// Steps of up to `step_max_m` metres and slopes of up to `slope_max_rad` radians in cells of
    /// `cell_m` metres. Slopes below 1 in 32 do not count, and those above 45 degrees are steps.
    #[must_use]
    pub fn new(step_max_m: f64, slope_max_rad: f64, cell_m: f64) -> Self {
        let whole = |cells: f64| (cells + SNAP_CELLS).floor() as i32;
        let run_cells = 1.0 / libm::tan(slope_max_rad.clamp(0.0, FRAC_PI_4));
        let slope = (2.0 * run_cells <= f64::from(RUN_CELLS_MAX))
            .then(|| Run { each: whole(run_cells).max(1), both: whole(2.0 * run_cells).max(2) });
        Self { step_cells: whole(step_max_m.max(0.0) / cell_m), slope }
    }

    /// Whether the body may be so many cells above a floor whatever there is around it.
    fn is_step(&self, above_cells: i32) -> bool {
        above_cells <= self.step_cells
    }

    /// The most cells that the body may be above its floor.
    #[must_use]
    pub fn cells_max(&self) -> i32 {
        self.step_cells.max(i32::from(self.slope.is_some()))
    }

    /// Whether the body may be so many cells above its floor where it would touch `below` if it
    /// were one cell lower.
    pub fn allows(&self, ground: &impl Ground, above_cells: i32, mut below: impl Iterator<Item = Cell>) -> bool {
        let is_gentle = |cell: Cell| ground.is_free(cell) || self.is_gentle(ground, cell);
        self.is_step(above_cells) || (above_cells == 1 && self.slope.is_some() && below.all(is_gentle))
    }

    /// Whether a wall carries the floor behind a rise of a slope that the body climbs.
    pub fn is_gentle(&self, ground: &impl Ground, wall: Cell) -> bool {
        let Some(Run { each, both }) = self.slope else { return false };
        let is_floor = |cell: Cell| ground.is_free(cell) && ground.is_wall(cell + DOWN);
        let length = |from: Cell, by: Cell| {
            let mut cells = std::iter::successors(Some(from), |&cell| Some(cell + by)).take(both as usize);
            cells.position(|cell| !is_floor(cell)).map_or(both, |length| length as i32)
        };
        let floor = wall - DOWN;
        is_floor(floor)
            && ALONG.into_iter().any(|along| {
                let (ahead, back) = (length(floor, along), length(floor, Cell::default() - along));
                let first = (1..back).fold(floor, |cell, _| cell - along);
                let behind = ahead + back - 1;
                let before = length(first - along + DOWN, Cell::default() - along);
                let is_open = ground.is_free(first - along);
                is_open && back < both && before >= each && behind >= each && before + behind >= both
            })
    }
}

/// One cell down.
const DOWN: Cell = Cell::new(0, 0, -1);

/// The footing of a body of one size.
#[derive(Debug, Clone, PartialEq)]
pub struct Footing {
    climb: Climb,
    /// The cells right below the body, under its centre, relative to its cell.
    under: Vec<Cell>,
    /// The cells that the body touches at the place of a cell, relative to it.
    sphere: Vec<Cell>,
    /// For each horizontal move those that it touches at both ends, and so all the way.
    throughout: Vec<(Cell, Vec<Cell>)>,
    /// How far from the centre it may touch a rise, cells.
    radius_cells: i32,
}

impl Footing {
    /// That of a sphere of `radius_m` metres, at most 16 cells, on cells with edges of `cell_m`
    /// metres.
    #[must_use]
    pub fn new(radius_m: f64, cell_m: f64, climb: Climb) -> Self {
        let lattice = BodyLattice::of(radius_m, cell_m);
        let diameter_cells = ((2.0 * radius_m / cell_m - SNAP_CELLS).ceil() as i32).max(1);
        let (columns, lowest) = match lattice {
            BodyLattice::Centres => (0..=0, (diameter_cells - 1) / 2),
            BodyLattice::Corners => (-1..=0, diameter_cells / 2),
        };
        let under = columns.clone().flat_map(|y| columns.clone().map(move |x| Cell::new(x, y, -lowest - 1))).collect();
        let distance = |along: i32| {
            let low = f64::from(along) - lattice.offset_cells();
            low.max(-1.0 - low).max(0.0)
        };
        let radius = radius_m / cell_m;
        let is_touched = |cell: &Cell| {
            let [x, y, z] = [cell.x, cell.y, cell.z].map(distance);
            x * x + y * y + z * z < radius * radius - SLACK_SQUARED
        };
        let along = move || -lowest - 1..=lowest + 1;
        let cube = along().flat_map(|z| along().flat_map(move |y| along().map(move |x| Cell::new(x, y, z))));
        let sphere: Vec<Cell> = cube.filter(is_touched).collect();
        let level = Cell::default().neighbours26().into_iter().filter(|by| by.z == 0);
        let throughout = level.map(|by| {
            let is_at_end = |&cell: &Cell| sphere.binary_search(&(cell - by)).is_ok();
            (by, sphere.iter().copied().filter(is_at_end).collect())
        });
        let throughout = throughout.collect();
        Self { climb, under, sphere, throughout, radius_cells: lowest + 1 }
    }

    /// The rises that it climbs.
    #[must_use]
    pub fn climb(&self) -> &Climb {
        &self.climb
    }

    /// How far from a cell another one may be that decides whether the body can be there, cells.
    #[must_use]
    pub fn reach_cells(&self) -> i32 {
        let of_slopes = self.climb.slope.map_or(0, |run| run.both);
        self.radius_cells + self.climb.cells_max().max(of_slopes) + 1
    }

    /// How many cells the body at the place of a cell, in which it has room, can sink, at most as
    /// many as it climbs. `None`: no floor is known there.
    pub fn above(&self, ground: &impl Ground, cell: Cell) -> Option<i32> {
        self.depth(ground, cell, &self.sphere)
    }

    /// How many cells some cells relative to `cell` can sink until one of them is wall.
    fn depth(&self, ground: &impl Ground, cell: Cell, cells: &[Cell]) -> Option<i32> {
        let meets = |&depth: &i32| {
            let at = cell + Cell::new(0, 0, -depth - 1);
            cells.iter().any(|&by| ground.is_wall(at + by))
        };
        (0..=self.climb.cells_max()).find(meets)
    }

    /// How far the floor under the centre of the body is below it, cells.
    fn depth_under(&self, ground: &impl Ground, cell: Cell) -> Option<i32> {
        let depth = |&under: &Cell| {
            (0..=self.climb.cells_max()).find(|&depth| ground.is_wall(cell + under + Cell::new(0, 0, -depth)))
        };
        self.under.iter().map(depth).try_fold(0, |most, depth| Some(depth?.max(most)))
    }

    /// Whether the body stands at the place of a cell, in which it has room.
    pub fn stands(&self, ground: &impl Ground, cell: Cell) -> bool {
        self.above(ground, cell) == Some(0)
    }

    /// Whether the body can be at the place of a cell, in which it has room: above a floor as high
    /// as its steps, or before a rise of a slope.
    pub fn holds(&self, ground: &impl Ground, cell: Cell) -> bool {
        let is_before_rise = |&under: &Cell| {
            ALONG.into_iter().any(|along| {
                let ahead = std::iter::successors(Some(cell + under), |&wall| Some(wall + along));
                ahead.skip(1).take(self.radius_cells as usize).any(|wall| self.climb.is_gentle(ground, wall))
            })
        };
        self.above(ground, cell)
            .is_some_and(|above| self.climb.is_step(above) || (above == 1 && self.under.iter().any(is_before_rise)))
    }

    /// Whether the floor below a cell of a straight and level motion of the centre carries the body
    /// on the way.
    pub fn carries(&self, ground: &impl Ground, cell: Cell) -> bool {
        let is_wall = |depth: i32| ground.is_wall(cell + Cell::new(0, 0, -self.radius_cells - depth));
        (0..=self.climb.step_cells).any(is_wall)
    }

    /// Whether the body, which has room on the way, can go from the place of a cell to that of one
    /// of the 26 around it. It never goes up or down and aside at once.
    pub fn can_go(&self, ground: &impl Ground, from: Cell, to: Cell) -> bool {
        let by = to - from;
        if !self.holds(ground, to) {
            return false;
        }
        if by.z != 0 {
            return by.x == 0 && by.y == 0;
        }
        // What it touches at both ends it touches on the way; what is under its centre changes
        // once.
        let throughout = self.throughout.iter().find(|(other, _)| *other == by);
        let depth = throughout.and_then(|(_, cells)| self.depth(ground, from, cells));
        let under = self.depth_under(ground, from).zip(self.depth_under(ground, to)).map(|(start, end)| start.max(end));
        let Some(above) = depth.into_iter().chain(under).min() else { return false };
        let touched = |at: Cell| self.sphere.iter().map(move |&by| at + DOWN + by);
        let is_diagonal = by.x != 0 && by.y != 0;
        match is_diagonal {
            true => self.climb.is_step(above),
            false => self.climb.allows(ground, above, touched(from).chain(touched(to))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A terrain from the heights of its floor, 12 cells high, with a wall around it.
    fn hills(heights: &[&str]) -> Grid<Terrain> {
        let size = [heights[0].len() as u32 + 2, heights.len() as u32 + 2, 12];
        let mut terrain = Grid::new(crate::Extent::new(size, 1.0).unwrap(), Terrain::Wall);
        for (y, row) in (1..).zip(heights) {
            for (x, height) in (1..).zip(row.bytes()) {
                (i32::from(height - b'0') + 1..11).for_each(|z| {
                    terrain.set(Cell::new(x, y, z), Terrain::Free);
                });
            }
        }
        terrain
    }

    /// Whether a body gets from the first column of a floor to the last, by the moves.
    fn passes(heights: &str, radius_m: f64, (step_max_m, slope_max_rad): (f64, f64)) -> bool {
        let terrain = hills(&[heights; 5]);
        let footing = Footing::new(radius_m, 1.0, Climb::new(step_max_m, slope_max_rad, 1.0));
        let clearance = crate::Clearance::for_body(radius_m, &terrain);
        let room = clearance.room(radius_m);
        let stands = |cell: &Cell| room.is_free(*cell) && footing.stands(&terrain, *cell);
        let starts: Vec<Cell> = terrain.extent().cells().filter(stands).collect();
        let [first, last] = [starts.iter().map(|cell| cell.x).min(), starts.iter().map(|cell| cell.x).max()];
        let mut reached: Vec<Cell> = starts.into_iter().filter(|cell| Some(cell.x) == first).collect();
        let mut done = 0;
        while let Some(&cell) = reached.get(done) {
            done += 1;
            for next in cell.neighbours6() {
                if room.is_free(next) && footing.can_go(&terrain, cell, next) && !reached.contains(&next) {
                    reached.push(next);
                }
            }
        }
        reached.iter().any(|cell| Some(cell.x) == last && footing.stands(&terrain, *cell))
    }

    #[test]
    fn steps_and_slopes_are_passable_for_one_body_and_not_for_another() {
        const WHEELS: (f64, f64) = (0.1, 0.35);
        const LEGS: (f64, f64) = (1.0, 0.0);
        let (flat, stairs, ramp) = ("11111111", "1111234444", "1111222333444444");
        let (kerb, ledge, pit) = ("1111122222", "1111333333", "1111011111");
        for radius_m in [0.4, 0.5] {
            for (heights, of_wheels, of_legs) in [
                (flat, true, true),
                (stairs, false, true),
                (ramp, true, true),
                (kerb, true, true),
                (ledge, false, false),
                (pit, false, true),
            ] {
                assert_eq!(passes(heights, radius_m, WHEELS), of_wheels, "{heights} on wheels, {radius_m} m");
                assert_eq!(passes(heights, radius_m, LEGS), of_legs, "{heights} on legs, {radius_m} m");
            }
        }
        assert!(passes(ledge, 0.4, (2.0, 0.0)) && !passes(ramp, 0.4, (0.9, 0.0)) && !passes(ramp, 0.4, (0.0, 0.2)));
        assert!(passes(stairs, 1.0, (1.0, 0.0)) && passes("1111111222222333333", 1.0, WHEELS));
    }

    #[test]
    fn slopes_are_measured_along_two_floors() {
        let passes = |slope_max_rad| passes("11112334556677777", 0.4, (0.0, slope_max_rad));
        // 1 in 1.5.
        assert!(passes(libm::atan(1.0 / 1.5)) && !passes(libm::atan(0.5)) && passes(FRAC_PI_4));
    }

    #[test]
    fn floor_is_what_is_known_to_be_wall() {
        struct Unknown;
        impl Ground for Unknown {
            fn is_free(&self, cell: Cell) -> bool {
                cell.z > 0
            }
            fn is_wall(&self, cell: Cell) -> bool {
                cell.x < 0 && cell.z < 0
            }
        }
        let footing = Footing::new(0.4, 1.0, Climb::new(3.0, 0.0, 1.0));
        assert_eq!(footing.above(&Unknown, Cell::new(-1, 0, 0)), Some(0));
        assert_eq!(footing.above(&Unknown, Cell::new(-1, 0, 2)), Some(2), "whatever the cell between is");
        assert_eq!(footing.above(&Unknown, Cell::new(1, 0, 2)), None);
    }

    #[test]
    fn body_stands_on_what_is_below_it() {
        for (radius_m, lowest, columns) in [(0.2, -1, 1), (0.5, -1, 1), (0.6, -2, 4), (1.0, -2, 4), (1.1, -2, 1)] {
            let footing = Footing::new(radius_m, 1.0, Climb::new(0.0, 0.0, 1.0));
            assert!(footing.under.len() == columns && footing.under.iter().all(|cell| cell.z == lowest), "{radius_m}");
            assert!(footing.sphere.iter().all(|cell| cell.z > lowest), "{radius_m} touches what it stands on");
        }
    }
}
