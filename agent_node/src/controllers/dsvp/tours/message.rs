//! The messages by which agents share tasks out, and their bytes.
//!
//! Invariants: a record takes at most [`RECORD_BYTES_MAX`] bytes; a malformed message decodes to
//! nothing; what decodes names agents of the team, cells of the map and blocks of the task grid.

use msgs::ids::{AgentId, Tick};
use voxels::{Cell, Extent};

use super::tasks::{TaskGrid, TaskId};

/// The mark of messages that share tasks out.
pub const TASKS_MESSAGE: u8 = 3;

const VERSION: u8 = 1;

/// Bytes of a record at most.
pub(super) const RECORD_BYTES_MAX: usize = 90;

/// Bytes of a record without its tasks, and of one task.
const BARE_BYTES: usize = 2 + 4 + 2 + 4 + 1;
const TASK_BYTES: usize = 4;

/// Tasks of a record at most; further ones are not announced.
pub(super) const TASKS_MAX: usize = (RECORD_BYTES_MAX - BARE_BYTES) / TASK_BYTES;

/// What an agent has announced: the tasks it holds.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Record {
    /// Later records of an agent have higher stamps.
    pub(super) stamp: Tick,
    /// When the lease ends: from then on the record holds nothing.
    pub(super) ends: Tick,
    /// Where the agent was.
    pub(super) at: Cell,
    /// In the order of its tour, at most [`TASKS_MAX`].
    pub(super) tasks: Vec<TaskId>,
}

/// A message.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Message {
    /// What the sender knows.
    Records(Vec<(AgentId, Record)>),
    /// The first phase of an exchange: both agents' records as they shall be.
    Proposal {
        /// The stamp of the receiver's record that it replaces.
        replaces: Tick,
        /// The sender's record, whose stamp names the proposal.
        sender: Record,
        /// The receiver's record.
        receiver: Record,
    },
    /// The second phase: the proposal holds, or it does not.
    Answer {
        /// The stamp of the proposal.
        proposal: Tick,
        /// Whether the receiver has taken its record over.
        is_accepted: bool,
    },
}

impl Message {
    pub(super) fn encode(&self, extent: Extent) -> Vec<u8> {
        let mut bytes = vec![VERSION];
        match self {
            Self::Records(records) => {
                bytes.push(0);
                for (agent, record) in records {
                    put_record(&mut bytes, *agent, record, extent);
                }
            }
            Self::Proposal { replaces, sender, receiver } => {
                bytes.push(1);
                bytes.extend(short(*replaces));
                put_record(&mut bytes, AgentId(0), sender, extent);
                put_record(&mut bytes, AgentId(0), receiver, extent);
            }
            Self::Answer { proposal, is_accepted } => {
                bytes.push(2);
                bytes.extend(short(*proposal));
                bytes.push(u8::from(*is_accepted));
            }
        }
        bytes
    }

    pub(super) fn decode(bytes: &[u8], extent: Extent, grid: &TaskGrid, agents: u32) -> Option<Self> {
        let mut rest = Reader { bytes, extent, blocks: grid.blocks(), agents };
        if rest.byte()? != VERSION {
            return None;
        }
        let message = match rest.byte()? {
            0 => {
                let mut records = Vec::new();
                while !rest.bytes.is_empty() {
                    if records.len() == agents as usize {
                        return None;
                    }
                    records.push(rest.record()?);
                }
                Self::Records(records)
            }
            1 => {
                let replaces = rest.tick()?;
                let ((_, sender), (_, receiver)) = (rest.record()?, rest.record()?);
                Self::Proposal { replaces, sender, receiver }
            }
            2 => Self::Answer { proposal: rest.tick()?, is_accepted: rest.byte()? == 1 },
            _ => return None,
        };
        rest.bytes.is_empty().then_some(message)
    }
}

/// A tick in four bytes: more than two years.
fn short(tick: Tick) -> [u8; 4] {
    u32::try_from(tick.0).unwrap_or(u32::MAX).to_le_bytes()
}

fn put_record(bytes: &mut Vec<u8>, agent: AgentId, record: &Record, extent: Extent) {
    let lease_s = (record.ends.0.saturating_sub(record.stamp.0) / TICKS_PER_S).min(u16::MAX.into()) as u16;
    bytes.extend((agent.0 as u16).to_le_bytes());
    bytes.extend(short(record.stamp));
    bytes.extend(lease_s.to_le_bytes());
    bytes.extend((extent.index(record.at).unwrap_or_default() as u32).to_le_bytes());
    let tasks = &record.tasks[..record.tasks.len().min(TASKS_MAX)];
    bytes.push(tasks.len() as u8);
    for task in tasks {
        bytes.extend(&task.block.to_le_bytes()[..3]);
        bytes.push(task.octants);
    }
}

/// Ticks in a second: the unit of leases in messages.
pub(super) const TICKS_PER_S: u64 = 50;

struct Reader<'a> {
    bytes: &'a [u8],
    extent: Extent,
    blocks: u32,
    agents: u32,
}

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.bytes.split_first_chunk()?;
        self.bytes = rest;
        Some(*first)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take::<1>().map(|[byte]| byte)
    }

    fn tick(&mut self) -> Option<Tick> {
        self.take().map(|bytes| Tick(u32::from_le_bytes(bytes).into()))
    }

    fn record(&mut self) -> Option<(AgentId, Record)> {
        let agent = u32::from(u16::from_le_bytes(self.take()?));
        let stamp = self.tick()?;
        let lease_s = u16::from_le_bytes(self.take()?);
        let cell = u32::from_le_bytes(self.take()?) as usize;
        let count = usize::from(self.byte()?);
        if agent >= self.agents || cell >= self.extent.volume() || count > TASKS_MAX {
            return None;
        }
        let mut tasks = Vec::with_capacity(count);
        for _ in 0..count {
            let [low, middle, high] = self.take()?;
            let task = TaskId { block: u32::from_le_bytes([low, middle, high, 0]), octants: self.byte()? };
            if task.block >= self.blocks || task.octants == 0 {
                return None;
            }
            tasks.push(task);
        }
        let ends = stamp.after(u64::from(lease_s) * TICKS_PER_S);
        Some((AgentId(agent), Record { stamp, ends, at: self.extent.cell_at(cell), tasks }))
    }
}

#[cfg(test)]
mod tests;
