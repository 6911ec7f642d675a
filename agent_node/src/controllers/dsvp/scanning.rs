//! When the LiDAR scans: always, or under way only near frontiers in sight.
//!
//! What an agent sees where it knows everything around is nothing new; not to look there saves
//! computing time, messages and redundant coverage. Openings that it does not know yet may stay
//! unseen on the way, so whoever looks less may have to come back.
//!
//! Invariants: an agent at rest scans; so does one under way while it is in a cell from which a
//! frontier of its map can be seen nearby. With a distance of 0 no request is made here.

use crate::command::{Command, Motion, ScanRequest};
use crate::controllers::Ctx;
use crate::observation::Observation;

/// Whether the LiDAR has been asked to scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Scanning {
    /// By the schedule of the run.
    #[default]
    On,
    /// Not until the next request.
    Off,
}

impl Scanning {
    /// Adds a request to a command, if the schedule is to change; `scan_m` is the distance from
    /// frontiers in sight within which an agent under way scans, along each axis.
    pub(super) fn with_request(
        &mut self,
        command: Command,
        scan_m: f64,
        observation: &Observation,
        ctx: &Ctx<'_>,
    ) -> Command {
        if command.lidar != ScanRequest::Keep {
            *self = if command.lidar == ScanRequest::Never { Self::Off } else { Self::On };
            return command;
        }
        let is_under_way = match command.motion {
            Motion::Keep => observation.is_active,
            Motion::Stop => false,
            _ => true,
        };
        let (map, here) = (ctx.map(), ctx.cell());
        let reach = (scan_m / map.extent().cell_m()).ceil() as i32;
        let is_useful = || map.frontiers_near(here, reach).any(|frontier| map.is_in_sight(here, frontier));
        let due = if scan_m == 0.0 || !is_under_way || is_useful() { Self::On } else { Self::Off };
        if std::mem::replace(self, due) == due {
            return command;
        }
        let lidar = match due {
            Self::On => ScanRequest::Every(ctx.run_info().lidar_period_ticks),
            Self::Off => ScanRequest::Never,
        };
        Command { lidar, ..command }
    }
}

#[cfg(test)]
mod tests {
    use voxels::Cell;

    use super::*;
    use crate::command::Trigger;
    use crate::controllers::testing::World;

    /// A corridor that is unexplored beyond its high end.
    const CORRIDOR: &str = "\
        ####################\n\
        #.................??\n\
        ####################\n";

    /// The request of an agent in the corridor.
    fn request(scanning: &mut Scanning, scan_m: f64, x: i32, is_active: bool) -> ScanRequest {
        let mut world = World::known(CORRIDOR, Cell::new(x, 1, 0));
        world.observation.is_active = is_active;
        let observation = world.observation.clone();
        scanning.with_request(Command::keep(Trigger::NEXT_TICK), scan_m, &observation, &world.ctx()).lidar
    }

    #[test]
    fn agents_under_way_scan_near_frontiers_only() {
        let scanning = &mut Scanning::default();
        assert_eq!(request(scanning, 4.0, 5, false), ScanRequest::Keep, "at rest");
        assert_eq!(request(scanning, 4.0, 5, true), ScanRequest::Never);
        assert_eq!(request(scanning, 4.0, 12, true), ScanRequest::Keep, "the frontier is five cells away");
        assert!(matches!(request(scanning, 4.0, 13, true), ScanRequest::Every(1..)));
        assert_eq!(request(scanning, 4.0, 14, true), ScanRequest::Keep);
        assert_eq!(request(scanning, 4.0, 5, true), ScanRequest::Never);
        assert!(matches!(request(scanning, 4.0, 5, false), ScanRequest::Every(1..)), "it stopped");
        assert_eq!(request(scanning, 0.0, 5, true), ScanRequest::Keep, "always");
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
        let command = Command::keep(Trigger::NEXT_TICK);
        let command = Scanning::default().with_request(command, 4.0, &observation, &world.ctx());
        assert_eq!(command.lidar, ScanRequest::Never);
    }

    #[test]
    fn requests_of_the_planner_stand() {
        let mut world = World::known(CORRIDOR, Cell::new(5, 1, 0));
        world.observation.is_active = true;
        let observation = world.observation.clone();
        let mut scanning = Scanning::Off;
        let once = Command { lidar: ScanRequest::Once, ..Command::keep(Trigger::NEXT_TICK) };
        let command = scanning.with_request(once, 4.0, &observation, &world.ctx());
        assert_eq!((command.lidar, scanning), (ScanRequest::Once, Scanning::On));
    }
}
