//! Agents that are driven by standard messages, by a node that knows nothing of this project.
//!
//! Such a node gets odometry in every tick and a point cloud with every scan, and answers each stamp of `/clock` with a
//! `geometry_msgs/TwistStamped` of the same stamp on `/agent_<id>/cmd_vel`. This module makes these messages of the observations
//! that an agent of ours would get, and of each twist the command that it would have sent. So all that follows is the same: the
//! lock-step waits for the twist, it is checked, recorded and part of the digest.
//!
//! Invariants: a twist becomes the same command whenever it comes; a tick that is asked again is asked in the same words; the node
//! learns no more than the observation says. This module sends nothing and knows no transport.

use msgs::geometry_msgs::{self, Pose, PoseWithCovariance, Quaternion, Twist, TwistStamped, TwistWithCovariance};
use msgs::ids::{AgentId, Tick};
use msgs::limits::PROTOCOL;
use msgs::maes_msgs::{CellRuns, Command, Join, LidarRequest, Observation as Part, Task, Wake};
use msgs::nav_msgs::Odometry;
use msgs::sensor_msgs::{PointCloud2, PointField};
use msgs::std_msgs::Header;
use nalgebra::{Point3, Rotation3, Vector3};
use voxels::Extent;

use crate::scenario::{LidarSchedule, Scenario};

/// What such an agent is called where others name their controller.
const CONTROLLER: &str = "cmd_vel";

/// Bytes of a point: x, y and z, 32 bits each.
const POINT_STEP: usize = 12;

/// Points of a cloud at the most, so that its message is no larger than 60 000 bytes. The reference's LiDAR has 5124 rays, and most
/// walls are seen by several.
const POINTS_MAX: usize = 4900;

/// What a tick is to a node that is driven by standard messages.
#[derive(Debug, Clone, PartialEq)]
pub struct Told {
    /// The tick.
    pub tick: Tick,
    /// Where the body is and how it moves.
    pub odom: Odometry,
    /// What its scan of this tick has hit, if it had one.
    pub points: Option<PointCloud2>,
}

/// The server's side of one such agent.
#[derive(Debug, Clone)]
pub struct Driver {
    agent: AgentId,
    extent: Extent,
    /// Its scans are in the ticks that leave `phase` when divided by `period`.
    period: u64,
    phase: u64,
    /// Parts of an observation that is not complete.
    parts: Vec<Part>,
}

impl Driver {
    /// The driver of an agent of a scenario, on a map of this extent.
    #[must_use]
    pub fn new(agent: AgentId, scenario: &Scenario, extent: Extent) -> Self {
        let (period, phase) = match scenario.lidar.schedule {
            LidarSchedule::OnRequest => (scenario.lidar.period_ticks, 0),
            LidarSchedule::Maes3d => (scenario.agents.count, agent.0),
        };
        Self { agent, extent, period: period.into(), phase: phase.into(), parts: Vec::new() }
    }

    /// The join on behalf of a node that has been found to publish velocities for this agent.
    #[must_use]
    pub fn join(&self, run: u64) -> Join {
        Join {
            run,
            agent: self.agent.0,
            instance: 0,
            protocol: PROTOCOL,
            controller: CONTROLLER.to_owned(),
            last_tick: Join::NONE,
        }
    }

    /// Takes in a part of an observation. With the last one, what the node is told.
    pub fn tell(&mut self, part: &Part) -> Option<Told> {
        if part.part == 0 {
            self.parts.clear();
        }
        self.parts.push(part.clone());
        if self.parts.len() < usize::from(part.parts) {
            return None;
        }
        let parts = std::mem::take(&mut self.parts);
        let first = &parts[0];
        let has_scan = first.scan_tick == first.tick;
        // At the start nothing was asked for, but all that the first scan has seen is new.
        let walls = |part: &Part| if first.tick == 0 { part.seen_wall.clone() } else { part.view_wall.clone() };
        let points = has_scan.then(|| self.points(first, &parts.iter().map(walls).collect::<Vec<_>>()));
        Some(Told { tick: Tick(first.tick), odom: self.odom(first), points })
    }

    fn frame(&self) -> String {
        format!("agent_{}/base_link", self.agent)
    }

    fn odom(&self, observation: &Part) -> Odometry {
        let velocity = &observation.velocity_m_s;
        let in_body = heading(observation).inverse() * Vector3::new(velocity.x, velocity.y, velocity.z);
        let (sin, cos) = libm::sincos(observation.yaw_rad * 0.5);
        let pose = Pose { position: observation.position, orientation: Quaternion { x: 0.0, y: 0.0, z: sin, w: cos } };
        let twist = Twist {
            linear: geometry_msgs::Vector3 { x: in_body.x, y: in_body.y, z: in_body.z },
            angular: geometry_msgs::Vector3 { x: 0.0, y: 0.0, z: observation.yaw_rate_rad_s },
        };
        Odometry {
            header: observation.header.clone(),
            child_frame_id: self.frame(),
            pose: PoseWithCovariance { pose, ..PoseWithCovariance::default() },
            twist: TwistWithCovariance { twist, ..TwistWithCovariance::default() },
        }
    }

    /// The centres of the wall cells that were hit, in the frame of the body; evenly thinned out if they are too many.
    fn points(&self, observation: &Part, walls: &[CellRuns]) -> PointCloud2 {
        let position = &observation.position;
        let from = Point3::new(position.x, position.y, position.z);
        let into_body = heading(observation).inverse();
        let runs = walls.iter().flat_map(|runs| runs.start.iter().zip(&runs.length));
        let cells: Vec<u32> = runs.flat_map(|(&start, &length)| start..start + u32::from(length)).collect();
        let keep_one_of = cells.len().div_ceil(POINTS_MAX).max(1);
        let mut data = Vec::with_capacity(cells.len() / keep_one_of * POINT_STEP);
        for &cell in cells.iter().step_by(keep_one_of) {
            let point = into_body * (self.extent.centre(self.extent.cell_at(cell as usize)) - from);
            data.extend(point.iter().flat_map(|&along| (along as f32).to_le_bytes()));
        }
        let field =
            |name: &str, offset| PointField { name: name.to_owned(), offset, datatype: PointField::FLOAT32, count: 1 };
        PointCloud2 {
            header: Header { stamp: observation.header.stamp, frame_id: self.frame() },
            height: 1,
            width: (data.len() / POINT_STEP) as u32,
            fields: vec![field("x", 0), field("y", 4), field("z", 8)],
            is_bigendian: false,
            point_step: POINT_STEP as u32,
            row_step: data.len() as u32,
            data,
            is_dense: true,
        }
    }

    /// The command that a twist stands for: hold this velocity, scan as the scenario says, ask again in the next tick.
    ///
    /// The twist is in the frame of the body: x forward, y left, z up. Only the yaw rate of its angular part counts, because the
    /// body stays upright.
    ///
    /// # Errors
    /// What is wrong with the stamp or the frame. Numbers are checked where those of all commands are.
    pub fn command(&self, run: u64, twist: &TwistStamped) -> Result<Command, String> {
        let own_frame = self.frame();
        let frame = twist.header.frame_id.trim_start_matches('/');
        if !["", "base_link", &own_frame].contains(&frame) {
            return Err(format!(
                "header.frame_id is \"{frame}\": expected \"{own_frame}\", \"base_link\" or nothing; a velocity is given in the \
                 frame of the body"
            ));
        }
        let tick = tick(twist)?;
        Ok(Command {
            tick: tick.0,
            run,
            agent: self.agent.0,
            task: Task {
                kind: Task::VELOCITY,
                linear_m_s: twist.twist.linear,
                yaw_rate_rad_s: twist.twist.angular.z,
                ..Task::default()
            },
            lidar: LidarRequest { kind: LidarRequest::KEEP, ..LidarRequest::default() },
            want_view: tick.after(1).0 % self.period == self.phase,
            wake: Wake { at_tick: 0, events: 0 },
            ..Command::default()
        })
    }

    /// The receipt for the end of a run.
    #[must_use]
    pub fn receipt(&self, run: u64, tick: Tick) -> Command {
        Command { tick: tick.0, run, agent: self.agent.0, ..Command::default() }
    }
}

/// How the body is turned in the frame `map`.
fn heading(observation: &Part) -> Rotation3<f64> {
    let (sin, cos) = libm::sincos(observation.yaw_rad);
    Rotation3::from_matrix_unchecked(nalgebra::Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0))
}

/// The tick whose stamp a twist carries.
fn tick(twist: &TwistStamped) -> Result<Tick, String> {
    let stamp = &twist.header.stamp;
    let nanoseconds = i128::from(stamp.sec) * 1_000_000_000 + i128::from(stamp.nanosec);
    u64::try_from(nanoseconds)
        .ok()
        .filter(|nanoseconds| nanoseconds.is_multiple_of(Tick::TICK_NS))
        .map(|nanoseconds| Tick(nanoseconds / Tick::TICK_NS))
        .ok_or_else(|| {
            format!(
                "header.stamp is {}.{:09} s: expected that of a tick, as it is on /clock (multiples of {} s)",
                stamp.sec,
                stamp.nanosec,
                Tick::TICK_S
            )
        })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use msgs::builtin_interfaces::Time;

    use super::*;

    fn twist(sec: i32, nanosec: u32, frame: &str) -> TwistStamped {
        let linear = geometry_msgs::Vector3 { x: 1.0, y: 0.5, z: -0.25 };
        let angular = geometry_msgs::Vector3 { x: 7.0, y: 8.0, z: 0.5 };
        let header = Header { stamp: Time { sec, nanosec }, frame_id: frame.to_owned() };
        TwistStamped { header, twist: Twist { linear, angular } }
    }

    fn driver() -> Driver {
        driver_on(10)
    }

    fn driver_on(size: usize) -> Driver {
        let extent = Extent::new([size; 3], 1.0).unwrap();
        Driver { agent: AgentId(3), extent, period: 10, phase: 0, parts: Vec::new() }
    }

    #[test]
    fn a_twist_is_a_velocity_for_the_tick_of_its_stamp() {
        let command = driver().command(9, &twist(2, 40_000_000, "agent_3/base_link")).unwrap();
        assert_eq!((command.tick, command.run, command.agent), (102, 9, 3));
        assert_eq!(command.task.kind, Task::VELOCITY);
        assert_eq!(command.task.linear_m_s, geometry_msgs::Vector3 { x: 1.0, y: 0.5, z: -0.25 });
        assert_eq!(command.task.yaw_rate_rad_s, 0.5);
        assert!(crate::wire::command(&command, 4).is_ok());
    }

    #[test]
    fn the_view_is_asked_for_in_the_tick_before_a_scan() {
        let asks = |nanosec| driver().command(9, &twist(0, nanosec, "")).unwrap().want_view;
        assert_eq!([160_000_000, 180_000_000, 200_000_000].map(asks), [false, true, false]);
    }

    #[test]
    fn the_world_takes_no_numbers_that_are_none() {
        let mut nonsense = twist(0, 0, "");
        nonsense.twist.linear.x = f64::NAN;
        let command = driver().command(9, &nonsense).unwrap();
        assert!(crate::wire::command(&command, 4).is_err());
    }

    #[test]
    fn a_stamp_between_two_ticks_and_a_foreign_frame_are_refused() {
        let refusal = |twist| driver().command(9, &twist).unwrap_err();
        assert!(refusal(twist(0, 30_000_000, "")).contains("0.030000000 s: expected that of a tick"));
        assert!(refusal(twist(-1, 0, "")).contains("header.stamp is -1."));
        assert!(refusal(twist(0, 0, "map")).contains("expected \"agent_3/base_link\""));
        assert!(driver().command(9, &twist(0, 0, "base_link")).is_ok());
    }

    /// A body at (2.5, 2.5, 2.5) that looks along y and has seen a wall cell two cells ahead.
    fn part(number: u16, cell: u32) -> Part {
        Part {
            header: Header { stamp: Tick(20).into(), frame_id: "map".to_owned() },
            tick: 20,
            part: number,
            parts: 2,
            position: geometry_msgs::Point { x: 2.5, y: 2.5, z: 2.5 },
            yaw_rad: FRAC_PI_2,
            velocity_m_s: geometry_msgs::Vector3 { x: 0.0, y: 1.5, z: 0.5 },
            scan_tick: 20,
            has_view: true,
            view_wall: CellRuns { start: vec![cell], length: vec![1] },
            ..Part::default()
        }
    }

    #[test]
    fn odometry_and_points_are_in_the_frame_of_the_body() {
        let mut driver = driver();
        let index = |x, y, z| driver.extent.index(voxels::Cell::new(x, y, z)).unwrap() as u32;
        let [ahead, left] = [index(2, 4, 2), index(0, 2, 3)];
        assert_eq!(driver.tell(&part(0, ahead)), None, "the second part is missing");
        let told = driver.tell(&part(1, left)).unwrap();
        let linear = told.odom.twist.twist.linear;
        assert!((linear.x - 1.5).abs() < 1e-12 && linear.y.abs() < 1e-12 && linear.z == 0.5, "{linear:?}");
        assert_eq!((told.tick, told.odom.header.frame_id.as_str()), (Tick(20), "map"));
        let cloud = told.points.unwrap();
        assert_eq!((cloud.header.frame_id.as_str(), cloud.width, cloud.row_step), ("agent_3/base_link", 2, 24));
        let numbers: Vec<f32> =
            cloud.data.chunks_exact(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect();
        let expected = [2.0, 0.0, 0.0, 0.0, 2.0, 1.0];
        assert!(numbers.iter().zip(expected).all(|(is, should)| (is - should).abs() < 1e-6), "{numbers:?}");
    }

    #[test]
    fn between_scans_there_are_no_points_and_many_are_thinned_out() {
        let alone = Part { parts: 1, ..part(0, 0) };
        let idle = Part { scan_tick: 10, ..alone.clone() };
        assert_eq!(driver().tell(&idle).unwrap().points, None);
        let view_wall = CellRuns { start: vec![0], length: vec![10_000] };
        let cloud = driver_on(100).tell(&Part { view_wall, ..alone }).unwrap().points.unwrap();
        assert_eq!(cloud.width, 3334);
    }
}
