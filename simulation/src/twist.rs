//! Externally controlled agents: a ROS 2 node that uses standard messages only.
//!
//! The node receives odometry in every tick and a point cloud with every scan
//! ([`crate::visualisation`]), and replies to each stamp of `/clock` with a
//! `geometry_msgs/TwistStamped` of the same stamp on `/agent_<id>/cmd_vel`. This module converts
//! each twist into the equivalent command of an agent, so lock-step, checks, recording and digest
//! are the same as for any agent.
//!
//! Invariant: a twist becomes the same command whenever it comes. There is no transport here.

use msgs::geometry_msgs::TwistStamped;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::{Command, Join, Motion, ScanRequest, WakeCondition};
use protocol::limits::PROTOCOL;

use crate::wire::body_frame;

/// The controller name of an externally controlled agent.
const CONTROLLER: &str = "cmd_vel";

/// The join on behalf of a node that publishes velocities for an agent.
#[must_use]
pub fn join(run: u64, agent: AgentId) -> Join {
    let (controller, last_tick) = (CONTROLLER.to_owned(), Join::NONE);
    Join { run, agent: agent.0, instance: 0, protocol: PROTOCOL, controller, last_tick }
}

/// The command equivalent to a twist: hold this velocity, keep the scan schedule, next request in
/// the next tick.
///
/// The twist is in the frame of the body: x forward, y left, z up. Of its angular part only z, the
/// yaw rate, is used, because the body stays upright.
///
/// # Errors
/// Describes a wrong stamp or frame. Numbers are checked as those of all commands
/// ([`protocol::command::Command::from_message`]).
pub fn command(run: u64, agent: AgentId, twist: &TwistStamped) -> Result<Command, String> {
    let own_frame = body_frame(agent);
    let frame = twist.header.frame_id.trim_start_matches('/');
    if !["", "base_link", &own_frame].contains(&frame) {
        return Err(format!(
            "header.frame_id is \"{frame}\": expected \"{own_frame}\", \"base_link\" or nothing; a velocity is given in the frame \
             of the body"
        ));
    }
    Ok(Command {
        tick: tick(twist)?.0,
        run,
        agent: agent.0,
        motion: Motion {
            kind: Motion::VELOCITY,
            linear_m_s: twist.twist.linear,
            yaw_rate_rad_s: twist.twist.angular.z,
            ..Motion::default()
        },
        lidar: ScanRequest { kind: ScanRequest::KEEP, ..ScanRequest::default() },
        wake: WakeCondition { at_tick: 0, events: 0 },
        ..Command::default()
    })
}

/// The acknowledgement of the end of a run.
#[must_use]
pub fn acknowledgement(run: u64, agent: AgentId, tick: Tick) -> Command {
    Command { tick: tick.0, run, agent: agent.0, ..Command::default() }
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
    use msgs::builtin_interfaces::Time;
    use msgs::geometry_msgs::{Twist, Vector3};
    use msgs::std_msgs::Header;

    use super::*;

    const AGENT: AgentId = AgentId(3);

    fn twist(sec: i32, nanosec: u32, frame: &str) -> TwistStamped {
        let linear = Vector3 { x: 1.0, y: 0.5, z: -0.25 };
        let angular = Vector3 { x: 7.0, y: 8.0, z: 0.5 };
        let header = Header { stamp: Time { sec, nanosec }, frame_id: frame.to_owned() };
        TwistStamped { header, twist: Twist { linear, angular } }
    }

    #[test]
    fn twist_is_a_velocity_for_the_tick_of_its_stamp() {
        let command = command(9, AGENT, &twist(2, 40_000_000, "agent_3/base_link")).unwrap();
        assert_eq!((command.tick, command.run, command.agent), (102, 9, 3));
        assert_eq!(command.motion.kind, Motion::VELOCITY);
        assert_eq!(command.motion.linear_m_s, Vector3 { x: 1.0, y: 0.5, z: -0.25 });
        assert_eq!(command.motion.yaw_rate_rad_s, 0.5);
        assert!(protocol::command::Command::from_message(&command, 4).is_ok());
    }

    #[test]
    fn nan_is_refused() {
        let mut nonsense = twist(0, 0, "");
        nonsense.twist.linear.x = f64::NAN;
        let command = command(9, AGENT, &nonsense).unwrap();
        assert!(protocol::command::Command::from_message(&command, 4).is_err());
    }

    #[test]
    fn a_stamp_between_two_ticks_and_a_foreign_frame_are_refused() {
        let refusal = |twist| command(9, AGENT, &twist).unwrap_err();
        assert!(refusal(twist(0, 30_000_000, "")).contains("0.030000000 s: expected that of a tick"));
        assert!(refusal(twist(-1, 0, "")).contains("header.stamp is -1."));
        assert!(refusal(twist(0, 0, "map")).contains("expected \"agent_3/base_link\""));
        assert!(command(9, AGENT, &twist(0, 0, "base_link")).is_ok());
    }
}
