//! Lines of sight: whether walls are between two points, and how far the points can move before
//! that may change.
//!
//! Teams ask for the same pairs of points in each tick while the points move by a few hundredths of
//! a cell, so a walk ([`crate::traverse`]) also yields a *slack*, a length by which both ends can
//! move without changing the answer. If neither end of a segment moves by more than a length, none
//! of its points does (each point is a mean of the ends). So there stays
//!
//! - *no wall* while all cells within the slack of each stretch of the segment are free;
//! - *a wall* while one point of the segment is deeper inside a box of walls than the slack.
//!
//! **Rounding.** The crossings of boundaries that a walk computes are off by less than 1e-9 cells
//! on the largest map. A slack is a thousand times that below what the geometry says, so it holds
//! for what a walk answers and not only for what is true. Points far outside all maps, where
//! rounding is coarser, have no slack.

use std::ops::ControlFlow;

use nalgebra::Point3;

use crate::extent::floor;
use crate::traverse::{walk_segment, walk_stretches};
use crate::{Cell, Extent, Grid, OpenSpace, Terrain, is_wall_at};

/// By how much a slack stays below what the geometry says, cells.
pub(crate) const MARGIN_CELLS: f64 = 1e-6;

/// Points with a greater coordinate have no slack, cells.
const REACH_CELLS: f64 = 4096.0;

/// The greatest slack that is searched for along a segment near walls, cells.
const WALK_SLACK_CELLS_MAX: f64 = 0.4;

/// The least slack that is worth its search, cells.
const SLACK_CELLS_MIN: f64 = 0.05;

/// Greatest number of cells along an edge of a box of walls.
const BOX_CELLS_MAX: i32 = 8;

/// Whether the segment between two points of the map frame crosses no wall; the cells of both ends
/// count, and so does the world outside the map, which is wall. Symmetric in its two points.
///
/// ```
/// use nalgebra::Point3;
/// use voxels::{Grid, line_of_sight};
/// let world = Grid::from_text("...\n.#.\n")?;
/// let (left, right) = (Point3::new(0.5, 0.5, 0.5), Point3::new(2.5, 0.5, 0.5));
/// assert!(!line_of_sight(&world, &left, &right));
/// assert!(line_of_sight(&world, &left, &Point3::new(0.5, 1.5, 0.5)));
/// # Ok::<(), voxels::TextError>(())
/// ```
pub fn line_of_sight(terrain: &Grid<Terrain>, a: &Point3<f64>, b: &Point3<f64>) -> bool {
    let mut is_visited = false;
    let walk = walk_segment(terrain.extent(), a, b, |cell| {
        is_visited = true;
        if is_wall_at(terrain, cell) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    is_visited && walk.is_continue()
}

/// What is between two points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sight {
    /// No wall: there is a line of sight.
    Clear {
        /// There still is one after neither end has moved by more than this, metres.
        slack_m: f64,
    },
    /// This wall, perhaps among others.
    Wall(Cell),
    /// There is no segment between them: see [`walk_segment`].
    Undefined,
}

/// What the segment between two points of the map frame meets; see [`line_of_sight`].
///
/// The slack is at most `slack_cells_max` (cells), and less near walls; a greater one takes longer
/// to find, and 0 finds none. `open_space` is that of `terrain`.
pub fn sight(
    terrain: &Grid<Terrain>,
    open_space: &OpenSpace,
    a: &Point3<f64>,
    b: &Point3<f64>,
    slack_cells_max: f64,
) -> Sight {
    let extent = terrain.extent();
    let has_slack = slack_cells_max > 0.0 && is_near(extent, a) && is_near(extent, b);
    let clear = |slack_cells: f64| Sight::Clear { slack_m: (slack_cells - MARGIN_CELLS).max(0.0) * extent.cell_m() };
    if has_slack {
        let [a, b] = [a, b].map(|point| extent.in_cells(point));
        if let Some(slack_cells) = open_space.slack_cells(a, b, slack_cells_max) {
            return clear(slack_cells);
        }
    }
    let mut slack_cells = if has_slack { slack_cells_max.min(WALK_SLACK_CELLS_MAX) } else { 0.0 };
    let mut is_visited = false;
    let walk = walk_stretches(extent, a, b, |cell, stretch| {
        is_visited = true;
        if is_wall_at(terrain, cell) {
            return ControlFlow::Break(cell);
        }
        // The slack is less than the least reach.
        while slack_cells > 0.0 && open_space.reach(cell) == 0 && !is_free_around(terrain, stretch, slack_cells) {
            slack_cells /= 2.0;
            if slack_cells < SLACK_CELLS_MIN {
                slack_cells = 0.0;
            }
        }
        ControlFlow::Continue(())
    });
    match walk {
        ControlFlow::Break(wall) => Sight::Wall(wall),
        ControlFlow::Continue(()) if is_visited => clear(slack_cells),
        ControlFlow::Continue(()) => Sight::Undefined,
    }
}

fn is_near(extent: Extent, point: &Point3<f64>) -> bool {
    extent.in_cells(point).iter().all(|cells| cells.abs() <= REACH_CELLS)
}

/// Whether all cells are free that come within a distance of a stretch, along each axis.
fn is_free_around(terrain: &Grid<Terrain>, [one, other]: [[f64; 3]; 2], cells: f64) -> bool {
    let (mut low, mut high) = ([0; 3], [0; 3]);
    for axis in 0..3 {
        low[axis] = floor(one[axis].min(other[axis]) - cells);
        high[axis] = floor(one[axis].max(other[axis]) + cells);
    }
    are_all(low, high, |cell| !is_wall_at(terrain, cell))
}

/// Whether all cells of a box have a property.
fn are_all(low: [i32; 3], high: [i32; 3], has: impl Fn(Cell) -> bool) -> bool {
    for z in low[2]..=high[2] {
        for y in low[1]..=high[1] {
            for x in low[0]..=high[0] {
                if !has(Cell::new(x, y, z)) {
                    return false;
                }
            }
        }
    }
    true
}

/// A box of cells that are all wall, such as one that hides two points from each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WallBox {
    low: [i16; 3],
    high: [i16; 3],
}

impl WallBox {
    /// A box that contains a wall cell of the map or beside it, as large as it gets by growing
    /// layer by layer, up to 8 cells along each axis.
    pub fn around(terrain: &Grid<Terrain>, wall: Cell) -> Self {
        let mut low = [wall.x, wall.y, wall.z];
        let mut high = low;
        let mut can_grow = [[true; 2]; 3];
        while can_grow != [[false; 2]; 3] {
            for axis in 0..3 {
                for (side, step) in [(0, -1), (1, 1)] {
                    if !can_grow[axis][side] {
                        continue;
                    }
                    let (mut layer_low, mut layer_high) = (low, high);
                    let at = if step < 0 { low[axis] - 1 } else { high[axis] + 1 };
                    (layer_low[axis], layer_high[axis]) = (at, at);
                    can_grow[axis][side] = high[axis] - low[axis] + 1 < BOX_CELLS_MAX
                        && are_all(layer_low, layer_high, |cell| is_wall_at(terrain, cell));
                    if can_grow[axis][side] {
                        (low[axis], high[axis]) = (low[axis].min(at), high[axis].max(at));
                    }
                }
            }
        }
        // A map has at most 1024 cells along each axis.
        let clamp = |at: [i32; 3]| at.map(|at| at.clamp(-4096, 4096) as i16);
        Self { low: clamp(low), high: clamp(high) }
    }

    /// How far both of two points (metres, map frame) can move so that no line of sight between
    /// them can miss the box: metres; 0 or less says nothing.
    pub fn slack_m(&self, extent: Extent, a: &Point3<f64>, b: &Point3<f64>) -> f64 {
        if !(is_near(extent, a) && is_near(extent, b)) {
            return 0.0;
        }
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        let low = self.low.map(f64::from);
        let high = self.high.map(|cell| f64::from(cell) + 1.0);
        let [from, to] = [a, b].map(|point| extent.in_cells(point));
        for axis in 0..3 {
            let along = to[axis] - from[axis];
            if along != 0.0 {
                let (one, other) = ((low[axis] - from[axis]) / along, (high[axis] - from[axis]) / along);
                enter = enter.max(one.min(other));
                leave = leave.min(one.max(other));
            }
        }
        // The middle of the stretch in the box is deep inside, and if there is no such stretch,
        // outside.
        let middle = f64::midpoint(enter, leave).clamp(0.0, 1.0);
        let depth = |axis: usize| {
            let at = from[axis] + (to[axis] - from[axis]) * middle;
            (at - low[axis]).min(high[axis] - at)
        };
        (depth(0).min(depth(1)).min(depth(2)) - MARGIN_CELLS) * extent.cell_m()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn world(walls: &[bool], cell_m: f64) -> Grid<Terrain> {
        let cells = walls.iter().map(|&wall| if wall { Terrain::Wall } else { Terrain::Free });
        Grid::from_vec(Extent::new([6, 6, 6], cell_m).unwrap(), cells.collect()).unwrap()
    }

    #[test]
    fn a_hall_has_slack_and_a_block_hides() {
        let hall = Grid::new(Extent::new([9, 9, 9], 2.0).unwrap(), Terrain::Free);
        let open_space = OpenSpace::of(&hall);
        let at = |x: f64, y: f64| Point3::new(x, y, 9.0);
        let Sight::Clear { slack_m } = sight(&hall, &open_space, &at(5.0, 5.0), &at(12.0, 8.0), 0.4) else {
            panic!("it is empty")
        };
        assert!((slack_m - 0.8).abs() < 1e-5, "{slack_m}");
        assert_eq!(sight(&hall, &open_space, &at(5.0, 5.0), &at(12.0, 8.0), 0.0), Sight::Clear { slack_m: 0.0 });
        let rock = Grid::new(Extent::new([20, 20, 20], 2.0).unwrap(), Terrain::Wall);
        let wall = WallBox::around(&rock, Cell::new(10, 10, 10));
        let across = wall.slack_m(rock.extent(), &Point3::new(0.0, 21.0, 21.0), &Point3::new(40.0, 21.0, 21.0));
        assert!((5.0..=8.0).contains(&across), "{across}");
        assert!(wall.slack_m(rock.extent(), &Point3::new(0.0, 1.0, 1.0), &Point3::new(40.0, 1.0, 1.0)) < 0.0);
    }

    #[test]
    fn walls_and_the_world_outside_block_sight() {
        let world = Grid::from_text("...\n.#.\n...\n").unwrap();
        let sees = |a: [f64; 2], b: [f64; 2]| {
            line_of_sight(&world, &Point3::new(a[0], a[1], 0.5), &Point3::new(b[0], b[1], 0.5))
        };
        assert!(sees([0.5, 0.5], [2.5, 0.5]));
        assert!(!sees([0.5, 0.5], [2.5, 2.5]));
        assert!(!sees([0.5, 1.5], [1.5, 1.5]));
        assert!(!sees([1.5, 1.5], [1.5, 1.5]));
        assert!(sees([0.5, 1.5], [0.5, 1.5]));
        assert!(!sees([0.5, 1.5], [-0.5, 1.5]));
        assert!(!sees([0.5, f64::NAN], [0.5, 1.5]));
    }

    /// Coordinates in cells, many of them on boundaries or within rounding of them.
    fn place() -> impl Strategy<Value = [f64; 3]> {
        let snap = |(at, how): (f64, usize)| match how {
            0 => at.round(),
            1 => at.round() + 1e-12,
            2 => at.round() - 1e-7,
            3 => (2.0 * at).round() / 2.0,
            _ => at,
        };
        prop::array::uniform3((-0.5..6.5_f64, 0_usize..8).prop_map(snap))
    }

    proptest! {
        #[test]
        fn line_of_sight_is_symmetric(
            walls in prop::collection::vec(prop::bool::weighted(0.15), 216),
            a in prop::array::uniform3(-1i32..26),
            b in prop::array::uniform3(-1i32..26),
        ) {
            let extent = Extent::new([6, 6, 6], 1.0).unwrap();
            let cells = walls.iter().map(|&wall| if wall { Terrain::Wall } else { Terrain::Free });
            let world = Grid::from_vec(extent, cells.collect()).unwrap();
            // Quarters of a cell, so that many segments run along faces, edges and corners.
            let [a, b] = [a, b].map(|point| Point3::from(point.map(|quarters| f64::from(quarters) / 4.0)));
            prop_assert_eq!(line_of_sight(&world, &a, &b), line_of_sight(&world, &b, &a));
            prop_assert_eq!(line_of_sight(&world, &a, &a), !crate::is_wall_at(&world, extent.cell_of(&a)));
        }

        #[test]
        fn sight_holds_within_its_slack(
            walls in prop::collection::vec(prop::bool::weighted(0.05), 216),
            ends in [place(), place()],
            moves in [prop::array::uniform3(-1.0..1.0_f64), prop::array::uniform3(-1.0..1.0_f64)],
            slack_cells_max in prop::sample::select(vec![0.0, 0.1, 0.4, 1.5]),
            cell_m in prop::sample::select(vec![1.0, 0.3, 7.0]),
        ) {
            let world = world(&walls, cell_m);
            let [a, b] = ends.map(|end| Point3::from(end.map(|cells| cells * cell_m)));
            let is_clear = line_of_sight(&world, &a, &b);
            let (is_seen, slack_m) = match sight(&world, &OpenSpace::of(&world), &a, &b, slack_cells_max) {
                Sight::Clear { slack_m } => (true, slack_m),
                Sight::Wall(wall) => {
                    prop_assert!(is_wall_at(&world, wall));
                    let around = WallBox::around(&world, wall);
                    let slack_m = around.slack_m(world.extent(), &a, &b);
                    prop_assert!((slack_m - around.slack_m(world.extent(), &b, &a)).abs() < 1e-9);
                    (false, slack_m)
                }
                Sight::Undefined => unreachable!("the ends are near"),
            };
            prop_assert_eq!(is_seen, is_clear);
            prop_assert!(slack_m <= slack_cells_max * cell_m || !is_clear);
            if slack_m > 0.0 {
                let mut moves = moves.map(nalgebra::Vector3::from);
                // As far as allowed, and one end perhaps less.
                moves[0] *= slack_m / moves[0].norm();
                moves[1] *= slack_m / moves[1].norm().max(1.0);
                prop_assert_eq!(line_of_sight(&world, &(a + moves[0]), &(b + moves[1])), is_clear);
                prop_assert_eq!(line_of_sight(&world, &(a + moves[0]), &b), is_clear);
            }
        }

        #[test]
        fn sight_through_open_space_holds_within_its_slack(
            walls in prop::collection::vec(prop::array::uniform3(0_i32..16), 0..4),
            ends in [prop::array::uniform3(-0.5..16.5_f64), prop::array::uniform3(-0.5..16.5_f64)],
            moves in [prop::array::uniform3(-1.0..1.0_f64), prop::array::uniform3(-1.0..1.0_f64)],
            slack_cells_max in prop::sample::select(vec![0.1, 1.5, 5.0]),
        ) {
            let mut world = Grid::new(Extent::new([16; 3], 2.0).unwrap(), Terrain::Free);
            for wall in walls {
                world.set(Cell::new(wall[0], wall[1], wall[2]), Terrain::Wall);
            }
            let [a, b] = ends.map(|end| Point3::from(end.map(|cells| 2.0 * cells)));
            let is_clear = line_of_sight(&world, &a, &b);
            match sight(&world, &OpenSpace::of(&world), &a, &b, slack_cells_max) {
                Sight::Clear { slack_m } => {
                    prop_assert!(is_clear && slack_m <= 2.0 * slack_cells_max);
                    let moves = moves.map(|by| slack_m * nalgebra::Vector3::from(by).normalize());
                    prop_assert!(line_of_sight(&world, &(a + moves[0]), &(b + moves[1])));
                }
                _ => prop_assert!(!is_clear),
            }
        }

        #[test]
        fn boxes_are_all_wall(
            mut walls in prop::collection::vec(prop::bool::weighted(0.8), 216),
            index in 0_usize..216,
        ) {
            walls[index] = true;
            let world = world(&walls, 1.0);
            let cell = world.extent().cell_at(index);
            let WallBox { low, high } = WallBox::around(&world, cell);
            let all = are_all(low.map(i32::from), high.map(i32::from), |cell| is_wall_at(&world, cell));
            prop_assert!(all && (0..3).all(|axis| high[axis] - low[axis] < BOX_CELLS_MAX as i16));
        }
    }
}
