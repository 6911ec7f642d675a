//! The messages of the package `maes_msgs`, exactly as in the `.msg` files under `msgs/msg`.
//!
//! The `.msg` files are the source of truth: names, order and types of the fields, the constants
//! and the comments are theirs. Each struct is one file, in their order, and serialises to the CDR
//! bytes of the type that ROS 2 builds from it. Its receiver checks the raw numbers and converts
//! them. "Sum of the constants" means a bit set. Ticks are fixed updates of 20 ms.

mod changes;

use serde::{Deserialize, Serialize};

use crate::geometry_msgs::{Point, Vector3};
use crate::shared_bytes::SharedBytes;
use crate::std_msgs::Header;
pub use changes::{Intervention, MapChange};

impl Body {
    /// `kind`: turns first, then moves along its heading.
    pub const SUBMARINE: u8 = 0;
    /// `kind`: moves in any direction at once, and turns towards it on its way.
    pub const AERIAL: u8 = 1;
}

/// What the body of an agent can do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Body {
    /// How it moves.
    pub kind: u8,
    /// Radius of the body, a sphere.
    pub radius_m: f64,
    /// Highest speed along its path.
    pub speed_max_m_s: f64,
    /// How fast it gains speed.
    pub acceleration_m_s2: f64,
    /// How fast it brakes.
    pub deceleration_m_s2: f64,
    /// Highest rate of turning about the vertical.
    pub turn_rate_max_rad_s: f64,
    /// How fast it gains turning rate.
    pub turn_acceleration_rad_s2: f64,
    /// How fast it loses turning rate.
    pub turn_deceleration_rad_s2: f64,
}

/// A set of map cells, as runs of consecutive cell indices.
///
/// The index of cell (x, y, z) in a map of size (sx, sy, sz) is `(z * sy + y) * sx + x`; a run may
/// continue into the next row. Runs are disjoint and ascending; both arrays have the same length.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CellRuns {
    /// Index of the first cell of each run.
    pub start: Vec<u32>,
    /// Number of cells of each run, at least 1.
    pub length: Vec<u16>,
}

/// The reply of an agent to an observation: exactly one for each.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Command {
    /// The tick of the observation it replies to.
    pub tick: u64,
    /// The run of that observation; 0 in a recording.
    pub run: u64,
    /// The id of the agent.
    pub agent: u32,
    /// The task of the body from now on.
    pub motion: Motion,
    /// The schedule of the LiDAR from now on.
    pub lidar: ScanRequest,
    /// Whether the next observation has the view of the last scan.
    pub want_view: bool,
    /// Messages to send in this tick.
    pub messages: Vec<AgentMessage>,
    /// The wake-up condition of the next observation.
    pub wake: WakeCondition,
    /// A text for people, at most 1024 bytes; empty: as before.
    pub info: String,
    /// Free cells of its map, for the score; 0 if it has none.
    pub known_free: u32,
    /// Path searches without a result since the start.
    pub failed_searches: u32,
    /// What the agent is busy with, for measures: one of the constants; not in the digest.
    pub stage: u8,
}

impl Command {
    /// `stage`: as before.
    pub const SAME: u8 = 0;
    /// `stage`: on the way to a viewpoint nearby.
    pub const EXPLORING: u8 = 1;
    /// `stage`: on the way to a frontier that is not nearby.
    pub const RELOCATING: u8 = 2;
    /// `stage`: on the way to another agent, with news for it.
    pub const CARRYING: u8 = 3;
    /// `stage`: without a goal, or out of the way of others.
    pub const WAITING: u8 = 4;
}

/// An agent in contact, by the communication model of the scenario, or a relay that can be read and
/// written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// Its id; from [`AgentMessage::FIRST_RELAY`] on: a relay.
    pub agent: u32,
    /// Centre of its body, metres, frame "map"; of an agent, its estimate.
    pub position: Point,
}

/// A named number of a result.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Counter {
    /// The name.
    pub name: String,
    /// The number.
    pub value: u64,
}

/// The digest of the run up to and including a tick: a chain over the state of the world, the
/// observations and the commands.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Digest {
    /// Sim time of the tick; frame "map".
    pub header: Header,
    /// The last tick that it covers.
    pub tick: u64,
    /// The chain, a BLAKE3 hash.
    pub digest: [u8; 32],
}

/// The request of an agent to join a run, repeated until the server replies on `/sim/join_reply`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Join {
    /// The run of the scenario it has received; 0 in a recording.
    pub run: u64,
    /// The id it requests.
    pub agent: u32,
    /// Identifies this process among those that request the same id.
    pub instance: u64,
    /// Version of this protocol that it implements.
    pub protocol: u32,
    /// Name of its controller, with settings.
    pub controller: String,
    /// Last tick it has replied to, or [`NONE`](Self::NONE).
    pub last_tick: u64,
}

impl Join {
    /// `last_tick`: it has replied to none.
    pub const NONE: u64 = u64::MAX;
}

/// The server's reply to a join.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JoinReply {
    /// The run of the server.
    pub run: u64,
    /// The id that was requested.
    pub agent: u32,
    /// The process whose join this replies to.
    pub instance: u64,
    /// Whether the agent has joined.
    pub accepted: bool,
    /// The reason of a refusal: one of the constants.
    pub code: u8,
    /// The reason of a refusal, for people; empty if accepted.
    pub reason: String,
    /// With a join secret: random, drawn by the server for this process; otherwise zeros.
    pub nonce: [u8; 32],
    /// Without a join secret: the session key; zeros: messages are not signed, or the key is
    /// derived.
    pub key: [u8; 32],
    /// With a join secret: keyed BLAKE3 of this reply ([`signing`](crate::signing)); otherwise
    /// zeros.
    pub proof: [u8; 32],
}

impl JoinReply {
    /// `code`: the join is accepted.
    pub const NONE: u8 = 0;
    /// `code`: for a reason without a code of its own.
    pub const REFUSED: u8 = 1;
    /// `code`: the run does not have the id.
    pub const NOT_IN_RUN: u8 = 2;
    /// `code`: another process holds the id.
    pub const ID_TAKEN: u8 = 3;
    /// `code`: the process implements another version of the protocol.
    pub const WRONG_PROTOCOL: u8 = 4;
    /// `code`: the process that is replaced ran another controller.
    pub const OTHER_CONTROLLER: u8 = 5;
    /// `code`: no proof of the join secret, or the process does not sign.
    pub const UNPROVEN: u8 = 6;
    /// `code`: no refusal. Another process holds the id, and is replaced if it does not reply; the
    /// join is to be repeated.
    pub const HELD: u8 = 7;
    /// `code`: a late observation has overtaken earlier ones; the process is to be started again.
    pub const OVERTAKEN: u8 = 8;
}

/// What the LiDAR of an agent can do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Lidar {
    /// Rays of a scan.
    pub rays: u32,
    /// Range, metres; infinity: unlimited.
    pub range_m: f64,
    /// Full opening angle of the cone about the heading; 2 pi: all directions.
    pub fov_rad: f64,
    /// Ticks between scans unless the agent requests otherwise.
    pub period_ticks: u32,
}

/// When the LiDAR of an agent is to scan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ScanRequest {
    /// One of the constants.
    pub kind: u8,
    /// [`EVERY`](Self::EVERY): ticks between scans, at least 1.
    pub period_ticks: u32,
}

impl ScanRequest {
    /// As before; at the start: as the scenario says.
    pub const KEEP: u8 = 0;
    /// No scans from now on.
    pub const NEVER: u8 = 1;
    /// One scan in the next tick, none after it.
    pub const ONCE: u8 = 2;
    /// A scan every `period_ticks`, the next one in the next tick.
    pub const EVERY: u8 = 3;
}

/// What an agent observes in a tick in which its command is requested.
///
/// A large observation is sent in fragments, in order: the first fragment has all fields, later
/// ones add cells and messages to its lists. No fragment is larger than 60000 bytes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Observation {
    /// Sim time of the tick; frame "map".
    pub header: Header,
    /// Fixed updates since the start.
    pub tick: u64,
    /// The run it is part of; 0 in a recording.
    pub run: u64,
    /// The receiver.
    pub agent: u32,
    /// Number of this fragment, 0 .. parts - 1.
    pub part: u16,
    /// Number of fragments, at least 1.
    pub parts: u16,
    /// [`RUNNING`](Self::RUNNING) or [`ENDED`](Self::ENDED).
    pub phase: u8,
    /// Centre of the body, metres, frame "map".
    pub position: Point,
    /// Heading, 0 along x, positive to the left, -pi < `yaw_rad` <= pi.
    pub yaw_rad: f64,
    /// Velocity of the centre of the body, frame "map".
    pub velocity_m_s: Vector3,
    /// Rate of turning about the vertical, positive to the left.
    pub yaw_rate_rad_s: f64,
    /// [`IDLE`](Self::IDLE) or [`ACTIVE`](Self::ACTIVE).
    pub task_status: u8,
    /// [`NONE`](Self::NONE), [`WALL`](Self::WALL), [`FLOOR`](Self::FLOOR) or
    /// [`CEILING`](Self::CEILING).
    pub collision: u8,
    /// Whether the collision was with another agent.
    pub collision_with_agent: bool,
    /// Events since the last observation: sum of the constants of [`WakeCondition`].
    pub events: u8,
    /// Agents in contact now, ascending by id.
    pub contacts: Vec<Contact>,
    /// Messages that have arrived since the last observation, by tick, then by sender.
    pub messages: Vec<AgentMessage>,
    /// Tick of the last scan, or [`NEVER`](Self::NEVER).
    pub scan_tick: u64,
    /// Free cells this agent has seen for the first time since its last observation.
    pub seen_free: CellRuns,
    /// Walls this agent has seen for the first time since its last observation.
    pub seen_wall: CellRuns,
    /// Whether the last command requested the view and there has been a scan.
    pub has_view: bool,
    /// All free cells of the last scan.
    pub view_free: CellRuns,
    /// All walls of the last scan.
    pub view_wall: CellRuns,
}

impl Observation {
    /// `phase`: a command is awaited.
    pub const RUNNING: u8 = 0;
    /// `phase`: the run is over; an empty command with this tick acknowledges it.
    pub const ENDED: u8 = 1;
    /// `task_status`: no task.
    pub const IDLE: u8 = 0;
    /// `task_status`: a task is under way.
    pub const ACTIVE: u8 = 1;
    /// `collision`: none in the last motion.
    pub const NONE: u8 = 0;
    /// `collision`: an obstacle beside the body.
    pub const WALL: u8 = 1;
    /// `collision`: an obstacle below it.
    pub const FLOOR: u8 = 2;
    /// `collision`: an obstacle above it.
    pub const CEILING: u8 = 3;
    /// `scan_tick`: no scan yet.
    pub const NEVER: u64 = u64::MAX;

    /// Whether this is the last fragment.
    #[must_use]
    pub fn is_last(&self) -> bool {
        u32::from(self.part) + 1 == u32::from(self.parts)
    }
}

/// A message from one agent to another.
///
/// The server delivers it in the phase "communicate" of the tick in which it was sent, if the two
/// are in contact then by the communication model; otherwise it is lost. Radios of limited rate
/// transmit later, in order. A relay that an agent has deployed stores one message.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AgentMessage {
    /// In a command the receiver (or [`BROADCAST`](Self::BROADCAST)), in an observation the sender.
    pub agent: u32,
    /// The kind of content, for accounting; chosen by the sender.
    pub kind: u8,
    /// The content: at most 57344 bytes, and so is the sum over the messages of one command; to a
    /// relay at most 4096.
    pub data: SharedBytes,
}

impl AgentMessage {
    /// As receiver: all agents in contact.
    pub const BROADCAST: u32 = u32::MAX;
    /// As receiver: a new relay, deployed at the position of the body, which stores the message.
    pub const LEAVE_RELAY: u32 = 4294967294;
    /// As sender: the server; the content is the CDR of the [`Scenario`] that holds from now on.
    pub const SERVER: u32 = 4294967293;
    /// From here on: a relay, `FIRST_RELAY + 1024 *` the agent that deployed it `+` its number.
    pub const FIRST_RELAY: u32 = 2147483648;
}

/// The progress of a run.
///
/// Fractions are of the free cells of the true map, 0 .. 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Sim time of the tick; frame "map".
    pub header: Header,
    /// Fixed updates executed.
    pub tick: u64,
    /// The part seen by at least one agent.
    pub explored: f64,
    /// The part visited by at least one agent.
    pub covered: f64,
    /// The part seen by agent 0, 1, and so on.
    pub explored_by: Vec<f64>,
    /// The part visited by agent 0, 1, and so on.
    pub covered_by: Vec<f64>,
    /// Distance travelled, metres, by agent 0, 1, and so on.
    pub distance_m: Vec<f64>,
    /// The part that is on the map of agent 0, 1, and so on, as last reported.
    pub believed_by: Vec<f64>,
    /// Pairs of agents in contact.
    pub pairs_in_contact: u32,
    /// Bytes of messages delivered so far.
    pub message_bytes: u64,
}

/// The communication model. What each model assumes: docs/communication.md.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Radio {
    /// "line_of_sight", "range", "line_of_sight_and_range", "global" or "attenuated".
    pub model: String,
    /// Attenuated: transmit power.
    pub tx_dbm: f64,
    /// Attenuated: receiver threshold.
    pub threshold_dbm: f64,
    /// Attenuated: loss over the reference distance in the open.
    pub reference_loss_db: f64,
    /// Attenuated: the reference distance.
    pub reference_m: f64,
    /// Attenuated: path loss exponent in the open.
    pub free_exponent: f64,
    /// Attenuated: path loss exponent inside walls.
    pub wall_exponent: f64,
    /// Attenuated: the unit of length inside walls.
    pub wall_reference_m: f64,
    /// Probability that a message is lost, 0 .. 1.
    pub loss: f64,
    /// Rate of a radio; infinity: unlimited.
    pub bytes_per_s: f64,
    /// Capacity of the transmit queue of an agent.
    pub queue_bytes: u64,
    /// Number of relays that each agent can deploy.
    pub relays_per_agent: u32,
    /// Largest distance at which a relay in contact can be read and written; infinity: any.
    pub relay_read_range_m: f64,
}

/// The outcome of a run: the last message of its recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Result {
    /// Sim time of the end; frame "map".
    pub header: Header,
    /// Fixed updates executed.
    pub tick: u64,
    /// The reason of the end: "explored", "duration", or that of an early end.
    pub reason: String,
    /// The part seen by at least one agent; see [`Progress::explored`].
    pub explored: f64,
    /// The part visited by at least one agent; see [`Progress::covered`].
    pub covered: f64,
    /// The part seen by agent 0, 1, and so on.
    pub explored_by: Vec<f64>,
    /// The part visited by agent 0, 1, and so on.
    pub covered_by: Vec<f64>,
    /// Distance travelled, metres, by agent 0, 1, and so on.
    pub distance_m: Vec<f64>,
    /// The part that is on the map of agent 0, 1, and so on; see [`Progress::believed_by`].
    pub believed_by: Vec<f64>,
    /// Decisions, scans, messages, refusals, and so on.
    pub counters: Vec<Counter>,
    /// The digest of the whole run; see [`Digest`].
    pub digest: [u8; 32],
}

impl Scenario {
    /// `run`: none. The server removes the number of the run from what it records, so a replay has
    /// this.
    pub const NO_RUN: u64 = 0;
}

/// What agents may know of the run: neither the map nor its seed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Scenario {
    /// Version of this protocol, [`limits::PROTOCOL`](crate::limits::PROTOCOL).
    pub protocol: u32,
    /// Identifies this run, or [`NO_RUN`](Self::NO_RUN) in a recording.
    pub run: u64,
    /// `run` of the first run of this server: a reset changes `run` and keeps `origin`.
    pub origin: u64,
    /// Sim time of one fixed update, nanoseconds.
    pub tick_ns: u64,
    /// The run ends at this tick, or before.
    pub duration_ticks: u64,
    /// Cells of the map along x, y, z.
    pub size: [u32; 3],
    /// Edge of a cell, metres; the map spans 0 .. size * cell_m, frame "map".
    pub cell_m: f64,
    /// Number of agents: ids 0 .. agents - 1.
    pub agents: u32,
    /// Seed of the agents' random numbers.
    pub agents_seed: u64,
    /// The controller of agents that are started without another one.
    pub controller: String,
    /// Settings of that controller, each KEY=VALUE; `@IDS:NAME` and `@IDS:KEY=VALUE`, with ids such
    /// as `0-2,4`, for agents that run another one.
    pub settings: Vec<String>,
    /// The different bodies of the team, 1 to [`limits::BODIES_MAX`](crate::limits::BODIES_MAX).
    pub bodies: Vec<Body>,
    /// The place in `bodies` of that of agent 0, 1, and so on.
    #[serde(with = "serde_bytes")]
    pub body_of: Vec<u8>,
    /// The agents' LiDARs.
    pub lidar: Lidar,
    /// Range of communication, metres; infinity: limited by line of sight alone.
    pub communication_range_m: f64,
    /// The whole communication model.
    pub radio: Radio,
    /// Ticks between map exchanges with agents in contact; 0: agents only receive.
    pub share_period_ticks: u32,
}

/// A command as it is sent: with the message authentication code of the process that has joined.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SignedCommand {
    /// The command.
    pub command: Command,
    /// See [`SessionKey::of_command`](crate::signing::SessionKey::of_command); zeros: unsigned.
    pub mac: [u8; 32],
}

/// A join as it is sent: with the proof that the sender knows the join secret of the run, if there
/// is one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SignedJoin {
    /// The join.
    pub join: Join,
    /// Random, drawn by the process; zeros: it does not sign its commands.
    pub nonce: [u8; 32],
    /// See [`JoinSecret::prove_join`](crate::signing::JoinSecret::prove_join); zeros without a
    /// secret.
    pub proof: [u8; 32],
    /// Starts of the process: more than 1 if its start stalled and it restarted itself; 0: unknown.
    pub starts: u32,
}

/// A fragment of an observation as it is sent: with the message authentication code of the server.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SignedObservation {
    /// The fragment.
    pub observation: Observation,
    /// See [`SessionKey::of_observation`](crate::signing::SessionKey::of_observation); zeros:
    /// unsigned.
    pub mac: [u8; 32],
}

/// The task of a body, which lasts until another replaces it.
///
/// A task that replaces another starts from rest (a velocity task that replaces a velocity task
/// continues from the present velocity).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// One of the constants.
    pub kind: u8,
    /// [`MOVE`](Self::MOVE): elevation above the horizontal, -pi/2 .. pi/2.
    pub pitch_rad: f64,
    /// [`MOVE`](Self::MOVE): at least 0; infinity: until a collision.
    pub distance_m: f64,
    /// [`TURN`](Self::TURN): positive to the left (counter-clockwise from above), -2 pi .. 2 pi.
    pub angle_rad: f64,
    /// [`PATH`](Self::PATH): waypoints, metres, frame "map"; 1 to 1024.
    pub path: Vec<Point>,
    /// [`VELOCITY`](Self::VELOCITY): in the frame of the body (x forward, y left, z up); clamped to
    /// the body.
    pub linear_m_s: Vector3,
    /// [`VELOCITY`](Self::VELOCITY): positive to the left; clamped to the body.
    pub yaw_rate_rad_s: f64,
}

impl Motion {
    /// Continue the present task.
    pub const KEEP: u8 = 0;
    /// End the present task; the body is at rest at once.
    pub const STOP: u8 = 1;
    /// Go straight along the heading, raised by `pitch_rad`, for `distance_m`.
    pub const MOVE: u8 = 2;
    /// Turn about the vertical by `angle_rad`.
    pub const TURN: u8 = 3;
    /// Visit the waypoints in order: turn towards each, then move straight.
    pub const PATH: u8 = 4;
    /// Hold a velocity until the next task.
    pub const VELOCITY: u8 = 5;
}

/// The wake-up condition of the next observation: tick `at_tick` at the latest, or earlier any of
/// the events.
///
/// Until then the server neither sends the agent an observation nor waits for it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WakeCondition {
    /// The latest tick; one that is not after the present one stands for the next one.
    pub at_tick: u64,
    /// The events, as the sum of the constants.
    pub events: u8,
}

impl WakeCondition {
    /// The task has ended, by itself or by a collision.
    pub const TASK_DONE: u8 = 1;
    /// A motion was refused because of an obstacle.
    pub const COLLISION: u8 = 2;
    /// The centre of the body has entered another cell.
    pub const NEW_CELL: u8 = 4;
    /// The set of agents in contact has changed.
    pub const CONTACTS: u8 = 8;
    /// A message has arrived.
    pub const MESSAGE: u8 = 16;
    /// An agent is in contact that no observation of this share period has listed. Periods begin at
    /// the multiples of [`Scenario::share_period_ticks`].
    pub const FIRST_CONTACT: u8 = 32;
    /// A scan has found a cell in another state than an earlier scan; ends every wait.
    pub const REVISED: u8 = 64;
}
