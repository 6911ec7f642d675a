//! The status of the run and of each agent, as diagnostics.

use std::collections::BTreeSet;

use msgs::diagnostic_msgs::{DiagnosticArray, DiagnosticStatus, KeyValue};
use msgs::ids::AgentId;
use protocol::limits::{MESSAGE_BYTES_BARE, VIEW_BYTES_MAX};

use crate::wire::header;
use world::{Presence, World};

/// Bytes on the wire of a string beside its characters, with padding.
const TEXT_BYTES_BARE: usize = 12;

/// What the session knows of a run beside its world.
#[derive(Debug, Clone, Copy)]
pub struct RunStatus<'a> {
    /// The last information text of each agent.
    pub infos: &'a [String],
    /// Agents that have been lost.
    pub lost: &'a BTreeSet<AgentId>,
    /// What depends on wall time; `None` for the recording.
    pub live: Option<LiveStatus<'a>>,
}

/// What the session knows of a run under way that depends on wall time.
#[derive(Debug, Clone, Copy)]
pub struct LiveStatus<'a> {
    /// Real-time factor since the start: sim seconds per second of wall time.
    pub rtf: Option<f64>,
    /// Wall time of the loop by phase since the topic has subscribers, seconds.
    pub phases_s: &'a [(&'static str, f64)],
}

/// A status of the run and one of each agent, in messages of bounded size.
pub(super) fn info(world: &World, run_status: &RunStatus<'_>) -> Vec<DiagnosticArray> {
    let bare = DiagnosticArray { header: header(world.tick()), status: Vec::new() };
    let mut done = Vec::new();
    let mut filling = bare.clone();
    let mut left = VIEW_BYTES_MAX - MESSAGE_BYTES_BARE;
    let of_loop = run_status.live.map(|live| of_loop(&live));
    for status in std::iter::once(of_run(world, run_status)).chain(of_loop).chain(of_agents(world, run_status)) {
        let bytes = bytes_of(&status);
        if bytes > left {
            done.push(std::mem::replace(&mut filling, bare.clone()));
            left = VIEW_BYTES_MAX - MESSAGE_BYTES_BARE;
        }
        left = left.saturating_sub(bytes);
        filling.status.push(status);
    }
    done.push(filling);
    done
}

/// The same, with the names and the hardware that tools for diagnostics group by.
pub(super) fn diagnostics(world: &World, run_status: &RunStatus<'_>) -> Vec<DiagnosticArray> {
    let mut messages = info(world, run_status);
    for status in messages.iter_mut().flat_map(|message| &mut message.status) {
        status.hardware_id.clone_from(&status.name);
        status.name = format!("maes: {}", status.name);
    }
    messages
}

fn of_run(world: &World, run_status: &RunStatus<'_>) -> DiagnosticStatus {
    let coverage = world.coverage();
    let mut values = vec![
        value("tick", world.tick().0),
        value("explored", format!("{:.4}", coverage.explored())),
        value("covered", format!("{:.4}", coverage.covered())),
        value("agents_lost", run_status.lost.len()),
    ];
    let rtf = run_status.live.and_then(|live| live.rtf);
    values.extend(rtf.map(|rtf| value("rtf", format!("{rtf:.1}"))));
    let message = format!("{:.1} % explored", coverage.explored() * 100.0);
    DiagnosticStatus { name: "run".to_owned(), message, values, ..DiagnosticStatus::default() }
}

/// Where the wall time goes.
fn of_loop(live: &LiveStatus<'_>) -> DiagnosticStatus {
    let whole_s: f64 = live.phases_s.iter().map(|(_, seconds)| seconds).sum();
    let most = live.phases_s.iter().max_by(|a, b| a.1.total_cmp(&b.1)).filter(|_| whole_s > 0.0);
    let message = most.map(|(name, seconds)| format!("{name} {:.0} %", 100.0 * seconds / whole_s));
    DiagnosticStatus {
        name: "loop".to_owned(),
        message: message.unwrap_or_default(),
        values: live.phases_s.iter().map(|(name, seconds)| value(name, format!("{seconds:.3}"))).collect(),
        ..DiagnosticStatus::default()
    }
}

fn of_agents(world: &World, run_status: &RunStatus<'_>) -> impl Iterator<Item = DiagnosticStatus> {
    let coverage = world.coverage();
    let each = world.distance_m().into_iter().zip(coverage.explored_by()).zip(coverage.believed_by());
    world.agents().zip(each).map(|(agent, ((distance_m, explored), believed))| {
        let is_lost = run_status.lost.contains(&agent);
        let body = world.body(agent);
        let message = if let Some(word) = world.presence(agent).word() {
            word
        } else if is_lost {
            "lost"
        } else {
            run_status.infos.get(agent.index()).map_or("", String::as_str)
        };
        let collision = body.collision().map_or("none".to_owned(), |met| format!("{:?}", met.surface).to_lowercase());
        DiagnosticStatus {
            level: if is_lost && world.presence(agent) == Presence::Active {
                DiagnosticStatus::ERROR
            } else {
                DiagnosticStatus::OK
            },
            name: format!("agent_{agent}"),
            message: message.to_owned(),
            values: vec![
                value("task", if body.is_active() { "active" } else { "idle" }),
                value("collision", collision),
                value("distance_m", format!("{distance_m:.3}")),
                value("explored", format!("{explored:.4}")),
                value("believed", format!("{believed:.4}")),
            ],
            ..DiagnosticStatus::default()
        }
    })
}

fn value(key: &str, value: impl ToString) -> KeyValue {
    KeyValue { key: key.to_owned(), value: value.to_string() }
}

/// Bytes on the wire of a status, rounded up, with the longer names of [`diagnostics`].
fn bytes_of(status: &DiagnosticStatus) -> usize {
    let DiagnosticStatus { level: _, name, message, hardware_id, values } = status;
    let status =
        [name, message, hardware_id].into_iter().chain(values.iter().flat_map(|pair| [&pair.key, &pair.value]));
    status.map(|text| TEXT_BYTES_BARE + text.len()).sum::<usize>() + TEXT_BYTES_BARE + "maes: ".len() + name.len()
}
