//! What an agent knows of the others: where each was going when it last heard of it, and how
//! probably they have seen a task in the meantime.
//!
//! The probability is that of a logistic regression over 52 000 tasks (see docs/controllers.md),
//! rounded: tasks far from this agent and near to where another one was going have mostly been
//! seen, the large ones above all. This module plans nothing.

use std::collections::BTreeMap;

use msgs::ids::{AgentId, Tick};
use voxels::Cell;

use super::seconds;
use crate::auction::{Auction, Presence};
use agent::observation::Observation;

/// Seconds out of contact after which the probability is 1 - 1/e of its final value.
const OUT_OF_CONTACT_S: f64 = 20.0;

/// The probability is at most this: else what may have been seen counts no more than what hides
/// nothing.
const CHANCE_MAX: f64 = 0.8;

/// Arrival times count up to this one before and after now, seconds.
const ARRIVAL_MAX_S: f64 = 100.0;

/// The last known course of another agent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sighting {
    /// Its goal, or where it was.
    pub(super) cell: Cell,
    /// When it is expected there, seconds of sim time.
    pub(super) free_s: f64,
    /// Its planning speed.
    pub(super) speed_m_s: f64,
    /// When that was known, seconds of sim time.
    pub(super) known_s: f64,
}

/// A task as seen from here.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Prospect {
    /// Expected number of free cells.
    pub(super) expected_cells: f64,
    /// Time for this agent to get there, seconds.
    pub(super) own_s: f64,
}

/// The last known courses of the others.
#[derive(Debug, Clone, Default)]
pub(super) struct Sightings {
    by_agent: BTreeMap<AgentId, Sighting>,
}

impl Sightings {
    /// Takes over what the claims and the contacts of an observation say.
    pub(super) fn update(&mut self, auction: &Auction, observation: &Observation) {
        let made: BTreeMap<AgentId, Tick> = auction.claims().map(|(agent, claim)| (agent, claim.made)).collect();
        let now = observation.tick;
        for Presence { agent, cell, free_in_s, speed_m_s } in auction.presences(&observation.contacts, now) {
            let is_in_contact = observation.contacts.iter().any(|contact| contact.agent == agent);
            let known = if is_in_contact { now } else { made.get(&agent).copied().unwrap_or(now) };
            let sighting = Sighting { cell, free_s: seconds(now) + free_in_s, speed_m_s, known_s: seconds(known) };
            self.by_agent.insert(agent, sighting);
        }
    }

    /// The others that this agent has ever heard of, in the order of their ids.
    pub(super) fn iter(&self) -> impl Iterator<Item = (AgentId, &Sighting)> {
        self.by_agent.iter().map(|(&agent, sighting)| (agent, sighting))
    }
}

impl Sighting {
    /// The probability that this agent has seen a task without the knowledge of the own one, if it
    /// is expected there at `arrival_s`, seconds from now.
    pub(super) fn chance_seen(&self, prospect: Prospect, arrival_s: f64, now: Tick) -> f64 {
        let out_s = seconds(now) - self.known_s;
        if out_s <= 1.0 {
            return 0.0;
        }
        let arrival = arrival_s.clamp(-ARRIVAL_MAX_S, ARRIVAL_MAX_S) / 50.0;
        let log_odds = -7.2 + 1.6 * libm::log(prospect.own_s + 5.0) + 0.73 * arrival.min(0.0) - 1.7 * arrival.max(0.0)
            + 0.5 * libm::log(prospect.expected_cells + 1.0);
        CHANCE_MAX * (1.0 - libm::exp(-out_s / OUT_OF_CONTACT_S)) / (1.0 + libm::exp(-log_odds))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GONE: Sighting = Sighting { cell: Cell { x: 0, y: 0, z: 0 }, free_s: 90.0, speed_m_s: 0.8, known_s: 60.0 };

    #[test]
    fn what_is_near_to_another_agent_and_far_from_this_one_has_mostly_been_seen() {
        let now = Tick(100 * 50);
        let chance =
            |expected_cells, own_s, arrival_s| GONE.chance_seen(Prospect { expected_cells, own_s }, arrival_s, now);
        assert!(chance(100.0, 100.0, 5.0) > 0.6, "{}", chance(100.0, 100.0, 5.0));
        assert!(chance(10.0, 10.0, 60.0) < 0.05, "{}", chance(10.0, 10.0, 60.0));
        assert!(chance(100.0, 60.0, 10.0) > chance(5.0, 60.0, 10.0), "large tasks");
        let in_contact = Sighting { known_s: 100.0, ..GONE };
        assert_eq!(in_contact.chance_seen(Prospect { expected_cells: 100.0, own_s: 100.0 }, 5.0, now), 0.0);
    }
}
