//! Map messages as their receivers have them: decoded once for all that share the bytes.

use std::sync::Arc;

use msgs::ids::AgentId;
use msgs::shared_bytes::SharedBytes;
use voxels::Extent;

use super::agent_set::AgentSet;
use super::map_message::{self, Acknowledgement, MapMessageError, Message, SenderState};
use crate::exploration_map::Delta;

/// The content of a map message; see [`Message`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Content {
    Summary(Arc<Summary>),
    Update(Update),
    Acknowledgement(Arc<Acknowledgement>),
}

/// What an agent says that it knows.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Summary {
    /// How many summaries the sender has sent before.
    pub(super) number: u32,
    pub(super) state: SenderState,
    /// To whom it was sent.
    pub(super) receivers: AgentSet,
    pub(super) known: Known,
}

/// What an agent knows: positions in the journals of agents, by agent; 0 where nothing is known,
/// and beyond the end.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Known(Vec<u32>);

/// Cells for some receivers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Update {
    pub(super) receivers: AgentSet,
    pub(super) until: u32,
    pub(super) delta: Delta,
    /// Number of reported cells.
    pub(super) cells: u64,
}

impl Known {
    /// By agent.
    pub(super) fn positions(&self) -> &[u32] {
        &self.0
    }

    /// The position in the journal of an agent.
    pub(super) fn of(&self, agent: AgentId) -> u32 {
        self.0.get(agent.index()).copied().unwrap_or(0)
    }

    /// Sets the position in the journal of an agent.
    pub(super) fn set(&mut self, agent: AgentId, position: u32) {
        if agent.index() >= self.0.len() {
            self.0.resize(agent.index() + 1, 0);
        }
        self.0[agent.index()] = position;
    }

    /// Adds what another agent knows.
    pub(super) fn join(&mut self, other: &Self) {
        if other.0.len() > self.0.len() {
            self.0.resize(other.0.len(), 0);
        }
        self.0.iter_mut().zip(&other.0).for_each(|(own, other)| *own = (*own).max(*other));
    }
}

/// A decoded message, with what decides on its content besides its bytes.
struct Decoded {
    extent: Extent,
    agents: u32,
    content: Result<Arc<Content>, MapMessageError>,
}

/// The content of a message for a map of this extent and a team of `agents`; it is decoded unless
/// another receiver has done that.
///
/// # Errors
/// See [`map_message::decode`].
pub(super) fn content(data: &SharedBytes, extent: Extent, agents: u32) -> Result<Arc<Content>, MapMessageError> {
    let decoded = data.decoded(|bytes| Decoded { extent, agents, content: decode(bytes, extent, agents) });
    // All receivers are agents of one run, except where bytes outlive it.
    let is_of_this_run = (decoded.extent, decoded.agents) == (extent, agents);
    if is_of_this_run { decoded.content.clone() } else { decode(data, extent, agents) }
}

fn decode(bytes: &[u8], extent: Extent, agents: u32) -> Result<Arc<Content>, MapMessageError> {
    let content = match map_message::decode(bytes, extent, agents)? {
        Message::Summary { number, state, receivers, known } => {
            let mut positions = Known::default();
            known.into_iter().for_each(|(agent, position)| positions.set(agent, position));
            let receivers = AgentSet::of(receivers);
            Content::Summary(Arc::new(Summary { number, state, receivers, known: positions }))
        }
        Message::Update { receivers, until, delta } => {
            let (receivers, cells) = (AgentSet::of(receivers), delta.len() as u64);
            Content::Update(Update { receivers, until, delta, cells })
        }
        Message::Acknowledgement(acknowledgement) => Content::Acknowledgement(Arc::new(acknowledgement)),
    };
    Ok(Arc::new(content))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::sharing::VERSION;

    fn extent(side: u32) -> Extent {
        Extent::new([side; 3], 1.0).unwrap()
    }

    #[test]
    fn joined_positions_are_what_either_knows() {
        let known = |positions: &[u32]| Known(positions.to_vec());
        let mut joined = known(&[5, 0, 2]);
        joined.join(&known(&[3, 4, 2, 1]));
        assert_eq!(joined, known(&[5, 4, 2, 1]));
        assert_eq!([1, 7].map(|agent| joined.of(AgentId(agent))), [4, 0]);
    }

    #[test]
    fn each_run_has_its_own_content() {
        let data = SharedBytes::from(vec![VERSION, 1, 1, 2, 9, 1, 1, 0]);
        let receivers = |side, agents| match content(&data, extent(side), agents)?.as_ref() {
            Content::Update(Update { receivers, .. }) => Ok(receivers.iter().collect()),
            content => panic!("{content:?}"),
        };
        assert_eq!(receivers(4, 3), Err(MapMessageError::Outside { block: 1 }));
        assert_eq!(receivers(4, 2), Err(MapMessageError::Agent { agent: 2, agents: 2 }));
        assert_eq!(receivers(8, 3), Ok(vec![AgentId(2)]));
    }

    proptest! {
        #[test]
        fn shared_content_is_that_of_a_copy(form in 0..4_u8, mut bytes in prop::collection::vec(any::<u8>(), 5..40)) {
            bytes[..4].copy_from_slice(&[VERSION, form, 0, 1]);
            let data = SharedBytes::from(bytes.clone());
            let [first, second] = [&data, &data.clone()].map(|data| content(data, extent(9), 4));
            if let (Ok(first), Ok(second)) = (&first, &second) {
                prop_assert!(Arc::ptr_eq(first, second));
            }
            prop_assert_eq!(&first, &second);
            prop_assert_eq!(first, decode(&bytes, extent(9), 4));
        }
    }
}
