//! The auction: agents claim goals with bids, exchange their claims, and leave contested goals to
//! the best bid.
//!
//! An agent *claims* its goal with the length of its path there as the bid, and sends all claims
//! that it knows to the agents in contact. Of two conflicting claims the shorter path wins (then
//! the lower id), and the loser replans; since all agents know the same bids, they agree after at
//! most as many rounds as there are conflicts. In teams of bodies with different speeds, the bids
//! are travel times: path length over speed, which is known for all bodies. A goal claimed by
//! another agent has less utility, the less the nearer it is to the claim, and a frontier that
//! another agent will reach sooner from its claimed goal is left to it.
//!
//! Sources: W. Burgard, M. Moors, C. Stachniss, F. Schneider, "Coordinated Multi-Robot
//! Exploration", IEEE T-RO 2005 (utility discounted by the goals of others); R. Zlot, A. Stentz, M.
//! B. Dias, S. Thayer, "Multi-Robot Exploration Controlled by a Market Economy", ICRA 2002 (bids
//! that tolerate the loss of communication).
//!
//! Invariants: a claim expires with its lease, so a lost agent does not block goals for long; a
//! malformed message changes nothing; the claims depend on the messages alone, and of several
//! claims of one agent the latest holds.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_3;

use msgs::ids::{AgentId, Tick};
use protocol::message_type::MessageType;
use voxels::{Cell, Extent};

use super::settings::{SettingError, Settings};
use agent::bodies::{Bodies, BodyKind, BodyModel, leg_s};
use agent::command::AgentMessage;
use agent::observation::Contact;

const VERSION: u8 = 1;

/// The leg by which body speeds are compared: its length, metres, and the turn before it, radians.
/// Both are typical of caves.
const REFERENCE_LEG: (f64, f64) = (4.0, FRAC_PI_3);

/// Bytes of a claim in a message.
const CLAIM_BYTES: usize = 28;

/// Upper bound on the remaining lease of a received claim: ten minutes.
const LEASE_TICKS_MAX: u64 = 30_000;

/// Parameters of the auction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AuctionParams {
    /// Distance from a claim at which its effect has fallen to about 0.4, metres.
    pub spread_m: f64,
    /// Share of its utility that a claimed goal loses for others.
    pub discount: f64,
    /// Cost of a frontier that another agent will reach sooner, metres of path.
    pub conflict_penalty_m: f64,
    /// Ratio of path length to straight distance.
    pub detour: f64,
    /// Planning speed of submarines, m/s.
    pub cruise_speed_m_s: f64,
    /// Duration of a claim beyond the travel time, ticks.
    pub lease_ticks: u64,
}

impl AuctionParams {
    /// Takes the parameters from settings of the same names, the lease in seconds (`lease_s`).
    ///
    /// # Errors
    /// If a value is out of range.
    pub fn from_settings(settings: &mut Settings) -> Result<Self, SettingError> {
        Ok(Self {
            spread_m: settings.number("spread_m", 25.0, 0.1, 1000.0)?,
            discount: settings.number("discount", 0.9, 0.0, 1.0)?,
            conflict_penalty_m: settings.number("conflict_penalty_m", 80.0, 0.0, 10_000.0)?,
            detour: settings.number("detour", 1.3, 1.0, 10.0)?,
            cruise_speed_m_s: settings.number("cruise_speed_m_s", 0.8, 0.01, 100.0)?,
            lease_ticks: (settings.number("lease_s", 30.0, 0.0, 600.0)? / Tick::TICK_S).round() as u64,
        })
    }
}

/// A claimed goal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Claim {
    /// The viewpoint.
    pub cell: Cell,
    /// The bid: path length at the time of the claim, metres.
    pub path_m: f64,
    /// When it was made.
    pub made: Tick,
    /// When its lease ends.
    pub ends: Tick,
}

/// Where and when an agent is expected to be free for another goal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Presence {
    /// The agent.
    pub agent: AgentId,
    /// Where.
    pub cell: Cell,
    /// When, seconds from now.
    pub free_in_s: f64,
    /// Its planning speed.
    pub speed_m_s: f64,
}

/// The claims that an agent knows, its own included.
#[derive(Debug, Clone)]
pub struct Auction {
    params: AuctionParams,
    /// Planning speed by agent, m/s.
    speeds_m_s: Vec<f64>,
    own: AgentId,
    extent: Extent,
    claims: BTreeMap<AgentId, Claim>,
}

impl Auction {
    /// The auction as seen by the agent `own`, without claims.
    pub fn new(params: AuctionParams, bodies: &Bodies, own: AgentId, extent: Extent) -> Self {
        let speeds_m_s = bodies.iter().map(|body| planning_speed_m_s(body, params.cruise_speed_m_s)).collect();
        Self { params, speeds_m_s, own, extent, claims: BTreeMap::new() }
    }

    /// Merges received claims and drops expired ones. `agents` is the team size.
    pub fn receive(&mut self, messages: &[AgentMessage], now: Tick, agents: u32) {
        for message in messages.iter().filter(|message| message.is_from_agent(MessageType::Claims)) {
            for (agent, claim) in decode(&message.data, self.extent, agents).into_iter().flatten() {
                let is_newer = self.claims.get(&agent).is_none_or(|known| known.made < claim.made);
                if agent != self.own && is_newer && claim.made <= now {
                    let ends = claim.ends.min(now.after(LEASE_TICKS_MAX));
                    self.claims.insert(agent, Claim { ends, ..claim });
                }
            }
        }
        self.claims.retain(|_, claim| now < claim.ends);
    }

    /// Claims a goal.
    pub fn claim(&mut self, cell: Cell, path_m: f64, now: Tick) {
        let travel_ticks = (path_m / self.speed_m_s(self.own) / Tick::TICK_S) as u64;
        let ends = now.after(travel_ticks).after(self.params.lease_ticks);
        self.claims.insert(self.own, Claim { cell, path_m, made: now, ends });
    }

    /// All known claims, the own one included, by agent.
    pub fn claims(&self) -> impl Iterator<Item = (AgentId, &Claim)> {
        self.claims.iter().map(|(&agent, claim)| (agent, claim))
    }

    /// Withdraws the own claim.
    pub fn withdraw(&mut self) {
        self.claims.remove(&self.own);
    }

    /// The message that carries all known claims: the version (uint8), and for each claim the
    /// agent and the index of the cell (uint32), the path length in millimetres (uint32), and the
    /// ticks in which the claim was made and in which it ends (uint64), little-endian.
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = vec![VERSION];
        for (agent, claim) in &self.claims {
            let Some(cell) = self.extent.index(claim.cell) else { continue };
            bytes.extend(agent.0.to_le_bytes());
            bytes.extend((cell as u32).to_le_bytes());
            bytes.extend(((claim.path_m * 1000.0).min(f64::from(u32::MAX)) as u32).to_le_bytes());
            bytes.extend(claim.made.0.to_le_bytes());
            bytes.extend(claim.ends.0.to_le_bytes());
        }
        bytes
    }

    /// Where this agent expects the others, by agent: at their claimed goals once they are there,
    /// and those in contact that claim none where they are. A claim whose lease has ended says
    /// nothing.
    pub fn presences(&self, contacts: &[Contact], now: Tick) -> Vec<Presence> {
        let of_claim = |(agent, claim): (AgentId, &Claim)| {
            let speed_m_s = self.speed_m_s(agent);
            Presence { agent, cell: claim.cell, free_in_s: self.remaining_m(agent, claim, now) / speed_m_s, speed_m_s }
        };
        let beside =
            contacts.iter().filter(|contact| !self.claims.contains_key(&contact.agent)).map(|contact| Presence {
                agent: contact.agent,
                cell: self.extent.cell_of(&contact.position),
                free_in_s: 0.0,
                speed_m_s: self.speed_m_s(contact.agent),
            });
        let mut presences: Vec<Presence> = self.rival_claims().map(of_claim).chain(beside).collect();
        presences.sort_by_key(|presence| presence.agent);
        presences
    }

    /// The planning speed of the agent itself, m/s.
    pub fn own_speed_m_s(&self) -> f64 {
        self.speed_m_s(self.own)
    }

    fn rival_claims(&self) -> impl Iterator<Item = (AgentId, &Claim)> {
        self.claims().filter(|&(agent, _)| agent != self.own)
    }

    fn speed_m_s(&self, agent: AgentId) -> f64 {
        self.speeds_m_s[agent.index()]
    }

    /// Remaining path length of an agent to its claimed goal, metres.
    fn remaining_m(&self, agent: AgentId, claim: &Claim, now: Tick) -> f64 {
        let passed_s = now.0.saturating_sub(claim.made.0) as f64 * Tick::TICK_S;
        (claim.path_m - passed_s * self.speed_m_s(agent)).max(0.0)
    }

    /// The path length this agent covers while another one covers `path_m`, metres.
    fn own_equivalent_m(&self, agent: AgentId, path_m: f64) -> f64 {
        path_m * (self.speed_m_s(self.own) / self.speed_m_s(agent))
    }

    /// Distance between the centres of two cells, metres.
    fn distance_m(&self, a: Cell, b: Cell) -> f64 {
        a.distance(b) * self.extent.cell_m()
    }

    /// Whether another agent has a better bid on a conflicting claim.
    pub fn is_outbid(&self, now: Tick) -> bool {
        let Some(own) = self.claims.get(&self.own) else { return false };
        // Compared without a division where speeds are equal, so that all agents get the same
        // result to the last bit.
        let is_equally_fast = |agent| self.speed_m_s(agent).total_cmp(&self.speed_m_s(self.own)).is_eq();
        let remaining_s = |agent, claim| self.remaining_m(agent, claim, now) / self.speed_m_s(agent);
        self.rival_claims().any(|(agent, claim)| {
            let is_conflicting = self.distance_m(claim.cell, own.cell) < 0.5 * self.params.spread_m;
            let is_better = if is_equally_fast(agent) {
                (self.remaining_m(agent, claim, now), agent) < (self.remaining_m(self.own, own, now), self.own)
            } else {
                (remaining_s(agent, claim), agent) < (remaining_s(self.own, own), self.own)
            };
            is_conflicting && is_better
        })
    }

    /// The factor on the utility of a viewpoint at path length `path_m`, metres: 1 if no other
    /// claim is near.
    pub fn utility_factor(&self, cell: Cell, path_m: f64, now: Tick) -> f64 {
        self.rival_claims()
            .filter(|&(agent, claim)| {
                let apart_m = self.distance_m(claim.cell, cell);
                let other_m = self.remaining_m(agent, claim, now) + apart_m * self.params.detour;
                self.own_equivalent_m(agent, other_m) <= path_m || apart_m < 0.5 * self.params.spread_m
            })
            .map(|(_, claim)| 1.0 - self.params.discount * self.proximity(claim, cell))
            .product()
    }

    /// The cost added to the path length to a frontier, metres: 0 if no other claim is near and no
    /// other agent will reach it sooner.
    pub fn penalty_m(&self, cell: Cell, path_m: f64, contacts: &[Contact], now: Tick) -> f64 {
        let AuctionParams { conflict_penalty_m, detour, .. } = self.params;
        let sooner = |agent: AgentId, claim: &Claim| {
            let other_m = self.remaining_m(agent, claim, now) + self.distance_m(claim.cell, cell) * detour;
            self.own_equivalent_m(agent, other_m) < path_m
        };
        let without_goal = |contact: &&Contact| !self.claims.contains_key(&contact.agent);
        let centre = self.extent.centre(cell);
        let beside = |contact: &Contact| {
            self.own_equivalent_m(contact.agent, (contact.position - centre).norm() * detour) < path_m
        };
        if self.rival_claims().any(|(agent, claim)| sooner(agent, claim))
            || contacts.iter().filter(without_goal).any(beside)
        {
            conflict_penalty_m
        } else {
            let nearest = self.rival_claims().map(|(_, claim)| self.proximity(claim, cell)).fold(0.0, f64::max);
            conflict_penalty_m * self.params.discount * nearest
        }
    }

    /// 1 at a claim, falling to 0 with the distance.
    fn proximity(&self, claim: &Claim, cell: Cell) -> f64 {
        let apart = self.distance_m(claim.cell, cell) / self.params.spread_m;
        libm::exp(-apart * apart)
    }
}

/// The planning speed of a body, m/s, given that of submarines: a body that need not turn first, or
/// is faster, covers the reference leg in less time.
fn planning_speed_m_s(body: &BodyModel, submarine_m_s: f64) -> f64 {
    let (length_m, turn_rad) = REFERENCE_LEG;
    match body.kind {
        BodyKind::Submarine => submarine_m_s,
        BodyKind::Aerial | BodyKind::Ground => {
            submarine_m_s * leg_s(&BodyModel::SUBMARINE, length_m, turn_rad) / leg_s(body, length_m, turn_rad)
        }
    }
}

/// The claims of a message, if it is well-formed.
fn decode(bytes: &[u8], extent: Extent, agents: u32) -> Option<Vec<(AgentId, Claim)>> {
    let (version, claims) = bytes.split_first()?;
    if *version != VERSION || claims.len() % CLAIM_BYTES != 0 || claims.len() / CLAIM_BYTES > agents as usize {
        return None;
    }
    claims
        .chunks_exact(CLAIM_BYTES)
        .map(|bytes| {
            let short = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
            let long = |at: usize| Tick(u64::from(short(at)) | u64::from(short(at + 4)) << 32);
            let (agent, cell, path_m) = (short(0), short(4) as usize, f64::from(short(8)) / 1000.0);
            let is_known = agent < agents && cell < extent.volume();
            is_known
                .then(|| (AgentId(agent), Claim { cell: extent.cell_at(cell), path_m, made: long(12), ends: long(20) }))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use agent::command::Peer;
    use nalgebra::Point3;

    use super::*;

    const PARAMS: AuctionParams = AuctionParams {
        spread_m: 10.0,
        discount: 0.9,
        conflict_penalty_m: 40.0,
        detour: 1.3,
        cruise_speed_m_s: 0.8,
        lease_ticks: 1500,
    };

    fn extent() -> Extent {
        Extent::new([50; 3], 1.0).unwrap()
    }

    /// Equal bodies for agents 0 to 3.
    fn bodies() -> Bodies {
        Bodies::new(vec![BodyModel::SUBMARINE], vec![0; 4]).unwrap()
    }

    fn messages_of(from: &Auction) -> Vec<AgentMessage> {
        vec![AgentMessage { peer: Peer::One(from.own), kind: MessageType::Claims.number(), data: from.encode().into() }]
    }

    /// Two agents, each with a claim that the other has received.
    fn two(claims: [(Cell, f64); 2]) -> [Auction; 2] {
        two_of(&bodies(), claims)
    }

    /// The same in a team of these bodies.
    fn two_of(bodies: &Bodies, claims: [(Cell, f64); 2]) -> [Auction; 2] {
        let mut pair = [AgentId(3), AgentId(1)].map(|agent| Auction::new(PARAMS, bodies, agent, extent()));
        for (auction, (cell, path_m)) in pair.iter_mut().zip(claims) {
            auction.claim(cell, path_m, Tick(100));
        }
        let messages = [messages_of(&pair[1]), messages_of(&pair[0])];
        for (auction, messages) in pair.iter_mut().zip(&messages) {
            auction.receive(messages, Tick(101), 4);
        }
        pair
    }

    const GOAL: Cell = Cell { x: 20, y: 20, z: 20 };
    const BESIDE: Cell = Cell { x: 22, y: 20, z: 20 };
    const FAR: Cell = Cell { x: 45, y: 20, z: 20 };

    #[test]
    fn shorter_path_wins_then_the_lower_id() {
        let is_outbid = |pair: [Auction; 2]| pair.map(|auction| auction.is_outbid(Tick(101)));
        assert_eq!(is_outbid(two([(GOAL, 5.0), (BESIDE, 9.0)])), [false, true]);
        assert_eq!(is_outbid(two([(GOAL, 9.0), (BESIDE, 5.0)])), [true, false]);
        assert_eq!(is_outbid(two([(GOAL, 5.0), (GOAL, 5.0)])), [true, false]);
        assert_eq!(is_outbid(two([(GOAL, 9.0), (FAR, 5.0)])), [false, false]);
    }

    #[test]
    fn mixed_team_compares_travel_times() {
        // Agent 1 is aerial.
        let bodies = Bodies::new(vec![BodyModel::SUBMARINE, BodyModel::AERIAL], vec![0, 1, 0, 0]).unwrap();
        let is_outbid = |claims| two_of(&bodies, claims).map(|auction| auction.is_outbid(Tick(101)));
        assert_eq!(is_outbid([(GOAL, 10.0), (BESIDE, 18.0)]), [true, false]);
        assert_eq!(is_outbid([(GOAL, 10.0), (BESIDE, 40.0)]), [false, true]);
        let [submarine, flyer] = two_of(&bodies, [(FAR, 9.0), (GOAL, 9.0)]);
        let to_goal = |auction: &Auction, cell, path_m| auction.penalty_m(cell, path_m, &[], Tick(101));
        assert_eq!(to_goal(&submarine, BESIDE, 8.0), 40.0, "it will be there sooner, although its path is longer");
        assert!(to_goal(&flyer, FAR, 12.0) < 40.0);
    }

    #[test]
    fn agents_are_expected_at_their_goals_until_their_leases_end() {
        let [_, mut auction] = two([(GOAL, 8.0), (FAR, 9.0)]);
        let contact = |agent, x| Contact { agent: AgentId(agent), position: Point3::new(x, 20.5, 20.5) };
        let contacts = [contact(3, 12.5), contact(2, 30.5)];
        let at = |agent, x, free_in_s| Presence {
            agent: AgentId(agent),
            cell: Cell::new(x, 20, 20),
            free_in_s,
            speed_m_s: 0.8,
        };
        assert_eq!(auction.presences(&contacts, Tick(100)), [at(2, 30, 0.0), at(3, 20, 10.0)]);
        assert_eq!(auction.presences(&[], Tick(700)), [at(3, 20, 0.0)], "out of contact, and arrived");
        auction.receive(&[], Tick(100 + 500 + 1500), 4);
        assert_eq!(auction.presences(&[], Tick(2100)), [], "it says nothing any more");
        assert_eq!(auction.presences(&contacts, Tick(2100)), [at(2, 30, 0.0), at(3, 12, 0.0)]);
    }

    #[test]
    fn claims_lower_utility_and_raise_cost_nearby() {
        let [_, auction] = two([(GOAL, 5.0), (FAR, 9.0)]);
        let utility_factor = |cell| auction.utility_factor(cell, 30.0, Tick(101));
        assert!(
            utility_factor(GOAL) < 0.2 && utility_factor(GOAL) < utility_factor(BESIDE) && utility_factor(BESIDE) < 0.2,
            "{}",
            utility_factor(BESIDE)
        );
        assert!(utility_factor(Cell::new(2, 2, 2)) > 0.9);
        let penalty_m = |cell, path_m| auction.penalty_m(cell, path_m, &[], Tick(101));
        assert_eq!(penalty_m(GOAL, 30.0), 40.0);
        assert_eq!(penalty_m(BESIDE, 30.0), 40.0, "it will be there sooner");
        assert!(penalty_m(BESIDE, 1.0) < 40.0, "but not if this one is there at once");
        assert!(penalty_m(FAR, 20.0) < 0.1);
    }

    #[test]
    fn frontiers_beside_an_agent_without_a_claim_are_left_to_it() {
        let auction = Auction::new(PARAMS, &bodies(), AgentId(0), extent());
        let contact = Contact { agent: AgentId(1), position: Point3::new(20.5, 20.5, 20.5) };
        assert_eq!(auction.penalty_m(BESIDE, 30.0, &[contact], Tick(1)), 40.0);
        assert_eq!(auction.penalty_m(BESIDE, 1.0, &[contact], Tick(1)), 0.0);
    }

    #[test]
    fn claims_expire_with_their_lease() {
        let [mut auction, _] = two([(FAR, 5.0), (GOAL, 8.0)]);
        // 8 m at 0.8 m/s are 10 s; 30 s more make 2000 ticks.
        auction.receive(&[], Tick(2099), 4);
        assert!(auction.utility_factor(GOAL, 30.0, Tick(2099)) < 0.2);
        auction.receive(&[], Tick(2100), 4);
        assert_eq!(auction.utility_factor(GOAL, 30.0, Tick(2100)), 1.0);
    }

    #[test]
    fn claims_are_forwarded_and_the_latest_wins() {
        let [first, mut second] = two([(GOAL, 5.0), (FAR, 5.0)]);
        let mut third = Auction::new(PARAMS, &bodies(), AgentId(2), extent());
        third.receive(&messages_of(&second), Tick(102), 4);
        assert!(third.utility_factor(GOAL, 30.0, Tick(102)) < 0.2, "the first one's, from the second one");
        second.claim(BESIDE, 1.0, Tick(103));
        third.receive(&messages_of(&second), Tick(104), 4);
        third.receive(&messages_of(&first), Tick(105), 4);
        assert_eq!(third.claims[&AgentId(1)].cell, BESIDE, "the older word of the first one changes nothing");
    }

    #[test]
    fn malformed_messages_are_ignored_and_leases_are_bounded() {
        let [auction, _] = two([(GOAL, 5.0), (FAR, 5.0)]);
        let good = auction.encode();
        let received = |data: Vec<u8>| {
            let mut listener = Auction::new(PARAMS, &bodies(), AgentId(0), extent());
            listener.receive(
                &[AgentMessage { peer: Peer::One(AgentId(1)), kind: MessageType::Claims.number(), data: data.into() }],
                Tick(200),
                4,
            );
            listener.claims
        };
        assert_eq!(received(good.clone()).len(), 2);
        assert!(received(Vec::new()).is_empty());
        assert!(received(good[..good.len() - 1].to_vec()).is_empty());
        assert!(received([&[9], &good[1..]].concat()).is_empty());
        let mut outside = good.clone();
        outside[5..9].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(received(outside).is_empty());
        let mut endless = good;
        endless[21..29].copy_from_slice(&u64::MAX.to_le_bytes());
        assert!(received(endless).values().all(|claim| claim.ends <= Tick(200 + LEASE_TICKS_MAX)));
    }
}
