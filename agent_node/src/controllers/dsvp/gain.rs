//! The gain of a viewpoint: the unexplored cells that it would see, by ray casting in the agent's
//! own map.
//!
//! A ray from the centre of a cell passes through free cells and counts the unexplored cells it
//! meets, up to a depth, because behind the first ones there is usually rock; it ends at a wall and
//! at its range. A cell counts once for a viewpoint, however many rays meet it, and for less if it
//! is beside known walls ([`Likelihood`]).

use std::ops::ControlFlow;

use nalgebra::Point3;
use voxels::{Cell, Extent, lattice, walk};

use crate::exploration_map::{CellState, ExplorationMap};

/// How much an unexplored cell counts, by the number of known walls beside it: surfaces are smooth,
/// so what is beside a wall is mostly wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::controllers) struct Likelihood {
    /// By the number of known walls among the six neighbours, in units of 1 / [`WHOLE`]; `None`:
    /// all cells count alike.
    by_walls: Option<[u32; 7]>,
}

/// What a cell without known walls beside it counts.
pub(in crate::controllers) const WHOLE: u32 = 256;

impl Likelihood {
    /// Each known wall beside a cell multiplies what it counts by `beside_wall`.
    pub(in crate::controllers) fn new(beside_wall: f64) -> Self {
        let mut factor = 1.0;
        let by_walls = [0; 7].map(|_: u32| {
            let counts = (f64::from(WHOLE) * factor).round() as u32;
            factor *= beside_wall;
            counts
        });
        Self { by_walls: (beside_wall < 1.0).then_some(by_walls) }
    }

    /// What an unexplored cell counts.
    pub(in crate::controllers) fn of(self, map: &ExplorationMap, cell: Cell) -> u32 {
        let Some(by_walls) = self.by_walls else { return WHOLE };
        by_walls[cell.neighbours6().into_iter().filter(|&beside| map.state(beside) == CellState::Wall).count()]
    }
}

/// Estimates the gain of viewpoints.
#[derive(Debug, Clone)]
pub(in crate::controllers) struct GainEstimator {
    /// The cells of all rays relative to the viewpoint, ray by ray, nearest first.
    cells: Vec<Cell>,
    /// End index of each ray.
    ends: Vec<u32>,
    /// Most unexplored cells that one ray counts.
    depth: u32,
    likelihood: Likelihood,
    /// Half the side of the cube that contains all rays, cells.
    reach: i32,
    /// For each cell of that cube, the viewpoint that last counted it.
    counted: Vec<u32>,
    viewpoint: u32,
}

impl GainEstimator {
    /// Rays in all directions, `range_cells` long.
    pub(in crate::controllers) fn new(rays: u32, range_cells: f64, depth: u32, likelihood: Likelihood) -> Self {
        let reach = range_cells.ceil().max(1.0) as i32;
        let side = (2 * reach + 1) as u32;
        let cube = Extent::new([side; 3], 1.0).expect("the range is bounded by the settings");
        let home = Cell::new(reach, reach, reach);
        let mut cells = Vec::new();
        let mut ends = Vec::new();
        for ray in 0..rays {
            let centre: Point3<f64> = cube.centre(home);
            let _: ControlFlow<()> = walk(cube, &centre, &lattice::direction(ray, rays), range_cells, |cell, _| {
                if cell != home {
                    cells.push(cell - home);
                }
                ControlFlow::Continue(())
            });
            ends.push(cells.len() as u32);
        }
        Self { cells, ends, depth, likelihood, reach, counted: vec![0; cube.volume()], viewpoint: 0 }
    }

    /// The unexplored cells visible from the centre of a cell, each by its likelihood to be free.
    pub(in crate::controllers) fn gain(&mut self, map: &ExplorationMap, viewpoint: Cell) -> u32 {
        self.viewpoint += 1;
        let side = 2 * self.reach + 1;
        let mut gain = 0;
        let mut start = 0;
        for &end in &self.ends {
            let mut unexplored = 0;
            for &by in &self.cells[start..end as usize] {
                match map.state(viewpoint + by) {
                    CellState::Wall => break,
                    CellState::Free | CellState::Covered => {}
                    CellState::Unexplored => {
                        let place = ((by.z + self.reach) * side + by.y + self.reach) * side + by.x + self.reach;
                        let counted = &mut self.counted[place as usize];
                        if *counted != self.viewpoint {
                            *counted = self.viewpoint;
                            gain += self.likelihood.of(map, viewpoint + by);
                        }
                        unexplored += 1;
                        if unexplored == self.depth {
                            break;
                        }
                    }
                }
            }
            start = end as usize;
        }
        gain / WHOLE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALIKE: Likelihood = Likelihood { by_walls: None };

    /// A corridor along x, known from x = 1 to x = 8, with walls all around.
    fn corridor() -> ExplorationMap {
        let extent = Extent::new([20, 3, 3], 1.0).unwrap();
        let mut map = ExplorationMap::new(extent);
        for x in 0..20 {
            for (y, z) in (0..3).flat_map(|y| (0..3).map(move |z| (y, z))) {
                let index = [extent.index(Cell::new(x, y, z)).unwrap() as u32];
                if (y, z) != (1, 1) || x == 0 {
                    map.note_wall(&index);
                } else if x <= 8 {
                    map.note_free(&index);
                }
            }
        }
        map
    }

    #[test]
    fn gain_is_limited_by_range_and_depth() {
        let map = corridor();
        let gain = |range, depth, x| GainEstimator::new(2000, range, depth, ALIKE).gain(&map, Cell::new(x, 1, 1));
        assert_eq!(gain(5.0, 9, 8), 5);
        assert_eq!(gain(5.0, 2, 8), 2);
        assert_eq!(gain(5.0, 9, 5), 2);
        assert_eq!(gain(5.0, 9, 2), 0);
    }

    #[test]
    fn cells_beside_walls_count_less() {
        let map = corridor();
        let ahead = Cell::new(9, 1, 1);
        // Four walls beside the cell at the end of the corridor.
        let of = |beside_wall| Likelihood::new(beside_wall).of(&map, ahead);
        assert_eq!([of(1.0), of(0.5), of(0.1)], [WHOLE, WHOLE / 16, 0]);
        let empty = ExplorationMap::new(Extent::new([21; 3], 1.0).unwrap());
        assert_eq!(Likelihood::new(0.1).of(&empty, Cell::new(10, 10, 10)), WHOLE);
        let gain =
            |beside_wall| GainEstimator::new(2000, 5.0, 9, Likelihood::new(beside_wall)).gain(&map, Cell::new(8, 1, 1));
        assert_eq!([gain(1.0), gain(0.9), gain(0.1)], [5, 3, 0]);
    }

    #[test]
    fn walls_block_rays_and_cells_count_once() {
        let mut map = corridor();
        let wall = map.extent().index(Cell::new(9, 1, 1)).unwrap() as u32;
        map.note_wall(&[wall]);
        let mut gain_estimator = GainEstimator::new(500, 8.0, 8, ALIKE);
        assert_eq!(gain_estimator.gain(&map, Cell::new(8, 1, 1)), 0);
        let empty = ExplorationMap::new(Extent::new([21; 3], 1.0).unwrap());
        let mut gain_estimator = GainEstimator::new(5000, 3.0, 9, ALIKE);
        // All cells within 3 cells of the viewpoint, up to some at the edge.
        let all = gain_estimator.gain(&empty, Cell::new(10, 10, 10));
        assert!((100..260).contains(&all), "{all}");
        assert_eq!(gain_estimator.gain(&empty, Cell::new(10, 10, 10)), all);
    }
}
