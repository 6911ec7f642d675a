//! Messages that several agents of a process receive in one tick, kept once.
//!
//! Every observation from another process has bytes of its own. A message to a dense neighbourhood
//! reaches the agents of a process in as many observations; if they share its bytes, it is decoded
//! once.

use std::collections::BTreeMap;

use msgs::maes_msgs::Observation as Part;
use msgs::shared_bytes::SharedBytes;

/// The messages of the last tick in which agents received any.
#[derive(Debug, Default)]
pub(super) struct MessagePool {
    tick: u64,
    /// By sender and number of bytes; of several such messages the last one.
    messages: BTreeMap<(u32, usize), SharedBytes>,
}

impl MessagePool {
    /// Makes the messages of an observation share their bytes with equal ones that other agents
    /// received in the same tick.
    pub(super) fn share(&mut self, part: &mut Part) {
        if part.messages.is_empty() {
            return;
        }
        if part.tick != self.tick {
            *self = Self { tick: part.tick, ..Self::default() };
        }
        for message in &mut part.messages {
            let kept = self.messages.entry((message.agent, message.data.len())).or_insert_with(|| message.data.clone());
            if *kept == message.data {
                message.data = kept.clone();
            } else {
                *kept = message.data.clone();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use msgs::maes_msgs::AgentMessage;

    use super::*;

    fn received(pool: &mut MessagePool, tick: u64, messages: &[(u32, &[u8])]) -> Vec<SharedBytes> {
        let message =
            |&(agent, data): &(u32, &[u8])| AgentMessage { agent, data: data.into(), ..AgentMessage::default() };
        let mut part = Part { tick, messages: messages.iter().map(message).collect(), ..Part::default() };
        pool.share(&mut part);
        assert!(part.messages.iter().map(|message| (message.agent, &*message.data)).eq(messages.iter().copied()));
        part.messages.into_iter().map(|message| message.data).collect()
    }

    #[test]
    fn equal_messages_of_a_tick_share_their_bytes() {
        let mut pool = MessagePool::default();
        let first = received(&mut pool, 4, &[(1, &[7, 8]), (2, &[9])]);
        let second = received(&mut pool, 4, &[(1, &[7, 8]), (2, &[5]), (3, &[9])]);
        let third = received(&mut pool, 4, &[(2, &[5])]);
        let later = received(&mut pool, 5, &[(1, &[7, 8])]);
        assert!(std::ptr::eq(&*first[0], &*second[0]));
        assert!(std::ptr::eq(&*second[1], &*third[0]));
        assert!(!std::ptr::eq(&*first[0], &*later[0]));
    }
}
