//! Relay peers: agents that pass on to a dense neighbourhood what its agents have sent them.
//!
//! Among `n` agents in contact with each other, each of whom has seen something, updates for all
//! would be `n^2`. With a relay peer they are `2 n`: each sends it what it has, and it sends all of
//! that to all.
//!
//! Invariant: of two agents of a dense neighbourhood that exchange their maps, each gets what the
//! other has from that one, or a relay peer in contact with both gets it.

use msgs::ids::AgentId;

use super::agent_set::AgentSet;
use super::outbox::ADDRESSED_MAX;
use super::peer::Peer;
use crate::observation::Contact;

/// Whom an agent sends to what a dense neighbourhood lacks.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Division {
    /// The receivers: the relay peers, and those that no relay peer reaches.
    pub(super) receivers: AgentSet,
    pub(super) relay_peers: AgentSet,
    /// Those that relay peers pass it on to.
    pub(super) left: AgentSet,
}

impl Division {
    /// Divides those in an exchange among the contacts of an agent: the relay peers are the first
    /// ones, in an order that is the same for all, that reach the contacts. Without relay peers if
    /// these would spare nothing.
    pub(super) fn of(exchanging: AgentSet, contacts: AgentSet, in_order: &[AgentId], peers: &[Peer]) -> Self {
        let mut relay_peers = AgentSet::default();
        let mut rest = contacts;
        for &agent in in_order.iter().filter(|&&agent| exchanging.contains(agent)) {
            if rest.is_empty() {
                break;
            }
            let mut reached = rest.clone();
            reached.remove(agent);
            let reached = reached.take(&peers[agent.index()].heard.receivers);
            if !reached.is_empty() {
                rest.take(&reached);
                rest.remove(agent);
                relay_peers.insert(agent);
            }
        }
        let mut left = exchanging.clone();
        let mut receivers = left.take(&rest);
        receivers.extend(&relay_peers);
        left.take(&relay_peers);
        if receivers.len() > ADDRESSED_MAX {
            return Self { receivers: exchanging, ..Self::default() };
        }
        Self { receivers, relay_peers, left }
    }
}

/// Whether one of some agents is in contact with all contacts of another one.
pub(super) fn reach_all(contacts: &[Contact], agents: &[AgentId], peers: &[Peer]) -> bool {
    let reaches_all = |agent: &AgentId| {
        let reached = &peers[agent.index()].heard.receivers;
        contacts.iter().all(|contact| contact.agent == *agent || reached.contains(contact.agent))
    };
    agents.iter().any(reaches_all)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::Point3;
    use proptest::prelude::*;

    use super::super::decoded::Summary;
    use super::*;

    /// Peers that have sent their summaries to these agents.
    fn peers(contacts: &[Vec<u32>]) -> Vec<Peer> {
        let heard = |contacts: &Vec<u32>| Summary { receivers: agents(contacts), ..Summary::default() };
        contacts.iter().map(|contacts| Peer { heard: Arc::new(heard(contacts)), ..Peer::default() }).collect()
    }

    fn agents(ids: &[u32]) -> AgentSet {
        AgentSet::of(ids.iter().copied().map(AgentId))
    }

    #[test]
    fn the_first_of_a_clique_is_its_relay_peer() {
        let peers = peers(&[vec![1, 2, 3], vec![0, 2, 3], vec![0, 1, 3], vec![0, 1, 2]]);
        let [one, two] = [1, 2].map(AgentId);
        let division = Division::of(agents(&[0, 1, 2]), agents(&[0, 1, 2]), &[two, one], &peers);
        assert_eq!((division.receivers.iter().collect::<Vec<_>>(), division.relay_peers.len()), (vec![two], 1));
        assert_eq!(division.left.iter().collect::<Vec<_>>(), [AgentId(0), one]);
        assert_eq!(Division::of(agents(&[0, 1]), agents(&[0, 1]), &[], &peers).left.len(), 0, "none comes before it");
        let contacts = [0, 1, 2].map(|agent| Contact { agent: AgentId(agent), position: Point3::origin() });
        assert!(!reach_all(&contacts, &[], &peers));
        assert!(reach_all(&contacts, &[one], &peers));
    }

    proptest! {
        #[test]
        fn each_receives_it_or_has_a_relay_peer(
            edges in prop::collection::vec(any::<u64>(), 40),
            exchanging in any::<u64>(),
            order in prop::sample::subsequence((0..40).collect::<Vec<u32>>(), 0..40),
        ) {
            let reached = edges.iter().map(|&edges| (0..40).filter(|&at| edges >> at & 1 != 0).collect());
            let peers = peers(&reached.collect::<Vec<_>>());
            let neighbourhood = AgentSet::of((0..40).map(AgentId));
            let in_order: Vec<AgentId> = order.into_iter().map(AgentId).collect();
            let exchanging = AgentSet::of(neighbourhood.iter().filter(|agent| exchanging >> agent.0 & 1 != 0));
            let division = Division::of(exchanging.clone(), neighbourhood, &in_order, &peers);
            for agent in exchanging.iter() {
                prop_assert!(division.receivers.contains(agent) != division.left.contains(agent));
                let mut relay_peers = division.relay_peers.iter();
                let has_relay_peer = relay_peers.any(|relay_peer| relay_peer != agent && peers[relay_peer.index()].heard.receivers.contains(agent));
                prop_assert!(division.receivers.contains(agent) || has_relay_peer);
            }
            prop_assert!(division.relay_peers.iter().all(|relay_peer| in_order.contains(&relay_peer) && division.receivers.contains(relay_peer)));
            let is_whole = division.left.is_empty() && division.receivers == exchanging;
            prop_assert!(is_whole || division.receivers.len() <= ADDRESSED_MAX);
        }
    }
}
