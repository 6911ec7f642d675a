//! Loop closures: corrections of what agents believe, where they see a place again or meet another
//! agent.
//!
//! How good a position is, is measured by its *way*: the length of the odometry on which it rests,
//! which a closure shortens. An agent closes a loop at a place where it was before, or at another
//! agent in contact, if that is within the range and in sight, and shortens the way by the least
//! gain. It then is in the frame of the block in which it was there, or of the block of the other
//! agent. The blocks since then, or since the last closure, are re-anchored: each is moved by the
//! share of the correction that belongs to the part of the way before it.
//!
//! Both are looked for every [`SAMPLE_TICKS`](super::SAMPLE_TICKS) ticks. Places are remembered one
//! for each cube with the edge of the range.

use std::collections::BTreeMap;

use msgs::ids::AgentId;
use nalgebra::{Point3, Vector3};
use voxels::line_of_sight;

use super::{AgentLocalisation, World};
use crate::Presence;

/// When loops are closed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoopClosures {
    /// Greatest distance from the place or the agent, metres; 0: loops are not closed.
    pub range_m: f64,
    /// Least length by which a closure shortens the odometry on which a position rests, metres.
    pub gain_min_m: f64,
}

/// The loops of one agent.
#[derive(Debug, Default)]
pub(super) struct Loops {
    /// By cube with the edge of the range, where the agent was there first, or better than before.
    places: BTreeMap<[i32; 3], Place>,
    /// Distance travelled so far, metres.
    pub(super) travelled_m: f64,
    /// By block the distance travelled when it began, metres.
    begun_at_m: Vec<f64>,
    /// What of the distance travelled the way leaves out, metres.
    left_out_m: f64,
    /// Where the blocks that the next meeting moves begin.
    anchor: Anchor,
    pub(super) closed: u64,
}

/// A point of the way of an agent from which its error has grown.
#[derive(Debug, Clone, Copy, Default)]
struct Anchor {
    block: usize,
    travelled_m: f64,
}

/// A place where an agent was.
#[derive(Debug, Clone, Copy)]
struct Place {
    /// The true position, metres.
    position: Point3<f64>,
    anchor: Anchor,
    way_m: f64,
    heading_error_rad: f64,
}

/// A correction of what an agent believes.
#[derive(Debug, Clone, Copy)]
struct Closure {
    /// The offset that it has from now on, cells.
    offset: [i32; 3],
    heading_error_rad: f64,
    way_m: f64,
    /// From where the blocks are moved.
    from: Anchor,
}

impl Loops {
    /// Notes that a block begins.
    pub(super) fn begin_block(&mut self, block: usize) {
        self.begun_at_m.resize(block + 1, self.travelled_m);
    }

    /// Length of the odometry on which the position rests, metres.
    fn way_m(&self) -> f64 {
        self.travelled_m - self.left_out_m
    }
}

fn cube(position: &Point3<f64>, range_m: f64) -> [i32; 3] {
    [0, 1, 2].map(|axis: usize| libm::floor(position[axis] / range_m) as i32)
}

fn cubes_around([x, y, z]: [i32; 3]) -> impl Iterator<Item = [i32; 3]> {
    (-1..=1)
        .flat_map(move |by_z| (-1..=1).flat_map(move |by_y| (-1..=1).map(move |by_x| [x + by_x, y + by_y, z + by_z])))
}

impl AgentLocalisation {
    fn heading_error_rad(&self) -> f64 {
        self.odometry.heading_error_rad() + self.heading_correction_rad
    }

    /// Remembers a place, unless the agent was near it on a shorter way.
    fn remember(&mut self, position: Point3<f64>, range_m: f64) {
        let place = Place {
            position,
            anchor: Anchor { block: self.belief.present(), travelled_m: self.loops.travelled_m },
            way_m: self.loops.way_m(),
            heading_error_rad: self.heading_error_rad(),
        };
        let known = self.loops.places.entry(cube(&position, range_m)).or_insert(place);
        if place.way_m < known.way_m {
            *known = place;
        }
    }

    /// Adopts a correction; returns the offset of the block that begins with it.
    fn close(&mut self, closure: &Closure, cell_m: f64) -> [i32; 3] {
        self.heading_correction_rad = closure.heading_error_rad - self.odometry.heading_error_rad();
        self.drift_m = Vector3::from(closure.offset.map(f64::from)) * cell_m;
        let Loops { travelled_m, left_out_m, anchor, closed, .. } = &mut self.loops;
        *left_out_m = *travelled_m - closure.way_m;
        *anchor = Anchor { block: self.belief.present(), travelled_m: *travelled_m };
        *closed += 1;
        closure.offset
    }

    /// By how much each block is moved by a correction.
    fn shares(&self, Closure { offset, from, .. }: &Closure) -> BTreeMap<usize, [i32; 3]> {
        let present = self.belief.offset();
        let all_m = self.loops.travelled_m - from.travelled_m;
        let share = |block: usize| {
            let before_m = self.loops.begun_at_m.get(block).copied().unwrap_or(0.0) - from.travelled_m;
            let share = (before_m / all_m).clamp(0.0, 1.0);
            let by = [0, 1, 2].map(|axis: usize| libm::round(f64::from(offset[axis] - present[axis]) * share) as i32);
            (by != [0; 3]).then_some((block, by))
        };
        self.belief.built_after(from.block).filter_map(share).collect()
    }
}

impl World {
    /// Closes the loops of this tick, in the order of the agents.
    pub(super) fn close_loops(&mut self) {
        let Some(LoopClosures { range_m, gain_min_m }) = self.params.closures else { return };
        let active = |agent: &AgentId| self.presence(*agent) == Presence::Active;
        for agent in self.agents().filter(active).collect::<Vec<_>>() {
            let at_place = self.closure_at_place(agent, range_m, gain_min_m);
            let closure = at_place.or_else(|| self.closure_at_meeting(agent, range_m, gain_min_m));
            if let Some(closure) = closure {
                self.close_loop(agent, &closure);
            }
            let position = self.body(agent).pose().position;
            if let Some(localisation) = &mut self.localisation {
                localisation.agents[agent.index()].remember(position, range_m);
            }
        }
    }

    /// The closure at the place with the shortest way.
    fn closure_at_place(&self, agent: AgentId, range_m: f64, gain_min_m: f64) -> Option<Closure> {
        let own = self.localisation_of(agent)?;
        let here = self.body(agent).pose().position;
        let way_max_m = own.loops.way_m() - gain_min_m;
        let is_seen = |place: &&Place| {
            place.way_m <= way_max_m
                && (place.position - here).norm() <= range_m
                && line_of_sight(&self.terrain, &place.position, &here)
        };
        let places = cubes_around(cube(&here, range_m)).filter_map(|cube| own.loops.places.get(&cube));
        let place = places.filter(is_seen).min_by(|one, other| one.way_m.total_cmp(&other.way_m))?;
        Some(Closure {
            offset: own.belief.offset_of(place.anchor.block),
            heading_error_rad: place.heading_error_rad,
            way_m: place.way_m,
            from: place.anchor,
        })
    }

    /// The closure at the agent in contact with the shortest way.
    fn closure_at_meeting(&mut self, agent: AgentId, range_m: f64, gain_min_m: f64) -> Option<Closure> {
        let way_max_m = self.localisation_of(agent)?.loops.way_m() - gain_min_m;
        if way_max_m <= 0.0 {
            return None;
        }
        let here = self.body(agent).pose().position;
        let contacts = self.contacts_of(agent);
        let is_near = |other: &AgentId| {
            let there = self.body(*other).pose().position;
            (there - here).norm() <= range_m && line_of_sight(&self.terrain, &there, &here)
        };
        let others = contacts.into_iter().filter(is_near).filter_map(|other| self.localisation_of(other));
        let other = others
            .filter(|other| other.loops.way_m() <= way_max_m)
            .min_by(|one, other| one.loops.way_m().total_cmp(&other.loops.way_m()))?;
        Some(Closure {
            offset: other.belief.offset(),
            heading_error_rad: other.heading_error_rad(),
            way_m: other.loops.way_m(),
            from: self.localisation_of(agent)?.loops.anchor,
        })
    }

    fn close_loop(&mut self, agent: AgentId, closure: &Closure) {
        let index = agent.index();
        // What was seen so far belongs to the blocks that are moved.
        self.collect_scans(index);
        let Self { localisation: Some(localisation), agents, terrain, .. } = self else { return };
        let own = &mut localisation.agents[index];
        let has_moved = own.belief.offset() != closure.offset;
        if has_moved {
            let shares = own.shares(closure);
            let [free, wall] = own.belief.move_blocks(&shares);
            agents[index].pending_observation.enter(free, wall);
        }
        let offset = own.close(closure, terrain.extent().cell_m());
        if has_moved && own.belief.has_room() {
            self.begin_block(index, offset);
        }
    }
}
