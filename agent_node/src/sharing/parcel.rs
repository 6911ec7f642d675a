//! The bytes of a map parcel.
//!
//! | bytes | content |
//! |---|---|
//! | 1 | version of this form, [`VERSION`] |
//! | number | how many agents are told the same in the same tick, the receiver included |
//! | number each | their ids, ascending: the first one, then how many ids lie between it and the next, and so on |
//! | list | free cells that are not known to be covered |
//! | list | walls |
//! | list | covered cells, which are free as well |
//!
//! A *number* is an unsigned LEB128: 7 bits in each byte, the lowest first, the top bit set in all bytes but the last; at most
//! 2^32 - 1, at most 5 bytes. A *list* is the number of its runs, a number, followed by two numbers for each run of consecutive
//! cell indices, in ascending order: how many cells lie between the end of the run before it (or the start of the map) and its
//! start; and its length less one. Nothing follows the last list.
//!
//! Invariant: what [`decode`] gives is ascending, disjoint, inside the map, and about agents that take part; a parcel of which
//! any byte is wrong gives nothing at all.

use std::ops::Range;

use msgs::ids::AgentId;
use thiserror::Error;

use crate::exploration_map::Delta;

/// Version of the form.
pub const VERSION: u8 = 1;

/// The most bytes that one more cell can make a parcel longer by: a run of its own far from the others.
pub(super) const CELL_BYTES_MAX: usize = 6;

/// The most bytes of a parcel for so many receivers beside its cells.
pub(super) const fn bare_bytes_max(receivers: usize) -> usize {
    1 + NUMBER_BYTES_MAX * (receivers + 4)
}

const NUMBER_BYTES_MAX: usize = 5;

/// Why bytes are no map parcel of this run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum ParcelError {
    /// It is of another version.
    #[error("version {0}, expected {VERSION}")]
    Version(u8),
    /// It ends too early.
    #[error("it ends after {0} bytes, in the middle of its content")]
    Short(usize),
    /// A number is too large.
    #[error("the number at byte {0} is larger than 4294967295 or longer than 5 bytes")]
    Number(usize),
    /// An agent does not take part.
    #[error("it is for agent {agent}, allowed are 0 to {}", agents.saturating_sub(1))]
    Agent {
        /// The id.
        agent: u64,
        /// How many take part.
        agents: u32,
    },
    /// A cell lies outside the map.
    #[error("it tells of cell {cell}, the map has {volume} cells")]
    Outside {
        /// Index of the cell.
        cell: u64,
        /// Cells in the map.
        volume: u32,
    },
    /// Its sender has told of more cells than an agent can have news of.
    #[error("its sender has told of more than {allowance} cells, as often as there can be news")]
    Barred {
        /// How many cells one sender may tell of in a run.
        allowance: u64,
    },
    /// Something follows.
    #[error("{0} bytes follow its end")]
    Long(usize),
}

/// Says something to some agents, ascending by id.
pub(super) fn encode(receivers: &[AgentId], delta: &Delta) -> Vec<u8> {
    let mut bytes = vec![VERSION];
    put(&mut bytes, receivers.len() as u32);
    let mut next = 0;
    for receiver in receivers {
        put(&mut bytes, receiver.0 - next);
        next = receiver.0 + 1;
    }
    for runs in [&delta.free, &delta.wall, &delta.covered] {
        put(&mut bytes, runs.len() as u32);
        let mut next = 0;
        for run in runs {
            put(&mut bytes, run.start - next);
            put(&mut bytes, run.end - run.start - 1);
            next = run.end;
        }
    }
    bytes
}

/// What was said, and to whom.
///
/// # Errors
/// If the bytes are not a parcel for a map of `volume` cells and a team of `agents`.
pub(super) fn decode(bytes: &[u8], volume: u32, agents: u32) -> Result<(Vec<AgentId>, Delta), ParcelError> {
    let mut reader = Reader { bytes, at: 0 };
    let version = reader.byte()?;
    if version != VERSION {
        return Err(ParcelError::Version(version));
    }
    let mut receivers = Vec::new();
    let mut next = 0u64;
    for _ in 0..reader.number()? {
        let agent = next + u64::from(reader.number()?);
        if agent >= agents.into() {
            return Err(ParcelError::Agent { agent, agents });
        }
        receivers.push(AgentId(agent as u32));
        next = agent + 1;
    }
    let delta = Delta { free: reader.runs(volume)?, wall: reader.runs(volume)?, covered: reader.runs(volume)? };
    match bytes.len() - reader.at {
        0 => Ok((receivers, delta)),
        left => Err(ParcelError::Long(left)),
    }
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
    fn byte(&mut self) -> Result<u8, ParcelError> {
        let byte = *self.bytes.get(self.at).ok_or(ParcelError::Short(self.bytes.len()))?;
        self.at += 1;
        Ok(byte)
    }

    fn number(&mut self) -> Result<u32, ParcelError> {
        let start = self.at;
        let mut number = 0u64;
        for place in 0..NUMBER_BYTES_MAX {
            let byte = self.byte()?;
            number |= u64::from(byte & 0x7f) << (7 * place);
            if byte & 0x80 == 0 {
                return u32::try_from(number).map_err(|_| ParcelError::Number(start));
            }
        }
        Err(ParcelError::Number(start))
    }

    fn runs(&mut self, volume: u32) -> Result<Vec<Range<u32>>, ParcelError> {
        let count = self.number()?;
        // The count is not to be trusted with memory: a run takes two bytes at least.
        let mut runs = Vec::with_capacity((count as usize).min((self.bytes.len() - self.at) / 2));
        let mut next = 0u64;
        for _ in 0..count {
            let start = next + u64::from(self.number()?);
            next = start + u64::from(self.number()?) + 1;
            if next > volume.into() {
                return Err(ParcelError::Outside { cell: next - 1, volume });
            }
            runs.push(start as u32..next as u32);
        }
        Ok(runs)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::exploration_map::{Change, Finding};

    const VOLUME: u32 = 1 << 30;

    #[test]
    fn byte_for_byte_as_documented() {
        let delta = Delta { free: vec![3..5, 300..1324], wall: vec![Range { start: 0, end: 1 }], covered: vec![] };
        let bytes = encode(&[AgentId(1), AgentId(4)], &delta);
        assert_eq!(bytes, [1, 2, 1, 2, 2, 3, 1, 0xa7, 2, 0xff, 7, 1, 0, 0, 0]);
        assert_eq!(decode(&bytes, 1324, 5), Ok((vec![AgentId(1), AgentId(4)], delta)));
        assert_eq!(decode(&bytes, 1323, 5), Err(ParcelError::Outside { cell: 1323, volume: 1323 }));
        assert_eq!(decode(&bytes, 1324, 4), Err(ParcelError::Agent { agent: 4, agents: 4 }));
    }

    #[test]
    fn malformed_bytes_are_refused_with_the_reason() {
        let refused = |bytes: &[u8]| decode(bytes, 100, 2).unwrap_err().to_string();
        assert_eq!(refused(&[]), "it ends after 0 bytes, in the middle of its content");
        assert_eq!(refused(&[2, 0]), "version 2, expected 1");
        assert_eq!(refused(&[1, 0, 1, 5]), "it ends after 4 bytes, in the middle of its content");
        assert_eq!(refused(&[1, 0, 0, 0, 0, 7]), "1 bytes follow its end");
        assert_eq!(refused(&[1, 1, 2, 0, 0, 0]), "it is for agent 2, allowed are 0 to 1");
        assert_eq!(refused(&[1, 0, 1, 99, 1, 0, 0]), "it tells of cell 100, the map has 100 cells");
        let long = "the number at byte 1 is larger than 4294967295 or longer than 5 bytes";
        assert_eq!(refused(&[1, 0xff, 0xff, 0xff, 0xff, 0x1f]), long);
        assert_eq!(refused(&[1, 0x80, 0x80, 0x80, 0x80, 0x80]), long);
        let largest = [0xff, 0xff, 0xff, 0xff, 0x0f];
        let claims = [&[1, 0][..], &largest, &largest, &largest].concat();
        assert_eq!(refused(&claims), "it tells of cell 8589934590, the map has 100 cells");
    }

    fn findings() -> impl Strategy<Value = Vec<(u32, Finding)>> {
        let finding = prop::sample::select(vec![Finding::Free, Finding::Wall, Finding::Covered]);
        prop::collection::vec((prop_oneof![0..VOLUME, 0..200u32], finding), 0..60)
    }

    proptest! {
        #[test]
        fn comes_back_as_it_was_and_no_longer_than_reckoned(
            receivers in prop::collection::btree_set(0u32..9, 0..9),
            findings in findings(),
        ) {
            let receivers: Vec<AgentId> = receivers.into_iter().map(AgentId).collect();
            let count = findings.len();
            let delta = Delta::of(findings.into_iter().map(|(cell, finding)| Change { cell, finding, from: None }));
            let bytes = encode(&receivers, &delta);
            prop_assert!(bytes.len() <= bare_bytes_max(receivers.len()) + CELL_BYTES_MAX * count);
            prop_assert_eq!(decode(&bytes, VOLUME, 9), Ok((receivers, delta)));
        }

        #[test]
        fn what_is_decoded_lies_inside_the_map(mut bytes in prop::collection::vec(any::<u8>(), 0..80)) {
            if let Some(first) = bytes.first_mut() {
                *first = VERSION;
            }
            if let Ok((receivers, delta)) = decode(&bytes, 1000, 4) {
                prop_assert!(receivers.iter().all(|receiver| receiver.0 < 4));
                for runs in [delta.free, delta.wall, delta.covered] {
                    prop_assert!(runs.iter().all(|run| run.start < run.end && run.end <= 1000));
                    prop_assert!(runs.is_sorted_by(|a, b| a.end <= b.start));
                }
            }
        }
    }
}
