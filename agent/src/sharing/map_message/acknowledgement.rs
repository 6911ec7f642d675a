//! Acknowledgements: what their receivers have been sent, and who sends them the rest.

use msgs::ids::AgentId;
use voxels::{Extent, bits};

use super::super::agent_set::AgentSet;
use super::{MapMessageError, Reader, put, put_receivers, receivers};

/// Some receivers have been sent all that they lacked.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(in super::super) struct Acknowledgement {
    /// Whether its receivers are to pass on what they have been sent, as relay peers.
    pub(in super::super) is_for_relay_peers: bool,
    /// Ascending.
    pub(in super::super) receivers: Vec<Acknowledged>,
    /// If they have got them all, they know the journal of the sender up to this position.
    pub(in super::super) until: u32,
    /// The delegates, ascending, each with the position up to which its journal has to be known.
    delegates: Vec<(AgentId, u32)>,
    /// For each receiver one bit for each delegate, padded to whole bytes: whether it sends it
    /// something. One list for all, for a dense neighbourhood has as many delegates as receivers.
    sends: Vec<u8>,
}

/// A receiver that has been sent all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in super::super) struct Acknowledged {
    pub(in super::super) receiver: AgentId,
    /// The number of the last summary that it was sent.
    pub(in super::super) summary: u32,
    /// Number of updates that it was sent since then.
    pub(in super::super) updates: u32,
}

impl Acknowledgement {
    /// An acknowledgement for receivers, ascending, each with its delegates, whose positions are
    /// given.
    pub(in super::super) fn new(
        receivers: &[(Acknowledged, &AgentSet)],
        (until, is_for_relay_peers): (u32, bool),
        position: impl Fn(AgentId) -> u32,
    ) -> Self {
        let mut all = AgentSet::default();
        receivers.iter().flat_map(|(_, delegates)| delegates.iter()).for_each(|delegate| all.insert(delegate));
        let delegates: Vec<(AgentId, u32)> = all.iter().map(|delegate| (delegate, position(delegate))).collect();
        let byte = |of_one: &AgentSet, eight: &[(AgentId, u32)]| {
            (0..).zip(eight).fold(0, |byte, (bit, &(delegate, _))| byte | u8::from(of_one.contains(delegate)) << bit)
        };
        let sends = receivers.iter().flat_map(|(_, of_one)| delegates.chunks(8).map(|eight| byte(of_one, eight)));
        let sends = sends.collect();
        let receivers = receivers.iter().map(|(completed, _)| *completed).collect();
        Self { is_for_relay_peers, receivers, until, delegates, sends }
    }

    /// The receivers, ascending.
    pub(in super::super) fn agents(&self) -> Vec<AgentId> {
        self.receivers.iter().map(|completed| completed.receiver).collect()
    }

    /// The place of a receiver among the receivers.
    pub(in super::super) fn place_of(&self, receiver: AgentId) -> Option<usize> {
        self.receivers.binary_search_by_key(&receiver, |completed| completed.receiver).ok()
    }

    /// The delegates that send the receiver at this place the rest, ascending, each with the
    /// position up to which its journal has to be known.
    pub(in super::super) fn rest_from(&self, place: usize) -> impl Iterator<Item = (AgentId, u32)> + '_ {
        let by_eight = self.row(place).iter().zip(self.delegates.chunks(8));
        by_eight.flat_map(|(&byte, eight)| bits(byte.into()).map(|bit| eight[bit as usize]))
    }

    fn row(&self, place: usize) -> &[u8] {
        let row = self.delegates.len().div_ceil(8);
        &self.sends[place * row..][..row]
    }

    /// Appends it to bytes.
    pub(super) fn put(&self, bytes: &mut Vec<u8>) {
        put_receivers(bytes, &self.agents());
        put_receivers(bytes, &self.delegates.iter().map(|&(delegate, _)| delegate).collect::<Vec<_>>());
        self.delegates.iter().for_each(|&(_, position)| put(bytes, position));
        for (place, &Acknowledged { summary, updates, .. }) in self.receivers.iter().enumerate() {
            put(bytes, summary);
            put(bytes, updates);
            bytes.extend(self.row(place));
        }
        put(bytes, self.until);
    }

    pub(super) fn decode(
        reader: &mut Reader<'_>,
        is_for_relay_peers: bool,
        extent: Extent,
        agents: u32,
    ) -> Result<Self, MapMessageError> {
        let named = receivers(reader, agents)?;
        let mut acknowledgement = Self { is_for_relay_peers, ..Self::default() };
        for delegate in receivers(reader, agents)? {
            acknowledgement.delegates.push((delegate, reader.position(extent)?));
        }
        for receiver in named {
            let (summary, updates) = (reader.number()?, reader.number()?);
            for eight in acknowledgement.delegates.chunks(8) {
                let byte = reader.byte()?;
                if byte >> (eight.len() - 1) > 1 {
                    return Err(MapMessageError::Filling);
                }
                acknowledgement.sends.push(byte);
            }
            acknowledgement.receivers.push(Acknowledged { receiver, summary, updates });
        }
        acknowledgement.until = reader.position(extent)?;
        Ok(acknowledgement)
    }
}
