//! An injector of invalid messages into the ROS domain of a run, thousands per second.
//!
//! Invariant: no message registers an agent id of this run validly: that is not an invalid message,
//! but a duplicate agent, which is a fault of its own.

use std::time::Duration;

use msgs::ids::AgentId;
use msgs::maes_msgs::{AgentMessage, Command, Join, Motion, Scenario, SignedCommand, SignedJoin};
use msgs::topics;
use protocol::limits::{AGENT_MESSAGE_BYTES_MAX, PROTOCOL};
use protocol::signing::{Bytes, NONE};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use ros_node::ros_env::RosEnv;
use ros_node::{Inbox, Publisher, RosError, Sample, linger};

/// Number of messages between two polls of the scenario topic.
const BURST: u32 = 20;

/// Timeout of a poll, wall time.
const POLL: Duration = Duration::from_millis(5);

/// Timeout of the first poll, wall time: discovery takes a while.
const FIRST_POLL: Duration = Duration::from_secs(10);

/// Sends so many invalid messages on the topics of a team of so many agents.
///
/// # Errors
/// If the network cannot be joined.
pub fn inject_garbage(seed: u64, agents: u32, messages: u32, env: &RosEnv) -> Result<(), RosError> {
    let (context, mut workshop) = ros_node::join(env, false)?;
    let mut node = ros_node::node(&context, "garbage")?;
    let mut inbox = Inbox::default();
    workshop.subscribe(&mut node, &topics::scenario(), &mut inbox, |sample: Sample<Scenario>| sample.message)?;
    let mut outlets: Vec<(Publisher<SignedJoin>, Publisher<SignedCommand>)> = Vec::new();
    for agent in (0..agents).map(AgentId) {
        let join = workshop.publisher(&mut node, &topics::signed_join(agent))?;
        outlets.push((join, workshop.publisher(&mut node, &topics::signed_command(agent))?));
    }
    let mut rng = voxels::random_streams::stream(seed, 0, "garbage");
    // Messages with another run id are refused first; those with the current one get further.
    let mut run = 0;
    let mut timeout = FIRST_POLL;
    for number in 0..messages {
        if number % BURST == 0 {
            while let Some(scenario) = inbox.receive(timeout) {
                run = scenario.map_or(run, |scenario| scenario.run);
                timeout = POLL;
            }
            timeout = POLL;
        }
        let topic = rng.random_range(0..agents);
        let (joins, commands) = &mut outlets[topic as usize];
        if rng.random_bool(0.2) {
            let (join, nonce) = (join(&mut rng, run, topic, agents), bytes(&mut rng));
            joins.publish(&mut node, &SignedJoin { join, nonce, proof: bytes(&mut rng), starts: rng.random() });
        } else {
            let command = command(&mut rng, run, topic, agents);
            commands.publish(&mut node, &SignedCommand { command, mac: bytes(&mut rng) });
        }
    }
    linger(false);
    Ok(())
}

/// No or a false proof.
fn bytes(rng: &mut ChaCha8Rng) -> Bytes {
    if rng.random_bool(0.5) { NONE } else { rng.random() }
}

fn join(rng: &mut ChaCha8Rng, run: u64, topic: u32, agents: u32) -> Join {
    let controller = "rbw".to_owned();
    let legal =
        Join { run, agent: topic, instance: rng.random(), protocol: PROTOCOL, controller, last_tick: Join::NONE };
    match rng.random_range(0..4) {
        0 => Join { run: run ^ 1, ..legal },
        1 => Join { protocol: PROTOCOL + 1, ..legal },
        2 => Join { agent: agents + rng.random_range(0..1000), ..legal },
        _ => Join { agent: u32::MAX, controller: "x".repeat(10_000), ..legal },
    }
}

fn command(rng: &mut ChaCha8Rng, run: u64, topic: u32, agents: u32) -> Command {
    let stop = Motion { kind: Motion::STOP, ..Motion::default() };
    let command = Command { tick: rng.random_range(0..3000), run, agent: topic, motion: stop, ..Command::default() };
    let motion = |motion: Motion| Command { motion, ..command.clone() };
    match rng.random_range(0..7) {
        0 => Command { tick: u64::MAX, ..command },
        1 => Command { agent: rng.random_range(0..agents), ..command },
        2 => Command { agent: agents, ..command },
        3 => Command { run: run ^ 1, ..command },
        4 => motion(Motion { kind: Motion::MOVE, distance_m: f64::NAN, pitch_rad: f64::INFINITY, ..Motion::default() }),
        5 => Command {
            messages: vec![AgentMessage { agent: 0, kind: 1, data: vec![7; AGENT_MESSAGE_BYTES_MAX + 1].into() }],
            ..command
        },
        _ => command,
    }
}
