//! The journal of a map: each change once, in order, in about two bytes.
//!
//! It is most of what an agent remembers, and its old parts are seldom read. So it consists of
//! sections: the last one has an [`Entry`] for each change, and full ones are packed. A packed
//! change is a byte with the number of the cell in its block and the finding, which is not 0.
//! Bytes whose lower two bits are 0 say where the next changes are, and from whom:
//!
//! | upper six bits | meaning |
//! |---|---|
//! | 0 | the block is another one; the difference follows, zigzag and LEB128 |
//! | 1 | the source is another one; 1 + its number follows, LEB128 |
//! | 63 | many cells, ascending: their bits follow, then those of walls and of covered cells |
//! | others | the block is another one; the difference is 32 less |

use super::Finding;
use super::delta::Block;
use std::ops::Range;

/// Entries of a section.
const SECTION: usize = if cfg!(test) { 32 } else { 4096 };

/// What a byte adds to the difference of blocks that it holds.
const BIAS: i32 = 32;

/// The upper six bits of the bytes without a difference.
const FAR: u8 = 0;
const SOURCE: u8 = 1;
const MANY: u8 = 63;

/// Changes from which on the words of a block take fewer bytes.
const MANY_MIN: usize = 26;

/// A change in 8 bytes. `what` has the block of the cell in the upper 24 bits, its number in the
/// block in the next 6, and the finding in the lower two: a map of 1024^3 cells has 256^3 blocks.
///
/// Most readers want blocks: map messages consist of them, and their coordinates do not take a
/// division for each cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Entry {
    what: u32,
    pub(super) from: u32,
}

impl Entry {
    pub(super) fn new((block, number): (u32, u32), finding: Finding, from: u32) -> Self {
        Self { what: block << 8 | number << 2 | finding as u32, from }
    }

    /// The block of the cell, and the number of the cell in it.
    pub(super) fn place(self) -> (u32, u32) {
        (self.what >> 8, self.what >> 2 & 63)
    }

    pub(super) fn report(self) -> Block {
        let (block, number) = self.place();
        Block::of_cell(block, number, self.finding())
    }

    pub(super) fn finding(self) -> Finding {
        match self.what & 3 {
            1 => Finding::Free,
            2 => Finding::Covered,
            _ => Finding::Wall,
        }
    }
}

/// The changes of one map.
#[derive(Debug, Clone, Default)]
pub(super) struct Journal {
    /// Full sections.
    packed: Vec<Box<[u8]>>,
    last: Vec<Entry>,
}

impl Journal {
    /// Number of changes.
    pub(super) fn len(&self) -> usize {
        self.packed.len() * SECTION + self.last.len()
    }

    pub(super) fn push(&mut self, entry: Entry) {
        self.last.push(entry);
        if self.last.len() == SECTION {
            self.packed.push(pack(&self.last));
            self.last.clear();
        }
    }

    /// The entries at these positions as reports, in order: neighbours of one block are one report.
    /// What was packed as words stays words, so this costs less than to go through the entries.
    pub(super) fn reports(&self, positions: Range<usize>) -> impl Iterator<Item = Block> + '_ {
        let end = positions.end.min(self.len());
        let start = positions.start.min(end);
        let plain_from = self.packed.len() * SECTION;
        let of_last = |position: usize| position.max(plain_from) - plain_from;
        let is_same_block = |a: &Entry, b: &Entry| a.place().0 == b.place().0;
        let plain = self.last[of_last(start)..of_last(end)].chunk_by(is_same_block).map(|entries| {
            let mut report = entries[0].report();
            entries[1..].iter().for_each(|entry| report.say(entry.report()));
            report
        });
        let sections = self.packed.get(start / SECTION..).unwrap_or_default().iter();
        let left = end.min(plain_from).saturating_sub(start);
        let skipped = if left == 0 { 0 } else { start % SECTION };
        let mut pieces = Pieces { sections, section: Unpacked::new(&[]), left: skipped + left };
        pieces.leave_out(skipped);
        let mut pieces = pieces.chain(plain).peekable();
        std::iter::from_fn(move || {
            let mut report = pieces.next()?;
            while let Some(later) = pieces.next_if(|later| later.index == report.index) {
                report.say(later);
            }
            Some(report)
        })
    }

    /// The entries at these positions, in order; there are none beyond the end.
    pub(super) fn entries(&self, positions: Range<usize>) -> impl Iterator<Item = Entry> + '_ {
        let end = positions.end.min(self.len());
        let start = positions.start.min(end);
        let plain_from = self.packed.len() * SECTION;
        let of_last = |position: usize| position.max(plain_from) - plain_from;
        let plain = &self.last[of_last(start)..of_last(end)];
        let section = start / SECTION;
        let packed = self.packed.get(section..).unwrap_or_default().iter().flat_map(|bytes| Unpacked::new(bytes));
        let count = end.min(plain_from).saturating_sub(start);
        packed.skip(start - section * SECTION).take(count).chain(plain.iter().copied())
    }
}

fn pack(entries: &[Entry]) -> Box<[u8]> {
    let mut bytes = Vec::with_capacity(2 * entries.len());
    let (mut block, mut source) = (0_u32, 0_u32);
    let is_ascending = |a: &Entry, b: &Entry| a.place() < b.place() && a.place().0 == b.place().0 && a.from == b.from;
    for run in entries.chunk_by(is_ascending) {
        let (to, from) = (run[0].what >> 8, run[0].from.wrapping_add(1));
        if from != source {
            bytes.push(SOURCE << 2);
            put(&mut bytes, from);
            source = from;
        }
        if to != block {
            let by = to.wrapping_sub(block).cast_signed();
            match u8::try_from(by.saturating_add(BIAS)) {
                Ok(near @ 2..MANY) => bytes.push(near << 2),
                _ => {
                    bytes.push(FAR << 2);
                    put(&mut bytes, (by << 1 ^ by >> 31).cast_unsigned());
                }
            }
            block = to;
        }
        if run.len() < MANY_MIN {
            bytes.extend(run.iter().map(|entry| entry.what as u8));
            continue;
        }
        let mut report = run[0].report();
        run.iter().for_each(|entry| report.say(entry.report()));
        bytes.push(MANY << 2);
        for word in [report.known, report.wall, report.covered] {
            bytes.extend(word.to_le_bytes());
        }
    }
    bytes.into()
}

/// Appends a number, seven bits at a time.
fn put(bytes: &mut Vec<u8>, mut number: u32) {
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

/// Reports of successive entries in packed sections; those of one block may be several.
struct Pieces<'b> {
    sections: std::slice::Iter<'b, Box<[u8]>>,
    section: Unpacked<'b>,
    /// Entries to report.
    left: usize,
}

impl Pieces<'_> {
    /// Leaves out so many entries, at most those that are left.
    fn leave_out(&mut self, count: usize) {
        let end = self.left - count;
        while self.left > end && self.piece(self.left - end).is_some() {}
    }

    /// The next report, of at most so many entries.
    #[inline]
    fn piece(&mut self, entries_max: usize) -> Option<Block> {
        loop {
            if let Some((report, entries)) = self.section.piece(entries_max) {
                self.left -= entries;
                return Some(report);
            }
            self.section = Unpacked::new(self.sections.next()?);
        }
    }
}

impl Iterator for Pieces<'_> {
    type Item = Block;

    #[inline]
    fn next(&mut self) -> Option<Block> {
        if self.left == 0 { None } else { self.piece(self.left) }
    }
}

/// The entries of a packed section.
struct Unpacked<'b> {
    bytes: std::slice::Iter<'b, u8>,
    block: u32,
    source: u32,
    /// What is left of many cells of the block.
    many: Block,
}

impl<'b> Unpacked<'b> {
    fn new(bytes: &'b [u8]) -> Self {
        Self { bytes: bytes.iter(), block: 0, source: 0, many: Block::default() }
    }

    fn number(&mut self) -> Option<u32> {
        let (mut number, mut shift) = (0, 0);
        loop {
            let byte = *self.bytes.next()?;
            number |= u32::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(number);
            }
            shift += 7;
        }
    }

    fn word(&mut self) -> Option<u64> {
        let (word, rest) = self.bytes.as_slice().split_first_chunk()?;
        self.bytes = rest.iter();
        Some(u64::from_le_bytes(*word))
    }

    /// Reads up to the next byte that is a change, and returns it; `None` before many cells, and at
    /// the end.
    #[inline]
    fn change(&mut self) -> Option<u8> {
        while self.many.known == 0 {
            let byte = *self.bytes.next()?;
            if byte & 3 != 0 {
                return Some(byte);
            }
            match byte >> 2 {
                FAR => {
                    let zigzag = self.number()?;
                    let by = (zigzag >> 1) ^ (zigzag & 1).wrapping_neg();
                    self.block = self.block.wrapping_add(by);
                }
                SOURCE => self.source = self.number()?,
                MANY => {
                    let [known, wall, covered] = [self.word()?, self.word()?, self.word()?];
                    self.many = Block { index: self.block, known, wall, covered };
                }
                near => self.block = self.block.wrapping_add_signed(i32::from(near) - BIAS),
            }
        }
        None
    }

    fn entry(&self, byte: u8) -> Entry {
        Entry { what: self.block << 8 | u32::from(byte), from: self.source.wrapping_sub(1) }
    }

    /// A report of the next entries, as far as they follow each other in one block and are at most
    /// so many, and their number.
    #[inline]
    fn piece(&mut self, entries_max: usize) -> Option<(Block, usize)> {
        let Some(byte) = self.change() else {
            let known = self.many.known;
            let count = known.count_ones() as usize;
            let taken = count.min(entries_max);
            self.many.known = if taken == count { 0 } else { (0..taken).fold(known, |left, _| left & (left - 1)) };
            let cells = known & !self.many.known;
            let Block { index, wall, covered, .. } = self.many;
            return (cells != 0)
                .then_some((Block { index, known: cells, wall: wall & cells, covered: covered & cells }, taken));
        };
        let mut report = self.entry(byte).report();
        let next = self.bytes.as_slice().iter().take(entries_max - 1).take_while(|&byte| byte & 3 != 0);
        let more = next.map(|&byte| report.say(self.entry(byte).report())).count();
        self.bytes = self.bytes.as_slice()[more..].iter();
        Some((report, 1 + more))
    }
}

impl Iterator for Unpacked<'_> {
    type Item = Entry;

    #[inline]
    fn next(&mut self) -> Option<Entry> {
        if let Some(byte) = self.change() {
            return Some(self.entry(byte));
        }
        if self.many.known == 0 {
            return None;
        }
        let number = self.many.known.trailing_zeros();
        self.many.known &= self.many.known - 1;
        Some(Entry::new((self.block, number), self.many.finding(number), self.source.wrapping_sub(1)))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn entries() -> impl Strategy<Value = Vec<Entry>> {
        let block = prop_oneof![4 => 1000_u32..1070, 1 => 0_u32..1 << 24];
        let from = prop_oneof![3 => Just(u32::MAX), 1 => 0_u32..1000];
        let finding = prop::sample::select(vec![Finding::Free, Finding::Covered, Finding::Wall]);
        // Single cells, and all cells of a block from a number on.
        let count = prop_oneof![3 => Just(1_u32), 1 => 20_u32..64];
        let entries = (block, 0_u32..64, count, finding, from).prop_map(|(block, first, count, finding, from)| {
            let numbers = first..(first + count).min(64);
            let entry = move |number: u32| {
                let finding = if number.is_multiple_of(5) { Finding::Wall } else { finding };
                Entry::new((block, number), finding, from)
            };
            numbers.map(entry).collect::<Vec<Entry>>()
        });
        prop::collection::vec(entries, 0..60).prop_map(|entries| entries.concat())
    }

    proptest! {
        #[test]
        fn entries_are_read_as_written(
            entries in entries(), ranges in prop::collection::vec((0_usize..900, 0_usize..900), 8),
        ) {
            let mut journal = Journal::default();
            entries.iter().for_each(|&entry| journal.push(entry));
            prop_assert_eq!(journal.len(), entries.len());
            for (start, end) in ranges {
                let expected = entries.get(start.min(entries.len())..end.min(entries.len())).unwrap_or_default();
                prop_assert!(journal.entries(start..end).eq(expected.iter().copied()));
                let reports = expected.chunk_by(|a, b| a.place().0 == b.place().0).map(|entries| {
                    let mut report = entries[0].report();
                    entries.iter().for_each(|entry| report.say(entry.report()));
                    report
                });
                prop_assert!(journal.reports(start..end).eq(reports));
            }
        }
    }

    #[test]
    fn many_cells_of_a_block_take_less_than_a_byte_each() {
        let mut journal = Journal::default();
        let count = 64 * SECTION as u32;
        for cell in 0..count {
            journal.push(Entry::new((7000 + cell / 64, cell % 64), Finding::Free, 3));
        }
        let bytes: usize = journal.packed.iter().map(|section| section.len()).sum();
        assert!(bytes < count as usize, "{bytes}");
    }

    #[test]
    fn a_row_of_cells_takes_less_than_two_bytes_for_each() {
        let mut journal = Journal::default();
        let count = 64 * SECTION as u32;
        for cell in 0..count {
            journal.push(Entry::new((7000 + cell / 4, cell % 4), Finding::Free, u32::MAX));
        }
        let bytes: usize = journal.packed.iter().map(|section| section.len()).sum();
        assert!(bytes < 2 * count as usize, "{bytes}");
    }
}
