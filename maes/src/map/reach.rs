//! What a body of one radius reaches in a map: where it fits, and how that is connected.
//!
//! A body goes from place to place ([`BodyLattice`](voxels::BodyLattice)) along the axes, and fits
//! where no wall is nearer than its radius. `maes map check` reports these shares, and the page
//! shows these cells.

use voxels::clearance::REACH_CELLS;
use voxels::{CellSet, Clearance, Components, FACES, Grid, Terrain, free_components};

/// The places of bodies of one radius.
pub(crate) struct Reach {
    /// Free where a body fits.
    room: Grid<Terrain>,
    parts: Components,
    /// Free cells of the map.
    free: u64,
}

impl Reach {
    /// That of bodies of `radius_cells` lengths of a cell; the map has `free` free cells.
    pub(crate) fn new(clearance: &Clearance, radius_cells: f64, free: u64) -> Self {
        let room = clearance.room(radius_cells);
        let parts = free_components(&room);
        Self { room, parts, free }
    }

    /// Share of the free cells at whose places a body fits, 0 ..= 1.
    pub(crate) fn fits(&self) -> f64 {
        self.share(self.parts.sizes.iter().sum())
    }

    /// Share of the free cells in the largest connected part of those.
    pub(crate) fn reached(&self) -> f64 {
        self.share(self.parts.largest().map_or(0, |part| self.parts.sizes[part as usize]))
    }

    /// Index of a cell of that part.
    pub(crate) fn start(&self) -> Option<usize> {
        self.parts.largest().map(|part| self.parts.firsts[part as usize])
    }

    /// The cells at whose places a body fits.
    pub(crate) fn room(&self) -> &Grid<Terrain> {
        &self.room
    }

    /// The cells that bodies reach which start in these, and their share of the free cells.
    pub(crate) fn from(&self, starts: impl IntoIterator<Item = usize>) -> (CellSet, f64) {
        let extent = self.room.extent();
        let mut reached = CellSet::new(extent.volume());
        let mut open: Vec<usize> = Vec::new();
        let mut visit = |index: usize, open: &mut Vec<usize>| {
            if self.room[index] == Terrain::Free && !reached.contains(index) {
                reached.insert(index);
                open.push(index);
            }
        };
        starts.into_iter().for_each(|start| visit(start, &mut open));
        while let Some(index) = open.pop() {
            let cell = extent.cell_at(index);
            FACES.into_iter().filter_map(|face| extent.index(cell + face)).for_each(|next| visit(next, &mut open));
        }
        let share = self.share(reached.len());
        (reached, share)
    }

    fn share(&self, cells: usize) -> f64 {
        if self.free == 0 { 0.0 } else { cells as f64 / self.free as f64 }
    }
}

/// The largest radius, metres, for which distances to walls are told apart in cells of `cell_m`.
pub(crate) fn radius_max_m(cell_m: f64) -> f64 {
    f64::from(REACH_CELLS) * cell_m
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two rooms of 3 x 3 x 3 cells, with a passage of one cell between them.
    fn rooms() -> Grid<Terrain> {
        let wall = "#########\n".repeat(5);
        let room = "#########\n#...#...#\n#...#...#\n#...#...#\n#########\n";
        let door = "#########\n#...#...#\n#.......#\n#...#...#\n#########\n";
        Grid::from_text(&[&wall, room, door, room, &wall].map(|layer: &str| layer.to_owned()).join("\n")).unwrap()
    }

    #[test]
    fn a_wide_body_reaches_one_room() {
        let terrain = rooms();
        let free = mapgen::free_cells(&terrain);
        assert_eq!(free, 55);
        let reach = |radius: f64| Reach::new(&Clearance::of(&terrain), radius, free);
        let narrow = reach(0.5);
        assert_eq!((narrow.fits(), narrow.reached()), (1.0, 1.0));
        assert_eq!(narrow.from(narrow.start()).1, 1.0);
        let wide = reach(1.5);
        let in_each_room = 1.0 / 55.0;
        assert_eq!((wide.fits(), wide.reached()), (2.0 / 55.0, in_each_room));
        let centre = |x: i32| terrain.extent().index(voxels::Cell::new(x, 2, 2)).unwrap();
        let (cells, share) = wide.from([centre(6)]);
        assert!(cells.contains(centre(6)) && !cells.contains(centre(2)) && share == in_each_room);
        assert_eq!(wide.from([centre(2), centre(6)]).1, wide.fits());
        assert_eq!(wide.from([centre(4)]).1, 0.0, "no body fits there");
    }
}
