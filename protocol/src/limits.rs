//! The limits that the protocol sets, as the `.msg` files state them.
//!
//! All follow from one: a sample of more than 60 kB does not reach every reader over UDP with the
//! socket buffers that a machine has by default, and the loss is not reported. This module
//! checks nothing; the receiver of a message does.

/// Version of the protocol. Another one is not understood, and a join that names it is refused.
pub const PROTOCOL: u32 = 7;

/// Version of the recorded messages. Version 4 of the protocol has added signatures, and version 5
/// codes of refusals, which are not recorded, version 6 an event, which is reported to those who
/// ask for it, and version 7 the stage at the end of commands, which the digest leaves out. So the
/// bytes that the digest covers are those of version 3.
pub const RECORDED_PROTOCOL: u32 = 3;

/// Longest CDR encoding of one part of an observation, bytes.
pub const OBSERVATION_BYTES_MAX: usize = 60_000;

/// Longest CDR encoding of a message that is only looked at, bytes.
pub const VIEW_BYTES_MAX: usize = OBSERVATION_BYTES_MAX;

/// Most bytes of data in the messages of one command taken together, and so in each of them.
pub const AGENT_MESSAGE_BYTES_MAX: usize = 57_344;

/// Most bytes that a relay keeps.
pub const RELAY_BYTES_MAX: usize = 4_096;

/// Most relays that an agent can deploy: their numbers share a field with that of the agent.
pub const RELAYS_PER_AGENT_MAX: u32 = 1_024;

/// Most relays that an observation names, those that are nearest.
pub const RELAYS_TOLD_MAX: usize = 256;

/// Longest information text of a command, bytes.
pub const INFO_BYTES_MAX: usize = 1_024;

/// Most waypoints of a path.
pub const PATH_POINTS_MAX: usize = 1_024;

/// Most bases where an agent charges: its observations name all of them.
pub const BASES_MAX: usize = 64;

/// Most different bodies of a team.
pub const BODIES_MAX: usize = 256;

/// Bytes on the wire of a point, such as a waypoint.
pub const POINT_BYTES: usize = 24;

/// Bytes on the wire of a message beside its data, with padding.
pub const AGENT_MESSAGE_BYTES_BARE: usize = 16;

/// Bytes on the wire of a command or of a part of an observation without its lists and texts,
/// rounded up generously.
pub const MESSAGE_BYTES_BARE: usize = 512;

/// Most bytes that the waypoints and the messages of one command may take together: what fits into
/// one sample of [`OBSERVATION_BYTES_MAX`] beside the information text and the rest.
pub const LIST_BYTES_MAX: usize = OBSERVATION_BYTES_MAX - INFO_BYTES_MAX - MESSAGE_BYTES_BARE;

#[cfg(test)]
mod tests {
    use super::*;
    use msgs::cdr;
    use msgs::geometry_msgs::Point;
    use msgs::maes_msgs::{AgentMessage, Body, Command, Energy, Motion, Observation, Scenario};
    use msgs::message::Message;

    #[test]
    fn the_msg_files_state_the_same_limits() {
        let states = |definition: &str, words: String| assert!(definition.contains(&words), "{words}");
        states(Observation::TYPE.definition, format!("No fragment is larger than {OBSERVATION_BYTES_MAX} bytes."));
        states(AgentMessage::TYPE.definition, format!("at most {AGENT_MESSAGE_BYTES_MAX} bytes"));
        states(AgentMessage::TYPE.definition, format!("to a relay at most {RELAY_BYTES_MAX}"));
        states(AgentMessage::TYPE.definition, format!("FIRST_RELAY + {RELAYS_PER_AGENT_MAX} *"));
        states(Command::TYPE.definition, format!("at most {INFO_BYTES_MAX} bytes"));
        states(Scenario::TYPE.definition, format!("1 to {BODIES_MAX}"));
        states(Energy::TYPE.definition, format!("1 to {BASES_MAX}"));
        states(Motion::TYPE.definition, format!("1 to {PATH_POINTS_MAX}"));
    }

    #[test]
    fn a_scenario_of_many_bodies_fits_into_a_sample_with_room_for_settings() {
        let (bodies, body_of) = (vec![Body::default(); BODIES_MAX], vec![0; 1000]);
        let bytes = cdr::encode(&Scenario { bodies, body_of, ..Scenario::default() }).len();
        assert!(bytes <= OBSERVATION_BYTES_MAX / 2, "{bytes} bytes");
    }

    #[test]
    fn a_command_with_full_lists_fits_into_a_sample() {
        let path = vec![Point::default(); PATH_POINTS_MAX];
        for messages in [1, 7, 500] {
            let room = LIST_BYTES_MAX - POINT_BYTES * path.len() - AGENT_MESSAGE_BYTES_BARE * messages;
            let message = AgentMessage { agent: 1, kind: 1, data: vec![0; room / messages].into() };
            let command = Command {
                motion: Motion { path: path.clone(), ..Motion::default() },
                messages: vec![message; messages],
                info: "x".repeat(INFO_BYTES_MAX),
                ..Command::default()
            };
            let bytes = cdr::encode(&command).len();
            assert!(bytes <= OBSERVATION_BYTES_MAX, "{messages} messages: {bytes} bytes");
        }
    }
}
