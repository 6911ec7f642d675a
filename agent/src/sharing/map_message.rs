//! The encoding of map messages.
//!
//! Every message begins with the version of the encoding, [`VERSION`], and a byte for its form. A
//! *number* is an unsigned LEB128: 7 bits in each byte, the lowest first, the top bit set in all
//! bytes but the last; at most 2^32 - 1, at most 5 bytes. A *position* is a number of entries of
//! the journal of an agent, from its start.
//!
//! *Receivers* are their number and runs of consecutive ids: the number of ids that are skipped
//! before the run, less one after the first run; then, if more than one receiver is left, its
//! length less one. Runs ascend.
//!
//! **Form 0, a summary: what the sender knows.**
//!
//! 1. A byte of flags: 1 if the own sensor of the sender contradicts reports of others, 2 if it
//!    only receives.
//! 2. The number of the summary: how many the sender has sent before.
//! 3. The receivers.
//! 4. The number of agents that it knows something of, and for each, ascending, the number of ids
//!    skipped before it, and the position in its journal up to which it is known.
//!
//! **Form 1, an update: cells for some receivers.**
//!
//! 1. The receivers.
//! 2. A position in the journal of the sender: whoever knows the journal up to there knows the
//!    cells.
//! 3. The number of blocks, and the blocks (`blocks.rs`).
//!
//! **Form 2, an acknowledgement: some receivers have been sent all.**
//!
//! 1. The receivers.
//! 2. The delegates, written like receivers: agents that send receivers what the sender does not.
//!    For each, the position in its journal that belongs to that.
//! 3. For each receiver, the number of the last summary that it was sent, the number of updates
//!    since then, and in as many bytes as it takes one bit for each delegate, the lowest first:
//!    whether that one sends it something.
//! 4. The position in the journal of the sender up to which the receivers know it then.
//!
//! **Form 3, an acknowledgement for relay peers**, which are to pass on what they have been sent:
//! as form 2.
//!
//! Invariant: the result of [`decode`] names only agents of the run, and positions that a journal
//! can have, and has only cells inside the map; a message with any wrong bit is rejected as a
//! whole.

mod acknowledgement;
mod blocks;

use msgs::ids::AgentId;
use thiserror::Error;
use voxels::Extent;

use crate::exploration_map::{CHANGES_MAX, Delta, Layout};
pub(super) use acknowledgement::{Acknowledged, Acknowledgement};
pub(super) use blocks::CELL_BYTES_MAX;
use blocks::{blocks, put_blocks};

/// Version of the encoding.
pub const VERSION: u8 = 4;

/// The forms of messages.
const SUMMARY: u8 = 0;
const UPDATE: u8 = 1;
const ACKNOWLEDGEMENT: u8 = 2;
const ACKNOWLEDGEMENT_FOR_RELAY_PEERS: u8 = 3;

const NUMBER_BYTES_MAX: usize = 5;

/// A map message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Message {
    /// What the sender knows: positions in the journals of agents, ascending by id.
    Summary {
        /// How many summaries the sender has sent before.
        number: u32,
        /// Of the sender.
        state: SenderState,
        /// To whom it is sent, ascending.
        receivers: Vec<AgentId>,
        /// The positions.
        known: Vec<(AgentId, u32)>,
    },
    /// Cells for some receivers.
    Update {
        /// Ascending.
        receivers: Vec<AgentId>,
        /// Whoever knows the journal of the sender up to this position knows the cells.
        until: u32,
        /// The cells.
        delta: Delta,
    },
    /// Some receivers have been sent all that they lacked.
    Acknowledgement(Acknowledgement),
}

/// What a summary says of its sender beside what it knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct SenderState {
    /// Whether its map contradicts reports of others.
    pub(super) has_contradictions: bool,
    /// Whether it sends no updates.
    pub(super) only_receives: bool,
}

/// Most bytes of an update for this many receivers, without its cells.
pub(super) const fn bare_bytes_max(receivers: usize) -> usize {
    2 + NUMBER_BYTES_MAX * (2 * receivers + 3)
}

/// Why bytes are no map message of this run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum MapMessageError {
    /// Another version of the encoding.
    #[error("version {0}, expected {VERSION}")]
    Version(u8),
    /// A form that does not exist.
    #[error("form {0}, allowed are {SUMMARY} to {ACKNOWLEDGEMENT_FOR_RELAY_PEERS}")]
    Form(u8),
    /// Flags of a summary that do not exist.
    #[error("flags {0}, allowed are 0 to 3")]
    Flags(u8),
    /// Truncated after this many bytes.
    #[error("truncated after {0} bytes")]
    Short(usize),
    /// A number out of range, at this byte.
    #[error("the number at byte {0} is larger than 4294967295 or longer than 5 bytes")]
    Number(usize),
    /// An agent that is not part of the run.
    #[error("agent {agent} is not part of the run, allowed are 0 to {}", agents.saturating_sub(1))]
    Agent {
        /// The id.
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
    /// A position that no journal has.
    #[error("position {position}, but no journal has more than {allowance} entries")]
    Position {
        /// The position.
        position: u32,
        /// Number of entries that a journal can have in this run.
        allowance: u64,
    },
    /// A summary that knows more of the journal of its receiver than there is.
    #[error("it knows {position} entries of a journal that has {entries}")]
    Ahead {
        /// The position that it states.
        position: u32,
        /// Number of entries of the journal of this agent.
        entries: usize,
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
        /// Number of cells that one sender may report between two summaries to it.
        allowance: u64,
    },
    /// Trailing bytes, by their number.
    #[error("{0} bytes after its end")]
    Long(usize),
}

/// Encodes what an agent knows, by agent, 0 where nothing is known; if that takes more bytes than
/// these, its own journal alone: what is left out counts as unknown.
pub(super) fn encode_summary(
    (number, state): (u32, SenderState),
    receivers: &[AgentId],
    known: &[u32],
    own: AgentId,
    bytes_max: usize,
) -> Vec<u8> {
    let mut bytes = vec![VERSION, SUMMARY];
    bytes.push(u8::from(state.has_contradictions) | u8::from(state.only_receives) << 1);
    put(&mut bytes, number);
    let mut all = bytes.clone();
    put_receivers(&mut all, receivers);
    put_known(&mut all, known, |_| true);
    if all.len() <= bytes_max {
        return all;
    }
    put_receivers(&mut bytes, &[]);
    put_known(&mut bytes, known, |agent| agent == own.0);
    bytes
}

fn put_known(bytes: &mut Vec<u8>, known: &[u32], is_listed: impl Fn(u32) -> bool) {
    let listed = || (0..).zip(known).filter(|&(agent, &position)| position > 0 && is_listed(agent));
    put(bytes, listed().count() as u32);
    let mut next = 0;
    for (agent, &position) in listed() {
        put(bytes, agent - next);
        put(bytes, position);
        next = agent + 1;
    }
}

/// Encodes cells for receivers, ascending by id.
pub(super) fn encode_update(receivers: &[AgentId], until: u32, delta: &Delta) -> Vec<u8> {
    let mut bytes = vec![VERSION, UPDATE];
    put_receivers(&mut bytes, receivers);
    put(&mut bytes, until);
    put(&mut bytes, delta.blocks.len() as u32);
    put_blocks(&mut bytes, &delta.blocks);
    bytes
}

/// Encodes that some receivers have been sent all.
pub(super) fn encode_acknowledgement(acknowledgement: &Acknowledgement) -> Vec<u8> {
    let mut bytes = vec![
        VERSION,
        if acknowledgement.is_for_relay_peers { ACKNOWLEDGEMENT_FOR_RELAY_PEERS } else { ACKNOWLEDGEMENT },
    ];
    acknowledgement.put(&mut bytes);
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

/// Decodes a message.
///
/// # Errors
/// If the bytes are no map message for a map of this extent and a team of `agents`.
pub(super) fn decode(bytes: &[u8], extent: Extent, agents: u32) -> Result<Message, MapMessageError> {
    let mut reader = Reader { bytes, at: 0 };
    let version = reader.byte()?;
    if version != VERSION {
        return Err(MapMessageError::Version(version));
    }
    let message = match reader.byte()? {
        SUMMARY => {
            let flags = reader.byte()?;
            if flags > 3 {
                return Err(MapMessageError::Flags(flags));
            }
            let state = SenderState { has_contradictions: flags & 1 != 0, only_receives: flags & 2 != 0 };
            let number = reader.number()?;
            let receivers = receivers(&mut reader, agents)?;
            Message::Summary { number, state, receivers, known: known(&mut reader, extent, agents)? }
        }
        UPDATE => {
            let receivers = receivers(&mut reader, agents)?;
            let until = reader.position(extent)?;
            let count = reader.number()?;
            let delta = Delta { blocks: blocks(&bytes[reader.at..], count, Layout::new(extent), bytes.len())? };
            return Ok(Message::Update { receivers, until, delta });
        }
        form @ (ACKNOWLEDGEMENT | ACKNOWLEDGEMENT_FOR_RELAY_PEERS) => Message::Acknowledgement(
            Acknowledgement::decode(&mut reader, form == ACKNOWLEDGEMENT_FOR_RELAY_PEERS, extent, agents)?,
        ),
        form => return Err(MapMessageError::Form(form)),
    };
    match bytes.len() - reader.at {
        0 => Ok(message),
        left => Err(MapMessageError::Long(left)),
    }
}

fn known(reader: &mut Reader<'_>, extent: Extent, agents: u32) -> Result<Vec<(AgentId, u32)>, MapMessageError> {
    let mut known = Vec::new();
    let mut next = 0;
    for _ in 0..reader.number()? {
        let agent = next + u64::from(reader.number()?);
        if agent >= agents.into() {
            return Err(MapMessageError::Agent { agent, agents });
        }
        known.push((AgentId(agent as u32), reader.position(extent)?));
        next = agent + 1;
    }
    Ok(known)
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

    /// A position that a journal can have.
    fn position(&mut self, extent: Extent) -> Result<u32, MapMessageError> {
        let position = self.number()?;
        let allowance = (CHANGES_MAX * extent.volume()) as u64;
        if u64::from(position) > allowance {
            Err(MapMessageError::Position { position, allowance })
        } else {
            Ok(position)
        }
    }
}

#[cfg(test)]
mod tests;
