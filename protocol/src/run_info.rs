//! What an agent may know of a run before it begins.
//!
//! The message is `maes_msgs/Scenario`; the server makes it of a scenario file. Lengths in metres.

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs;
use voxels::Extent;

use crate::body_model::{BodyModel, UnknownBodyKind};
use crate::field_of_view::FieldOfView;
use crate::wire_error::WireError;

/// The static information on a run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunInfo {
    /// Duration of the run at most.
    pub duration: Tick,
    /// Extent of the map.
    pub extent: Extent,
    /// Number of agents; their ids are 0 .. agents - 1.
    pub agents: u32,
    /// Seed of the agents' random streams.
    pub agents_seed: u64,
    /// The controller, unless the process is started with another one.
    pub controller: String,
    /// Settings of that controller, `KEY=VALUE`.
    pub settings: Vec<String>,
    /// The bodies of the team.
    pub bodies: Bodies,
    /// Greatest range of the LiDAR, metres; infinity: unlimited.
    pub lidar_range_m: f64,
    /// What the LiDAR of the agent sees of its surroundings; `None`: all around, or not known yet.
    /// Each observation says it.
    pub field_of_view: Option<FieldOfView>,
    /// Ticks between scans by default.
    pub lidar_period_ticks: u32,
    /// Greatest distance of agents in contact, metres; infinity: limited by line of sight alone.
    pub communication_range_m: f64,
    /// Number of relays that each agent can drop.
    pub relays_per_agent: u32,
    /// Ticks between map exchanges with agents in contact; 0: agents only receive.
    pub share_period_ticks: u32,
    /// The base stations: the agents to which the scenario gives the controller [`BASE_STATION`],
    /// ascending.
    pub base_stations: Vec<AgentId>,
}

/// The bodies of a team.
#[derive(Debug, Clone, PartialEq)]
pub struct Bodies {
    different: Vec<BodyModel>,
    /// Index of the model, by agent.
    body_of: Vec<u8>,
}

impl Bodies {
    /// The distinct models, and the index of the model of each agent; `None` if an index is out of
    /// range.
    #[must_use]
    pub fn new(different: Vec<BodyModel>, body_of: Vec<u8>) -> Option<Self> {
        body_of.iter().all(|&body| usize::from(body) < different.len()).then_some(Self { different, body_of })
    }

    /// The body of an agent of the run.
    ///
    /// # Panics
    /// If the run has no such agent.
    #[must_use]
    pub fn of(&self, agent: AgentId) -> &BodyModel {
        &self.different[usize::from(self.body_of[agent.index()])]
    }

    /// The bodies by agent.
    pub fn iter(&self) -> impl Iterator<Item = &BodyModel> {
        self.body_of.iter().map(|&body| &self.different[usize::from(body)])
    }
}

impl RunInfo {
    /// What an agent knows of a scenario, with the controller that the scenario gives it.
    ///
    /// # Errors
    /// If the extent is illegal, or bodies or controllers do not match the team.
    pub fn from_message(scenario: &maes_msgs::Scenario, agent: AgentId) -> Result<Self, WireError> {
        let (controller, settings) = controller(scenario, agent)?;
        Ok(Self {
            duration: Tick(scenario.duration_ticks),
            extent: Extent::new(scenario.size, scenario.cell_m)?,
            agents: scenario.agents,
            agents_seed: scenario.agents_seed,
            controller,
            settings,
            bodies: bodies(scenario)?,
            lidar_range_m: scenario.lidar.range_m,
            field_of_view: None,
            lidar_period_ticks: scenario.lidar.period_ticks,
            communication_range_m: scenario.communication_range_m,
            relays_per_agent: scenario.radio.relays_per_agent,
            share_period_ticks: scenario.share_period_ticks,
            base_stations: base_stations(scenario)?,
        })
    }

    /// The smallest run: one agent in a map of one cell, with everything unlimited and off. The
    /// settings of a controller are checked without a run, and so with this one.
    ///
    /// # Panics
    /// Never: a map of one cell is legal.
    #[must_use]
    pub fn smallest() -> Self {
        Self {
            duration: Tick::ZERO,
            extent: Extent::new([1; 3], 1.0).expect("a map of one cell is legal"),
            agents: 1,
            agents_seed: 0,
            controller: String::new(),
            settings: Vec::new(),
            bodies: Bodies::new(vec![BodyModel::SUBMARINE], vec![0]).expect("the agent has the only body"),
            lidar_range_m: f64::INFINITY,
            field_of_view: None,
            lidar_period_ticks: 1,
            communication_range_m: f64::INFINITY,
            relays_per_agent: 0,
            share_period_ticks: 0,
            base_stations: Vec::new(),
        }
    }

    /// The controller with its settings, as the agents that run it are labelled.
    #[must_use]
    pub fn controller_label(&self) -> String {
        std::iter::once(self.controller.as_str())
            .chain(self.settings.iter().map(String::as_str))
            .collect::<Vec<_>>()
            .join(" ")
    }
}

/// The controller of base stations.
pub const BASE_STATION: &str = "base-station";

/// What begins a setting that says what a ground body can do.
pub const OF_BODY: char = '%';

/// The agents of which a scenario says that they run [`BASE_STATION`].
fn base_stations(scenario: &maes_msgs::Scenario) -> Result<Vec<AgentId>, WireError> {
    let is_named = |setting: &String| setting.strip_prefix('@').is_some_and(|of| of.ends_with(BASE_STATION));
    if !scenario.settings.iter().any(is_named) {
        return Ok(Vec::new());
    }
    let mut stations = Vec::new();
    for agent in (0..scenario.agents).map(AgentId) {
        if controller(scenario, agent)?.0 == BASE_STATION {
            stations.push(agent);
        }
    }
    Ok(stations)
}

/// The controller of an agent with its settings: those of a mix, whose entries are `@IDS:NAME` and
/// `@IDS:KEY=VALUE`, or else those of the team.
fn controller(scenario: &maes_msgs::Scenario, agent: AgentId) -> Result<(String, Vec<String>), WireError> {
    let mut own: Option<String> = None;
    let (mut settings, mut settings_of_own) = (Vec::new(), Vec::new());
    for setting in scenario.settings.iter().filter(|setting| !setting.starts_with(OF_BODY)) {
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
    let mut different = bodies.iter().map(body).collect::<Result<Vec<BodyModel>, WireError>>()?;
    for setting in scenario.settings.iter().filter_map(|setting| setting.strip_prefix(OF_BODY)) {
        let of_body = |(number, setting): (&str, &str)| {
            let body = different.get_mut(number.parse::<usize>().ok()?)?;
            *body = body.with_ground_setting(setting)?;
            Some(())
        };
        setting.split_once(':').and_then(of_body).ok_or_else(|| {
            let allowed = "%BODY:DRIVE STEP_MAX_M SLOPE_MAX_RAD with the number of a ground body".to_owned();
            wrong("settings", format!("{OF_BODY}{setting}"), allowed)
        })?;
    }
    let last = bodies.len().saturating_sub(1);
    let beyond = || body_of.iter().find(|&&body| usize::from(body) > last || bodies.is_empty());
    Bodies::new(different, body_of.clone()).ok_or_else(|| {
        let value = beyond().map_or_else(String::new, u8::to_string);
        wrong("body_of", value, format!("one of {} bodies, the first of them 0", bodies.len()))
    })
}

fn body(message: &maes_msgs::Body) -> Result<BodyModel, WireError> {
    BodyModel::try_from(message).map_err(|UnknownBodyKind { kind }| {
        let allowed = "0 (submarine), 1 (aerial) or 2 (ground)".to_owned();
        WireError::Scenario { field: "bodies.kind", value: kind.to_string(), allowed }
    })
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
            RunInfo::from_message(&scenario, AgentId(0)).unwrap_err().to_string()
        };
        assert_eq!(refused(&[0], &[0]), "scenario: body_of = 1 entries: expected one for each of 2 agents");
        assert_eq!(refused(&[0, 1], &[1, 2]), "scenario: body_of = 2: expected one of 2 bodies, the first of them 0");
        assert_eq!(refused(&[], &[0, 0]), "scenario: body_of = 0: expected one of 0 bodies, the first of them 0");
        assert_eq!(
            refused(&[0, 7], &[0, 0]),
            "scenario: bodies.kind = 7: expected 0 (submarine), 1 (aerial) or 2 (ground)"
        );
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

    #[test]
    fn base_stations_are_those_that_run_their_controller() {
        let of = |settings: &[&str]| {
            let settings = settings.iter().map(|&setting| setting.to_owned()).collect();
            let scenario =
                maes_msgs::Scenario { agents: 4, controller: "rbw".to_owned(), settings, ..Default::default() };
            base_stations(&scenario).unwrap()
        };
        assert_eq!(of(&["k=1", "@1:lvd", "@0,2:base-station"]), [AgentId(0), AgentId(2)]);
        assert_eq!(of(&["@1:lvd", "@1:name=base-station"]), []);
    }

    #[test]
    fn every_agent_has_a_body() {
        let small = BodyModel { radius_m: 0.1, ..BodyModel::SUBMARINE };
        let bodies = Bodies::new(vec![BodyModel::SUBMARINE, small], vec![0, 1]).unwrap();
        assert_eq!(bodies.of(AgentId(1)), &small);
        assert_eq!(bodies.iter().collect::<Vec<_>>(), [&BodyModel::SUBMARINE, &small]);
        assert_eq!(Bodies::new(vec![small], vec![0, 1]), None);
    }
}
