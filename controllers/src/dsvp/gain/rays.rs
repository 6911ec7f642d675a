//! The rays of a viewpoint: the cells that each one passes, relative to the viewpoint.
//!
//! The tables depend on a few numbers alone, and all agents of a process share them: a hundred
//! thousand bytes that each agent would otherwise bring into the cache.
//!
//! Invariant: every cell lies within [`Pattern::reach`] of the viewpoint along each axis.

use std::ops::{ControlFlow, Range};
use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};

use agent::observation::FieldOfView;
use voxels::{BodyLattice, Cell, Extent, lattice, walk};

/// The rays of one pattern on maps of one size.
#[derive(Debug)]
pub(super) struct Rays {
    pattern: Pattern,
    map_size: [u32; 3],
    /// The cells of all rays, ray by ray, nearest first; without that of the viewpoint.
    pub(super) cells: Vec<RayCell>,
    /// By how much the index of each of them in the map differs from that of the viewpoint: apart
    /// from the rest, since it is all that is read of most of them.
    pub(super) offsets: Vec<i32>,
    /// End of each ray.
    pub(super) ends: Vec<u32>,
    /// Cells of the cube around the viewpoint.
    pub(super) cube_cells: usize,
    /// See [`Rays::through`].
    through: OnceLock<Vec<(u32, u32)>>,
}

/// Directions spread evenly ([`lattice`]), and the length of rays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pattern {
    /// Where the rays begin in the cell of the viewpoint.
    pub(super) from: BodyLattice,
    pub(super) rays: u32,
    pub(super) range_cells: f64,
    /// What some heading brings into view; `None`: all directions.
    pub(super) view: Option<FieldOfView>,
}

/// A cell on a ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct RayCell {
    /// Relative to the viewpoint.
    pub(super) by: Cell,
    /// Its index in the cube around the viewpoint.
    pub(super) place: u32,
}

/// All tables in use.
static SHARED: Mutex<Vec<Weak<Rays>>> = Mutex::new(Vec::new());

impl Pattern {
    /// Half the side of the cube that contains all rays, cells.
    fn reach(self) -> i32 {
        self.range_cells.ceil().max(1.0) as i32
    }

    /// The cube that contains all rays; the viewpoint is its middle.
    fn cube(self) -> Extent {
        let side = (2 * self.reach() + 1).cast_unsigned();
        Extent::new([side; 3], 1.0).expect("the range is bounded by the settings")
    }
}

impl Rays {
    /// The tables of a pattern for maps of this size.
    pub(super) fn shared(pattern: Pattern, map_size: [u32; 3]) -> Arc<Self> {
        let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
        shared.retain(|rays| rays.strong_count() > 0);
        let present = shared.iter().filter_map(Weak::upgrade).find(|rays| rays.fits(pattern, map_size));
        present.unwrap_or_else(|| {
            let rays = Arc::new(Self::new(pattern, map_size));
            shared.push(Arc::downgrade(&rays));
            rays
        })
    }

    /// Whether these are the rays of a pattern for maps of this size.
    pub(super) fn fits(&self, pattern: Pattern, map_size: [u32; 3]) -> bool {
        self.pattern == pattern && self.map_size == map_size
    }

    fn new(pattern: Pattern, map_size: [u32; 3]) -> Self {
        let cube = pattern.cube();
        let reach = pattern.reach();
        let home = Cell::new(reach, reach, reach);
        let [size_x, size_y, _] = map_size.map(|cells| cells as i32);
        let from = pattern.from.place(cube, home);
        let (mut cells, mut offsets) = (Vec::new(), Vec::new());
        let mut ends = Vec::new();
        for ray in 0..pattern.rays {
            let direction = lattice::direction(ray, pattern.rays);
            if pattern.view.is_some_and(|view| !view.holds(&direction)) {
                continue;
            }
            let _: ControlFlow<()> = walk(cube, &from, &direction, pattern.range_cells, |cell, _| {
                if cell != home {
                    let by = cell - home;
                    let place = cube.index(cell).expect("the cube contains all rays") as u32;
                    cells.push(RayCell { by, place });
                    offsets.push((by.z * size_y + by.y) * size_x + by.x);
                }
                ControlFlow::Continue(())
            });
            ends.push(cells.len() as u32);
        }
        Self { pattern, map_size, cells, offsets, ends, cube_cells: cube.volume(), through: OnceLock::new() }
    }

    /// Half the side of the cube that contains all rays, cells.
    pub(super) fn reach(&self) -> i32 {
        self.pattern.reach()
    }

    /// The places of the cells of a ray among those of all rays.
    pub(super) fn places(&self, number: u32) -> Range<usize> {
        let start = number.checked_sub(1).map_or(0, |before| self.ends[before as usize]);
        start as usize..self.ends[number as usize] as usize
    }

    /// The cells of a ray.
    pub(super) fn ray(&self, number: u32) -> &[RayCell] {
        &self.cells[self.places(number)]
    }

    /// The numbers of the rays that pass a cell of the cube, relative to the viewpoint, ascending.
    pub(super) fn through(&self, by: Cell) -> impl Iterator<Item = u32> + '_ {
        let through = self.through.get_or_init(|| {
            let rays = (0..self.ends.len() as u32).flat_map(|ray| self.ray(ray).iter().map(move |at| (at.place, ray)));
            let mut through: Vec<(u32, u32)> = rays.collect();
            through.sort_unstable();
            through
        });
        let reach = self.reach();
        let place = self.pattern.cube().index(by + Cell::new(reach, reach, reach)).unwrap_or(usize::MAX);
        let first = through.partition_point(|&(at, _)| (at as usize) < place);
        through[first..].iter().take_while(move |&&(at, _)| at as usize == place).map(|&(_, ray)| ray)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_shared_while_they_are_in_use() {
        let pattern = Pattern { from: BodyLattice::Centres, rays: 30, range_cells: 4.5, view: None };
        let rays = Rays::shared(pattern, [40, 30, 20]);
        assert!(Arc::ptr_eq(&rays, &Rays::shared(pattern, [40, 30, 20])));
        assert!(!Arc::ptr_eq(&rays, &Rays::shared(pattern, [40, 20, 30])));
        let view =
            FieldOfView { horizontal_rad: 1.0, lowest_rad: -0.1, highest_rad: 0.1, spacing_rad: 0.1, min_range_m: 0.0 };
        let level = Rays::shared(Pattern { view: Some(view), ..pattern }, [40, 30, 20]);
        assert!(level.cells.len() < rays.cells.len() / 5 && level.cells.iter().all(|cell| cell.by.z == 0));
        for (cell, &offset) in rays.cells.iter().zip(&rays.offsets) {
            assert_eq!(offset, (cell.by.z * 30 + cell.by.y) * 40 + cell.by.x);
        }
    }
}
