//! Hostile messages drawn from bytes: any message that can come in over the wire, most of them
//! close to a legal one.

use arbitrary::{Result, Unstructured};
use msgs::geometry_msgs::{Point, Vector3};
use msgs::maes_msgs::{AgentMessage, Command, Join, Motion, ScanRequest, WakeCondition};
use msgs::shared_bytes::SharedBytes;
use protocol::limits::{AGENT_MESSAGE_BYTES_MAX, INFO_BYTES_MAX, PATH_POINTS_MAX, PROTOCOL};
use protocol::signed::Signed;
use transport::Inbound;

/// What a hostile sender knows from listening to all topics.
pub(crate) struct Known {
    pub(crate) run: u64,
    /// The tick of the current requests.
    pub(crate) tick: u64,
    /// Number of agents of the run.
    pub(crate) agents: u32,
    /// Instance numbers of the joined processes.
    pub(crate) instances: Vec<u64>,
}

/// A message, and the agent on whose topic it comes in.
pub(crate) fn message(data: &mut Unstructured<'_>, known: &Known) -> Result<(u32, Inbound)> {
    let agent = id(data, known.agents)?;
    // A transport has topics of the agents of the run only.
    let topic = if data.ratio(1, 8)? { data.int_in_range(0..=known.agents - 1)? } else { agent % known.agents };
    let run = if data.ratio(1, 8)? { data.arbitrary()? } else { known.run };
    let message = match data.int_in_range(0..=7)? {
        0 => Inbound::Undecodable { reason: text(data)? },
        1 | 2 => Inbound::Join(Signed::unsigned(Join {
            run,
            agent,
            instance: if data.ratio(1, 2)? { *data.choose(&known.instances)? } else { data.arbitrary()? },
            protocol: if data.ratio(1, 8)? { data.arbitrary()? } else { PROTOCOL },
            controller: text(data)?,
            last_tick: data.arbitrary()?,
        })),
        _ => Inbound::Command(Signed::unsigned(command(data, known, run, agent)?)),
    };
    Ok((topic, message))
}

fn command(data: &mut Unstructured<'_>, known: &Known, run: u64, agent: u32) -> Result<Command> {
    let tick = match data.int_in_range(0..=15)? {
        0 => data.arbitrary()?,
        1 => known.tick.wrapping_sub(1),
        2 => known.tick.wrapping_add(1),
        _ => known.tick,
    };
    Ok(Command {
        tick,
        run,
        agent,
        motion: motion(data)?,
        lidar: ScanRequest { kind: data.int_in_range(0..=4)?, period_ticks: data.int_in_range(0..=5)? },
        want_view: data.arbitrary()?,
        messages: messages(data, known.agents)?,
        wake: WakeCondition {
            at_tick: known.tick.wrapping_add(data.arbitrary::<u8>()?.into()),
            events: data.arbitrary()?,
        },
        info: if data.ratio(1, 8)? { text(data)? } else { String::new() },
        known_free: data.arbitrary()?,
        failed_searches: data.arbitrary()?,
        stage: data.int_in_range(0..=5)?,
    })
}

fn id(data: &mut Unstructured<'_>, agents: u32) -> Result<u32> {
    if data.ratio(1, 8)? { data.arbitrary() } else { data.int_in_range(0..=agents) }
}

fn motion(data: &mut Unstructured<'_>) -> Result<Motion> {
    let kind = data.int_in_range(0..=6)?;
    let points = match (kind, data.ratio(1, 16)?) {
        (Motion::PATH, false) => data.int_in_range(0..=3)?,
        (Motion::PATH, true) => PATH_POINTS_MAX + data.int_in_range(0..=1)?,
        _ => 0,
    };
    let mut point = || Ok(Point { x: number(data)?, y: number(data)?, z: number(data)? });
    let path = (0..points).map(|_| point()).collect::<Result<_>>()?;
    Ok(Motion {
        kind,
        pitch_rad: number(data)?,
        distance_m: number(data)?,
        angle_rad: number(data)?,
        path,
        linear_m_s: Vector3 { x: number(data)?, y: number(data)?, z: number(data)? },
        yaw_rate_rad_s: number(data)?,
    })
}

/// A number: mostly a plausible one, else any 64 bits.
pub(crate) fn number(data: &mut Unstructured<'_>) -> Result<f64> {
    if data.ratio(1, 8)? {
        return Ok(f64::from_bits(data.arbitrary()?));
    }
    Ok(f64::from(data.arbitrary::<i8>()?) / 8.0)
}

fn messages(data: &mut Unstructured<'_>, agents: u32) -> Result<Vec<AgentMessage>> {
    let count = match data.int_in_range(0..=31)? {
        0 => 4_000,
        few => few % 4,
    };
    let one = |data: &mut Unstructured<'_>| {
        let agent = if data.ratio(1, 2)? { AgentMessage::BROADCAST } else { id(data, agents)? };
        let length = if data.ratio(1, 8)? {
            AGENT_MESSAGE_BYTES_MAX + data.int_in_range(0..=1)?
        } else {
            data.arbitrary_len::<u8>()? % 64
        };
        let mut content = vec![0; length];
        let given = length.min(data.len()).min(64);
        data.fill_buffer(&mut content[..given])?;
        Ok(AgentMessage { agent, kind: data.arbitrary()?, data: content.into() })
    };
    if count > 4 {
        return Ok(vec![AgentMessage { data: SharedBytes::default(), ..one(data)? }; count]);
    }
    (0..count).map(|_| one(data)).collect()
}

fn text(data: &mut Unstructured<'_>) -> Result<String> {
    if data.ratio(1, 16)? { Ok("x".repeat(INFO_BYTES_MAX + 1)) } else { data.arbitrary() }
}
