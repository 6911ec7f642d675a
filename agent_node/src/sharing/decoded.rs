//! Map messages as their receivers have them: decoded once for all that share the bytes.

use std::sync::{Arc, OnceLock};

use msgs::ids::AgentId;
use msgs::shared_bytes::SharedBytes;
use voxels::Extent;

use super::agent_set::AgentSet;
use super::map_message::{self, MapMessageError};
use crate::exploration_map::Delta;

/// The content of a map message.
#[derive(Debug, Clone)]
pub(super) struct Content {
    pub(super) receivers: AgentSet,
    pub(super) delta: Delta,
    /// Number of reported cells.
    pub(super) cells: u64,
    /// The first sender, and those who know the content because of it.
    holders: OnceLock<(AgentId, Arc<AgentSet>)>,
}

impl Content {
    /// Those who know the content because of a message from this sender.
    pub(super) fn holders(&self, from: AgentId) -> Arc<AgentSet> {
        let with = || Arc::new(self.receivers.with(from));
        let (first, holders) = self.holders.get_or_init(|| (from, with()));
        if *first == from { Arc::clone(holders) } else { with() }
    }
}

impl PartialEq for Content {
    fn eq(&self, other: &Self) -> bool {
        (&self.receivers, &self.delta, self.cells) == (&other.receivers, &other.delta, other.cells)
    }
}

impl Eq for Content {}

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
    let (receivers, delta) = map_message::decode(bytes, extent, agents)?;
    let (receivers, cells) = (AgentSet::of(receivers), delta.len() as u64);
    Ok(Arc::new(Content { receivers, cells, delta, holders: OnceLock::new() }))
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
    fn holders_are_the_receivers_and_the_sender() {
        let data = SharedBytes::from(vec![VERSION, 1, 2, 0]);
        let content = content(&data, extent(4), 4).unwrap();
        for from in [1, 0, 1].map(AgentId) {
            assert_eq!(*content.holders(from), AgentSet::of([from, AgentId(2)]));
        }
    }

    #[test]
    fn each_run_has_its_own_content() {
        let data = SharedBytes::from(vec![VERSION, 1, 2, 1, 1, 0]);
        let receivers =
            |side, agents| content(&data, extent(side), agents).map(|content| content.receivers.iter().collect());
        assert_eq!(receivers(4, 3), Err(MapMessageError::Outside { block: 1 }));
        assert_eq!(receivers(4, 2), Err(MapMessageError::Agent { agent: 2, agents: 2 }));
        assert_eq!(receivers(8, 3), Ok(vec![AgentId(2)]));
    }

    proptest! {
        #[test]
        fn shared_content_is_that_of_a_copy(mut bytes in prop::collection::vec(any::<u8>(), 4..40)) {
            bytes[..3].copy_from_slice(&[VERSION, 0, 1]);
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
