//! The projection of a map to the plane, as planners in two dimensions see it.
//!
//! A place of the plane is free where any cell above it is known to be free, else occupied where
//! any is known to be wall, else unknown. Where the plane has too many places, squares of cells
//! become one, by the same rule but with walls first, so that no thin wall vanishes.

use crate::{Cell, Extent, Terrain};

/// A projected map, row by row from the lowest y on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Projection {
    /// Cells of the map along the side of a place.
    pub side_cells: u32,
    /// Places along x and y.
    pub size: [u32; 2],
    /// `None` where nothing is known.
    pub places: Vec<Option<Terrain>>,
}

/// Projects the known cells of a map to at most `places_max` places.
#[must_use]
pub fn project(extent: Extent, places_max: usize, known: impl Fn(Cell) -> Option<Terrain>) -> Projection {
    let [size_x, size_y, size_z] = extent.size();
    let places = |side: u32| size_x.div_ceil(side) as usize * size_y.div_ceil(side) as usize;
    let side_cells = (1..=size_x.max(size_y)).find(|&side| places(side) <= places_max).unwrap_or(size_x.max(size_y));
    let size = [size_x.div_ceil(side_cells), size_y.div_ceil(side_cells)];
    let column = |x: u32, y: u32| {
        let mut found = None;
        for z in 0..size_z {
            match known(Cell::new(x as i32, y as i32, z as i32)) {
                Some(Terrain::Free) => return Some(Terrain::Free),
                Some(Terrain::Wall) => found = Some(Terrain::Wall),
                None => {}
            }
        }
        found
    };
    let mut projected = vec![None; size[0] as usize * size[1] as usize];
    for y in 0..size_y {
        for x in 0..size_x {
            let place = &mut projected[((y / side_cells) * size[0] + x / side_cells) as usize];
            *place = match (*place, column(x, y)) {
                (Some(Terrain::Wall), _) | (_, Some(Terrain::Wall)) => Some(Terrain::Wall),
                (known, None) => known,
                (_, free) => free,
            };
        }
    }
    Projection { side_cells, size, places: projected }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two layers; `#` wall, `.` free, blank unknown.
    fn projected(places_max: usize, layers: [[&str; 3]; 2]) -> (u32, Vec<String>) {
        let extent = Extent::new([4, 3, 2], 0.5).unwrap();
        let known = |cell: Cell| match layers[cell.z as usize][cell.y as usize].as_bytes()[cell.x as usize] {
            b'#' => Some(Terrain::Wall),
            b'.' => Some(Terrain::Free),
            _ => None,
        };
        let Projection { side_cells, size, places } = project(extent, places_max, known);
        let letter = |place: &Option<Terrain>| match place {
            Some(Terrain::Wall) => '#',
            Some(Terrain::Free) => '.',
            None => ' ',
        };
        let rows = places.chunks(size[0] as usize).map(|row| row.iter().map(letter).collect());
        (side_cells, rows.collect())
    }

    #[test]
    fn free_cells_come_before_walls_in_a_column() {
        let layers = [["####", "#.# ", "   #"], ["####", "# . ", "  ##"]];
        assert_eq!(projected(12, layers), (1, vec!["####".into(), "#.. ".into(), "  ##".into()]));
    }

    #[test]
    fn walls_come_before_free_cells_in_a_square() {
        let layers = [["....", ".#..", "    "], ["    ", "    ", "   ."]];
        assert_eq!(projected(4, layers), (2, vec!["#.".into(), " .".into()]));
        assert_eq!(projected(1, layers), (4, vec!["#".into()]));
    }
}
