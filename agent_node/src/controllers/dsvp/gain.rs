//! The gain of a viewpoint: the unexplored cells that it would see, by ray casting in the agent's
//! own map.
//!
//! A ray from the centre of a cell passes through free cells and counts the unexplored cells it
//! meets, up to a depth, because behind the first ones there is usually rock; it ends at a wall and
//! at its range. A cell counts once for a viewpoint, however many rays meet it.

use std::ops::ControlFlow;

use nalgebra::Point3;
use voxels::{Cell, Extent, lattice, walk};

use crate::exploration_map::{CellState, ExplorationMap};

/// Estimates the gain of viewpoints.
#[derive(Debug, Clone)]
pub(in crate::controllers) struct GainEstimator {
    /// The cells of all rays relative to the viewpoint, ray by ray, nearest first.
    cells: Vec<Cell>,
    /// End index of each ray.
    ends: Vec<u32>,
    /// Most unexplored cells that one ray counts.
    depth: u32,
    /// Half the side of the cube that contains all rays, cells.
    reach: i32,
    /// For each cell of that cube, the viewpoint that last counted it.
    counted: Vec<u32>,
    viewpoint: u32,
}

impl GainEstimator {
    /// Rays in all directions, `range_cells` long.
    pub(in crate::controllers) fn new(rays: u32, range_cells: f64, depth: u32) -> Self {
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
        Self { cells, ends, depth, reach, counted: vec![0; cube.volume()], viewpoint: 0 }
    }

    /// The unexplored cells visible from the centre of a cell.
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
                        gain += u32::from(*counted != self.viewpoint);
                        *counted = self.viewpoint;
                        unexplored += 1;
                        if unexplored == self.depth {
                            break;
                        }
                    }
                }
            }
            start = end as usize;
        }
        gain
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let gain = |range, depth, x| GainEstimator::new(2000, range, depth).gain(&map, Cell::new(x, 1, 1));
        assert_eq!(gain(5.0, 9, 8), 5);
        assert_eq!(gain(5.0, 2, 8), 2);
        assert_eq!(gain(5.0, 9, 5), 2);
        assert_eq!(gain(5.0, 9, 2), 0);
    }

    #[test]
    fn walls_block_rays_and_cells_count_once() {
        let mut map = corridor();
        let wall = map.extent().index(Cell::new(9, 1, 1)).unwrap() as u32;
        map.note_wall(&[wall]);
        let mut gain_estimator = GainEstimator::new(500, 8.0, 8);
        assert_eq!(gain_estimator.gain(&map, Cell::new(8, 1, 1)), 0);
        let empty = ExplorationMap::new(Extent::new([21; 3], 1.0).unwrap());
        let mut gain_estimator = GainEstimator::new(5000, 3.0, 9);
        // All cells within 3 cells of the viewpoint, up to some at the edge.
        let all = gain_estimator.gain(&empty, Cell::new(10, 10, 10));
        assert!((100..260).contains(&all), "{all}");
        assert_eq!(gain_estimator.gain(&empty, Cell::new(10, 10, 10)), all);
    }
}
