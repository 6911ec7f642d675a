//! The encoding of the blocks of a delta as a bit stream.
//!
//! Blocks ascend. Blocks, the numbers of cells in them and their octants are those of [`Block`];
//! words and gaps of bits are those of `bits.rs`. A block is:
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
//! The last byte is padded with zeros, and nothing follows it. A cell takes between 27/64 of a bit,
//! in a block that is all free, and 64 bits.
//!
//! Invariant: decoded blocks are ascending, not empty, and inside the map.

use voxels::bits;

use super::super::bits::{Reader as Bits, Writer, gap_bits};
use super::MapMessageError;
use crate::exploration_map::{Block, Layout};

/// Most bytes that one more cell can add to a message: a block of its own, covered and far from the
/// others, takes 61 bits, of which the gap takes 49.
pub(in super::super) const CELL_BYTES_MAX: usize = 8;

/// Fewest bits of a block: a gap of 0, a list of one cell.
const BLOCK_BITS_MIN: usize = 10;

/// So few cells are always listed: 17 bits, where seven empty octants and one with some cells take
/// 18.
const LISTED_CELLS: u32 = 2;

/// An octant with all of its cells.
const ALL: u32 = 0xff;

/// Appends blocks to bytes.
pub(super) fn put_blocks(bytes: &mut Vec<u8>, blocks: &[Block]) {
    let mut writer = Writer::new(bytes);
    let mut next = 0;
    for block in blocks {
        writer.gap(block.index - next);
        next = block.index + 1;
        put_block(&mut writer, block);
    }
    writer.end();
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

/// Decodes so many blocks, which take all of the bytes.
pub(super) fn blocks(
    bytes: &[u8],
    count: u32,
    layout: Layout,
    message_bytes: usize,
) -> Result<Vec<Block>, MapMessageError> {
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
