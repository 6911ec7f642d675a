//! Conversion between messages and domain types: the only module of the agent that knows both.
//!
//! Invariant: the results of [`run_info`] and [`FragmentReassembler`] are consistent, whatever was
//! received: cells and points lie inside the map, numbers are finite, agents are part of the run,
//! ticks are those of a run.
//!
//! This module sends nothing and knows no transport.

mod observation;

use msgs::body_model::UnknownBodyKind;
use msgs::geometry_msgs;
use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs;
use msgs::relay_id::RelayId;
use nalgebra::Point3;
use thiserror::Error;
use voxels::{Extent, ExtentError, RunsError};

use agent::bodies::{Bodies, BodyModel};
use agent::command::{Command, Motion, Stage};
use agent::observation::RunInfo;

pub use observation::{FragmentReassembler, Reassembled};

/// Why a message of the server is rejected.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum WireError {
    /// The extent of the map is illegal.
    #[error("scenario: {0}")]
    Extent(#[from] ExtentError),
    /// The bodies or the controllers do not match the team.
    #[error("scenario: {field} = {value}: expected {allowed}")]
    Scenario {
        /// The field.
        field: &'static str,
        /// Its value.
        value: String,
        /// The legal values.
        allowed: String,
    },
    /// A list of cells does not fit the map.
    #[error("observation of tick {tick}: {source}")]
    Cells {
        /// The tick of the observation.
        tick: Tick,
        /// What is wrong.
        source: RunsError,
    },
    /// A value is illegal.
    #[error("observation of tick {tick}: {field} = {value}: expected {allowed}")]
    Value {
        /// The tick of the observation.
        tick: Tick,
        /// The field.
        field: &'static str,
        /// Its value.
        value: String,
        /// The legal values.
        allowed: String,
    },
    /// A fragment number is out of range, or the fragments disagree on their count.
    #[error("observation of tick {tick}: part {part} of {parts}")]
    Part {
        /// The tick of the observation.
        tick: Tick,
        /// Number of the fragment.
        part: u16,
        /// Count of fragments.
        parts: u16,
    },
}

/// What an agent knows of a scenario, with the controller that the scenario gives it.
///
/// # Errors
/// If the extent is illegal, or bodies or controllers do not match the team.
pub fn run_info(scenario: &maes_msgs::Scenario, agent: AgentId) -> Result<RunInfo, WireError> {
    let (controller, settings) = controller(scenario, agent)?;
    Ok(RunInfo {
        duration: Tick(scenario.duration_ticks),
        extent: Extent::new(scenario.size, scenario.cell_m)?,
        agents: scenario.agents,
        agents_seed: scenario.agents_seed,
        controller,
        settings,
        bodies: bodies(scenario)?,
        lidar_range_m: scenario.lidar.range_m,
        lidar_period_ticks: scenario.lidar.period_ticks,
        communication_range_m: scenario.communication_range_m,
        relays_per_agent: scenario.radio.relays_per_agent,
        share_period_ticks: scenario.share_period_ticks,
    })
}

/// The controller of an agent with its settings: those of a mix, whose entries are `@IDS:NAME` and
/// `@IDS:KEY=VALUE`, or else those of the team.
fn controller(scenario: &maes_msgs::Scenario, agent: AgentId) -> Result<(String, Vec<String>), WireError> {
    let mut own: Option<String> = None;
    let (mut settings, mut settings_of_own) = (Vec::new(), Vec::new());
    for setting in &scenario.settings {
        let Some(of_mix) = setting.strip_prefix('@') else {
            settings.push(setting.clone());
            continue;
        };
        let wrong = || WireError::Scenario {
            field: "settings",
            value: setting.clone(),
            allowed: "KEY=VALUE, @IDS:CONTROLLER or @IDS:KEY=VALUE, with ids such as 0-2,4".to_owned(),
        };
        let (ids, word) = of_mix.split_once(':').ok_or_else(wrong)?;
        if !is_among(agent, ids).ok_or_else(wrong)? {
            continue;
        }
        match word.contains('=') {
            true => settings_of_own.push(word.to_owned()),
            false => own = Some(word.to_owned()),
        }
    }
    Ok(match own {
        Some(controller) => (controller, settings_of_own),
        None => (scenario.controller.clone(), settings),
    })
}

/// Whether ids such as `0-2,4` have this one; `None` if they are no ids.
fn is_among(agent: AgentId, ids: &str) -> Option<bool> {
    let mut is_among = false;
    for run in ids.split(',') {
        let (first, last) = run.split_once('-').unwrap_or((run, run));
        let (first, last): (u32, u32) = (first.parse().ok()?, last.parse().ok()?);
        is_among |= (first..=last).contains(&agent.0);
    }
    Some(is_among)
}

fn bodies(scenario: &maes_msgs::Scenario) -> Result<Bodies, WireError> {
    let maes_msgs::Scenario { agents, bodies, body_of, .. } = scenario;
    let wrong = |field, value: String, allowed: String| WireError::Scenario { field, value, allowed };
    if body_of.len() != *agents as usize {
        let value = format!("{} entries", body_of.len());
        return Err(wrong("body_of", value, format!("one for each of {agents} agents")));
    }
    let different: Result<Vec<BodyModel>, WireError> = bodies.iter().map(body).collect();
    let last = bodies.len().saturating_sub(1);
    let beyond = || body_of.iter().find(|&&body| usize::from(body) > last || bodies.is_empty());
    Bodies::new(different?, body_of.clone()).ok_or_else(|| {
        let value = beyond().map_or_else(String::new, u8::to_string);
        wrong("body_of", value, format!("one of {} bodies, the first of them 0", bodies.len()))
    })
}

fn body(message: &maes_msgs::Body) -> Result<BodyModel, WireError> {
    BodyModel::try_from(message).map_err(|UnknownBodyKind { kind }| {
        let allowed = "0 (submarine) or 1 (aerial)".to_owned();
        WireError::Scenario { field: "bodies.kind", value: kind.to_string(), allowed }
    })
}

/// A command as a message, without the id of the run.
#[must_use]
pub fn command(agent: AgentId, tick: Tick, command: Command) -> maes_msgs::Command {
    maes_msgs::Command {
        tick: tick.0,
        run: 0,
        agent: agent.0,
        motion: motion(command.motion),
        lidar: command.lidar.into(),
        want_view: command.want_view,
        messages: command
            .messages
            .into_iter()
            .map(|message| maes_msgs::AgentMessage {
                agent: message.to.map_or(maes_msgs::AgentMessage::BROADCAST, |agent| agent.0),
                kind: message.kind,
                data: message.data,
            })
            .chain(command.relays.into_iter().map(|order| maes_msgs::AgentMessage {
                agent: order.relay.map_or(maes_msgs::AgentMessage::LEAVE_RELAY, RelayId::on_wire),
                kind: order.kind,
                data: order.data,
            }))
            .collect(),
        wake: command.wake.into(),
        info: command.info,
        known_free: 0,
        failed_searches: 0,
        stage: Stage::on_wire(command.stage),
    }
}

fn motion(motion: Motion) -> maes_msgs::Motion {
    use maes_msgs::Motion as WireMotion;
    let bare = WireMotion::default();
    match motion {
        Motion::Keep => WireMotion { kind: WireMotion::KEEP, ..bare },
        Motion::Stop => WireMotion { kind: WireMotion::STOP, ..bare },
        Motion::Move { pitch_rad, distance_m } => WireMotion { kind: WireMotion::MOVE, pitch_rad, distance_m, ..bare },
        Motion::Turn { angle_rad } => WireMotion { kind: WireMotion::TURN, angle_rad, ..bare },
        Motion::Path(waypoints) => WireMotion { kind: WireMotion::PATH, path: points(waypoints), ..bare },
        Motion::Velocity { linear_in_body_m_s: linear, yaw_rate_rad_s, path } => WireMotion {
            kind: WireMotion::VELOCITY,
            linear_m_s: geometry_msgs::Vector3 { x: linear.x, y: linear.y, z: linear.z },
            yaw_rate_rad_s,
            path: points(path),
            ..bare
        },
    }
}

fn points(path: Vec<Point3<f64>>) -> Vec<geometry_msgs::Point> {
    path.into_iter().map(|point| geometry_msgs::Point { x: point.x, y: point.y, z: point.z }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inconsistent_bodies_are_refused() {
        let refused = |bodies: &[u8], body_of: &[u8]| {
            let bodies = bodies.iter().map(|&kind| maes_msgs::Body { kind, ..Default::default() }).collect();
            let (size, body_of) = ([4, 4, 4], body_of.to_vec());
            let scenario = maes_msgs::Scenario { size, cell_m: 1.0, agents: 2, bodies, body_of, ..Default::default() };
            run_info(&scenario, AgentId(0)).unwrap_err().to_string()
        };
        assert_eq!(refused(&[0], &[0]), "scenario: body_of = 1 entries: expected one for each of 2 agents");
        assert_eq!(refused(&[0, 1], &[1, 2]), "scenario: body_of = 2: expected one of 2 bodies, the first of them 0");
        assert_eq!(refused(&[], &[0, 0]), "scenario: body_of = 0: expected one of 0 bodies, the first of them 0");
        assert_eq!(refused(&[0, 7], &[0, 0]), "scenario: bodies.kind = 7: expected 0 (submarine) or 1 (aerial)");
    }

    #[test]
    fn each_agent_takes_its_controller_from_the_scenario() {
        let of = |settings: &[&str], agent| {
            let settings = settings.iter().map(|&setting| setting.to_owned()).collect();
            let scenario = maes_msgs::Scenario { controller: "rbw".to_owned(), settings, ..Default::default() };
            controller(&scenario, AgentId(agent)).map_err(|error| error.to_string())
        };
        let labels: Vec<String> = (0..6)
            .map(|agent| of(&["k=1", "@0-2,4:lvd", "@0-2,4:t=x:y z", "@5:dsvp"], agent).unwrap())
            .map(|(name, settings)| format!("{name} {}", settings.join("|")))
            .collect();
        assert_eq!(labels, ["lvd t=x:y z", "lvd t=x:y z", "lvd t=x:y z", "rbw k=1", "lvd t=x:y z", "dsvp "]);
        for wrong in ["@0", "@:lvd", "@x:lvd", "@1-:lvd", "@1-2-3:lvd"] {
            let refused = of(&[wrong], 0).unwrap_err();
            assert!(
                refused.starts_with(&format!("scenario: settings = {wrong}: expected KEY=VALUE, @IDS")),
                "{refused}"
            );
        }
    }
}
