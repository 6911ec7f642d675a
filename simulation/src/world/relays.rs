//! Relays that agents have left behind: they float in place, carry messages from one to the next, and keep some bytes.
//!
//! Relays in contact with each other, directly or over others, are a *network*; two agents that hear the same network are in
//! contact. What each agent hears is found out again only once it has moved or a relay has come.
//!
//! Invariants: a relay stays where it was left and is in nobody's way; numbers go up in the order of leaving, by agent.

use msgs::ids::AgentId;
use msgs::relay_id::RelayId;
use nalgebra::Point3;
use voxels::{Grid, Terrain};

use super::comms::{AgentMessage, Comms, Peer};

/// A relay.
#[derive(Debug, Clone, PartialEq)]
pub struct Relay {
    /// Its name.
    pub id: RelayId,
    /// Where it floats, metres, frame `map`.
    pub position: Point3<f64>,
    /// The mark of what it keeps.
    pub kind: u8,
    /// What it keeps.
    pub data: Vec<u8>,
    /// How often something was written on it; 0: it was left empty, and is.
    pub writings: u64,
    network: usize,
}

/// All relays of a world, and who hears and has read them.
#[derive(Debug, Default)]
pub(super) struct Relays {
    /// In the order of leaving.
    relays: Vec<Relay>,
    links: Vec<(usize, usize)>,
    listeners: Vec<Listener>,
}

/// An agent, as far as relays are concerned.
#[derive(Debug, Clone, Default)]
struct Listener {
    left: u32,
    /// Where and among how many relays the list of those in contact was made.
    heard_at: Option<(Point3<f64>, usize)>,
    heard: Vec<usize>,
    /// By relay, how many of its writings the agent knows.
    read: Vec<u64>,
}

impl Relays {
    /// None, for so many agents.
    pub(super) fn new(agents: usize) -> Self {
        Self { listeners: vec![Listener::default(); agents], ..Self::default() }
    }

    /// All of them, in the order of leaving.
    pub(super) fn all(&self) -> &[Relay] {
        &self.relays
    }

    /// The pairs of relays that hear each other, by place in [`Relays::all`].
    pub(super) fn links(&self) -> &[(usize, usize)] {
        &self.links
    }

    /// Leaves a relay behind with this content, unless the agent has none left. Says whether it has.
    pub(super) fn leave(
        &mut self,
        owner: AgentId,
        position: Point3<f64>,
        content: (u8, Vec<u8>),
        comms: &Comms,
        terrain: &Grid<Terrain>,
    ) -> bool {
        let number = self.listeners[owner.index()].left;
        if number >= comms.relays_per_agent {
            return false;
        }
        let new = self.relays.len();
        let heard: Vec<usize> =
            (0..new).filter(|&other| comms.contact.joins(terrain, &self.relays[other].position, &position)).collect();
        // A new network, which takes in those of the relays it hears.
        let joined: Vec<usize> = heard.iter().map(|&other| self.relays[other].network).collect();
        self.relays.iter_mut().filter(|relay| joined.contains(&relay.network)).for_each(|relay| relay.network = new);
        self.links.extend(heard.into_iter().map(|other| (other, new)));
        let (kind, data) = content;
        let writings = u64::from(!data.is_empty());
        self.relays.push(Relay { id: RelayId { owner, number }, position, kind, data, writings, network: new });
        self.listeners[owner.index()].left += 1;
        self.has_read(owner, new);
        true
    }

    /// Writes on a relay that the agent can reach from where it is. Says whether it can.
    pub(super) fn write(
        &mut self,
        writer: AgentId,
        from: Point3<f64>,
        to: RelayId,
        content: (u8, Vec<u8>),
        comms: &Comms,
        terrain: &Grid<Terrain>,
    ) -> bool {
        let reached = self.reached(writer, &from, comms, terrain);
        let Some(relay) = reached.into_iter().find(|&relay| self.relays[relay].id == to) else {
            return false;
        };
        (self.relays[relay].kind, self.relays[relay].data) = content;
        self.relays[relay].writings += 1;
        self.has_read(writer, relay);
        true
    }

    /// The relays that an agent can read and write from where it is, in the order of leaving, by place in [`Relays::all`].
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

    /// What a relay has to tell an agent that reaches it, as a message; nothing if the agent knows it.
    pub(super) fn news(&self, agent: AgentId, relay: usize) -> Option<AgentMessage> {
        let known = self.listeners[agent.index()].read.get(relay).copied().unwrap_or(0);
        let Relay { id, kind, data, writings, .. } = &self.relays[relay];
        (*writings > known).then(|| AgentMessage { peer: Peer::Relay(*id), kind: *kind, data: data.clone() })
    }

    /// Notes that an agent knows what a relay keeps.
    pub(super) fn has_read(&mut self, agent: AgentId, relay: usize) {
        let read = &mut self.listeners[agent.index()].read;
        read.resize(self.relays.len(), 0);
        read[relay] = self.relays[relay].writings;
    }

    /// The networks that an agent hears, ascending.
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
