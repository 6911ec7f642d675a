//! Maps drawn as text, for tests.

use voxels::{Grid, Terrain};

use super::ExplorationMap;

/// A map with the drawn knowledge: `.` free, `#` wall, `?` unexplored.
pub(crate) fn drawn(text: &str) -> ExplorationMap {
    let free = Grid::from_text(&text.replace('?', "#")).unwrap();
    let unexplored = Grid::from_text(&text.replace('#', ".").replace('?', "#")).unwrap();
    let mut map = ExplorationMap::new(free.extent());
    for (index, (terrain, mark)) in (0..).zip(free.as_slice().iter().zip(unexplored.as_slice())) {
        match (terrain, mark) {
            (Terrain::Free, _) => map.note_free(&[index]),
            (Terrain::Wall, Terrain::Free) => map.note_wall(&[index]),
            (Terrain::Wall, Terrain::Wall) => {}
        }
    }
    map
}
