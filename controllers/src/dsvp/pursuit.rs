//! Where to carry the map to when nothing is left to explore: to agents that may have something
//! left, at their last known positions.
//!
//! M-TARE (Cao et al., Science Robotics 2023) calls meeting on purpose a pursuit; here it is taken
//! up only by an agent that knows no frontier. Agents report to each other whether they have any:
//! one without frontiers that it can reach needs no map of others. When all have reported to have
//! none, the team rests. A later report replaces an earlier one, also if an agent has frontiers
//! again.
//!
//! Invariants: only an agent itself makes reports on itself; a malformed message changes nothing.
//! An agent that never reports (a lost one, or one with another kind of controller) is pursued
//! until the end of the run.

use std::collections::BTreeMap;

use msgs::ids::{AgentId, Tick};
use protocol::message_type::MessageType;
use voxels::{Cell, Extent};

use super::goal::Goal;
use agent::command::Command;
use agent::observation::{Contact, Observation};

const VERSION: u8 = 1;

/// Bytes of a report: the id of the agent, the tick, and whether it has nothing left.
const REPORT_BYTES: usize = 4 + 8 + 1;

/// Reports by agent.
type Reports = BTreeMap<AgentId, Report>;

/// Whether an agent has nothing left to explore.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Report {
    /// When it reported that.
    as_of: Tick,
    has_finished: bool,
}

/// What an agent knows of those that it could bring its map to.
#[derive(Debug, Clone)]
pub(super) struct Pursuit {
    own: AgentId,
    agents: u32,
    /// Where and when each agent was last in contact, by agent.
    last_known: Vec<Option<LastKnown>>,
    /// The last report of each agent that has made one.
    reports: Reports,
    /// Whether the agents in contact may lack some of the reports.
    is_unsent: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct LastKnown {
    cell: Cell,
    seen: Tick,
    /// This agent has been there since and has not found it.
    is_absent: bool,
}

impl Pursuit {
    /// That of one agent of a team, before it has met others.
    pub(super) fn new(own: AgentId, agents: u32) -> Self {
        Self { own, agents, last_known: Vec::new(), reports: Reports::new(), is_unsent: false }
    }

    /// Records the agents in contact and their reports.
    pub(super) fn receive(&mut self, observation: &Observation, extent: Extent) {
        for contact in &observation.contacts {
            let cell = extent.cell_of(&contact.position);
            let place = contact.agent.index();
            if place >= self.last_known.len() {
                self.last_known.resize(place + 1, None);
            }
            self.last_known[place] = Some(LastKnown { cell, seen: observation.tick, is_absent: false });
        }
        for message in &observation.messages {
            if message.is_from_agent(MessageType::Finished)
                && let Some(received) = decode(&message.data, self.agents)
            {
                self.merge(&received, observation.tick);
            }
        }
    }

    fn merge(&mut self, received: &Reports, now: Tick) {
        for (&agent, report) in received.iter().filter(|(_, report)| report.as_of <= now) {
            if agent == self.own {
                // A controller before this one may have reported something else.
                let has_finished = self.has_finished(agent);
                if report.has_finished != has_finished {
                    self.insert(agent, Report { as_of: now, has_finished });
                }
            } else if self.reports.get(&agent).is_none_or(|known| known.as_of < report.as_of) {
                self.insert(agent, *report);
            }
        }
        let lacks = |(agent, known): (&AgentId, &Report)| received.get(agent).is_none_or(|it| it.as_of < known.as_of);
        self.is_unsent |= self.reports.iter().any(lacks);
    }

    fn insert(&mut self, agent: AgentId, report: Report) {
        self.reports.insert(agent, report);
        self.is_unsent = true;
    }

    /// Reports whether this agent has nothing left to explore, if that has changed.
    pub(super) fn report(&mut self, has_finished: bool, now: Tick) {
        if self.has_finished(self.own) != has_finished {
            self.insert(self.own, Report { as_of: now, has_finished });
        }
    }

    /// Whether an agent has last reported to have nothing left.
    fn has_finished(&self, agent: AgentId) -> bool {
        self.reports.get(&agent).is_some_and(|report| report.has_finished)
    }

    /// Adds the reports for the agents in contact to a command, if they may lack some. `has_met`
    /// says that there may be others in contact than before.
    pub(super) fn with_reports(&mut self, command: Command, contacts: &[Contact], has_met: bool) -> Command {
        if contacts.is_empty() || self.reports.is_empty() || !(has_met || self.is_unsent) {
            return command;
        }
        self.is_unsent = false;
        command.with_message(None, MessageType::Finished.number(), encode(&self.reports))
    }

    /// Notes that an agent pursued is not at the position of the goal, if this one is there.
    pub(super) fn arrive(&mut self, goal: Option<Goal>, here: Cell) {
        if let Some(Goal::Pursuit { agent, cell }) = goal
            && cell == here
            && let Some(Some(last_known)) = self.last_known.get_mut(agent.index())
        {
            last_known.is_absent = true;
        }
    }

    /// Whether an agent is out of contact and may have something left to explore.
    pub(super) fn is_sought(&self, agent: AgentId, contacts: &[Contact]) -> bool {
        let is_in_contact = contacts.binary_search_by_key(&agent, |contact| contact.agent).is_ok();
        agent != self.own && !is_in_contact && !self.has_finished(agent)
    }

    /// Whether all agents of the team have nothing left to explore.
    pub(super) fn have_all_finished(&self) -> bool {
        (0..self.agents).all(|agent| self.has_finished(AgentId(agent)))
    }

    /// The agents sought that may still be at their last known positions, longest out of contact
    /// first, as goals.
    pub(super) fn candidates(&self, contacts: &[Contact], here: Cell) -> impl Iterator<Item = Goal> + use<> {
        let known = (0..).map(AgentId).zip(&self.last_known).filter_map(|(agent, known)| Some((agent, (*known)?)));
        let mut candidates: Vec<(Tick, AgentId, Cell)> = known
            .filter(|&(agent, known)| self.is_sought(agent, contacts) && !known.is_absent && known.cell != here)
            .map(|(agent, known)| (known.seen, agent, known.cell))
            .collect();
        candidates.sort_unstable();
        candidates.into_iter().map(|(_, agent, cell)| Goal::Pursuit { agent, cell })
    }
}

/// The bytes of a message: the version (uint8), and for each agent that is known to have reported
/// its id (uint32), the tick (uint64), and whether it has none left (uint8, 0 or 1), little-endian.
fn encode(reports: &Reports) -> Vec<u8> {
    let mut bytes = vec![VERSION];
    for (agent, Report { as_of, has_finished }) in reports {
        bytes.extend(agent.0.to_le_bytes());
        bytes.extend(as_of.0.to_le_bytes());
        bytes.push((*has_finished).into());
    }
    bytes
}

/// The reports of a message, or nothing if it is malformed.
fn decode(data: &[u8], agents: u32) -> Option<Reports> {
    let (&VERSION, reports) = data.split_first()? else { return None };
    let (reports, []) = reports.as_chunks::<REPORT_BYTES>() else { return None };
    let report = |bytes: &[u8; REPORT_BYTES]| {
        let (agent, rest) = bytes.split_first_chunk()?;
        let (as_of, has_finished) = rest.split_first_chunk()?;
        let (agent, as_of) = (AgentId(u32::from_le_bytes(*agent)), Tick(u64::from_le_bytes(*as_of)));
        let has_finished = match has_finished {
            [0] => false,
            [1] => true,
            _ => return None,
        };
        (agent.0 < agents).then_some((agent, Report { as_of, has_finished }))
    };
    reports.iter().map(report).collect()
}

#[cfg(test)]
mod tests {
    use agent::command::{AgentMessage, Peer};

    use super::*;
    use crate::testing::idle;

    const OWN: AgentId = AgentId(1);
    const OTHER: AgentId = AgentId(2);

    fn report(as_of: u64, has_finished: bool) -> Report {
        Report { as_of: Tick(as_of), has_finished }
    }

    /// After receiving these reports in this tick.
    fn received(pursuit: &mut Pursuit, now: u64, reports: &[(AgentId, Report)]) {
        let data = encode(&reports.iter().copied().collect()).into();
        let messages = vec![AgentMessage { peer: Peer::One(OTHER), kind: MessageType::Finished.number(), data }];
        let observation = Observation { tick: Tick(now), messages, ..idle() };
        pursuit.receive(&observation, Extent::new([10; 3], 1.0).unwrap());
    }

    #[test]
    fn messages_are_read_as_written_and_malformed_ones_are_refused() {
        let reports: Reports = [(AgentId(0), report(258, true)), (AgentId(6), report(7, false))].into();
        let bytes = encode(&reports);
        assert_eq!(bytes[..14], [1, 0, 0, 0, 0, 2, 1, 0, 0, 0, 0, 0, 0, 1]);
        assert_eq!(decode(&bytes, 7), Some(reports));
        assert_eq!(decode(&bytes, 6), None, "an agent that is not of the team");
        assert_eq!(decode(&bytes[..26], 7), None, "cut off");
        assert_eq!(decode(&[&bytes[..13], &[2][..]].concat(), 7), None, "neither yes nor no");
        assert_eq!(decode(&[2], 7), None, "of another version");
        assert_eq!(decode(&[], 7), None);
    }

    #[test]
    fn later_reports_replace_earlier_ones() {
        let mut pursuit = Pursuit::new(OWN, 3);
        received(&mut pursuit, 50, &[(OTHER, report(60, true))]);
        assert!(pursuit.is_sought(OTHER, &[]), "a report of the future");
        received(&mut pursuit, 50, &[(OTHER, report(40, true))]);
        assert!(!pursuit.is_sought(OTHER, &[]));
        received(&mut pursuit, 60, &[(OTHER, report(30, false))]);
        assert!(!pursuit.is_sought(OTHER, &[]), "an earlier report");
        received(&mut pursuit, 60, &[(OTHER, report(55, false))]);
        assert!(pursuit.is_sought(OTHER, &[]), "it has frontiers again");
    }

    #[test]
    fn reports_of_others_on_this_agent_are_corrected() {
        let mut pursuit = Pursuit::new(OWN, 2);
        received(&mut pursuit, 50, &[(OWN, report(40, true)), (AgentId(0), report(40, true))]);
        assert!(!pursuit.have_all_finished());
        assert_eq!(pursuit.reports[&OWN], report(50, false));
    }

    #[test]
    fn contacts_that_lack_a_report_get_it() {
        let contacts = [Contact { agent: OTHER, position: nalgebra::Point3::origin() }];
        let mut pursuit = Pursuit::new(OWN, 3);
        let sends = |pursuit: &mut Pursuit, has_met| {
            let command = Command::keep(agent::command::WakeCondition::NEXT_TICK);
            !pursuit.with_reports(command, &contacts, has_met).messages.is_empty()
        };
        assert!(!sends(&mut pursuit, true), "there is none");
        pursuit.report(true, Tick(10));
        assert!(sends(&mut pursuit, false));
        pursuit.report(true, Tick(11));
        assert!(!sends(&mut pursuit, false), "nothing has changed");
        assert!(sends(&mut pursuit, true), "another contact may lack it");
        received(&mut pursuit, 20, &[(OTHER, report(15, true))]);
        assert!(sends(&mut pursuit, false), "the message that had it was lost");
        received(&mut pursuit, 30, &[(OTHER, report(15, true)), (OWN, report(10, true))]);
        assert!(!sends(&mut pursuit, false), "both have all");
    }
}
