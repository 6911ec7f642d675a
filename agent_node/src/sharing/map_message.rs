//! The encoding of a map message.
//!
//! | bytes | content |
//! |---|---|
//! | 1 | version of the encoding, [`VERSION`] |
//! | number | number of receivers of the message in the same tick |
//! | numbers | the receivers, as runs of consecutive ids |
//! | number | number of blocks of the map |
//! | bits | the blocks, ascending; the last byte is padded with zeros |
//!
//! A run of receivers is the number of ids that are skipped before it, less one after the first
//! run; then, if more than one receiver is left, its length less one. Runs ascend.
//!
//! A *number* is an unsigned LEB128: 7 bits in each byte, the lowest first, the top bit set in all
//! bytes but the last; at most 2^32 - 1, at most 5 bytes. Blocks, the numbers of cells in them and
//! their octants are those of [`Block`]; words and gaps of bits are those of `bits.rs`. A block is:
//!
//! 1. A gap: the number of blocks between the block before (or the start of the map) and it.
//! 2. Its form: `0`: a list without covered cells; `10`: octants without covered cells; `110`: a
//!    list with covered cells; `111`: octants with covered cells.
//! 3. Its cells. A list is a gap, the number of cells less one; then the number of each cell in the
//!    block, ascending, a word of 6 bits; then one bit for each of them, whether it is wall.
//!    Otherwise each of the eight octants is `0` if none of its cells is reported; `11` if all are;
//!    `10` and a word of 8 bits, with a one for each reported cell, if some are. After `10` and
//!    `11` follows `0` if all these cells are free, `10` if all are wall, or `11` and one bit for
//!    each of them, whether it is wall.
//! 4. With covered cells, one bit for each free cell, ascending, whether it is covered.
//!
//! Nothing follows the last block. A cell takes between 27/64 of a bit, in a block that is all
//! free, and 64 bits.
//!
//! Invariant: the result of [`decode`] is ascending, without empty blocks, inside the map, and
//! names only agents of the run; a message with any wrong bit is rejected as a whole.

use msgs::ids::AgentId;
use thiserror::Error;
use voxels::{Extent, bits};

use super::bits::{Reader as Bits, Writer, gap_bits};
use crate::exploration_map::{Block, Delta, Layout};

/// Version of the encoding.
pub const VERSION: u8 = 3;

/// Most bytes that one more cell can add to a message: a block of its own, covered and far from the
/// others, takes 61 bits, of which the gap takes 49.
pub(super) const CELL_BYTES_MAX: usize = 8;

/// Most bytes of a message for this many receivers, without its cells.
pub(super) const fn bare_bytes_max(receivers: usize) -> usize {
    2 + NUMBER_BYTES_MAX * (2 * receivers + 2)
}

const NUMBER_BYTES_MAX: usize = 5;

/// Fewest bits of a block: a gap of 0, a list of one cell.
const BLOCK_BITS_MIN: usize = 10;

/// So few cells are always listed: 17 bits, where seven empty octants and one with some cells take
/// 18.
const LISTED_CELLS: u32 = 2;

/// An octant with all of its cells.
const ALL: u32 = 0xff;

/// Why bytes are no map message of this run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum MapMessageError {
    /// Another version of the encoding.
    #[error("version {0}, expected {VERSION}")]
    Version(u8),
    /// Truncated after this many bytes.
    #[error("truncated after {0} bytes")]
    Short(usize),
    /// A number out of range, at this byte.
    #[error("the number at byte {0} is larger than 4294967295 or longer than 5 bytes")]
    Number(usize),
    /// A receiver that is not part of the run.
    #[error("receiver {agent} is not part of the run, allowed are 0 to {}", agents.saturating_sub(1))]
    Agent {
        /// The id of the receiver.
        agent: u64,
        /// Number of agents of the run.
        agents: u32,
    },
    /// A run of more receivers than are left.
    #[error("a run of {run} receivers where {left} are left")]
    Run {
        /// The length of the run.
        run: u64,
        /// Receivers that are not named yet.
        left: u32,
    },
    /// A cell outside the map.
    #[error("block {block} has cells outside the map")]
    Outside {
        /// The number of the block.
        block: u64,
    },
    /// A block that is empty or not encoded canonically.
    #[error("block {0} is empty or not encoded canonically")]
    Block(u32),
    /// Padding that is not zero.
    #[error("a bit is set after its end")]
    Filling,
    /// More cells from its sender than an agent can know.
    #[error("its sender has reported more than {allowance} cells, all that an agent can know")]
    Barred {
        /// Number of cells that one sender may report in a run.
        allowance: u64,
    },
    /// Trailing bytes, by their number.
    #[error("{0} bytes after its end")]
    Long(usize),
}

/// Encodes a delta for receivers, ascending by id.
pub(super) fn encode(receivers: &[AgentId], delta: &Delta) -> Vec<u8> {
    let mut bytes = vec![VERSION];
    put_receivers(&mut bytes, receivers);
    put(&mut bytes, delta.blocks.len() as u32);
    let mut writer = Writer::new(&mut bytes);
    let mut next = 0;
    for block in &delta.blocks {
        writer.gap(block.index - next);
        next = block.index + 1;
        put_block(&mut writer, block);
    }
    writer.end();
    bytes
}

fn put_receivers(bytes: &mut Vec<u8>, receivers: &[AgentId]) {
    put(bytes, receivers.len() as u32);
    let mut left = receivers.len();
    let mut next = 0;
    for run in receivers.chunk_by(|one, other| one.0 + 1 == other.0) {
        put(bytes, run[0].0 - next);
        if left > 1 {
            put(bytes, run.len() as u32 - 1);
        }
        left -= run.len();
        // The next id is not in another run.
        next = run[0].0 + run.len() as u32 + 1;
    }
}

/// The octants of a block, each as a word and its number of bits.
fn octants(block: &Block) -> [(u32, u32); 8] {
    let (known, wall) = (block.known.to_le_bytes(), block.wall.to_le_bytes());
    std::array::from_fn(|place| octant_word(known[place].into(), wall[place].into()))
}

fn put_block(writer: &mut Writer<'_>, block: &Block) {
    let cells = block.known.count_ones();
    let list_bits = gap_bits(cells - 1) + 7 * cells;
    let shorter_octants = (cells > LISTED_CELLS).then(|| octants(block)).filter(|octants| {
        let octants_bits: u32 = octants.iter().map(|&(_, bits)| bits).sum();
        // The additional bit of octants without covered cells.
        octants_bits + u32::from(block.covered == 0) < list_bits
    });
    match (block.covered == 0, shorter_octants.is_none()) {
        (true, true) => writer.word(0, 1),
        (true, false) => writer.word(0b01, 2),
        (false, is_list) => writer.word(0b011 | u32::from(!is_list) << 2, 3),
    }
    match shorter_octants {
        Some(octants) => octants.into_iter().for_each(|(word, bits)| writer.word(word, bits)),
        None => {
            writer.gap(cells - 1);
            bits(block.known).for_each(|number| writer.word(number, 6));
            bits(block.known).for_each(|number| writer.word((block.wall >> number) as u32 & 1, 1));
        }
    }
    if block.covered != 0 {
        bits(block.known & !block.wall).for_each(|number| writer.word((block.covered >> number) as u32 & 1, 1));
    }
}

/// An octant, given its reported cells and those of them that are wall: at most 20 bits.
fn octant_word(known: u32, wall: u32) -> (u32, u32) {
    let (shape, shape_bits) = match known {
        0 => return (0, 1),
        ALL => (0b11, 2),
        _ => (known << 2 | 0b01, 10),
    };
    let (walls, walls_bits) = match wall {
        0 => (0, 1),
        _ if wall == known => (0b01, 2),
        _ => (gathered(wall, known) << 2 | 0b11, 2 + known.count_ones()),
    };
    (walls << shape_bits | shape, shape_bits + walls_bits)
}

/// The bits of an octant at the ones of a mask, gathered at the lower end.
fn gathered(octant: u32, mask: u32) -> u32 {
    if mask == ALL {
        return octant;
    }
    bits(mask.into()).zip(0..).fold(0, |word, (from, to)| word | (octant >> from & 1) << to)
}

/// The inverse: bits at the lower end, scattered to the ones of a mask.
fn scattered(word: u32, mask: u32) -> u32 {
    if mask == ALL {
        return word;
    }
    bits(mask.into()).zip(0..).fold(0, |octant, (to, from)| octant | (word >> from & 1) << to)
}

/// Decodes a message: its receivers and its delta.
///
/// # Errors
/// If the bytes are no map message for a map of this extent and a team of `agents`.
pub(super) fn decode(bytes: &[u8], extent: Extent, agents: u32) -> Result<(Vec<AgentId>, Delta), MapMessageError> {
    let mut reader = Reader { bytes, at: 0 };
    let version = reader.byte()?;
    if version != VERSION {
        return Err(MapMessageError::Version(version));
    }
    let receivers = receivers(&mut reader, agents)?;
    let count = reader.number()?;
    let delta = Delta { blocks: blocks(&bytes[reader.at..], count, Layout::new(extent), bytes.len())? };
    Ok((receivers, delta))
}

fn receivers(reader: &mut Reader<'_>, agents: u32) -> Result<Vec<AgentId>, MapMessageError> {
    let mut left = reader.number()?;
    let mut receivers = Vec::new();
    let mut next = 0;
    while left > 0 {
        let start = next + u64::from(reader.number()?);
        let run = if left > 1 { u64::from(reader.number()?) + 1 } else { 1 };
        // The numbers are untrusted.
        if start + run > agents.into() {
            let agent = start.max(agents.into());
            return Err(MapMessageError::Agent { agent, agents });
        }
        if run > left.into() {
            return Err(MapMessageError::Run { run, left });
        }
        receivers.extend((start..start + run).map(|agent| AgentId(agent as u32)));
        left -= run as u32;
        next = start + run + 1;
    }
    Ok(receivers)
}

fn blocks(bytes: &[u8], count: u32, layout: Layout, message_bytes: usize) -> Result<Vec<Block>, MapMessageError> {
    // The count is untrusted and must not reserve memory.
    let mut blocks = Vec::with_capacity((count as usize).min(8 * bytes.len() / BLOCK_BITS_MIN));
    let mut reader = Bits::new(bytes);
    let mut next = 0;
    for _ in 0..count {
        let gap = reader.gap();
        if reader.has_overrun() {
            return Err(MapMessageError::Short(message_bytes));
        }
        let index = gap.map_or(u32::MAX, |gap| next + gap);
        if index >= layout.count() {
            return Err(MapMessageError::Outside { block: index.into() });
        }
        let block = block(&mut reader, index);
        if reader.has_overrun() {
            return Err(MapMessageError::Short(message_bytes));
        }
        let block = block.ok_or(MapMessageError::Block(index))?;
        if block.known & !layout.inside(index) != 0 {
            return Err(MapMessageError::Outside { block: index.into() });
        }
        blocks.push(block);
        next = index + 1;
    }
    match reader.rest() {
        (0, 0) => Ok(blocks),
        (0, _) => Err(MapMessageError::Filling),
        (left, _) => Err(MapMessageError::Long(left)),
    }
}

/// Decodes a block; `None` if it is not as documented. Bits beyond the end may make it either.
fn block(reader: &mut Bits<'_>, index: u32) -> Option<Block> {
    let is_bare_list = !reader.bit();
    let has_covered = !is_bare_list && reader.bit();
    let is_list = is_bare_list || has_covered && !reader.bit();
    let mut block = Block { index, ..Block::default() };
    if is_list {
        let cells = reader.gap()? + 1;
        let mut next = 0;
        for _ in 0..cells {
            let number = reader.word(6);
            if number < next {
                return None;
            }
            next = number + 1;
            block.known |= 1 << number;
        }
        for number in bits(block.known) {
            block.wall |= u64::from(reader.bit()) << number;
        }
    } else {
        for place in 0..8 {
            let (known, wall) = octant(reader)?;
            block.known |= u64::from(known) << (8 * place);
            block.wall |= u64::from(wall) << (8 * place);
        }
    }
    if has_covered {
        for number in bits(block.known & !block.wall) {
            block.covered |= u64::from(reader.bit()) << number;
        }
    }
    (block.known != 0 && has_covered == (block.covered != 0)).then_some(block)
}

/// Decodes an octant: reported cells and walls; `None` if it is not as documented.
fn octant(reader: &mut Bits<'_>) -> Option<(u32, u32)> {
    // An octant has at most 20 bits, all of which are looked at in one word.
    let ahead = reader.ahead();
    if ahead & 1 == 0 {
        reader.skip(1);
        return Some((0, 0));
    }
    let (known, used) = match ahead >> 1 & 1 {
        0 => ((ahead >> 2) as u32 & ALL, 10),
        _ => (ALL, 2),
    };
    if used == 10 && (known == 0 || known == ALL) {
        return None;
    }
    let ahead = ahead >> used;
    let (wall, more) = match ahead & 0b11 {
        0b00 | 0b10 => (0, 1),
        0b01 => (known, 2),
        _ => {
            let count = known.count_ones();
            let wall = scattered((ahead >> 2) as u32 & ((1 << count) - 1), known);
            if wall == 0 || wall == known {
                return None;
            }
            (wall, 2 + count)
        }
    };
    reader.skip(used + more);
    Some((known, wall))
}

fn put(bytes: &mut Vec<u8>, mut number: u32) {
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Reader<'_> {
    fn byte(&mut self) -> Result<u8, MapMessageError> {
        let byte = *self.bytes.get(self.at).ok_or(MapMessageError::Short(self.bytes.len()))?;
        self.at += 1;
        Ok(byte)
    }

    fn number(&mut self) -> Result<u32, MapMessageError> {
        let start = self.at;
        let mut number = 0u64;
        for place in 0..NUMBER_BYTES_MAX {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7f) << (7 * place);
            if byte & 0x80 == 0 {
                return u32::try_from(number).map_err(|_| MapMessageError::Number(start));
            }
        }
        Err(MapMessageError::Number(start))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::exploration_map::{Change, Finding};

    fn extent(size: [u32; 3]) -> Extent {
        Extent::new(size, 1.0).unwrap()
    }

    fn block(index: u32, known: u64, wall: u64, covered: u64) -> Block {
        Block { index, known, wall, covered }
    }

    #[test]
    fn byte_for_byte_as_documented() {
        let blocks = vec![
            // Cells 3 and 5, one of them a wall.
            block(1, 0b10_1000, 0b10_0000, 0),
            // Octants: all free; all wall; five cells, of which one is wall; and none.
            block(2, 0x1f_ffff, 0x04_ff00, 0),
            // One covered cell, one that is not.
            block(5, 0b11, 0, 0b10),
        ];
        let delta = Delta { blocks };
        let receivers = [1, 4, 5, 6, 8].map(AgentId);
        let bytes = encode(&receivers, &delta);
        let strings = [
            "100 0 100 110000 101000 0 1",
            "0 10 110 1110 10 11111000 11 00100 0 0 0 0 0",
            "101 110 100 000000 100000 0 0 0 1",
        ];
        let written = strings.concat().replace(' ', "");
        let mut expected = vec![3, 5, 1, 0, 1, 2, 0, 3];
        for byte in written.as_bytes().chunks(8) {
            expected.push(byte.iter().rev().fold(0, |bits, digit| bits << 1 | (digit - b'0')));
        }
        assert_eq!(bytes, expected);
        let map = extent([8, 8, 8]);
        assert_eq!(decode(&bytes, map, 9), Ok((receivers.to_vec(), delta)));
        assert_eq!(decode(&bytes, extent([8, 8, 4]), 9), Err(MapMessageError::Outside { block: 5 }));
        assert_eq!(decode(&bytes, extent([8, 5, 8]), 9), Err(MapMessageError::Outside { block: 2 }));
        assert_eq!(decode(&bytes, map, 8), Err(MapMessageError::Agent { agent: 8, agents: 8 }));
    }

    #[test]
    fn malformed_bytes_are_refused_with_the_reason() {
        let refused = |bytes: &[u8]| decode(bytes, extent([8, 8, 8]), 2).unwrap_err().to_string();
        assert_eq!(refused(&[]), "truncated after 0 bytes");
        assert_eq!(refused(&[1, 0]), "version 1, expected 3");
        assert_eq!(refused(&[3, 0, 1]), "truncated after 3 bytes");
        assert_eq!(refused(&[3, 0, 1, 0]), "truncated after 4 bytes");
        assert_eq!(refused(&[3, 0, 0, 7]), "1 bytes after its end");
        assert_eq!(refused(&[3, 2, 0, 2, 0]), "receiver 2 is not part of the run, allowed are 0 to 1");
        assert_eq!(refused(&[3, 1, 2, 0]), "receiver 2 is not part of the run, allowed are 0 to 1");
        let long = "the number at byte 1 is larger than 4294967295 or longer than 5 bytes";
        assert_eq!(refused(&[3, 0xff, 0xff, 0xff, 0xff, 0x1f]), long);
        assert_eq!(refused(&[3, 0x80, 0x80, 0x80, 0x80, 0x80]), long);
        let bits = |digits: &str| {
            let digits: Vec<u8> = digits.bytes().filter(|&digit| digit != b' ').collect();
            let byte = |digits: &[u8]| digits.iter().rev().fold(0, |bits, digit| bits << 1 | (digit - b'0'));
            [[3, 0, 1].as_slice(), &digits.chunks(8).map(byte).collect::<Vec<u8>>()].concat()
        };
        assert!(decode(&bits("0 0 0 010000 1 000000"), extent([8; 3]), 2).is_ok());
        assert_eq!(refused(&bits("0 0 0 010000 1 000010")), "a bit is set after its end");
        assert_eq!(refused(&bits("1110100 0 0 010000 1 000000")), "block 8 has cells outside the map");
        let endless = "block 4294967295 has cells outside the map";
        assert_eq!(refused(&bits(&"1".repeat(96))), endless);
        let wrong = "block 0 is empty or not encoded canonically";
        for digits in [
            "0 0 100 010000 010000 1 1",
            "0 0 100 010000 100000 1 1",
            "0 10 00000000",
            "0 10 10 00000000 0 0000000",
            "0 10 10 11111111 0 0000000",
            "0 10 10 11000000 11 11 0000000",
            "0 10 11 11 00000000 0000000",
            "0 110 0 010000 0 0",
            "0 110 0 010000 1",
        ] {
            assert_eq!(refused(&bits(&format!("{digits} {}", "0".repeat(64)))), wrong, "{digits}");
        }
    }

    fn findings(volume: u32) -> impl Strategy<Value = Vec<(u32, Finding)>> {
        let finding = prop::sample::select(vec![Finding::Free, Finding::Wall, Finding::Covered]);
        let scattered = prop::collection::vec((0..volume, finding), 0..60);
        let mixed = prop::sample::select(vec![Finding::Free, Finding::Wall]);
        let dense = (0..volume, prop::collection::vec(mixed, 0..300))
            .prop_map(move |(start, findings)| (start..volume).zip(findings).collect::<Vec<_>>());
        (scattered, dense).prop_map(|(scattered, dense)| [scattered, dense].concat())
    }

    proptest! {
        #[test]
        fn encoding_round_trips_within_its_size_bound(
            receivers in prop::collection::btree_set(0u32..9, 0..9),
            findings in findings(50_000),
            size in prop::sample::select(vec![[1024, 1024, 1024], [7, 90, 80], [50_000 / 50, 50, 1]]),
        ) {
            let receivers: Vec<AgentId> = receivers.into_iter().map(AgentId).collect();
            let count = findings.len();
            let changes = findings.into_iter().map(|(cell, finding)| Change { cell, finding, from: None });
            let delta = Delta::of(extent(size), changes);
            let bytes = encode(&receivers, &delta);
            prop_assert!(bytes.len() <= bare_bytes_max(receivers.len()) + CELL_BYTES_MAX * count);
            prop_assert_eq!(decode(&bytes, extent(size), 9), Ok((receivers, delta)));
        }

        #[test]
        fn one_cell_stays_within_the_size_bound(cell in 0u32..1 << 30) {
            let changes = [Change { cell, finding: Finding::Covered, from: None }];
            let bytes = encode(&[], &Delta::of(extent([1024; 3]), changes));
            prop_assert!(bytes.len() <= 3 + CELL_BYTES_MAX);
        }

        #[test]
        fn decoded_cells_lie_inside_the_map(
            mut bytes in prop::collection::vec(any::<u8>(), 4..40),
            blocks in 0u8..3,
        ) {
            bytes[..3].copy_from_slice(&[VERSION, 0, blocks]);
            let extent = extent([18, 10, 5]);
            for end in 3..=bytes.len() {
                let Ok((_, delta)) = decode(&bytes[..end], extent, 4) else { continue };
                prop_assert_eq!(delta.findings(extent).count(), delta.len());
                prop_assert!(delta.blocks.is_sorted_by(|a, b| a.index < b.index));
                let again = decode(&encode(&[], &delta), extent, 4);
                prop_assert_eq!(again, Ok((vec![], delta)));
            }
        }
    }
}
