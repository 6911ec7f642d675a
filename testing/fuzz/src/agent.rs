//! Target `agent`: any fragments of observations with any agent messages, and map sharing on.

use agent_node::control_loop::{Agent, Reaction};
use agent_node::controllers;
use arbitrary::{Result, Unstructured};
use msgs::cdr;
use msgs::geometry_msgs::{Point, Vector3};
use msgs::ids::AgentId;
use msgs::maes_msgs::{AgentMessage, Body, CellRuns, Contact, Lidar, Observation as Part, Scenario};
use protocol::limits::OBSERVATION_BYTES_MAX;
use protocol::message_type::MessageType;
use protocol::run_info::RunInfo;
use protocol::signed::Signed;

use crate::hostile_messages::number;

/// Number of agents of the run.
const AGENTS: u32 = 3;

/// The agent.
const OWN: AgentId = AgentId(1);

/// Cells of the map along x, y and z.
const SIZE: [u32; 3] = [9, 8, 7];

/// Most fragments for one agent.
const PARTS_MAX: usize = 64;

/// An agent takes fragments: it replies with a legal command, or with an error.
pub(crate) fn take(bytes: &[u8]) {
    let _end_of_bytes = play(&mut Unstructured::new(bytes));
}

fn play(data: &mut Unstructured<'_>) -> Result<()> {
    let name = *data.choose(&controllers::NAMES)?;
    let share_period_ticks = *data.choose(&[0, 1, 2, 251])?;
    let scenario = Scenario {
        duration_ticks: 1000,
        size: SIZE,
        cell_m: 1.0,
        agents: AGENTS,
        agents_seed: 5,
        bodies: bodies(),
        body_of: vec![0, 0, 1],
        lidar: Lidar { rays: 100, range_m: f64::INFINITY, fov_rad: 6.0, period_ticks: 10 },
        communication_range_m: f64::INFINITY,
        share_period_ticks,
        ..Scenario::default()
    };
    let run_info = RunInfo::from_message(&scenario, OWN).expect("a legal scenario");
    let controller = controllers::build(name, &[], OWN, &run_info).expect("there is such a controller");
    let mut agent = Agent::new(OWN, run_info, controller);
    let mut tick = 0;
    for _ in 0..PARTS_MAX {
        if data.is_empty() {
            return Ok(());
        }
        tick += u64::from(data.int_in_range(0..=3u8)?);
        let Ok(Reaction::Reply(command) | Reaction::Acknowledge(command)) =
            agent.take(Signed::unsigned(part(data, tick)?).trusted())
        else {
            continue;
        };
        protocol::command::Command::from_message(&command, AGENTS)
            .unwrap_or_else(|reason| panic!("{name} answers: {reason}"));
        assert_eq!(command.agent, OWN.0);
        assert!(cdr::encode(&command).len() <= OBSERVATION_BYTES_MAX, "an answer fits into a sample");
    }
    Ok(())
}

/// A submarine and an aerial body.
fn bodies() -> Vec<Body> {
    let submarine = Body {
        kind: Body::SUBMARINE,
        radius_m: 0.4,
        speed_max_m_s: 1.5,
        acceleration_m_s2: 0.5,
        deceleration_m_s2: 0.25,
        turn_rate_max_rad_s: 1.7,
        turn_acceleration_rad_s2: 0.9,
        turn_deceleration_rad_s2: 0.4,
    };
    vec![submarine, Body { kind: Body::AERIAL, ..submarine }]
}

/// A fragment of an observation, mostly close to a legal one.
fn part(data: &mut Unstructured<'_>, tick: u64) -> Result<Part> {
    let is_whole = data.ratio(7, 8)?;
    let [part, parts] = if is_whole { [0, 1] } else { [data.int_in_range(0..=3)?, data.int_in_range(0..=3)?] };
    Ok(Part {
        tick: if data.ratio(1, 32)? { data.arbitrary()? } else { tick },
        agent: 1,
        part,
        parts,
        phase: if data.ratio(1, 32)? { data.arbitrary()? } else { Part::RUNNING },
        position: position(data)?,
        yaw_rad: number(data)? / 8.0,
        velocity_m_s: Vector3 { x: number(data)?, y: number(data)?, z: number(data)? },
        yaw_rate_rad_s: number(data)?,
        task_status: data.int_in_range(0..=2)?,
        collision: data.int_in_range(0..=4)?,
        collision_with_agent: data.arbitrary()?,
        events: data.arbitrary()?,
        contacts: some(data, |data| Ok(Contact { agent: peer(data)?, position: position(data)? }))?,
        messages: some(data, message)?,
        scan_tick: if data.arbitrary()? { Part::NEVER } else { tick },
        seen_free: runs(data)?,
        seen_wall: runs(data)?,
        has_view: data.arbitrary()?,
        view_free: runs(data)?,
        view_wall: runs(data)?,
        ..Part::default()
    })
}

/// A short list.
fn some<T>(data: &mut Unstructured<'_>, mut one: impl FnMut(&mut Unstructured<'_>) -> Result<T>) -> Result<Vec<T>> {
    let count = data.int_in_range(0..=7)?;
    // Most lists are empty.
    (4..count).map(|_| one(data)).collect()
}

fn peer(data: &mut Unstructured<'_>) -> Result<u32> {
    if data.ratio(1, 32)? { data.arbitrary() } else { data.int_in_range(0..=AGENTS - 1) }
}

/// A position, mostly in the map.
fn position(data: &mut Unstructured<'_>) -> Result<Point> {
    if data.ratio(1, 16)? {
        return Ok(Point { x: number(data)?, y: number(data)?, z: number(data)? });
    }
    let mut along = |axis: usize| Ok(f64::from(data.arbitrary::<u8>()?) / 256.0 * f64::from(SIZE[axis]));
    Ok(Point { x: along(0)?, y: along(1)?, z: along(2)? })
}

/// An agent message, mostly of the kind of a map, with a correct version and, if it is an update or
/// a completion, for [`OWN`] alone.
fn message(data: &mut Unstructured<'_>) -> Result<AgentMessage> {
    let kind = if data.ratio(1, 4)? { data.arbitrary()? } else { MessageType::Map.number() };
    let length = data.int_in_range(0..=40)?;
    let mut content = match data.int_in_range(0..=7)? {
        0 => Vec::new(),
        1 | 2 => vec![agent_node::sharing::VERSION],
        3 => vec![agent_node::sharing::VERSION, 0],
        4 => vec![agent_node::sharing::VERSION, 2, 1, OWN.0 as u8],
        _ => vec![agent_node::sharing::VERSION, 1, 1, OWN.0 as u8],
    };
    content.extend_from_slice(data.bytes(length.min(data.len()))?);
    Ok(AgentMessage { agent: peer(data)?, kind, data: content.into() })
}

/// Runs of cells, mostly of this map.
fn runs(data: &mut Unstructured<'_>) -> Result<CellRuns> {
    let mut cells = CellRuns::default();
    let is_legal = data.ratio(15, 16)?;
    let mut next = 0u32;
    for _ in 0..data.int_in_range(0..=6)? {
        let (gap, length) = (data.arbitrary::<u8>()?, data.int_in_range(1..=30)?);
        let start = if is_legal { next + u32::from(gap) } else { data.arbitrary()? };
        if is_legal && start + u32::from(length) > SIZE.iter().product::<u32>() {
            break;
        }
        cells.start.push(start);
        cells.length.push(length);
        next = start.wrapping_add(length.into());
    }
    if data.ratio(1, 64)? {
        cells.start.push(data.arbitrary()?);
    }
    Ok(cells)
}
