//! What is known of each block of 4 x 4 x 4 cells, as bits.
//!
//! Invariant: a block is occupied if and only if one of its cells is explored.

use voxels::CellSet;

use super::Finding;

/// Of one block: its explored cells, those of them that are wall, and those that are covered.
type Words = [u64; 3];

/// The blocks of a map.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct KnownBlocks {
    words: Vec<Words>,
    /// The blocks with explored cells: the words of the others are 0, and are not read. The system
    /// would provide a page that is read first and then written twice.
    occupied: CellSet,
}

impl KnownBlocks {
    /// So many unexplored blocks.
    pub(super) fn new(count: u32) -> Self {
        let count = count as usize;
        Self { words: vec![[0; 3]; count], occupied: CellSet::new(count) }
    }

    /// The words of a block; `None`: there is no such block.
    #[inline]
    pub(super) fn get(&self, block: u32) -> Option<Words> {
        let is_block = (block as usize) < self.words.len();
        is_block.then(|| if self.is_occupied(block) { self.words[block as usize] } else { [0; 3] })
    }

    /// Notes a finding about a cell of a block, by its number in it.
    #[inline]
    pub(super) fn note(&mut self, block: u32, number: u32, finding: Finding) {
        let bit = 1 << number;
        let only_if = |condition| if condition { bit } else { 0 };
        let (wall, covered) = (only_if(finding == Finding::Wall), only_if(finding == Finding::Covered));
        let words = &mut self.words[block as usize];
        if self.occupied.contains(block as usize) {
            let [known, walls, visited] = words;
            *known |= bit;
            *walls = *walls & !bit | wall;
            *visited = *visited & !bit | covered;
        } else {
            self.occupied.insert(block as usize);
            *words = [bit, wall, covered];
        }
    }

    /// Whether a cell of a block is explored.
    #[inline]
    pub(super) fn is_occupied(&self, block: u32) -> bool {
        self.occupied.contains(block as usize)
    }
}
