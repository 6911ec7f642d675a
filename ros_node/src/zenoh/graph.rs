//! The publishers and subscriptions of all processes, by their liveliness tokens.
//!
//! Invariant: at most [`ENTITIES_MAX`] are known; later ones stay unknown until others leave.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ::zenoh::Wait;
use ::zenoh::pubsub::Subscriber;
use ::zenoh::sample::SampleKind;

use super::names::{self, EndpointKind, Entity};

/// Most publishers and subscriptions: several times those of a run with 1000 agents.
const ENTITIES_MAX: usize = 65_536;

/// The graph, which stays up to date while it is there.
pub(super) struct Graph {
    entities: Arc<Entities>,
    _tokens: Subscriber<()>,
}

/// Publishers and subscriptions by their id.
#[derive(Default)]
struct Entities(Mutex<BTreeMap<[u8; 16], Entity>>);

impl Graph {
    /// The graph of a domain.
    pub(super) fn new(session: &::zenoh::Session, domain_id: u16) -> Result<Self, ::zenoh::Error> {
        let entities = Arc::new(Entities::default());
        let shared = Arc::clone(&entities);
        let tokens = session
            .liveliness()
            .declare_subscriber(names::tokens(domain_id))
            .history(true)
            .callback(move |sample| shared.update(sample.key_expr().as_str(), sample.kind() == SampleKind::Put))
            .wait()?;
        Ok(Graph { entities, _tokens: tokens })
    }

    /// The sessions of the publishers of a topic.
    pub(super) fn publishers(&self, topic: &str) -> Vec<[u8; 16]> {
        let entities = self.entities.lock();
        let of_topic = entities.values().filter(|of| of.kind == EndpointKind::Publisher && of.topic == topic);
        of_topic.filter_map(|publisher| names::session_bytes(&publisher.session)).collect()
    }

    /// The subscriptions of other sessions: their topics, ids and sessions.
    pub(super) fn subscriptions(&self, own_session: &str) -> Vec<(String, [u8; 16], [u8; 16])> {
        let entities = self.entities.lock();
        let others = entities.iter().filter(|(_, of)| of.session != own_session);
        let subscriptions = others.filter(|(_, of)| of.kind == EndpointKind::Subscription);
        subscriptions
            .map(|(gid, of)| (of.topic.clone(), *gid, names::session_bytes(&of.session).unwrap_or(*gid)))
            .collect()
    }

    /// The session of a publisher, if it is known.
    pub(super) fn session_of(&self, publisher: &[u8; 16]) -> Option<[u8; 16]> {
        names::session_bytes(&self.entities.lock().get(publisher)?.session)
    }
}

impl Entities {
    fn update(&self, token: &str, is_alive: bool) {
        let Some(entity) = Entity::of_token(token) else { return };
        let (gid, mut entities) = (names::gid(token), self.lock());
        if !is_alive {
            entities.remove(&gid);
        } else if entities.len() < ENTITIES_MAX {
            entities.insert(gid, entity);
        }
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<[u8; 16], Entity>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn token(number: usize) -> String {
        format!("@ros2_lv/0/7f21/0/{number}/MS/%/%/listener/%chatter/T/H/::,1:,:,:,,")
    }

    #[test]
    fn entities_come_and_go() {
        let entities = Entities::default();
        entities.update(&token(1), true);
        entities.update(&token(2), true);
        entities.update("@ros2_lv/0/7f21/0/0/NN/%/%/listener", true);
        entities.update(&token(1), false);
        let left: Vec<_> = entities.lock().keys().copied().collect();
        assert_eq!(left, [names::gid(&token(2))]);
    }

    #[test]
    fn a_flood_of_tokens_is_bounded() {
        let entities = Entities::default();
        (0..ENTITIES_MAX + 10).for_each(|number| entities.update(&token(number), true));
        assert_eq!(entities.lock().len(), ENTITIES_MAX);
    }
}
