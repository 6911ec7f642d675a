//! Bodies that stand in the way and do not move.
//!
//! A body that blocks all paths mostly moves on, so an agent waits a little or evades, and plans
//! again. After some blockages at the same place the body is taken to stay. Either it has broken
//! down in a passage, or it waits for this one in turn, and no observation says which. So the agent
//! first leaves the way: the one with the higher id at once, and the one with the lower id if the
//! other has not made way in the meantime. It backs out to where there is room (`room`), and stays
//! there for a while. If the other body then stands where it stood, it has had no use for the room.
//! The agent rests before it, and leaves the way again only after more and more rests, since the
//! other one may have had another one behind it: so do the bodies of a jam in a lane, the last one
//! first. One that is due to leave and is shut in tries it again and again.
//!
//! A rest ends when that body moves or its contact ends, and after longer and longer times, since a
//! body without a radio is noticed by collisions alone. A change of its map ends all that.

mod room;

use std::cmp::Reverse;

use msgs::ids::{AgentId, Tick};
use nalgebra::Point3;

use super::Ctx;
use super::dsvp::avoidance::path_length_m;
use super::dsvp::obstacles::{CLEARANCE, NEAR, Obstacles, is_near};
use agent::command::{Command, Motion, Stage, WakeCondition};
use agent::observation::{Contact, Observation};
use protocol::event_mask::EventMask;

/// Blockages by a body after which it is taken to stay.
const BLOCKAGES_MIN: u32 = 4;

/// Sim time from the first of them to the last: 20 s.
const STANDING_TICKS: u64 = 1000;

/// Rest before the next plan: 10 s more each time, up to two minutes.
const REST_TICKS: u64 = 500;
const RESTS_MAX: u32 = 12;

/// The same for an agent that leaves the way as soon as it can: up to 30 s.
const OWED_RESTS_MAX: u32 = 3;

/// The rests, from 1 on, instead of which an agent leaves the way of one with a lower id that is
/// shut in, or if it has not far to go; those at which it does so anyway, if only for where it is
/// far from the others; and how much later it leaves that of one with a higher id.
const TURNS: &[u32] = &[1, 5, 25, 125];
const LATE_TURNS: &[u32] = &[20, 100];
const LATER: u32 = 2;

/// What is not far, as a multiple of the distance at which the bodies touch.
const SHORT: f64 = 4.0;

/// How long it stays out of the way the first time, and each further time: 30 s.
const AWAY_TICKS: u64 = 1500;

/// How often it looks whether a body that is shut in has moved, while it rests, and while it is out
/// of its way: 2 s and 1 s.
const LOOK_TICKS: u64 = 100;
const LOOK_AWAY_TICKS: u64 = 50;

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
    /// Whether it has tried to get round them since it last waited for one.
    has_detoured: bool,
    waiting: Option<Waiting>,
    /// Whether it leaves no way.
    only_rests: bool,
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
    /// How often it was found to stay.
    stays: u32,
    /// Whether it was found to be shut in by this agent and others.
    is_shut_in: bool,
    /// How often this agent has left its way, and whether it was to do so and found no way.
    leaves: u32,
    is_owed: bool,
}

impl Standing {
    fn does_stay(&self, now: Tick) -> bool {
        self.blockages >= BLOCKAGES_MIN && now >= self.since.after(STANDING_TICKS)
    }

    /// When an agent that rests before it until a tick looks whether it has moved: often if it
    /// shuts this body in itself.
    fn looks_again(&self, until: Tick, now: Tick) -> WakeCondition {
        wakes_at(if self.is_shut_in { until.min(now.after(LOOK_TICKS)) } else { until })
    }

    /// The time of a rest before it: longer and longer, unless this agent is to leave its way as
    /// soon as it can.
    fn rest_ticks(&self) -> u64 {
        let rests_max = if self.is_owed { OWED_RESTS_MAX } else { RESTS_MAX };
        REST_TICKS * u64::from(self.stays.clamp(1, rests_max))
    }
}

/// What an agent does before a body that is taken to stay.
#[derive(Debug, Clone, Copy)]
struct Waiting {
    before: Standing,
    until: Until,
}

#[derive(Debug, Clone, Copy)]
enum Until {
    /// It rests until then at the latest.
    Rested(Tick),
    /// It leaves the way, and then stays there for so many ticks.
    Left(u64),
    /// It stays out of the way until then at the latest.
    Away(Tick),
}

/// What follows a collision with a body that is taken to stay.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Yield {
    /// A rest where the body is, or on its way to where there is room for the other one.
    Rest(Command),
    /// A way round the body, or to another goal.
    Detour(Command),
    /// A step aside, from where the next attempt may lead past.
    StepAside,
}

/// What a controller that plans round bodies does before one that is taken to stay.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Bypass<D> {
    /// A rest where the body is, or on its way to where there is room for the other one.
    Rest(Command),
    /// A way to another goal.
    Detour(D),
}

impl Blockages {
    /// The blockages of an agent that leaves no way, but rests: its controller would draw it back
    /// at once.
    pub(crate) fn with_rests_alone() -> Self {
        Self { only_rests: true, ..Self::default() }
    }

    /// [`Blockages::note`] for controllers that plan as if no body were in the way. Before bodies
    /// that are taken to stay they make a detour, if there is one, clear of all that are nearby;
    /// then steps aside, and only then they rest.
    pub(crate) fn note_between_steps(
        &mut self,
        observation: &Observation,
        ctx: &Ctx<'_>,
        detour: impl FnOnce(&Obstacles) -> Option<Command>,
    ) -> Option<Yield> {
        let staying = self.count_all(observation, ctx)?;
        if let Some(command) = self.try_detour(observation, ctx, detour) {
            return Some(Yield::Detour(command));
        }
        if self.steps_aside == STEPS_ASIDE_MAX {
            return Some(Yield::Rest(self.waits(&staying, observation, ctx)));
        }
        self.steps_aside += 1;
        Some(Yield::StepAside)
    }

    /// [`Blockages::note`] for controllers that plan round the bodies nearby: before those that are
    /// taken to stay they look for another goal before each rest.
    pub(crate) fn note_between_rests<D>(
        &mut self,
        observation: &Observation,
        ctx: &Ctx<'_>,
        detour: impl FnOnce(&Obstacles) -> Option<D>,
    ) -> Option<Bypass<D>> {
        let staying = self.count_all(observation, ctx)?;
        let detour = self.try_detour(observation, ctx, detour).map(Bypass::Detour);
        Some(detour.unwrap_or_else(|| Bypass::Rest(self.waits(&staying, observation, ctx))))
    }

    /// A detour clear of all bodies nearby, if none was looked for since the last rest.
    fn try_detour<D>(
        &mut self,
        observation: &Observation,
        ctx: &Ctx<'_>,
        detour: impl FnOnce(&Obstacles) -> Option<D>,
    ) -> Option<D> {
        let has_detoured = std::mem::replace(&mut self.has_detoured, true);
        let obstacles = Obstacles::of(observation, ctx);
        if has_detoured || obstacles.is_empty() { None } else { detour(&obstacles) }
    }

    /// Whether the agent rests before a body or is out of its way.
    pub(crate) fn is_waiting(&self) -> bool {
        self.waiting.is_some()
    }

    /// Whether this body has run into one that is not in contact, at the same place again: it has
    /// no use for a long way out of its way.
    pub(crate) fn is_by_unknown(&self) -> bool {
        self.standing.iter().any(|standing| standing.agent.is_none() && standing.blockages > 1)
    }

    /// The command of an agent that still waits: it is under way to where there is room, or at rest
    /// and its time is not over, its map has not changed, and the body in the way is where it was,
    /// as far as this agent can know.
    pub(crate) fn still_waits(&mut self, observation: &Observation, ctx: &Ctx<'_>) -> Option<Command> {
        let Waiting { before, until } = self.waiting.take()?;
        if observation.events.intersects(EventMask::COLLISION | EventMask::REVISED) {
            return None;
        }
        let now = observation.tick;
        let until = match until {
            Until::Left(_) if observation.is_active => until,
            Until::Left(ticks) => Until::Away(now.after(ticks)),
            _ => until,
        };
        let radius_m = ctx.body().radius_m;
        let contact = observation.contacts.iter().find(|contact| Some(contact.agent) == before.agent);
        let wake = match until {
            Until::Left(_) => under_way(),
            Until::Rested(until) => {
                let has_changed = ctx.map().free() + ctx.map().wall() != self.known_cells;
                let is_there = |contact: &Contact| (contact.position - before.at).norm() < radius_m;
                let is_blocked = before.agent.is_none() || contact.is_some_and(is_there);
                if now >= until || has_changed || !is_blocked {
                    return None;
                }
                before.looks_again(until, now)
            }
            Until::Away(until) => {
                let bodies = &ctx.run_info().bodies;
                let has_passed = contact.is_none_or(|contact| {
                    let far_m = NEAR * (radius_m + bodies.of(contact.agent).radius_m);
                    (contact.position - before.at).norm() > far_m
                        && !is_near(contact, &ctx.position(), radius_m, bodies)
                });
                if now >= until || has_passed {
                    return None;
                }
                wakes_at(until.min(now.after(LOOK_AWAY_TICKS)))
            }
        };
        self.waiting = Some(Waiting { before, until });
        Some(Command::keep(wake))
    }

    /// Notes that the bodies nearby block all paths now, or that this body has run into another
    /// one. Returns what it does if one of them is taken to stay where it is.
    pub(crate) fn note(&mut self, observation: &Observation, ctx: &Ctx<'_>) -> Option<Command> {
        let staying = self.count_all(observation, ctx)?;
        Some(self.waits(&staying, observation, ctx))
    }

    /// Counts the blockages by the bodies nearby. Returns those that are taken to stay, by their
    /// numbers, if there are any: the one with most blockages first.
    fn count_all(&mut self, observation: &Observation, ctx: &Ctx<'_>) -> Option<Vec<usize>> {
        self.waiting = None;
        let known_cells = ctx.map().free() + ctx.map().wall();
        if std::mem::replace(&mut self.known_cells, known_cells) != known_cells {
            self.standing.clear();
            (self.steps_aside, self.has_detoured) = (0, false);
        }
        let now = observation.tick;
        let blocking = blocking(observation, ctx);
        for &(agent, at) in &blocking {
            self.count(agent, at, ctx, now);
        }
        // Only now, because the first one goes when there are too many.
        let numbers = blocking.iter().filter_map(|&(agent, at)| self.number_of(agent, at, ctx));
        let mut staying: Vec<usize> = numbers.filter(|&number| self.standing[number].does_stay(now)).collect();
        staying.sort_by_key(|&number| Reverse(self.standing[number].blockages));
        (!staying.is_empty()).then_some(staying)
    }

    /// Leaves the way of the first of the bodies that stay, or rests before it.
    fn waits(&mut self, staying: &[usize], observation: &Observation, ctx: &Ctx<'_>) -> Command {
        let now = observation.tick;
        self.has_detoured = false;
        self.standing[staying[0]].stays += 1;
        if let Some(command) = self.leaves_way(staying, observation, ctx) {
            return command;
        }
        let before = self.standing[staying[0]];
        let until = now.after(before.rest_ticks());
        self.waiting = Some(Waiting { before, until: Until::Rested(until) });
        let body = before.agent.map_or_else(|| "the body in the way".to_owned(), |agent| format!("agent {agent}"));
        let stop = if observation.is_active { Motion::Stop } else { Motion::Keep };
        let rest = Command::new(stop, before.looks_again(until, now));
        rest.with_stage(Stage::Waiting).with_info(format!("waits for {body} to move"))
    }

    /// The number of a body that was noted at a place before.
    fn number_of(&self, agent: Option<AgentId>, at: Point3<f64>, ctx: &Ctx<'_>) -> Option<usize> {
        let is_same =
            |standing: &Standing| standing.agent == agent && (standing.at - at).norm() < 2.0 * ctx.body().radius_m;
        self.standing.iter().position(is_same)
    }

    /// Counts a blockage by a body.
    fn count(&mut self, agent: Option<AgentId>, at: Point3<f64>, ctx: &Ctx<'_>, now: Tick) {
        let number = self.number_of(agent, at, ctx).unwrap_or_else(|| {
            if self.standing.len() == PLACES_MAX {
                self.standing.remove(0);
            }
            self.standing.push(Standing {
                agent,
                at,
                since: now,
                blockages: 0,
                stays: 0,
                is_shut_in: false,
                leaves: 0,
                is_owed: false,
            });
            self.standing.len() - 1
        });
        self.standing[number].blockages += 1;
    }

    /// The command by which the agent leaves the way of the first of the bodies that stay, if that
    /// is its turn and there is room anywhere.
    fn leaves_way(&mut self, staying: &[usize], observation: &Observation, ctx: &Ctx<'_>) -> Option<Command> {
        let before = self.standing[staying[0]];
        let agent = before.agent.filter(|_| !self.only_rests)?;
        let is_shut_in = room::is_shut_in((agent, before.at), observation, ctx);
        self.standing[staying[0]].is_shut_in = is_shut_in;
        let later = if agent < ctx.agent() { 0 } else { LATER };
        let is_turn = |turns: &[u32]| turns.iter().any(|turn| turn + later == before.stays);
        let (is_turn, is_late_turn) = (is_turn(TURNS), is_turn(LATE_TURNS));
        if !(is_turn || is_late_turn || before.is_owed) {
            return None;
        }
        let touch_m = ctx.body().radius_m + ctx.run_info().bodies.of(agent).radius_m;
        let places = staying.iter().map(|&number| self.standing[number]);
        let places: Vec<Point3<f64>> = places.filter(|standing| standing.agent.is_some()).map(|it| it.at).collect();
        let obstacles = Obstacles::of(observation, ctx);
        let is_late_turn = is_late_turn || before.is_owed;
        let back = || room::way_back(ctx, &obstacles, &places, SHORT * touch_m).filter(|_| is_late_turn);
        let motion = room::way_to_room(ctx, &obstacles, &places, CLEARANCE * touch_m).or_else(back);
        let is_short = |motion: &Motion| path_length_m(&ctx.position(), motion) < SHORT * touch_m;
        let standing = &mut self.standing[staying[0]];
        let motion = motion.filter(|motion| is_shut_in || is_late_turn || is_short(motion));
        // It is its turn still if bodies behind it are in the way.
        standing.is_owed = motion.is_none() && is_shut_in;
        let motion = motion?;
        standing.leaves += 1;
        let until = Until::Left(AWAY_TICKS * u64::from(standing.leaves));
        self.waiting = Some(Waiting { before, until });
        let command = Command::new(motion, under_way()).with_stage(Stage::Waiting);
        Some(command.with_info(format!("leaves the way of agent {agent}")))
    }
}

/// The bodies nearby, or the one that this body has run into: agents in contact and where they are,
/// or `None` and where this body is. None at all if none is known to be there.
fn blocking(observation: &Observation, ctx: &Ctx<'_>) -> Vec<(Option<AgentId>, Point3<f64>)> {
    let (bodies, radius_m, here) = (&ctx.run_info().bodies, ctx.body().radius_m, ctx.position());
    let near = observation.contacts.iter().filter(|contact| is_near(contact, &here, radius_m, bodies));
    let mut blocking: Vec<(Option<AgentId>, Point3<f64>)> =
        near.map(|contact| (Some(contact.agent), contact.position)).collect();
    // A body without a radio is noticed by a collision with no one that is known to be there.
    let has_collided = observation.collision.is_some_and(|collision| collision.with_agent);
    if has_collided && !touches_any(observation, ctx) {
        blocking.push((None, here));
    }
    blocking
}

/// Whether an agent in contact touches this body.
fn touches_any(observation: &Observation, ctx: &Ctx<'_>) -> bool {
    let touches = |contact: &Contact| {
        let touch_m = ctx.body().radius_m + ctx.run_info().bodies.of(contact.agent).radius_m;
        (contact.position - ctx.position()).norm() < TOUCHING * touch_m
    };
    observation.contacts.iter().any(touches)
}

fn under_way() -> WakeCondition {
    WakeCondition::TASK_DONE.or(WakeCondition::on(EventMask::COLLISION))
}

fn wakes_at(tick: Tick) -> WakeCondition {
    WakeCondition::at(tick).or(WakeCondition::on(EventMask::CONTACTS | EventMask::MESSAGE))
}

#[cfg(test)]
mod tests;
