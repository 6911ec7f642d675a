//! The belief maps that agents publish, received for clients of the Foxglove server.
//!
//! Invariant: an agent is subscribed to while a client wants its map and no longer, because agents
//! make their maps for subscribers only.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::rc::Rc;

use msgs::ids::AgentId;
use msgs::topics;
use msgs::visualization_msgs::Marker;
use ros_node::{EndpointFactory, Inbox, Node, Sample, SubscriptionId};

use super::Item;

/// Most messages that wait to be relayed; the oldest make room.
const WAITING_MAX: usize = 1024;

type Waiting = Rc<RefCell<VecDeque<(AgentId, Marker)>>>;

/// The subscriptions, and what has arrived.
pub(super) struct RelayedBeliefs {
    endpoints: EndpointFactory,
    subscriptions: BTreeMap<AgentId, SubscriptionId>,
    waiting: Waiting,
}

impl RelayedBeliefs {
    pub(super) fn new(endpoints: EndpointFactory) -> Self {
        Self { endpoints, subscriptions: BTreeMap::new(), waiting: Waiting::default() }
    }

    /// Subscribes to the maps of these agents, and ends other subscriptions.
    pub(super) fn select(&mut self, agents: &BTreeSet<AgentId>, node: &mut Node, inbox: &mut Inbox<Item>) {
        let Self { endpoints, subscriptions, waiting } = self;
        subscriptions.retain(|agent, subscription| {
            let is_wanted = agents.contains(agent);
            if !is_wanted {
                inbox.unsubscribe(*subscription);
            }
            is_wanted
        });
        for &agent in agents {
            if subscriptions.contains_key(&agent) {
                continue;
            }
            let waiting = Rc::clone(waiting);
            let topic = topics::belief(agent);
            let subscribed = endpoints.subscribe(node, &topic, inbox, move |sample: Sample<Marker>| {
                if let Ok(marker) = sample.message {
                    let mut waiting = waiting.borrow_mut();
                    if waiting.len() >= WAITING_MAX {
                        waiting.pop_front();
                    }
                    waiting.push_back((agent, marker));
                }
                Item::Handled
            });
            match subscribed {
                Ok(subscription) => drop(subscriptions.insert(agent, subscription)),
                Err(error) => tracing::warn!("{topic}: not relayed: {error}"),
            }
        }
    }

    pub(super) fn next(&mut self) -> Option<(AgentId, Marker)> {
        self.waiting.borrow_mut().pop_front()
    }
}
