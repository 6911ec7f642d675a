//! A time that no team can beat.
//!
//! Three arguments, each of which holds for every controller; the bound is the latest of them.
//!
//! - *Distance.* The path of a body to the place where it sees a cell, and the ray from there, lie
//!   in free space, and the ray is at most as long as the range of the LiDAR. So their length is at
//!   least the distance of the cell from the start, through free space, and the body needs the time
//!   for what is left of it after one range. A share of the free cells takes at least as long as
//!   its nearest cells.
//! - *Volume.* A body that moves by a metre gets at most the cross-section of its range times a
//!   metre of new volume into range.
//! - *Occlusion*, for all free cells only. A far cell is seen only from cells from which a straight
//!   line may lead to it through free space, whatever the range. The nearest of these takes its
//!   time.
//!
//! Distances are underestimated, never overestimated: the greater of the straight distance and the
//! number of steps between cells that share at least a corner, less one. Turns, accelerations and
//! other bodies are left out.

use nalgebra::Point3;
use voxels::{Cell, Grid, Terrain};
use world::World;

use crate::rows::Marks;
use msgs::ids::Tick;

/// Far cells of the third argument.
const FAR_CELLS: usize = 16;

/// Cells from which each of them is looked for, nearest to the team first. If it is seen from none
/// of these, it takes the time to the last of them.
const TESTS_MAX: usize = 40_000;

/// Least distance between two of them along some axis, cells.
const FAR_APART: i32 = 4;

/// A leg of a path ends exactly on its waypoint, from at most this far, m.
const SNAP_M: f64 = 1e-3;

/// Rounding errors of a sum of times are below this, s.
const ROUNDING_S: f64 = 1e-9;

/// The bound for a world at the start of a run.
pub(super) fn of(world: &World) -> Marks {
    let terrain = world.terrain();
    let cell_m = terrain.extent().cell_m();
    let range_m = world.agents().map(|agent| world.sensors(agent).greatest_range_m(cell_m)).fold(0.0, f64::max);
    let team: Vec<(Point3<f64>, f64)> = world
        .agents()
        .map(|agent| {
            let body = world.body(agent);
            (body.pose().position, greatest_speed_m_s(body.model()))
        })
        .collect();
    let Earliest { arrivals_s: arrivals, views_s } = Earliest::of(terrain, &team, range_m);
    let free = terrain.as_slice().iter().zip(&views_s).filter(|(kind, _)| **kind == Terrain::Free);
    let mut seen_s: Vec<f64> = free.map(|(_, time_s)| *time_s).collect();
    seen_s.sort_by(f64::total_cmp);
    let volume = Volume::of(terrain, &team, range_m);
    let mark = |permille: usize| {
        let cells = (seen_s.len() * permille).div_ceil(1000);
        let by_distance = cells.checked_sub(1).map_or(0.0, |last| seen_s[last]);
        by_distance.max(volume.time_s(cells as f64))
    };
    let all_s = mark(1000).max(occluded_s(terrain, &arrivals));
    let [t90_s, t99_s, t100_s] =
        [mark(900), mark(990), all_s].map(|time_s| time_s.is_finite().then(|| at_a_tick(time_s)));
    Marks { t90_s, t99_s, t100_s }
}

/// The first tick at or after a time, s: things are seen at ticks.
fn at_a_tick(time_s: f64) -> f64 {
    libm::ceil((time_s - ROUNDING_S).max(0.0) / Tick::TICK_S) / (1e9 / Tick::TICK_NS as f64)
}

/// No body covers more than this in a second. The end of a leg may add a step that is no motion,
/// which its start from rest outweighs unless the body accelerates at once.
fn greatest_speed_m_s(body: &protocol::body_model::BodyModel) -> f64 {
    let snap_m_s = SNAP_M / Tick::TICK_S;
    let first_m_s = body.acceleration_m_s2.max(body.deceleration_m_s2) * Tick::TICK_S;
    body.speed_max_m_s + if first_m_s + snap_m_s <= body.speed_max_m_s { 0.0 } else { snap_m_s }
}

/// Times before which something cannot be, s, by cell index; infinite in walls and where no body
/// can get.
struct Earliest {
    /// The centre of a body is in the cell.
    arrivals_s: Vec<f64>,
    /// The cell is seen, according to the first argument.
    views_s: Vec<f64>,
}

impl Earliest {
    /// For a team of start points with their speeds, m/s, and LiDARs of this range.
    fn of(terrain: &Grid<Terrain>, team: &[(Point3<f64>, f64)], range_m: f64) -> Self {
        let extent = terrain.extent();
        let cell_m = extent.cell_m();
        let mut earliest =
            Self { arrivals_s: vec![f64::INFINITY; extent.volume()], views_s: vec![f64::INFINITY; extent.volume()] };
        for (start, speed_m_s) in team {
            let mut steps = vec![u32::MAX; extent.volume()];
            let Some(first) = extent.index(extent.cell_of(start)) else { continue };
            steps[first] = 0;
            let (mut layer, mut next) = (vec![first], Vec::new());
            while !layer.is_empty() {
                for &index in &layer {
                    let cell = extent.cell_at(index);
                    // A path within one cell of length meets cells that share a corner at most.
                    let crossed_m = f64::from(steps[index].saturating_sub(1)) * cell_m;
                    let path_m = crossed_m.max(distance_m(start, cell, cell_m));
                    // Each by its own speed: the first to see a cell may be a slow body near by.
                    let (arrival_s, view_s) = (path_m / speed_m_s, (path_m - range_m).max(0.0) / speed_m_s);
                    earliest.arrivals_s[index] = earliest.arrivals_s[index].min(arrival_s);
                    earliest.views_s[index] = earliest.views_s[index].min(view_s);
                    for near in cell.neighbours26() {
                        if let Some(place) = extent.index(near)
                            && terrain.as_slice()[place] == Terrain::Free
                            && steps[place] == u32::MAX
                        {
                            steps[place] = steps[index] + 1;
                            next.push(place);
                        }
                    }
                }
                layer.clear();
                std::mem::swap(&mut layer, &mut next);
            }
        }
        earliest
    }
}

/// The distance of a point from the nearest point of a cell, m.
fn distance_m(point: &Point3<f64>, cell: Cell, cell_m: f64) -> f64 {
    let low = [cell.x, cell.y, cell.z].map(|along| f64::from(along) * cell_m);
    let apart = |axis: usize| (low[axis] - point[axis]).max(point[axis] - low[axis] - cell_m).max(0.0);
    let [x, y, z] = [apart(0), apart(1), apart(2)];
    (x * x + y * y + z * z).sqrt()
}

/// The second argument: cells in range at the start, and at most so many more in a second.
struct Volume {
    at_start: f64,
    per_s: f64,
}

impl Volume {
    fn of(terrain: &Grid<Terrain>, team: &[(Point3<f64>, f64)], range_m: f64) -> Self {
        if !range_m.is_finite() {
            return Self { at_start: f64::INFINITY, per_s: 0.0 };
        }
        let cell_m = terrain.extent().cell_m();
        // A cell of which a part is in range lies within this distance as a whole.
        let outer_m = range_m + 3.0_f64.sqrt() * cell_m;
        let pi = std::f64::consts::PI;
        let rim = 4.0 / 3.0 * pi * (outer_m.powi(3) - range_m.powi(3)) / cell_m.powi(3);
        let mut volume = Self { at_start: 0.0, per_s: 0.0 };
        for (start, speed_m_s) in team {
            let is_near =
                |&(cell, kind): &(Cell, &Terrain)| *kind == Terrain::Free && distance_m(start, cell, cell_m) <= range_m;
            volume.at_start += terrain.iter().filter(is_near).count() as f64 + rim;
            volume.per_s += pi * outer_m * outer_m * speed_m_s / cell_m.powi(3);
        }
        volume
    }

    /// Before this time fewer cells are seen, s.
    fn time_s(&self, cells: f64) -> f64 {
        if cells <= self.at_start { 0.0 } else { (cells - self.at_start) / self.per_s }
    }
}

/// The third argument.
fn occluded_s(terrain: &Grid<Terrain>, arrivals: &[f64]) -> f64 {
    let extent = terrain.extent();
    let mut reached: Vec<usize> = (0..arrivals.len()).filter(|&index| arrivals[index].is_finite()).collect();
    reached.sort_by(|&one, &other| arrivals[one].total_cmp(&arrivals[other]).then(one.cmp(&other)));
    let mut far: Vec<Cell> = Vec::new();
    let mut latest = 0.0_f64;
    for &index in reached.iter().rev() {
        if far.len() == FAR_CELLS || arrivals[index] <= latest {
            break;
        }
        let cell = extent.cell_at(index);
        let is_apart = |other: &Cell| {
            let apart = cell - *other;
            [apart.x, apart.y, apart.z].iter().any(|along| along.abs() >= FAR_APART)
        };
        if far.iter().all(is_apart) {
            far.push(cell);
            // From the far cell, which lies in a nook: most lines end near it.
            let sees = |&place: &usize| may_see(terrain, cell, extent.cell_at(place));
            let tested = &reached[..reached.len().min(TESTS_MAX)];
            let first = tested.iter().copied().find(sees).or(tested.last().copied());
            latest = latest.max(first.map_or(0.0, |place| arrivals[place]));
        }
    }
    latest
}

/// Whether a straight line may lead from a point of one free cell to a point of another through
/// free cells. It says yes too often, never too seldom.
///
/// All these lines lie in the cell moved along the offset of the two. Layer by layer across the
/// longest axis of the offset, the free cells of this shaft are reached from those of the layer
/// before that share at least a corner with them, and from each other.
fn may_see(terrain: &Grid<Terrain>, from: Cell, to: Cell) -> bool {
    let (a, b) = ([from.x, from.y, from.z], [to.x, to.y, to.z]);
    let offset = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
    let axis = (0..3).max_by_key(|&axis| offset[axis].abs()).unwrap_or(0);
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let layers = offset[axis].abs();
    let mut reached = Patch { first: [a[u], a[v]], cells: Patch::MIDDLE };
    for layer in 0..=layers {
        // Of the way from one cell to the other, the part whose box touches this layer.
        let part = [layer - 1, layer + 1].map(|at| f64::from(at.clamp(0, layers)) / f64::from(layers.max(1)));
        let range = |across: usize| {
            let ends = part.map(|along| along * f64::from(offset[across]));
            let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
            // Rounded outwards by more than the error of the sum.
            (a[across] + libm::floor(low - 1e-9) as i32, a[across] + libm::floor(high + 1.0 + 1e-9) as i32)
        };
        let (rows, columns) = (range(u), range(v));
        let mut free = Patch { first: [rows.0, columns.0], cells: 0 };
        for row in rows.0..=rows.1 {
            for column in columns.0..=columns.1 {
                let mut cell = [0; 3];
                (cell[axis], cell[u], cell[v]) = (a[axis] + layer * offset[axis].signum(), row, column);
                if terrain.get(Cell::new(cell[0], cell[1], cell[2])) == Some(&Terrain::Free) {
                    free.cells |= free.bit([row, column]);
                }
            }
        }
        let mut here = reached.moved(free.first);
        loop {
            let grown = here.grown() & free.cells;
            if grown == here.cells {
                break;
            }
            here.cells = grown;
        }
        if here.cells == 0 {
            return false;
        }
        reached = here;
    }
    reached.cells & reached.bit([b[u], b[v]]) != 0
}

/// Some cells of a layer, as bits of eight rows of eight. A shaft is five cells wide at most: the
/// offset changes by two cells at most while the box touches a layer, and the box and the rounding
/// add one each. So a row and a column are left free on every side.
struct Patch {
    /// Row and column of the cell at bit (1, 1).
    first: [i32; 2],
    cells: u64,
}

impl Patch {
    const SIDE: i32 = 8;
    /// The cell at `first`.
    const MIDDLE: u64 = 1 << 9;

    /// The bit of a cell, 0 if it is outside.
    fn bit(&self, cell: [i32; 2]) -> u64 {
        let [row, column] = [cell[0] - self.first[0] + 1, cell[1] - self.first[1] + 1];
        let is_inside = (0..Self::SIDE).contains(&row) && (0..Self::SIDE).contains(&column);
        if is_inside { 1 << (row * Self::SIDE + column) } else { 0 }
    }

    /// The same cells with another first one; those outside are left out.
    fn moved(&self, first: [i32; 2]) -> Self {
        let mut moved = Self { first, cells: 0 };
        let mut left = self.cells;
        while left != 0 {
            let at = left.trailing_zeros() as i32;
            let cell = [at / Self::SIDE + self.first[0] - 1, at % Self::SIDE + self.first[1] - 1];
            moved.cells |= moved.bit(cell);
            left &= left - 1;
        }
        moved
    }

    /// The cells and those that share at least a corner with one of them.
    fn grown(&self) -> u64 {
        const FIRST_COLUMN: u64 = 0x0101_0101_0101_0101;
        let cells = self.cells;
        let wide = cells | ((cells << 1) & !FIRST_COLUMN) | ((cells >> 1) & !(FIRST_COLUMN << 7));
        wide | (wide << 8) | (wide >> 8)
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use rand::RngExt;
    use voxels::Extent;

    /// One layer of free cells from a drawing, between two of wall.
    fn layer(rows: &[&str]) -> Grid<Terrain> {
        let size = [rows[0].len() as u32, rows.len() as u32, 3];
        let mut terrain = Grid::new(Extent::new(size, 1.0).unwrap(), Terrain::Wall);
        for (y, row) in (0..).zip(rows) {
            for (x, _) in (0..).zip(row.chars()).filter(|(_, character)| *character != '#') {
                terrain.set(Cell::new(x, y, 1), Terrain::Free);
            }
        }
        terrain
    }

    #[test]
    fn lines_of_sight_end_at_walls() {
        let terrain = layer(&["##########", "#....#...#", "#.##.#.#.#", "#.##...#.#", "##########"]);
        let sees = |a: (i32, i32), b: (i32, i32)| {
            let [one, other] = [a, b].map(|(x, y)| Cell::new(x, y, 1));
            assert_eq!(may_see(&terrain, one, other), may_see(&terrain, other, one));
            may_see(&terrain, one, other)
        };
        assert!(sees((1, 1), (4, 1)) && sees((1, 1), (1, 3)) && sees((1, 1), (1, 1)));
        assert!(!sees((1, 3), (4, 3)) && !sees((1, 1), (6, 1)) && !sees((1, 1), (8, 3)));
    }

    /// Rays of LiDARs, also such as run along the sides of cells and through their corners.
    #[test]
    fn whatever_a_ray_sees_is_in_line_of_sight() {
        let extent = Extent::new([14, 11, 12], 1.0).unwrap();
        let mut seen = 0;
        for instance in 0..400 {
            let mut random = voxels::random_streams::stream(instance, 0, "rays");
            let mut terrain = Grid::new(extent, Terrain::Free);
            for index in 0..extent.volume() {
                if random.random_range(0..4) == 0 {
                    terrain.set(extent.cell_at(index), Terrain::Wall);
                }
            }
            for _ in 0..20 {
                let mut at = |cells: i32| f64::from(random.random_range(0..4 * cells)) / 4.0;
                let (origin, goal) = (Point3::new(at(14), at(11), at(12)), Point3::new(at(14), at(11), at(12)));
                let from = extent.cell_of(&origin);
                let _ = voxels::walk(extent, &origin, &(goal - origin), 1.0, |cell, _| {
                    if terrain.get(cell) != Some(&Terrain::Free) {
                        return ControlFlow::Break(());
                    }
                    assert!(
                        may_see(&terrain, from, cell) && may_see(&terrain, cell, from),
                        "{origin} to {goal}: {cell:?}"
                    );
                    seen += 1;
                    ControlFlow::Continue(())
                });
            }
        }
        assert!(seen > 10_000, "{seen}");
    }

    #[test]
    fn corridor_takes_the_time_to_its_end() {
        // A corridor round two corners: 8 cells, 2 cells, 8 cells.
        let terrain = layer(&["##########", "#........#", "########.#", "#........#", "##########"]);
        let arrivals = Earliest::of(&terrain, &[(Point3::new(1.5, 1.5, 1.5), 2.0)], f64::INFINITY).arrivals_s;
        let at = |x, y| arrivals[terrain.extent().index(Cell::new(x, y, 1)).unwrap()];
        assert_eq!((at(1, 1), at(8, 1)), (0.0, 3.25), "straight: 6.5 m at 2 m/s");
        // Cells that share a corner are neighbours: 14 steps.
        assert!(at(1, 3) > 6.0 && at(1, 3) <= 16.0 / 2.0);
        assert!(at(0, 0).is_infinite());
        // The far end is seen from the corner cell before it at the earliest.
        let latest = occluded_s(&terrain, &arrivals);
        assert!(latest >= at(7, 2).min(at(8, 2)) && latest <= at(8, 3), "{latest}");
    }

    #[test]
    fn slow_bodies_see_as_far_as_fast_ones() {
        let terrain = layer(&["############", "#..........#", "############"]);
        let (slow, fast) = ((Point3::new(7.5, 1.5, 1.5), 0.5), (Point3::new(1.5, 1.5, 1.5), 10.0));
        let views = Earliest::of(&terrain, &[slow, fast], 3.0).views_s;
        let at = |x| views[terrain.extent().index(Cell::new(x, 1, 1)).unwrap()];
        // In range of the slow one at the start, which takes 5 s to get there; the fast one 0.8 s.
        assert_eq!((at(2), at(10)), (0.0, 0.0));
        let alone = Earliest::of(&terrain, &[slow], 2.0).views_s;
        assert_eq!(
            alone[terrain.extent().index(Cell::new(10, 1, 1)).unwrap()],
            1.0,
            "2.5 m away, of which 0.5 m at 0.5 m/s"
        );
    }

    #[test]
    fn volume_grows_with_speed_and_team() {
        let terrain = layer(&["##########", "#........#", "#........#", "##########"]);
        let start = Point3::new(1.5, 1.5, 1.5);
        let one = Volume::of(&terrain, &[(start, 1.0)], 2.0);
        let two = Volume::of(&terrain, &[(start, 1.0), (start, 1.0)], 2.0);
        assert_eq!((2.0 * one.per_s, 2.0 * one.at_start), (two.per_s, two.at_start));
        assert!(one.time_s(1e6) > two.time_s(1e6) && one.time_s(one.at_start) == 0.0);
        assert_eq!(Volume::of(&terrain, &[(start, 1.0)], f64::INFINITY).time_s(1e9), 0.0);
    }
}
