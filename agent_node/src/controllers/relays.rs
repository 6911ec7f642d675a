//! When to leave a relay behind: the last place from which somebody or something that carries on is in sight.
//!
//! An agent leaves a relay where it is if a relay or an agent that it hears is in sight from here, on its own map, but none is from
//! a little farther along its way. So those that leave relays hang together like beads on a string, as long as they have any.
//!
//! In sight means that all cells on the straight line are known to be free. A model of communication that reaches farther makes
//! relays come earlier than they must.

use std::ops::ControlFlow;

use nalgebra::Point3;
use voxels::walk_segment;

use super::Ctx;
use super::settings::{SettingError, Settings};
use crate::exploration_map::{CellState, ExplorationMap};
use crate::observation::Observation;

/// How far along its way the agent looks ahead, in cells.
const AHEAD_CELLS: f64 = 1.5;

/// An agent's relays.
#[derive(Debug, Clone)]
pub struct Relays {
    is_on: bool,
    left: u32,
}

impl Relays {
    /// Setting: `relays`, `off` (the default) or `on`.
    ///
    /// # Errors
    /// If it is neither.
    pub fn new(settings: &mut Settings) -> Result<Self, SettingError> {
        let is_on = settings.word("relays", &["off", "on"])? == 1;
        Ok(Self { is_on, left: 0 })
    }

    /// Whether to leave a relay here before going on along these way-points; then it counts as left.
    pub fn is_one_left(&mut self, observation: &Observation, ctx: &Ctx<'_>, way: &[Point3<f64>]) -> bool {
        if !self.is_on || self.left >= ctx.briefing().relays_per_agent {
            return false;
        }
        let Observation { contacts, relays, .. } = observation;
        let others =
            || contacts.iter().map(|contact| contact.position).chain(relays.iter().map(|relay| relay.position));
        let range_m = ctx.briefing().communication_range_m;
        let is_joined = |from: &Point3<f64>| {
            others().any(|other| (other - from).norm() <= range_m && is_in_sight(ctx.map(), from, &other))
        };
        let here = ctx.position();
        let there = along(&here, way, AHEAD_CELLS * ctx.map().extent().cell_m());
        let is_last = is_joined(&here) && !is_joined(&there);
        self.left += u32::from(is_last);
        is_last
    }
}

/// The place so far along a way.
fn along(from: &Point3<f64>, way: &[Point3<f64>], mut length_m: f64) -> Point3<f64> {
    let mut here = *from;
    for next in way {
        let leg_m = (next - here).norm();
        if leg_m > length_m {
            return here + (next - here) * (length_m / leg_m);
        }
        length_m -= leg_m;
        here = *next;
    }
    here
}

fn is_in_sight(map: &ExplorationMap, from: &Point3<f64>, to: &Point3<f64>) -> bool {
    let is_free = |cell| matches!(map.state(cell), CellState::Free | CellState::Covered);
    let walk = walk_segment(map.extent(), from, to, |cell| match is_free(cell) {
        true => ControlFlow::Continue(()),
        false => ControlFlow::Break(()),
    });
    walk.is_continue()
}

#[cfg(test)]
mod tests {
    use msgs::ids::AgentId;
    use msgs::relay_id::RelayId;

    use super::*;
    use crate::controllers::testing::{World, flat};
    use crate::observation::{Contact, Relay};

    const BEND: &str = "\
        #######\n\
        #.....#\n\
        #####.#\n\
        #####.#\n\
        #######\n";

    fn relays(setting: &str) -> Relays {
        Relays::new(&mut Settings::parse(&[format!("relays={setting}")]).unwrap()).unwrap()
    }

    /// Where the relays are left on a way along the gallery and round the corner, with a contact at its start.
    fn places(setting: &str, with_contact: bool) -> Vec<i32> {
        let mut world = World::known(BEND, flat(2, 3));
        let centre = |x: f64, y: f64| Point3::new(x, y, 0.5);
        let corner = centre(5.5, 3.5);
        let end = centre(5.5, 1.5);
        if with_contact {
            world.observation.contacts = vec![Contact { agent: AgentId(0), position: centre(1.5, 3.5) }];
        }
        let mut relays = relays(setting);
        let mut left = Vec::new();
        for step in 2..=7 {
            let (cell, way) =
                if step <= 5 { (flat(step, 3), vec![corner, end]) } else { (flat(5, 8 - step), vec![end]) };
            world.put(cell);
            let observation = world.observation.clone();
            if relays.is_one_left(&observation, &world.ctx(), &way) {
                left.push(step);
                let id = RelayId { owner: AgentId(1), number: left.len() as u32 - 1 };
                world.observation.relays.push(Relay { id, position: observation.pose.position });
            }
        }
        left
    }

    #[test]
    fn one_is_left_where_the_team_is_last_in_sight() {
        // At the corner; from there on it is itself in sight.
        assert_eq!(places("on", true), [5]);
        assert_eq!(places("on", false), [0; 0]);
        assert_eq!(places("off", true), [0; 0]);
    }

    #[test]
    fn who_has_none_left_leaves_none() {
        let mut world = World::known(BEND, flat(5, 3));
        world.observation.contacts = vec![Contact { agent: AgentId(0), position: Point3::new(1.5, 3.5, 0.5) }];
        let observation = world.observation.clone();
        let mut relays = relays("on");
        let way = [Point3::new(5.5, 1.5, 0.5)];
        let left: Vec<bool> = (0..4).map(|_| relays.is_one_left(&observation, &world.ctx(), &way)).collect();
        assert_eq!(left, [true, true, false, false]);
    }

    #[test]
    fn a_way_ends_where_it_ends() {
        let at = |x: f64| Point3::new(x, 0.0, 0.0);
        assert_eq!(along(&at(0.0), &[at(2.0), at(4.0)], 3.0), at(3.0));
        assert_eq!(along(&at(0.0), &[at(2.0)], 3.0), at(2.0));
        assert_eq!(along(&at(1.0), &[], 3.0), at(1.0));
    }
}
