//! Markers of an agent's map for visualisation: only changes, block by block.
//!
//! Three namespaces: `walls`, `frontiers`, and `free` for all other free cells. The journal of the
//! map gives the blocks that may have changed; a change can turn neighbouring cells into frontiers
//! or back, so the blocks of the neighbours count as changed, too.
//!
//! Invariants: the map is only read; no message is larger than
//! [`protocol::limits::VIEW_BYTES_MAX`]. This module knows no transport and no clock.

use std::collections::BTreeSet;

use msgs::geometry_msgs::Point;
use msgs::ids::Tick;
use msgs::std_msgs::{ColorRGBA, Header};
use msgs::visualization_msgs::Marker;
use protocol::limits::{MESSAGE_BYTES_BARE, POINT_BYTES, VIEW_BYTES_MAX};
use voxels::{Blocks, Cell, Extent};

use crate::exploration_map::{CellState, ExplorationMap};

/// Cells along each axis of a block: as many as fit into a message.
const BLOCK_SIDE: u32 = 13;
const _: () =
    assert!((BLOCK_SIDE * BLOCK_SIDE * BLOCK_SIDE) as usize <= (VIEW_BYTES_MAX - MESSAGE_BYTES_BARE) / POINT_BYTES);

/// The namespaces and their colours.
const GROUPS: [(Group, &str, ColorRGBA); 3] = [
    (Group::Wall, "walls", ColorRGBA { r: 0.6, g: 0.6, b: 0.55, a: 1.0 }),
    (Group::Free, "free", ColorRGBA { r: 0.2, g: 0.6, b: 0.9, a: 0.08 }),
    (Group::Frontier, "frontiers", ColorRGBA { r: 1.0, g: 0.7, b: 0.1, a: 0.5 }),
];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Group {
    Wall,
    Free,
    Frontier,
}

/// The state of one map's markers.
#[derive(Debug)]
pub struct MapMarkers {
    blocks: Blocks,
    /// Position in the journal of the map up to which changes have been read.
    position: usize,
    changed: BTreeSet<u32>,
    /// Markers that exist at observers: block and namespace.
    shown: BTreeSet<(u32, usize)>,
    /// Markers of the present block, last one first.
    waiting: Vec<Marker>,
}

impl MapMarkers {
    /// No markers yet for a map of this extent.
    #[must_use]
    pub fn new(extent: Extent) -> Self {
        Self {
            blocks: Blocks::new(extent, BLOCK_SIDE),
            position: 0,
            changed: BTreeSet::new(),
            shown: BTreeSet::new(),
            waiting: Vec::new(),
        }
    }

    /// Sends everything again, for a new subscriber.
    pub fn show_again(&mut self) {
        self.changed.extend(self.shown.iter().map(|&(block, _)| block));
    }

    /// Starts over with an unexplored map of the same extent: all markers will be deleted or
    /// replaced.
    pub fn begin_again(&mut self) {
        self.position = 0;
        self.waiting.clear();
        self.show_again();
    }

    /// Reads the changes of the map since the last call.
    pub fn look(&mut self, map: &ExplorationMap) {
        let extent = map.extent();
        for change in map.changes_since(self.position) {
            let cell = extent.cell_at(change.cell as usize);
            let around = cell.neighbours6().into_iter().chain([cell]);
            self.changed.extend(around.filter_map(|cell| extent.index(cell)).map(|index| self.blocks.of(index)));
        }
        self.position = map.journal_len();
    }

    /// The next marker to publish, stamped with `tick`.
    pub fn next(&mut self, map: &ExplorationMap, tick: Tick) -> Option<Marker> {
        loop {
            if let Some(marker) = self.waiting.pop() {
                return Some(marker);
            }
            let block = self.changed.pop_first()?;
            self.make(block, map, tick);
        }
    }

    /// Makes the markers of a block. A marker whose cells are gone is deleted; one that never
    /// existed is not mentioned.
    fn make(&mut self, block: u32, map: &ExplorationMap, tick: Tick) {
        let extent = map.extent();
        let mut cells: [Vec<Point>; GROUPS.len()] = Default::default();
        for cell in self.blocks.cells(block) {
            if let Some(group) = group_of(map, cell)
                && let Some(number) = GROUPS.iter().position(|(other, _, _)| *other == group)
            {
                let centre = extent.centre(cell);
                cells[number].push(Point { x: centre.x, y: centre.y, z: centre.z });
            }
        }
        let header = Header { stamp: tick.into(), frame_id: "map".to_owned() };
        let id = i32::try_from(block).expect("an extent has at most 2^30 cells");
        for (number, points) in cells.into_iter().enumerate() {
            let was_shown = !self.shown.insert((block, number));
            if points.is_empty() {
                self.shown.remove(&(block, number));
                if !was_shown {
                    continue;
                }
            }
            let (_, ns, colour) = GROUPS[number];
            self.waiting.push(Marker::cubes(header.clone(), ns, id, extent.cell_m(), colour, points));
        }
        self.waiting.reverse();
    }
}

fn group_of(map: &ExplorationMap, cell: Cell) -> Option<Group> {
    match map.state(cell) {
        CellState::Unexplored => None,
        CellState::Wall => Some(Group::Wall),
        CellState::Free | CellState::Covered if map.is_frontier(cell) => Some(Group::Frontier),
        CellState::Free | CellState::Covered => Some(Group::Free),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pending markers: block, namespace and number of cells.
    fn shown(view: &mut MapMarkers, map: &ExplorationMap) -> Vec<(i32, String, usize)> {
        view.look(map);
        std::iter::from_fn(|| view.next(map, Tick(7)))
            .map(|marker| {
                assert_eq!(marker.action == Marker::DELETE, marker.points.is_empty());
                assert!(msgs::cdr::encode(&marker).len() <= VIEW_BYTES_MAX);
                (marker.id, marker.ns, marker.points.len())
            })
            .collect()
    }

    fn named(expected: &[(i32, &str, usize)]) -> Vec<(i32, String, usize)> {
        expected.iter().map(|&(id, ns, cells)| (id, ns.to_owned(), cells)).collect()
    }

    #[test]
    fn only_changes_are_published() {
        // Two blocks along x: cells 0 to 12, and 13 to 19.
        let extent = Extent::new([20, 1, 1], 0.5).unwrap();
        let mut map = ExplorationMap::new(extent);
        let mut view = MapMarkers::new(extent);
        assert_eq!(shown(&mut view, &map), []);
        map.note_free(&[11, 12]);
        map.note_wall(&[10]);
        // Only cell 12 has an unexplored neighbour, which lies in the other block.
        assert_eq!(shown(&mut view, &map), named(&[(0, "walls", 1), (0, "free", 1), (0, "frontiers", 1)]));
        assert_eq!(shown(&mut view, &map), []);
        map.note_wall(&[13]);
        let closed = named(&[(0, "walls", 1), (0, "free", 2), (0, "frontiers", 0), (1, "walls", 1)]);
        assert_eq!(shown(&mut view, &map), closed);
        view.show_again();
        let again = named(&[(0, "walls", 1), (0, "free", 2), (1, "walls", 1)]);
        assert_eq!(shown(&mut view, &map), again);
    }

    #[test]
    fn full_blocks_fit_into_messages() {
        let extent = Extent::new([13, 13, 13], 1.0).unwrap();
        let mut map = ExplorationMap::new(extent);
        map.note_wall(&(0..extent.volume() as u32).collect::<Vec<_>>());
        let mut view = MapMarkers::new(extent);
        assert_eq!(shown(&mut view, &map), named(&[(0, "walls", 2197)]));
    }
}
