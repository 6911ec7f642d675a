//! Bodies that stand in the way and do not move.
//!
//! A body that blocks all paths mostly moves on, so an agent waits a little or evades, and plans
//! again. One that has broken down in a passage does not: after some blockages at the same place
//! the agent rests. It plans again when that body moves or its contact ends, and after longer and
//! longer times, since a body without a radio is noticed by collisions alone. A change of its map
//! ends all that.

use msgs::ids::{AgentId, Tick};
use nalgebra::Point3;

use super::Ctx;
use super::dsvp::obstacles::is_near;
use agent::command::{Command, Stage, WakeCondition};
use agent::observation::{Contact, Observation};
use protocol::event_mask::EventMask;

/// Blockages by a body after which it is taken to stay.
const BLOCKAGES_MIN: u32 = 4;

/// Sim time from the first of them to the last: 20 s.
const STANDING_TICKS: u64 = 1000;

/// Rest before the next plan: 10 s more for each further blockage, up to two minutes.
const REST_TICKS: u64 = 500;
const RESTS_MAX: u32 = 12;

/// Most steps aside before bodies that are taken to stay, while the map does not change.
const STEPS_ASIDE_MAX: u32 = 3;

/// Bodies touch within this multiple of the distance at which they do: their contacts may be noisy.
const TOUCHING: f64 = 1.1;

/// Most blockages that are remembered.
const PLACES_MAX: usize = 64;

/// The blockages since the map last changed.
#[derive(Debug, Clone, Default)]
pub(crate) struct Blockages {
    /// Known cells of the map at the last one.
    known_cells: usize,
    standing: Vec<Standing>,
    /// Steps aside before bodies that are taken to stay.
    steps_aside: u32,
    /// The body before which it rests, and until when.
    resting: Option<(Standing, Tick)>,
}

/// A body that has not moved between blockages.
#[derive(Debug, Clone, Copy)]
struct Standing {
    /// `None`: a body that is not in contact, which this one ran into.
    agent: Option<AgentId>,
    /// Where it is, or where this body was when they collided.
    at: Point3<f64>,
    since: Tick,
    blockages: u32,
}

/// A rest before a body that is taken to stay.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Rest {
    pub(crate) wake: WakeCondition,
    pub(crate) info: String,
}

/// What follows a collision with a body that is taken to stay.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Yield {
    /// A rest where the body is.
    Rest(Rest),
    /// A step aside, from where the next attempt may lead past.
    StepAside,
}

fn wake_from_rest(until: Tick) -> WakeCondition {
    WakeCondition::at(until).or(WakeCondition::on(EventMask::CONTACTS | EventMask::MESSAGE))
}

impl Rest {
    /// The command of a body that has been stopped.
    pub(crate) fn command(self) -> Command {
        Command::keep(self.wake).with_stage(Stage::Waiting).with_info(self.info)
    }
}

impl Blockages {
    /// [`Blockages::note`] for controllers that find no path around a body but by steps aside,
    /// which come before the rests.
    pub(crate) fn note_between_steps(&mut self, observation: &Observation, ctx: &Ctx<'_>) -> Option<Yield> {
        let rest = self.note(observation, ctx)?;
        if self.steps_aside == STEPS_ASIDE_MAX {
            return Some(Yield::Rest(rest));
        }
        self.resting = None;
        self.steps_aside += 1;
        Some(Yield::StepAside)
    }

    /// The wake-up condition of a rest that continues: its time is not over, the map has not
    /// changed, and the body in the way is where it was, as far as this agent can know.
    pub(crate) fn still_rests(&mut self, observation: &Observation, ctx: &Ctx<'_>) -> Option<WakeCondition> {
        let (standing, until) = self.resting?;
        let is_there = |contact: &Contact| {
            Some(contact.agent) == standing.agent && (contact.position - standing.at).norm() < ctx.body().radius_m
        };
        let is_blocked = standing.agent.is_none() || observation.contacts.iter().any(is_there);
        let events = EventMask::COLLISION | EventMask::REVISED;
        let rests = observation.tick < until
            && ctx.map().free() + ctx.map().wall() == self.known_cells
            && is_blocked
            && !observation.events.intersects(events);
        if !rests {
            self.resting = None;
        }
        rests.then(|| wake_from_rest(until))
    }

    /// Notes that the bodies nearby block all paths now, or that this body has run into another
    /// one. Returns how it rests if one of them is taken to stay where it is.
    pub(crate) fn note(&mut self, observation: &Observation, ctx: &Ctx<'_>) -> Option<Rest> {
        let known_cells = ctx.map().free() + ctx.map().wall();
        if std::mem::replace(&mut self.known_cells, known_cells) != known_cells {
            self.standing.clear();
            self.steps_aside = 0;
        }
        let (bodies, radius_m, here) = (&ctx.run_info().bodies, ctx.body().radius_m, ctx.position());
        let near = observation.contacts.iter().filter(|contact| is_near(contact, &here, radius_m, bodies));
        let mut blocking: Vec<(Option<AgentId>, Point3<f64>)> =
            near.map(|contact| (Some(contact.agent), contact.position)).collect();
        // A body without a radio is noticed by a collision with no one that is known to be there.
        let touches = |contact: &Contact| {
            let touch_m = radius_m + bodies.of(contact.agent).radius_m;
            (contact.position - here).norm() < TOUCHING * touch_m
        };
        let has_collided = observation.collision.is_some_and(|collision| collision.with_agent);
        if blocking.is_empty() || has_collided && !observation.contacts.iter().any(touches) {
            blocking.push((None, here));
        }
        let now = observation.tick;
        let mut longest: Option<Standing> = None;
        for (agent, at) in blocking {
            let is_same =
                |standing: &&mut Standing| standing.agent == agent && (standing.at - at).norm() < 2.0 * radius_m;
            let standing = match self.standing.iter_mut().find(is_same) {
                Some(standing) => standing,
                None => {
                    if self.standing.len() == PLACES_MAX {
                        self.standing.remove(0);
                    }
                    self.standing.push(Standing { agent, at, since: now, blockages: 0 });
                    self.standing.last_mut()?
                }
            };
            standing.blockages += 1;
            let stays = standing.blockages >= BLOCKAGES_MIN && now >= standing.since.after(STANDING_TICKS);
            if stays && longest.is_none_or(|longest| standing.blockages > longest.blockages) {
                longest = Some(*standing);
            }
        }
        self.resting = longest.map(|standing| {
            let rests = (standing.blockages - BLOCKAGES_MIN + 1).min(RESTS_MAX);
            (standing, now.after(REST_TICKS * u64::from(rests)))
        });
        self.resting.map(|(standing, until)| {
            let body =
                standing.agent.map_or_else(|| "the body in the way".to_owned(), |agent| format!("agent {agent}"));
            Rest { wake: wake_from_rest(until), info: format!("waits for {body} to move") }
        })
    }
}
