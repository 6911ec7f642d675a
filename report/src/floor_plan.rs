//! The floor plan of a map: how open the columns of its cells are, seen from above, as outlines.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use voxels::{Grid, Terrain};

/// Most squares along the longer side: cells of larger maps are put together.
const SQUARES_MAX: u32 = 512;

/// A map from above, in squares of one cell or several.
#[derive(Debug, Clone)]
pub(super) struct FloorPlan {
    /// Length of the side of a square, m.
    side_m: f64,
    /// Squares along x and y.
    size: [usize; 2],
    /// Number of free cells above each square, row by row from the lowest y.
    free: Vec<u32>,
}

/// A closed line along sides of squares: its corners, in squares along x and y.
pub(super) type Outline = Vec<[usize; 2]>;

impl FloorPlan {
    /// The plan of the layers of cells with these coordinates along z.
    pub(super) fn of(terrain: &Grid<Terrain>, layers: RangeInclusive<usize>) -> Self {
        let extent = terrain.extent();
        let [size_x, size_y, size_z] = extent.size();
        let side_cells = size_x.max(size_y).div_ceil(SQUARES_MAX);
        let size = [size_x, size_y].map(|cells| cells.div_ceil(side_cells) as usize);
        let mut free = vec![0; size[0] * size[1]];
        let [size_x, size_y, size_z, side] = [size_x, size_y, size_z, side_cells].map(|number| number as usize);
        let (first, last) = (*layers.start(), (*layers.end()).min(size_z - 1));
        for (row, cells) in terrain.as_slice().chunks_exact(size_x).enumerate() {
            let (y, z) = (row % size_y, row / size_y);
            if (first..=last).contains(&z) {
                let squares = &mut free[y / side * size[0]..][..size[0]];
                for (x, _) in cells.iter().enumerate().filter(|(_, cell)| **cell == Terrain::Free) {
                    squares[x / side] += 1;
                }
            }
        }
        Self { side_m: extent.cell_m() * f64::from(side_cells), size, free }
    }

    /// Length of the side of a square, m.
    pub(super) fn side_m(&self) -> f64 {
        self.side_m
    }

    /// The squares along x and along y from the first to the last one that is open, with one more
    /// on each side; the whole map if none is.
    pub(super) fn open_part(&self) -> [RangeInclusive<usize>; 2] {
        let is_open = |(index, free): (usize, &u32)| (*free > 0).then(|| [index % self.size[0], index / self.size[0]]);
        let open: Vec<[usize; 2]> = self.free.iter().enumerate().filter_map(is_open).collect();
        [0, 1].map(|axis| {
            let along = || open.iter().map(|square| square[axis]);
            let (first, last) = (along().min().unwrap_or(0), along().max().unwrap_or(self.size[axis] - 1));
            first.saturating_sub(1)..=(last + 1).min(self.size[axis] - 1)
        })
    }

    /// The outlines of the squares above which more than this share of the cells is free, relative
    /// to the most open square. Together they bound the squares by the even-odd rule.
    pub(super) fn outlines(&self, share: f64) -> Vec<Outline> {
        let most = f64::from(self.free.iter().copied().max().unwrap_or(0));
        self.outlines_of(|free| f64::from(free) > share * most)
    }

    fn outlines_of(&self, is_in: impl Fn(u32) -> bool) -> Vec<Outline> {
        let [size_x, size_y] = self.size;
        let is_in = |x: usize, y: usize| x < size_x && y < size_y && is_in(self.free[y * size_x + x]);
        // From each corner the sides of squares that begin there, with the square to the left.
        let mut sides: BTreeMap<[usize; 2], Vec<[usize; 2]>> = BTreeMap::new();
        for y in 0..size_y {
            for x in (0..size_x).filter(|&x| is_in(x, y)) {
                let corners = [[x, y], [x + 1, y], [x + 1, y + 1], [x, y + 1]];
                let beside = [[x, y.wrapping_sub(1)], [x + 1, y], [x, y + 1], [x.wrapping_sub(1), y]];
                for (number, [beside_x, beside_y]) in beside.into_iter().enumerate() {
                    if !is_in(beside_x, beside_y) {
                        sides.entry(corners[number]).or_default().push(corners[(number + 1) % 4]);
                    }
                }
            }
        }
        let mut outlines = Vec::new();
        while let Some((&start, _)) = sides.first_key_value() {
            let (mut outline, mut at) = (Vec::new(), start);
            while let Some(mut next) = sides.remove(&at) {
                let to = next.pop().expect("a side begins at each corner of the list");
                if !next.is_empty() {
                    sides.insert(at, next);
                }
                push(&mut outline, at);
                at = to;
            }
            // The last corner may lie on the way to the first one.
            push(&mut outline, start);
            outline.pop();
            outlines.push(outline);
        }
        outlines
    }
}

/// Adds a corner to a line, in place of the last one if that lies on the way to it.
fn push(outline: &mut Outline, corner: [usize; 2]) {
    if let [.., before, last] = outline.as_slice()
        && (0..2).any(|axis| before[axis] == last[axis] && last[axis] == corner[axis])
    {
        outline.pop();
    }
    outline.push(corner);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plan of one layer; rows from the greatest y down.
    fn plan(rows: &[&str]) -> FloorPlan {
        let free = rows.iter().rev().flat_map(|row| row.bytes().map(|cell| u32::from(cell == b'.'))).collect();
        FloorPlan { side_m: 0.5, size: [rows[0].len(), rows.len()], free }
    }

    /// Whether the middle of a square is inside of outlines, by the even-odd rule.
    fn is_inside(outlines: &[Outline], [x, y]: [usize; 2]) -> bool {
        let crossed = |from: [usize; 2], to: [usize; 2]| {
            from[0] == to[0] && from[0] <= x && (from[1].min(to[1])..from[1].max(to[1])).contains(&y)
        };
        let sides = outlines.iter().flat_map(|line| line.iter().zip(line.iter().cycle().skip(1)));
        sides.filter(|(from, to)| crossed(**from, **to)).count() % 2 == 1
    }

    #[test]
    fn outlines_bound_the_open_squares() {
        for rows in [
            &["#####", "#..##", "#.#.#", "##..#", "#####"][..],
            &[".....", ".###.", ".#.#.", ".###.", "....."],
            &["#"],
            &[".#", "#."],
        ] {
            let plan = plan(rows);
            let outlines = plan.outlines(0.0);
            for (index, free) in plan.free.iter().enumerate() {
                let square = [index % plan.size[0], index / plan.size[0]];
                assert_eq!(is_inside(&outlines, square), *free > 0, "{rows:?} {square:?}");
            }
        }
        assert_eq!(plan(&["###", "#.#", "###"]).outlines(0.0), [vec![[1, 1], [2, 1], [2, 2], [1, 2]]]);
        // Straight lines have no corners on the way.
        assert_eq!(plan(&["....", "...."]).outlines(0.0)[0].len(), 4);
    }

    #[test]
    fn plan_counts_the_layers_that_are_shown() {
        let layers = "####\n#..#\n####\n\n####\n#.##\n####\n\n####\n####\n####\n";
        let terrain = Grid::from_text(layers).unwrap();
        assert_eq!(FloorPlan::of(&terrain, 0..=9).free, [0, 0, 0, 0, 0, 2, 1, 0, 0, 0, 0, 0]);
        let upper = FloorPlan::of(&terrain, 1..=1);
        assert_eq!(upper.free, [0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0]);
        assert_eq!(upper.open_part(), [0..=2, 0..=2]);
        let whole = FloorPlan::of(&terrain, 0..=2);
        // Half of the most open square is not more than half.
        assert_eq!((whole.outlines(0.0)[0].len(), whole.outlines(0.5).len()), (4, 1));
        assert_eq!(whole.outlines(0.5), [vec![[1, 1], [2, 1], [2, 2], [1, 2]]]);
    }

    #[test]
    fn large_maps_have_larger_squares() {
        let extent = voxels::Extent::new([1000, 3, 1], 0.25).unwrap();
        let plan = FloorPlan::of(&Grid::new(extent, Terrain::Free), 0..=0);
        assert_eq!((plan.size, plan.side_m), ([500, 2], 0.5));
        assert_eq!((plan.free[0], plan.free[500]), (4, 2));
    }
}
