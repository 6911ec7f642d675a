//! `rendezvous`: agents in contact agree on a place and a time to meet again, explore, and meet.
//!
//! Sources: A. Ribeiro da Silva, L. Chaimowicz, "Communication-Constrained Multi-Robot Exploration
//! with Intermittent Rendezvous", arXiv 2309.13494, 2023: meetings of known members are planned
//! before agents part, and a robot leaves in time, wherever it is. The same as "full rendezvous" is
//! what L. Achey et al., "RF-Modulated Adaptive Communication Improves Multi-Agent Robotic
//! Exploration" (ART), arXiv 2602.12074, 2026, compare with.
//!
//! There a schedule of meetings is made for the whole mission; here the members of a meeting agree
//! on the next one alone. The lowest id of those in contact proposes: the place is the viewpoint of
//! least way to all others that it knows, so that they meet amid what is left, and while all stay
//! in contact the meeting is put off. Between meetings agents explore as `dsvp-auction` does.
//!
//! Invariant: an agent waits at most `wait_s` for the others; then it explores without a meeting
//! until it agrees on another one.

use std::collections::BTreeSet;

use msgs::ids::{AgentId, Tick};
use protocol::event_mask::EventMask;
use protocol::message_type::MessageType;

use super::super::avoidance::motion_to;
use super::super::coordination::{Coordination, with_claims};
use super::super::goal::Goal;
use super::super::obstacles::Obstacles;
use super::super::tasks::{ReachedTask, Surroundings, Task, TaskSearch, lengths_between};
use super::super::{Dsvp, Plan};
use super::racer::ticks;
use super::{metres, planner, task_search};
use crate::auction::{Auction, AuctionParams};
use crate::settings::{SettingError, Settings};
use crate::{Controller, Ctx, Setup};
use agent::abstract_graph::PathLengths;
use agent::command::{Command, WakeCondition};
use agent::observation::Observation;
use voxels::{Cell, Extent};

const VERSION: u8 = 1;

/// Most viewpoints among which the place is chosen, the nearest ones.
const PLACES_MAX: usize = 40;

/// Within this distance of the place an agent waits, metres: bodies cannot all be at it.
const AT_PLACE_M: f64 = 5.0;

/// Longest time to a meeting that is taken over: ten hours.
const INTERVAL_TICKS_MAX: u64 = 1_800_000;

/// A planned meeting.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Meeting {
    /// When it was agreed on; of two the later one holds.
    made: Tick,
    at: Tick,
    place: Cell,
    members: BTreeSet<AgentId>,
}

/// What an agent knows of the next meeting.
#[derive(Debug)]
struct Rendezvous {
    own: AgentId,
    extent: Extent,
    auction: Auction,
    /// From an agreement to the meeting.
    interval_ticks: u64,
    /// Longest wait at the place after that time.
    wait_ticks: u64,
    meeting: Option<Meeting>,
    /// Whether it is under way to it.
    is_leaving: bool,
    /// Whether all members of the meeting are in contact.
    are_all_present: bool,
    search: TaskSearch,
    lengths: PathLengths,
}

/// The planner `rendezvous`.
///
/// Settings: `interval_s`, `wait_s`, those of claims ([`AuctionParams`]), `regions`, `expected_min`
/// (see docs/controllers.md).
///
/// # Errors
/// If a setting is out of range.
pub fn rendezvous(settings: &mut Settings, setup: Setup<'_>) -> Result<impl Controller + use<>, SettingError> {
    let Setup { agent, run_info, .. } = &setup;
    let interval_ticks = ticks(settings.number("interval_s", 120.0, 1.0, INTERVAL_TICKS_MAX as f64 * Tick::TICK_S)?);
    let wait_ticks = ticks(settings.number("wait_s", 30.0, 0.0, 3600.0)?);
    let auction = Auction::new(AuctionParams::from_settings(settings)?, &run_info.bodies, *agent, run_info.extent);
    let rendezvous = Rendezvous {
        own: *agent,
        extent: run_info.extent,
        auction,
        interval_ticks,
        wait_ticks,
        meeting: None,
        is_leaving: false,
        are_all_present: false,
        search: task_search(settings, run_info)?,
        lengths: PathLengths::default(),
    };
    Ok(planner(rendezvous, setup))
}

impl Rendezvous {
    /// Agrees on the next meeting with all in contact, if it is this agent's turn: it has the
    /// lowest id, and no absent member is waited for.
    fn propose(&mut self, observation: &Observation, ctx: &Ctx<'_>, at: &mut Surroundings<'_>) {
        let is_lowest = observation.contacts.first().is_some_and(|contact| self.own < contact.agent);
        if !is_lowest || self.meeting.is_some() && !self.are_all_present {
            return;
        }
        let mut tasks: Vec<ReachedTask> = self.search.tasks(at, ctx);
        tasks.sort_by(|a, b| a.own_m.total_cmp(&b.own_m));
        let tasks: Vec<Task> = tasks.iter().take(PLACES_MAX).map(|reached| reached.task).collect();
        let order: Vec<usize> = (0..tasks.len()).rev().collect();
        self.lengths.renew(at.graph);
        let between = lengths_between(&mut self.lengths, at.graph, &tasks, &order);
        let way_m = |task: &usize| between[*task].iter().map(|&length| metres(length, self.extent)).sum::<f64>();
        let place = (0..tasks.len()).min_by(|a, b| way_m(a).total_cmp(&way_m(b)).then(a.cmp(b)));
        let members = observation.contacts.iter().map(|contact| contact.agent).chain([self.own]).collect();
        let (made, at) = (observation.tick, observation.tick.after(self.interval_ticks));
        let place = place.map_or_else(|| ctx.cell(), |task| tasks[task].cell);
        self.meeting = Some(Meeting { made, at, place, members });
        self.are_all_present = true;
    }

    /// Whether it is time to leave for the meeting, by the length of the path there.
    fn has_to_leave(&mut self, meeting: &Meeting, here: Cell, at: &Surroundings<'_>, now: Tick) -> bool {
        let Some(region) = at.graph.region_of(meeting.place) else { return false };
        self.lengths.renew(at.graph);
        self.lengths.begin(at.graph, here, std::iter::once(region));
        let Some(length) = self.lengths.to(at.graph, region) else { return false };
        let travel_s = length * self.extent.cell_m() / self.auction.own_speed_m_s();
        now.after(ticks(travel_s)) >= meeting.at
    }

    /// To the meeting, or the wait there; `None` if it is not time.
    fn attend(
        &mut self,
        observation: &Observation,
        ctx: &mut Ctx<'_>,
        at: &mut Surroundings<'_>,
        obstacles: &Obstacles,
    ) -> Option<Plan> {
        let (now, here) = (observation.tick, ctx.cell());
        let meeting = self.meeting.clone()?;
        let ends = meeting.at.after(self.wait_ticks);
        if self.are_all_present || !self.has_to_leave(&meeting, here, at, now) {
            return None;
        }
        if now >= ends {
            self.meeting = None;
            return None;
        }
        if here.distance(meeting.place) * self.extent.cell_m() <= AT_PLACE_M {
            return Some(Plan::Wait { until: ends, info: "waits for the meeting" });
        }
        at.reach_all(here);
        Some(match motion_to(ctx, at.graph, at.paths, meeting.place, obstacles, at.params.waypoints) {
            Some(motion) => {
                self.is_leaving = true;
                Plan::Go(Goal::Meeting { cell: meeting.place }, motion)
            }
            None => Plan::Blocked,
        })
    }
}

impl Coordination for Rendezvous {
    fn auction(&self) -> Option<&Auction> {
        Some(&self.auction)
    }

    fn auction_mut(&mut self) -> Option<&mut Auction> {
        Some(&mut self.auction)
    }

    fn wake(&self) -> WakeCondition {
        WakeCondition::on(EventMask::CONTACTS | EventMask::MESSAGE)
    }

    fn receive(&mut self, observation: &Observation, agents: u32) {
        let Observation { messages, contacts, tick, .. } = observation;
        self.auction.receive(messages, *tick, agents);
        for message in messages.iter().filter(|message| message.kind == MessageType::Meeting.number()) {
            let Some(meeting) = decode(&message.data, self.extent, agents) else { continue };
            let is_later = self.meeting.as_ref().is_none_or(|known| known.made < meeting.made);
            let is_ahead = meeting.made <= *tick
                && *tick < meeting.at.after(self.wait_ticks)
                && meeting.at <= tick.after(INTERVAL_TICKS_MAX);
            if is_later && is_ahead && meeting.members.contains(&self.own) {
                self.meeting = Some(meeting);
            }
        }
        let is_here = |&agent: &AgentId| agent == self.own || contacts.iter().any(|contact| contact.agent == agent);
        self.are_all_present = self.meeting.as_ref().is_some_and(|meeting| meeting.members.iter().all(is_here));
    }

    fn first_stage(
        planner: &mut Dsvp<Self>,
        observation: &Observation,
        ctx: &mut Ctx<'_>,
        obstacles: &Obstacles,
    ) -> Plan {
        let (mut at, rendezvous) = planner.split();
        rendezvous.is_leaving = false;
        rendezvous.propose(observation, ctx, &mut at);
        match rendezvous.attend(observation, ctx, &mut at, obstacles) {
            Some(plan) => plan,
            None => planner.explore(observation, ctx, obstacles),
        }
    }

    /// An agent on its way to a meeting plans anew once all members are in contact.
    fn is_outbid(&self, now: Tick) -> bool {
        self.auction.is_outbid(now) || self.is_leaving && self.are_all_present
    }

    fn with_messages(&mut self, command: Command, observation: &Observation) -> Command {
        let command = with_claims(&self.auction, command, observation);
        match &self.meeting {
            Some(meeting) if !observation.contacts.is_empty() => {
                command.with_message(None, MessageType::Meeting.number(), encode(meeting, self.extent))
            }
            _ => command,
        }
    }
}

/// The bytes of a message: the version (uint8), the ticks of the agreement and of the meeting
/// (uint64), the index of its cell and the ids of its members (uint32), little-endian.
fn encode(meeting: &Meeting, extent: Extent) -> Vec<u8> {
    let mut bytes = vec![VERSION];
    bytes.extend(meeting.made.0.to_le_bytes());
    bytes.extend(meeting.at.0.to_le_bytes());
    bytes.extend((extent.index(meeting.place).unwrap_or_default() as u32).to_le_bytes());
    meeting.members.iter().for_each(|member| bytes.extend(member.0.to_le_bytes()));
    bytes
}

/// The meeting of a message, if it is well-formed.
fn decode(data: &[u8], extent: Extent, agents: u32) -> Option<Meeting> {
    let (&VERSION, rest) = data.split_first()? else { return None };
    let (made, rest) = rest.split_first_chunk()?;
    let (at, rest) = rest.split_first_chunk()?;
    let (place, rest) = rest.split_first_chunk()?;
    let (members, []) = rest.as_chunks::<4>() else { return None };
    let place = u32::from_le_bytes(*place) as usize;
    let members: BTreeSet<AgentId> = members.iter().map(|member| AgentId(u32::from_le_bytes(*member))).collect();
    let is_known = place < extent.volume() && members.iter().all(|member| member.0 < agents);
    is_known.then(|| Meeting {
        made: Tick(u64::from_le_bytes(*made)),
        at: Tick(u64::from_le_bytes(*at)),
        place: extent.cell_at(place),
        members,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_of_meetings_round_trip_or_are_ignored() {
        let extent = Extent::new([10, 9, 8], 1.0).unwrap();
        let members = BTreeSet::from([AgentId(0), AgentId(3)]);
        let meeting = Meeting { made: Tick(7), at: Tick(u64::MAX), place: Cell::new(9, 8, 7), members };
        let bytes = encode(&meeting, extent);
        assert_eq!(decode(&bytes, extent, 4), Some(meeting));
        assert_eq!(decode(&bytes, extent, 3), None, "no such agent");
        assert_eq!(decode(&bytes, Extent::new([9, 9, 8], 1.0).unwrap(), 4), None, "no such cell");
        assert_eq!(decode(&bytes[..bytes.len() - 1], extent, 4), None);
        assert_eq!(decode(&[&[9], &bytes[1..]].concat(), extent, 4), None);
        assert_eq!(decode(&[], extent, 4), None);
    }
}
