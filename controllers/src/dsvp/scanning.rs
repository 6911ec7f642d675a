//! When the LiDAR scans: always, or under way only near frontiers in sight.
//!
//! What an agent sees where it knows everything around is nothing new; not to look there saves
//! computing time and redundant coverage. Openings that it does not know yet may stay unseen on the
//! way, so whoever looks less may have to come back. An agent that scans has seen its surroundings,
//! and the next scan repeats little: so it starts close to a frontier, and stops far from any.
//!
//! Invariants: an agent at rest scans; so does one under way in a cell from which a frontier of its
//! map can be seen nearby. With a distance to start of 0 no request is made here.

use voxels::Cell;

use crate::Ctx;
use agent::command::{Command, Motion, ScanRequest};
use agent::observation::Observation;

/// Distances from frontiers in sight along each axis, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScanRange {
    /// An agent under way starts to scan within this distance. 0: it always scans.
    pub start_m: f64,
    /// It stops beyond this distance, or that to start if it is longer.
    pub stop_m: f64,
}

/// What the LiDAR has been asked to do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Scanning {
    /// Whether it scans by the schedule of the run, or not until the next request.
    is_on: bool,
    /// The frontier in sight that was found last. It mostly is in sight from the next cell as well,
    /// which saves a search.
    frontier: Option<Cell>,
}

impl Default for Scanning {
    fn default() -> Self {
        Self { is_on: true, frontier: None }
    }
}

impl Scanning {
    /// Adds a request to a command, if the schedule is to change.
    pub(super) fn with_request(
        &mut self,
        command: Command,
        range: ScanRange,
        observation: &Observation,
        ctx: &Ctx<'_>,
    ) -> Command {
        if command.lidar != ScanRequest::Keep {
            self.is_on = command.lidar != ScanRequest::Never;
            return command;
        }
        let is_under_way = match command.motion {
            Motion::Keep => observation.is_active,
            Motion::Stop => false,
            _ => true,
        };
        let is_due = range.start_m == 0.0 || !is_under_way || self.sees_frontier(range, ctx);
        if std::mem::replace(&mut self.is_on, is_due) == is_due {
            return command;
        }
        let lidar = if is_due { ScanRequest::Every(ctx.run_info().lidar_period_ticks) } else { ScanRequest::Never };
        Command { lidar, ..command }
    }

    /// Whether a frontier is in sight within the distance that counts.
    fn sees_frontier(&mut self, ScanRange { start_m, stop_m }: ScanRange, ctx: &Ctx<'_>) -> bool {
        let range_m = if self.is_on { stop_m.max(start_m) } else { start_m };
        let (map, here) = (ctx.map(), ctx.cell());
        let reach = (range_m / map.extent().cell_m()).ceil() as i32;
        let is_near = |frontier: &Cell| frontier.is_within(here, reach) && map.is_frontier(*frontier);
        let before = self.frontier.into_iter().filter(is_near);
        self.frontier = before.chain(map.frontiers_near(here, reach)).find(|&frontier| map.is_in_sight(here, frontier));
        self.frontier.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::World;
    use agent::command::WakeCondition;

    /// A corridor that is unexplored beyond its high end.
    const CORRIDOR: &str = "\
        ####################\n\
        #.................??\n\
        ####################\n";

    const RANGE: ScanRange = ScanRange { start_m: 2.0, stop_m: 4.0 };

    /// The request of an agent in the corridor.
    fn request(scanning: &mut Scanning, range: ScanRange, x: i32, is_active: bool) -> ScanRequest {
        let mut world = World::known(CORRIDOR, Cell::new(x, 1, 0));
        world.observation.is_active = is_active;
        let observation = world.observation.clone();
        scanning.with_request(Command::keep(WakeCondition::NEXT_TICK), range, &observation, &world.ctx()).lidar
    }

    #[test]
    fn agents_under_way_scan_near_frontiers_only() {
        let scanning = &mut Scanning::default();
        assert_eq!(request(scanning, RANGE, 5, false), ScanRequest::Keep, "at rest");
        assert_eq!(request(scanning, RANGE, 13, true), ScanRequest::Keep, "the frontier is four cells away");
        assert_eq!(request(scanning, RANGE, 12, true), ScanRequest::Never);
        assert_eq!(request(scanning, RANGE, 14, true), ScanRequest::Keep, "it starts within two cells");
        assert!(matches!(request(scanning, RANGE, 15, true), ScanRequest::Every(1..)));
        assert_eq!(request(scanning, RANGE, 13, true), ScanRequest::Keep);
        assert_eq!(request(scanning, RANGE, 5, true), ScanRequest::Never);
        assert!(matches!(request(scanning, RANGE, 5, false), ScanRequest::Every(1..)), "it stopped");
        let always = ScanRange { start_m: 0.0, ..RANGE };
        assert_eq!(request(scanning, always, 5, true), ScanRequest::Keep);
        let long = ScanRange { start_m: 12.0, ..RANGE };
        assert_eq!(request(scanning, long, 5, true), ScanRequest::Keep, "it does not stop where it would start");
    }

    #[test]
    fn a_frontier_behind_a_wall_is_no_reason_to_scan() {
        let walled = "\
            ####################\n\
            #..................#\n\
            ####################\n\
            #.................??\n\
            ####################\n";
        let mut world = World::known(walled, Cell::new(17, 3, 0));
        world.observation.is_active = true;
        let observation = world.observation.clone();
        let command = Command::keep(WakeCondition::NEXT_TICK);
        let command = Scanning::default().with_request(command, RANGE, &observation, &world.ctx());
        assert_eq!(command.lidar, ScanRequest::Never);
    }

    #[test]
    fn requests_of_the_planner_stand() {
        let mut world = World::known(CORRIDOR, Cell::new(5, 1, 0));
        world.observation.is_active = true;
        let observation = world.observation.clone();
        let mut scanning = Scanning { is_on: false, frontier: None };
        let once = Command { lidar: ScanRequest::Once, ..Command::keep(WakeCondition::NEXT_TICK) };
        let command = scanning.with_request(once, RANGE, &observation, &world.ctx());
        assert_eq!((command.lidar, scanning.is_on), (ScanRequest::Once, true));
    }
}
