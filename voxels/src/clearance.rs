//! Distances from the places of bodies ([`BodyLattice`]) to the nearest wall, and the passages
//! between large parts of free space.
//!
//! The distance to a cell that is a box is separable: along an axis, boxes `n` cells away from a
//! centre are `2 n - 1` half cells away, and those beside it none; from the lowest corner of a cell
//! those `n` cells above are `2 n` half cells away and those below `2 n - 2`. A body whose centre
//! goes from place to place along an axis is never nearer to a wall than at one of the two. Outside
//! the map all is wall.

use crate::{BodyLattice, Cell, FACES, Grid, Terrain};

/// Distance beyond which distances are not distinguished, in cells.
pub const REACH_CELLS: i32 = 16;

/// The square of a distance of [`REACH_CELLS`] or more, in half cells.
const FAR: u16 = (2 * REACH_CELLS as u16).pow(2);

/// Distances to walls.
#[derive(Clone, Debug, PartialEq)]
pub struct Clearance {
    lattice: BodyLattice,
    /// Squares of the distances, in half cells; 0 for wall.
    squares: Grid<u16>,
}

/// A place where free space narrows down between two parts of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    /// Its narrowest cell.
    pub cell: Cell,
    /// Largest radius of a body that goes through, in lengths of cells, up to [`REACH_CELLS`].
    pub radius_cells: f64,
    /// Free cells of the smaller part behind it.
    pub cells_behind: usize,
}

impl Clearance {
    /// The distances of all cells from their centres.
    #[must_use]
    pub fn of(terrain: &Grid<Terrain>) -> Self {
        Self::on(BodyLattice::Centres, terrain)
    }

    /// The distances of all cells from their places for a body of `radius_m` metres.
    #[must_use]
    pub fn for_body(radius_m: f64, terrain: &Grid<Terrain>) -> Self {
        Self::on(BodyLattice::of(radius_m, terrain.extent().cell_m()), terrain)
    }

    /// The distances of all cells from their places on a lattice.
    #[must_use]
    pub fn on(lattice: BodyLattice, terrain: &Grid<Terrain>) -> Self {
        let extent = terrain.extent();
        let size = extent.size().map(|cells| cells as usize);
        let stride = [1, size[0], size[0] * size[1]];
        let mut squares = Grid::new(extent, FAR);
        for (square, &here) in squares.as_mut_slice().iter_mut().zip(terrain.as_slice()) {
            if here == Terrain::Wall {
                *square = 0;
            }
        }
        // Of the cells below and above.
        let halves = |cells: usize| match lattice {
            BodyLattice::Centres => [(2 * cells as u16 - 1).pow(2); 2],
            BodyLattice::Corners => [(2 * cells as u16 - 2).pow(2), (2 * cells as u16).pow(2)],
        };
        let mut line = Vec::new();
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let squares = squares.as_mut_slice();
            for column in 0..size[u] * size[v] {
                let first = column % size[u] * stride[u] + column / size[u] * stride[v];
                line.clear();
                line.extend((0..size[axis]).map(|at| squares[first + at * stride[axis]]));
                for at in 0..size[axis] {
                    let mut least = line[at];
                    for away in 1..=REACH_CELLS as usize {
                        let [half_below, half_above] = halves(away);
                        if half_below >= least {
                            break;
                        }
                        let below = at.checked_sub(away).map_or(0, |at| line[at]);
                        let above = line.get(at + away).copied().unwrap_or(0);
                        least = least.min(below.saturating_add(half_below)).min(above.saturating_add(half_above));
                    }
                    squares[first + at * stride[axis]] = least;
                }
            }
        }
        Self { lattice, squares }
    }

    /// Where the bodies are.
    #[must_use]
    pub fn lattice(&self) -> BodyLattice {
        self.lattice
    }

    /// Largest radius of a body at the place of a cell, in lengths of cells, up to [`REACH_CELLS`].
    #[must_use]
    pub fn radius_cells(&self, index: usize) -> f64 {
        radius_of(self.squares[index])
    }

    /// The terrain for the centre of a body: cells where it does not fit are wall.
    #[must_use]
    pub fn room(&self, radius_cells: f64) -> Grid<Terrain> {
        let mut room = Grid::new(self.squares.extent(), Terrain::Wall);
        for (cell, &square) in room.as_mut_slice().iter_mut().zip(self.squares.as_slice()) {
            if square > 0 && radius_of(square) >= radius_cells {
                *cell = Terrain::Free;
            }
        }
        room
    }

    /// The passages to parts of at least `part` free cells, the narrowest first: where, as a body
    /// shrinks, two such parts become one.
    #[must_use]
    pub fn passages(&self, part: usize) -> Vec<Passage> {
        let extent = self.squares.extent();
        let mut order: Vec<u32> =
            (0..extent.volume() as u32).filter(|&index| self.squares[index as usize] > 0).collect();
        order.sort_by_key(|&index| std::cmp::Reverse(self.squares[index as usize]));
        let mut parts = Parts::new(extent.volume());
        let mut passages = Vec::new();
        for index in order {
            let cell = extent.cell_at(index as usize);
            let square = self.squares[index as usize];
            (parts.sizes[index as usize], parts.widest[index as usize]) = (1, square);
            let mut is_alone = true;
            for next in FACES.map(|face| cell + face) {
                let Some(next) = extent.index(next).filter(|&next| parts.sizes[next] > 0) else { continue };
                let (behind, widest) = parts.join(index as usize, next);
                // The first part that a cell joins just grows, and so does one that is nowhere
                // wider.
                let is_passage = !is_alone && behind >= part && widest > square;
                is_alone &= behind == 0;
                if is_passage {
                    let radius_cells = self.radius_cells(index as usize);
                    passages.push(Passage { cell, radius_cells, cells_behind: behind });
                }
            }
        }
        passages.sort_by(|a, b| a.radius_cells.total_cmp(&b.radius_cells));
        passages
    }
}

fn radius_of(square: u16) -> f64 {
    libm::sqrt(f64::from(square)) / 2.0
}

/// Connected parts that grow together.
struct Parts {
    above: Vec<u32>,
    /// Cells of each part, by its root; 0 for cells that are not yet there.
    sizes: Vec<u32>,
    /// The square at the widest cell of each part, by its root.
    widest: Vec<u16>,
}

impl Parts {
    fn new(count: usize) -> Self {
        Self { above: (0..count as u32).collect(), sizes: vec![0; count], widest: vec![0; count] }
    }

    fn root(&mut self, of: usize) -> usize {
        let mut at = of;
        while self.above[at] as usize != at {
            self.above[at] = self.above[self.above[at] as usize];
            at = self.above[at] as usize;
        }
        at
    }

    /// Joins the parts of two cells; returns the size of the smaller one, 0 if they are one
    /// already, and the square at the widest cell of the narrower one.
    fn join(&mut self, a: usize, b: usize) -> (usize, u16) {
        let (a, b) = (self.root(a), self.root(b));
        if a == b {
            return (0, 0);
        }
        let (small, large) = if self.sizes[a] < self.sizes[b] { (a, b) } else { (b, a) };
        self.above[small] = large as u32;
        self.sizes[large] += self.sizes[small];
        let narrower = self.widest[small].min(self.widest[large]);
        self.widest[large] = self.widest[large].max(self.widest[small]);
        (self.sizes[small] as usize, narrower)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Extent;
    use proptest::prelude::*;

    #[test]
    fn two_rooms_have_a_passage() {
        let wall = "###########\n".repeat(7);
        let room = "###########\n#....#....#\n#....#....#\n#.........#\n#....#....#\n#....#....#\n###########\n";
        let text = [&wall, room, room, room, room, room, &wall].map(|layer: &str| layer.to_owned()).join("\n");
        let clearance = Clearance::of(&Grid::from_text(&text).unwrap());
        let passages = clearance.passages(10);
        assert_eq!(passages.len(), 1, "{passages:?}");
        assert_eq!(passages[0].radius_cells, 0.5);
        assert!((4..=6).contains(&passages[0].cell.x), "{passages:?}");
        let middle = clearance.squares.extent().index(Cell::new(3, 3, 3)).unwrap();
        // To the edge of the wall beside the passage.
        assert_eq!(clearance.radius_cells(middle), f64::sqrt(1.5 * 1.5 + 0.5 * 0.5));
        assert_eq!(crate::free_components(&clearance.room(0.5)).sizes.len(), 1);
        assert_eq!(crate::free_components(&clearance.room(0.6)).sizes.len(), 2);
    }

    proptest! {
        #[test]
        fn distances_are_those_to_the_nearest_box(
            size in prop::array::uniform3(1u32..7), seed in prop::collection::vec(0u8..6, 216),
        ) {
            let extent = Extent::new(size, 1.0).unwrap();
            let kind = |&number: &u8| if number == 0 { Terrain::Wall } else { Terrain::Free };
            let cells = seed[..extent.volume()].iter().map(kind).collect();
            let terrain = Grid::from_vec(extent, cells).unwrap();
            for lattice in [BodyLattice::Centres, BodyLattice::Corners] {
                let clearance = Clearance::on(lattice, &terrain);
                for cell in extent.cells() {
                    let mut least = f64::from(REACH_CELLS);
                    for (x, y, z) in (-9..9).flat_map(|x| (-9..9).flat_map(move |y| (-9..9).map(move |z| (x, y, z)))) {
                        if crate::is_wall_at(&terrain, cell + Cell::new(x, y, z)) {
                            let at = lattice.offset_cells();
                            let along = [x, y, z].map(|n: i32| (f64::from(n) - at).max(at - f64::from(n) - 1.0).max(0.0));
                            least = least.min(along.iter().map(|d| d * d).sum::<f64>().sqrt());
                        }
                    }
                    prop_assert_eq!(clearance.radius_cells(extent.index(cell).unwrap()), least);
                }
            }
        }
    }
}
