//! Relay placement: an agent drops a relay at the last point from which it can be connected.
//!
//! A relay is dropped if a relay or agent in contact is in line of sight from here, on the agent's
//! own map, but none is from a little farther along its path. So the relays form a connected chain
//! as long as agents have relays left.
//!
//! In line of sight means that all cells on the straight segment are known to be free. With a
//! communication model of longer reach, relays are dropped earlier than necessary.

use nalgebra::Point3;

use super::Ctx;
use super::settings::{SettingError, Settings};
use agent::observation::{Contact, Observation};

/// The mark of relays that are there for contact alone, and store nothing.
pub(super) const RELAY_MARK: u8 = 0;

/// Look-ahead distance along the path, cells.
const AHEAD_CELLS: f64 = 1.5;

/// The relays of an agent.
#[derive(Debug, Clone)]
pub struct Relays {
    is_on: bool,
    left: u32,
}

impl Relays {
    /// Setting: `relays`, `off` (the default) or `on`.
    ///
    /// # Errors
    /// If the value is neither.
    pub fn new(settings: &mut Settings) -> Result<Self, SettingError> {
        Ok(Self::switched(settings.word("relays", &["off", "on"])? == 1))
    }

    /// The relays of an agent that drops them if `is_on`.
    #[must_use]
    pub fn switched(is_on: bool) -> Self {
        Self { is_on, left: 0 }
    }

    /// Whether the agent drops relays and has one left.
    #[must_use]
    pub fn has_more(&self, ctx: &Ctx<'_>) -> bool {
        self.is_on && self.left < ctx.run_info().relays_per_agent
    }

    /// Whether to drop a relay here before continuing along these waypoints; counts it as dropped.
    pub fn should_drop(&mut self, observation: &Observation, ctx: &Ctx<'_>, path: &[Point3<f64>]) -> bool {
        self.should_drop_within(observation, ctx, path, |_| true)
    }

    /// [`Relays::should_drop`] to stay connected with relays and those agents in contact alone for
    /// which `counts` holds.
    pub fn should_drop_within(
        &mut self,
        observation: &Observation,
        ctx: &Ctx<'_>,
        path: &[Point3<f64>],
        counts: impl Fn(&Contact) -> bool,
    ) -> bool {
        if !self.has_more(ctx) {
            return false;
        }
        let Observation { contacts, relays, .. } = observation;
        let of_agents = contacts.iter().filter(|&contact| counts(contact)).map(|contact| contact.position);
        let others: Vec<Point3<f64>> = of_agents.chain(relays.iter().map(|relay| relay.position)).collect();
        let range_m = ctx.run_info().communication_range_m;
        let is_connected = |from: &Point3<f64>| {
            others.iter().any(|other| (other - from).norm() <= range_m && ctx.map().is_free_between(from, other))
        };
        let here = ctx.position();
        let there = along(&here, path, AHEAD_CELLS * ctx.map().extent().cell_m());
        let is_last = is_connected(&here) && !is_connected(&there);
        self.left += u32::from(is_last);
        is_last
    }
}

/// The point at a distance along a path.
fn along(from: &Point3<f64>, path: &[Point3<f64>], mut length_m: f64) -> Point3<f64> {
    let mut here = *from;
    for next in path {
        let leg_m = (next - here).norm();
        if leg_m > length_m {
            return here + (next - here) * (length_m / leg_m);
        }
        length_m -= leg_m;
        here = *next;
    }
    here
}

#[cfg(test)]
mod tests {
    use msgs::ids::AgentId;
    use protocol::relay_id::RelayId;

    use super::*;
    use crate::testing::{World, flat};
    use agent::observation::Relay;

    const BEND: &str = "\
        #######\n\
        #.....#\n\
        #####.#\n\
        #####.#\n\
        #######\n";

    fn relays(setting: &str) -> Relays {
        Relays::new(&mut Settings::parse(&[format!("relays={setting}")]).unwrap()).unwrap()
    }

    /// The steps at which relays are dropped on a path along the gallery and round the corner, with
    /// a contact at its start.
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
            let (cell, path) =
                if step <= 5 { (flat(step, 3), vec![corner, end]) } else { (flat(5, 8 - step), vec![end]) };
            world.put(cell);
            let observation = world.observation.clone();
            if relays.should_drop(&observation, &world.ctx(), &path) {
                left.push(step);
                let id = RelayId { owner: AgentId(1), number: left.len() as u32 - 1 };
                world.observation.relays.push(Relay { id, position: observation.pose.position });
            }
        }
        left
    }

    #[test]
    fn relay_is_dropped_at_the_last_point_in_contact() {
        // At the corner; from there on the relay itself is in sight.
        assert_eq!(places("on", true), [5]);
        assert_eq!(places("on", false), [0; 0]);
        assert_eq!(places("off", true), [0; 0]);
    }

    #[test]
    fn no_relay_is_dropped_without_stock() {
        let mut world = World::known(BEND, flat(5, 3));
        world.observation.contacts = vec![Contact { agent: AgentId(0), position: Point3::new(1.5, 3.5, 0.5) }];
        let observation = world.observation.clone();
        let mut relays = relays("on");
        let path = [Point3::new(5.5, 1.5, 0.5)];
        let left: Vec<bool> = (0..4).map(|_| relays.should_drop(&observation, &world.ctx(), &path)).collect();
        assert_eq!(left, [true, true, false, false]);
    }

    #[test]
    fn point_along_a_path_stops_at_its_end() {
        let at = |x: f64| Point3::new(x, 0.0, 0.0);
        assert_eq!(along(&at(0.0), &[at(2.0), at(4.0)], 3.0), at(3.0));
        assert_eq!(along(&at(0.0), &[at(2.0)], 3.0), at(2.0));
        assert_eq!(along(&at(1.0), &[], 3.0), at(1.0));
    }
}
