//! Radio relays deployed by agents: they stay in place, forward messages and store some bytes.
//!
//! Relays in contact with each other, directly or over others, form a *network*; two agents in
//! contact with the same network are in contact. The relays in contact with an agent are computed
//! again once it has moved or a relay has been deployed.
//!
//! Invariants: a relay never moves and blocks no body; the relays of an agent are numbered in the
//! order of deployment.

use msgs::ids::AgentId;
use msgs::shared_bytes::SharedBytes;
use nalgebra::Point3;
use protocol::relay_id::RelayId;
use voxels::{Grid, Terrain};

use super::comms::{Comms, ContactModel};
use protocol::agent_message::{AgentMessage, Peer};

/// A deployed relay.
#[derive(Debug, Clone, PartialEq)]
pub struct Relay {
    /// Owner and number.
    pub id: RelayId,
    /// Position, metres, frame `map`.
    pub position: Point3<f64>,
    /// The kind of the stored content.
    pub kind: u8,
    /// The stored content.
    pub data: SharedBytes,
    /// Number of writes; 0: it was deployed empty and still is.
    pub writings: u64,
    network: usize,
}

/// All relays of a world, and the agents in contact with them.
#[derive(Debug, Default)]
pub(super) struct Relays {
    /// In the order of deployment.
    relays: Vec<Relay>,
    links: Vec<(usize, usize)>,
    listeners: Vec<Listener>,
}

/// The state of an agent towards the relays.
#[derive(Debug, Clone, Default)]
struct Listener {
    left: u32,
    /// Position and number of relays for which `heard` was computed.
    heard_at: Option<(Point3<f64>, usize)>,
    heard: Vec<usize>,
    /// By relay, the number of writes that the agent has read.
    read: Vec<u64>,
}

impl Relays {
    /// No relays yet, for a team of `agents`.
    pub(super) fn new(agents: usize) -> Self {
        Self { listeners: vec![Listener::default(); agents], ..Self::default() }
    }

    /// All relays, in the order of deployment.
    pub(super) fn all(&self) -> &[Relay] {
        &self.relays
    }

    /// The pairs of relays in contact, as indices into [`Relays::all`].
    pub(super) fn links(&self) -> &[(usize, usize)] {
        &self.links
    }

    /// Deploys a relay with this content; returns false if the agent has none left.
    pub(super) fn deploy(
        &mut self,
        owner: AgentId,
        position: Point3<f64>,
        content: (u8, SharedBytes),
        comms: &Comms,
        terrain: &Grid<Terrain>,
    ) -> bool {
        let number = self.listeners[owner.index()].left;
        if number >= comms.relays_per_agent {
            return false;
        }
        let new = self.relays.len();
        let (kind, data) = content;
        let writings = u64::from(!data.is_empty());
        self.relays.push(Relay { id: RelayId { owner, number }, position, kind, data, writings, network: new });
        self.connect(new, &comms.contact, terrain);
        self.listeners[owner.index()].left += 1;
        self.mark_read(owner, new);
        true
    }

    /// Links a relay with those before it, and unites their networks.
    fn connect(&mut self, new: usize, contact: &ContactModel, terrain: &Grid<Terrain>) {
        let position = self.relays[new].position;
        let heard: Vec<usize> =
            (0..new).filter(|&other| contact.joins(terrain, &self.relays[other].position, &position)).collect();
        // A new network that absorbs the networks of the relays in contact.
        let joined: Vec<usize> = heard.iter().map(|&other| self.relays[other].network).collect();
        self.relays[..new]
            .iter_mut()
            .filter(|relay| joined.contains(&relay.network))
            .for_each(|relay| relay.network = new);
        self.relays[new].network = new;
        self.links.extend(heard.into_iter().map(|other| (other, new)));
    }

    /// Links all relays anew, after a change of the contact model.
    pub(super) fn reconnect(&mut self, contact: &ContactModel, terrain: &Grid<Terrain>) {
        self.links.clear();
        (0..self.relays.len()).for_each(|relay| self.connect(relay, contact, terrain));
        self.listeners.iter_mut().for_each(|listener| listener.heard_at = None);
    }

    /// Writes to a relay; returns false if the agent does not reach it.
    pub(super) fn write(
        &mut self,
        writer: AgentId,
        from: Point3<f64>,
        to: RelayId,
        content: (u8, SharedBytes),
        comms: &Comms,
        terrain: &Grid<Terrain>,
    ) -> bool {
        let reached = self.reached(writer, &from, comms, terrain);
        let Some(relay) = reached.into_iter().find(|&relay| self.relays[relay].id == to) else {
            return false;
        };
        (self.relays[relay].kind, self.relays[relay].data) = content;
        self.relays[relay].writings += 1;
        self.mark_read(writer, relay);
        true
    }

    /// The relays that an agent at `from` can read and write, in the order of deployment, as
    /// indices into [`Relays::all`].
    pub(super) fn reached(
        &mut self,
        agent: AgentId,
        from: &Point3<f64>,
        comms: &Comms,
        terrain: &Grid<Terrain>,
    ) -> Vec<usize> {
        self.listen(agent, from, comms, terrain);
        let is_near = |&relay: &usize| (self.relays[relay].position - from).norm() <= comms.relay_read_range_m;
        self.listeners[agent.index()].heard.iter().copied().filter(is_near).collect()
    }

    /// The content of a relay as a message, `None` if the agent has read it.
    pub(super) fn unread(&self, agent: AgentId, relay: usize) -> Option<AgentMessage> {
        let known = self.listeners[agent.index()].read.get(relay).copied().unwrap_or(0);
        let Relay { id, kind, data, writings, .. } = &self.relays[relay];
        (*writings > known).then(|| AgentMessage { peer: Peer::Relay(*id), kind: *kind, data: data.clone() })
    }

    /// Marks the content of a relay as read by an agent.
    pub(super) fn mark_read(&mut self, agent: AgentId, relay: usize) {
        let read = &mut self.listeners[agent.index()].read;
        read.resize(self.relays.len(), 0);
        read[relay] = self.relays[relay].writings;
    }

    /// The relay networks in contact with an agent, ascending.
    pub(super) fn networks(
        &mut self,
        agent: AgentId,
        from: &Point3<f64>,
        comms: &Comms,
        terrain: &Grid<Terrain>,
    ) -> Vec<usize> {
        self.listen(agent, from, comms, terrain);
        let heard = &self.listeners[agent.index()].heard;
        let mut networks: Vec<usize> = heard.iter().map(|&relay| self.relays[relay].network).collect();
        networks.sort_unstable();
        networks.dedup();
        networks
    }

    fn listen(&mut self, agent: AgentId, from: &Point3<f64>, comms: &Comms, terrain: &Grid<Terrain>) {
        let listener = &mut self.listeners[agent.index()];
        let now = Some((*from, self.relays.len()));
        if listener.heard_at != now {
            listener.heard_at = now;
            let is_heard = |&relay: &usize| comms.contact.joins(terrain, &self.relays[relay].position, from);
            listener.heard = (0..self.relays.len()).filter(is_heard).collect();
        }
    }
}
