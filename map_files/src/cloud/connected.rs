//! The free space around a place: what is connected with it, through openings of some width.

use std::collections::VecDeque;

use voxels::{Cell, FACES, Grid, Terrain};

use super::super::options::ImportOptions;
use super::super::{FormatError, Note};

/// Fills free cells that are not connected with the cell of the option `free_from`, if it is given.
/// With `gap_cells`, connected is what a cube that is one cell wider than this covers on its way
/// from there, cell by cell along the axes; so openings that are no wider are closed.
///
/// # Errors
/// If that cell is wall or outside the map, or in a space too narrow for the cube.
pub(in super::super) fn keep_from(
    terrain: &mut Grid<Terrain>,
    options: &ImportOptions,
    cell_of: impl Fn([f64; 3]) -> Cell,
) -> Result<Option<Note>, FormatError> {
    let Some(place) = options.free_from else { return Ok(None) };
    let start = cell_of(place);
    if terrain.get(start) != Some(&Terrain::Free) {
        return Err(FormatError::FreeFrom { place, is_outside: !terrain.extent().contains(start) });
    }
    let gap = options.gap_cells.unwrap_or(0);
    let before = mapgen::free_cells(terrain);
    let kept = around(terrain, start, gap + 1);
    if mapgen::free_cells(&kept) == 0 {
        return Err(FormatError::Narrow { place, gap });
    }
    *terrain = kept;
    let filled = before - mapgen::free_cells(terrain);
    let openings = if gap > 0 { format!(", other than by openings of at most {gap} cell(s)") } else { String::new() };
    Ok(Some(Note::new("free_from", format!("{filled} free cells filled that are not connected with it{openings}"))))
}

/// What a cube of free cells with this edge covers on its way from where it covers `start`.
fn around(terrain: &Grid<Terrain>, start: Cell, edge: u32) -> Grid<Terrain> {
    let extent = terrain.extent();
    let back = edge as i32 - 1;
    // The lowest corners of the cubes that have room.
    let mut room = terrain.clone();
    for step in axes() {
        spread(&mut room, step, back, Terrain::Wall);
    }
    let mut reached = Grid::new(extent, Terrain::Wall);
    let mut open = VecDeque::new();
    let mut reach = |cell: Cell, open: &mut VecDeque<Cell>| {
        if room.set(cell, Terrain::Wall) == Some(Terrain::Free) {
            reached.set(cell, Terrain::Free);
            open.push_back(cell);
        }
    };
    for (z, y) in (0..=back).flat_map(|z| (0..=back).map(move |y| (z, y))) {
        (0..=back).for_each(|x| reach(Cell::new(start.x - x, start.y - y, start.z - z), &mut open));
    }
    while let Some(cell) = open.pop_front() {
        FACES.into_iter().for_each(|face| reach(cell + face, &mut open));
    }
    for step in axes() {
        spread(&mut reached, Cell::new(-step.x, -step.y, -step.z), back, Terrain::Free);
    }
    reached
}

fn axes() -> [Cell; 3] {
    [Cell::new(1, 0, 0), Cell::new(0, 1, 0), Cell::new(0, 0, 1)]
}

/// Gives `what` to each cell that has it in one of the `count` cells after it, in the direction of
/// `step`; outside is wall.
fn spread(terrain: &mut Grid<Terrain>, step: Cell, count: i32, what: Terrain) {
    if count == 0 {
        return;
    }
    let before = terrain.clone();
    let extent = terrain.extent();
    let size = extent.size().map(|cells| cells as i32);
    let along = if step.x != 0 {
        0
    } else if step.y != 0 {
        1
    } else {
        2
    };
    let is_up = step.x + step.y + step.z > 0;
    let (u, v) = ((along + 1) % 3, (along + 2) % 3);
    for (at_v, at_u) in (0..size[v]).flat_map(|at_v| (0..size[u]).map(move |at_u| (at_v, at_u))) {
        // How many cells on the last one with `what` was, from the end on.
        let mut since = if what == Terrain::Wall { 0 } else { i32::MAX - 1 };
        for number in 0..size[along] {
            let at = if is_up { size[along] - 1 - number } else { number };
            let mut cell = [0; 3];
            (cell[along], cell[u], cell[v]) = (at, at_u, at_v);
            let cell = Cell::new(cell[0], cell[1], cell[2]);
            since = if before.get(cell) == Some(&what) { 0 } else { (since + 1).min(i32::MAX - 1) };
            if since <= count {
                terrain.set(cell, what);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn around_start(text: &str, start: [i32; 2], edge: u32) -> String {
        let terrain = Grid::from_text(text).unwrap();
        let depth = terrain.extent().size()[2] as i32;
        let kept = around(&terrain, Cell::new(start[0], start[1], depth / 2), edge);
        let layers = kept.to_text();
        layers.split("\n\n").nth(depth as usize / 2).unwrap().trim_end().to_owned()
    }

    #[test]
    fn a_cube_stops_at_openings_that_are_as_wide_as_the_gap() {
        let layer = "#########\n#...#...#\n#...#...#\n#.......#\n#...#...#\n#...#####\n#########";
        let wall = "#########\n".repeat(7);
        let text = [&wall, layer, layer, layer, layer, wall.trim_end()].join("\n\n").replace("\n\n\n", "\n\n") + "\n";
        let left = "#########\n#...#####\n#...#####\n#...#####\n#...#####\n#...#####\n#########";
        assert_eq!(around_start(&text, [2, 3], 1), layer);
        assert_eq!(around_start(&text, [2, 3], 2), left);
        assert_eq!(around_start(&text, [1, 1], 3), left);
        assert_eq!(around_start(&text, [4, 3], 2), "#########\n".repeat(7).trim_end(), "no cube fits there");
    }
}
