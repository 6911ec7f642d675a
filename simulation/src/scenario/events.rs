//! `[[event]]`: what happens to a run at set times, and the forks of recorded runs.
//!
//! An event makes an agent join late, leave or break down, switches its radio, makes cells of the
//! map wall or free, or changes keys for the rest of the run. A fork of a recorded run is its
//! scenario with one more change of keys at the tick of the fork.
//!
//! Invariants: events ascend in time; a change never touches what has shaped the past (see
//! [`changeable`]); the scenario after each change is as legal as one from a file. A run is the
//! same up to its first event with and without events, digests included, save for agents that join
//! late.
//!
//! This module executes nothing: see the session of the server.

use std::collections::{BTreeMap, BTreeSet};

use mapgen::ImportOptions;
use msgs::ids::{AgentId, Tick};
use serde::{Deserialize, Serialize};
use voxels::Terrain;

use super::changes::{self, Change, Refusal};
use super::{Checker, Origins, Override, Scenario, ScenarioError, keys, one_line};
use world::map_change::{MapChange, Proximity};

/// Largest number of events.
pub const EVENTS_MAX: usize = 10_000;

/// Most bytes of all the scenarios that changes of keys make of one, each written as a whole: every
/// change has one of its own.
const PHASES_BYTES_MAX: usize = 64 << 20;

/// An entry of `[[event]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EventEntry {
    /// Sim time, seconds; a whole number of fixed updates.
    pub at_s: f64,
    /// What happens.
    pub kind: EventKind,
    /// The agent that it happens to; `None` for a change of keys. For a change of the map the agent
    /// whose approach it waits for; `None`: any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub agent: Option<u32>,
    /// Lowest corner of the box whose cells become wall or free: x, y, z in metres, frame `map`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low: Option<[f64; 3]>,
    /// Highest corner of that box.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high: Option<[f64; 3]>,
    /// A change of the map waits until an agent is as near to its cells, metres; `None`: it waits
    /// for no agent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within_m: Option<f64>,
    /// The new values of keys, by dotted path.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub set: BTreeMap<String, toml::Value>,
    /// The last digest of the recording that was forked here. The digest of this run does not
    /// cover it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parent: Option<String>,
}

/// What happens in an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EventKind {
    /// An agent enters the world at its start pose, as soon as there is room.
    Join,
    /// An agent leaves the world with its body.
    Leave,
    /// An agent fails: its body stays as an obstacle, and its radio is silent.
    BreakDown,
    /// The radio of an agent fails.
    RadioOff,
    /// The radio of an agent works again.
    RadioOn,
    /// Cells of the map become wall.
    Wall,
    /// Cells of the map become free.
    Free,
    /// Keys of the scenario change for the rest of the run.
    Set,
}

impl EventKind {
    fn word(self) -> &'static str {
        match self {
            Self::Join => "join",
            Self::Leave => "leave",
            Self::BreakDown => "break_down",
            Self::RadioOff => "radio_off",
            Self::RadioOn => "radio_on",
            Self::Wall => "wall",
            Self::Free => "free",
            Self::Set => "set",
        }
    }

    /// What the cells of the map become.
    fn terrain(self) -> Option<Terrain> {
        match self {
            Self::Wall => Some(Terrain::Wall),
            Self::Free => Some(Terrain::Free),
            _ => None,
        }
    }
}

impl EventEntry {
    fn bare(at_s: f64, kind: EventKind) -> Self {
        Self { at_s, kind, agent: None, low: None, high: None, within_m: None, set: BTreeMap::new(), parent: None }
    }

    /// The tick at whose start it takes effect.
    #[must_use]
    pub fn tick(&self) -> Tick {
        Tick(libm::round(self.at_s / Tick::TICK_S) as u64)
    }

    /// How it changes the map; `None` for events of other kinds.
    #[must_use]
    pub fn map_change(&self) -> Option<MapChange> {
        let (terrain, low, high) = (self.kind.terrain()?, self.low?, self.high?);
        let trigger = self.within_m.map(|within_m| Proximity { within_m, agent: self.agent.map(AgentId) });
        Some(MapChange { terrain, low: low.into(), high: high.into(), trigger })
    }

    /// The event as the digest covers it.
    ///
    /// # Panics
    /// Never: it has string keys and plain values.
    #[must_use]
    pub fn digested(&self) -> String {
        let entry = Self { parent: None, ..self.clone() };
        toml::to_string(&entry).expect("an event has string keys and plain values")
    }
}

/// An event of a run with what it does.
#[derive(Debug, Clone, PartialEq)]
pub struct ScheduledEvent {
    /// The tick at whose start it takes effect.
    pub tick: Tick,
    /// As the digest covers it.
    pub digested: String,
    /// What it does.
    pub action: EventAction,
}

/// What an event does.
#[derive(Debug, Clone, PartialEq)]
pub enum EventAction {
    /// See [`EventKind::Join`].
    Join(AgentId),
    /// See [`EventKind::Leave`].
    Leave(AgentId),
    /// See [`EventKind::BreakDown`].
    BreakDown(AgentId),
    /// The radio of an agent fails, or works again.
    SwitchRadio(AgentId, bool),
    /// Cells of the map become wall or free.
    ChangeMap(MapChange),
    /// From now on this scenario holds, which has no events.
    Set(Box<Scenario>),
}

/// Whether a key may change during a run.
///
/// # Errors
/// The reason why not.
pub fn changeable(key: &str) -> Result<(), String> {
    let is_changeable = keys::find(key).is_some_and(|key| key.is_changeable);
    if key == "agents.mix" || key.starts_with("agents.set.") || is_changeable {
        return Ok(());
    }
    let is_in = |table: &str| key.strip_prefix(table).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
    let reasons = [
        (&["seed", "map"][..], "the map and every random number of the past follow from it"),
        (
            &["agents.count", "agents.cmd_vel", "agents.reserve", "agents.base_stations", "spawn"][..],
            "the team is the one of the past",
        ),
        (&["agents.command", "agents.command_ids", "agents.command_signs"][..], "programs run for all of a run"),
        (&["body", "bodies"][..], "the bodies have moved with it"),
        (&["lidar", "lidars", "sensor", "localisation"][..], "what the agents know was measured with it"),
        (&["energy"][..], "batteries have drained with it"),
        (&["communication.relays.per_agent"][..], "the agents have carried their relays from the start"),
        (&["obstacle"][..], "obstacles have moved with it"),
        (&["recording", "faults"][..], "it holds for a recording as a whole"),
        (&["execution", "views"][..], "it is no part of the run"),
        (&["event"][..], "events do not change events"),
    ];
    let reason = reasons.iter().find(|(tables, _)| tables.iter().any(|table| is_in(table)));
    match reason {
        Some((_, reason)) => Err(format!("{key} cannot change during a run: {reason}; {}", changeable_keys())),
        None => {
            let known = keys::changeable_paths();
            let near = keys::nearest(key, known.iter().map(String::as_str));
            let hint = near.map(|near| format!("; did you mean `{near}`?")).unwrap_or_default();
            Err(format!("unknown key `{key}`{hint}; {}", changeable_keys()))
        }
    }
}

fn changeable_keys() -> String {
    let mut names: Vec<String> = Vec::new();
    for table in &keys::TABLES {
        let of_table = table.keys.iter().filter(|key| key.is_changeable).map(|key| table.path_of(key.name));
        let of_table: Vec<String> = of_table.collect();
        let is_whole = of_table.len() > 1 && of_table.len() == table.keys.len();
        names.extend(if is_whole { vec![format!("{}.*", table.path)] } else { of_table });
    }
    format!("keys that can change are {}", names.join(", "))
}

impl Scenario {
    /// What the digest of a run begins with, beside the hash of its map: the identity without
    /// events, each of which enters the digest at its tick, and without the name of a map file and
    /// how it was read, because the cells identify the map.
    #[must_use]
    pub fn initial_identity(&self) -> String {
        self.without_events().without_map_file().identity()
    }

    /// What the digest of a run with a map file began with in builds whose digests held the name of
    /// the file. It differs from [`Self::initial_identity`] for map files only.
    #[must_use]
    pub fn initial_identity_with_map_file(&self) -> String {
        self.without_events().identity()
    }

    fn without_events(&self) -> Self {
        Self { event: Vec::new(), ..self.clone() }
    }

    /// The scenario without the name of its map file and the options it is read with.
    #[must_use]
    pub fn without_map_file(mut self) -> Self {
        self.map.file = None;
        self.map.import = ImportOptions::default();
        self
    }

    /// The agents that are not in the world at the start.
    #[must_use]
    pub fn late_agents(&self) -> BTreeSet<AgentId> {
        let joins = self.event.iter().filter(|entry| entry.kind == EventKind::Join);
        let reserve = self.agents.reserve.iter().copied();
        joins.filter_map(|entry| entry.agent).chain(reserve).map(AgentId).collect()
    }

    /// The events of the run, ascending.
    #[must_use]
    pub fn schedule(&self) -> Vec<ScheduledEvent> {
        let mut present = self.without_events();
        let scheduled = self.event.iter().filter_map(|entry| {
            let action = match (entry.kind, entry.agent.map(AgentId)) {
                (EventKind::Wall | EventKind::Free, _) => EventAction::ChangeMap(entry.map_change()?),
                (EventKind::Join, Some(agent)) => EventAction::Join(agent),
                (EventKind::Leave, Some(agent)) => EventAction::Leave(agent),
                (EventKind::BreakDown, Some(agent)) => EventAction::BreakDown(agent),
                (EventKind::RadioOff, Some(agent)) => EventAction::SwitchRadio(agent, false),
                (EventKind::RadioOn, Some(agent)) => EventAction::SwitchRadio(agent, true),
                (EventKind::Set, _) => {
                    present = present.changed(&entry.set).ok()?;
                    EventAction::Set(Box::new(present.clone()))
                }
                // A checked scenario has no such event.
                (_, None) => return None,
            };
            Some(ScheduledEvent { tick: entry.tick(), digested: entry.digested(), action })
        });
        scheduled.collect()
    }

    /// The scenario at the start, and after each change of its keys; none of them has events.
    #[must_use]
    pub fn phases(&self) -> Vec<Self> {
        let changes = self.schedule().into_iter().filter_map(|event| match event.action {
            EventAction::Set(scenario) => Some(*scenario),
            _ => None,
        });
        std::iter::once(self.without_events()).chain(changes).collect()
    }

    /// The controllers of the team in one line, with those that take their place, such as `rbw,
    /// then lvd`.
    #[must_use]
    pub fn controllers_label(&self) -> String {
        let mut labels = vec![self.agents.controllers_label()];
        for event in self.schedule() {
            let EventAction::Set(changed) = event.action else { continue };
            if event.tick == Tick::ZERO {
                labels.clear();
            }
            labels.push(changed.agents.controllers_label());
        }
        labels.dedup();
        labels.join(", then ")
    }

    /// The tick at which the run ends at the latest, after all changes of its duration.
    #[must_use]
    pub fn last_duration_ticks(&self) -> Tick {
        self.phases().last().map_or(Tick::ZERO, Self::duration_ticks)
    }

    /// This scenario after a change of keys. Another controller starts with its default settings
    /// unless some are given.
    fn changed(&self, set: &BTreeMap<String, toml::Value>) -> Result<Self, String> {
        let table = toml::Table::try_from(self).map_err(|error| error.to_string())?;
        let controller = set.get("agents.controller").and_then(toml::Value::as_str);
        let is_other = controller.is_some_and(|controller| controller != self.agents.controller);
        let mut changes: Vec<Change<'_>> = if is_other { vec![("agents.set", None)] } else { Vec::new() };
        for (key, value) in set {
            changeable(key)?;
            changes.push((key, Some(value)));
        }
        let changed = changes::changed(&table, &changes, &mut 0).map_err(|refusal| match refusal {
            Refusal::Key(_, reason) => reason,
            Refusal::Scenario(number, _, error) => match changes.get(number) {
                Some((key, Some(value))) => {
                    let expected = keys::find(key).map(|key| key.expected()).unwrap_or_default();
                    let expected = if expected.is_empty() { one_line(error.message()) } else { expected };
                    format!("{key} = {value}: {expected}")
                }
                _ => one_line(error.message()),
            },
        })?;
        changed.check(&Origins::new("", "", &[])).map_err(|error| match error {
            ScenarioError::Value { key, value, allowed, .. } => format!("{key} = {value}: {allowed}"),
            other => other.to_string(),
        })?;
        Ok(changed)
    }

    pub(super) fn check_events(&self, checker: &Checker<'_>) -> Result<(), ScenarioError> {
        let count = self.event.len();
        checker.require(
            "event",
            format!("{count} entries"),
            count <= EVENTS_MAX,
            &format!("expected at most {EVENTS_MAX}"),
        )?;
        let changes = self.event.iter().filter(|entry| entry.kind == EventKind::Set).count();
        if changes > 0 {
            let bytes = self.without_events().to_toml().len();
            checker.require(
                "event",
                format!("{changes} changes of keys"),
                changes.saturating_mul(bytes) <= PHASES_BYTES_MAX,
                &format!(
                    "expected at most {}: each makes another scenario, and this one has {bytes} bytes without events",
                    PHASES_BYTES_MAX / bytes
                ),
            )?;
        }
        let mut last = Tick::ZERO;
        let mut present = self.without_events();
        let mut team = Lives::default();
        for (number, entry) in self.event.iter().enumerate() {
            let of = |name: &str| format!("event[{number}].{name}");
            let ticks = entry.at_s / Tick::TICK_S;
            let is_tick = (0.0..=1e10).contains(&ticks) && (ticks - libm::round(ticks)).abs() < 1e-6;
            checker.require(&of("at_s"), entry.at_s, is_tick, "expected a multiple of 0.02 s, 0 to 2e8")?;
            let is_ascending = entry.tick() >= last;
            checker.require(&of("at_s"), entry.at_s, is_ascending, "expected events in the order of their times")?;
            last = entry.tick();
            let kind = entry.kind.word();
            if entry.kind.terrain().is_none() {
                let only = "expected only with kind = \"wall\" or \"free\"";
                for (name, value) in [("low", entry.low), ("high", entry.high)] {
                    checker.require(&of(name), format!("{:?}", value.unwrap_or_default()), value.is_none(), only)?;
                }
                let within_m = entry.within_m;
                checker.require(&of("within_m"), within_m.unwrap_or_default(), within_m.is_none(), only)?;
            }
            if entry.kind == EventKind::Set {
                let none = "expected no agent: keys change for all of them";
                checker.require(&of("agent"), entry.agent.unwrap_or_default(), entry.agent.is_none(), none)?;
                let example = "expected a table of keys such as { \"agents.controller\" = \"lvd\" }";
                checker.require(&of("set"), "{}", !entry.set.is_empty(), example)?;
                let changed = present.changed(&entry.set);
                present =
                    changed.map_err(|reason| checker.error_from(&of("set"), &of("set"), shown(&entry.set), &reason))?;
                continue;
            }
            checker.require(
                &of("set"),
                shown(&entry.set),
                entry.set.is_empty(),
                "expected only with kind = \"set\"",
            )?;
            let no_parent = "expected only with kind = \"set\"";
            checker.require(&of("parent"), "...", entry.parent.is_none(), no_parent)?;
            let last_id = self.agents.count - 1;
            let ids = format!("expected the id of an agent, 0 to {last_id}");
            if entry.kind.terrain().is_some() {
                self.check_map_change(entry, number, checker)?;
                continue;
            }
            let Some(agent) = entry.agent else {
                return Err(checker.error_from(&of("kind"), &of("agent"), "nothing", &ids));
            };
            checker.require(&of("agent"), agent, agent <= last_id, &ids)?;
            let is_known = !self.agents.reserve.contains(&agent);
            let lives = "expected an agent that is not in agents.reserve: when it joins is not known";
            checker.require(&of("agent"), agent, is_known, lives)?;
            if let Err(reason) = team.live(agent, entry.kind) {
                return Err(checker.error_from(&of("kind"), &of("kind"), format!("\"{kind}\""), &reason));
            }
        }
        Ok(())
    }

    /// Checks the box and the trigger of an event that changes the map.
    fn check_map_change(&self, entry: &EventEntry, number: usize, checker: &Checker<'_>) -> Result<(), ScenarioError> {
        let of = |name: &str| format!("event[{number}].{name}");
        let corner = "expected [x, y, z] in metres, frame map";
        for (name, value) in [("low", entry.low), ("high", entry.high)] {
            let Some(value) = value else {
                return Err(checker.error_from(&of("kind"), &of(name), "nothing", corner));
            };
            let is_finite = value.iter().all(|along| along.is_finite());
            checker.require(&of(name), format!("{value:?}"), is_finite, "expected finite numbers")?;
        }
        let (low, high) = (entry.low.unwrap_or_default(), entry.high.unwrap_or_default());
        let is_box = low.iter().zip(&high).all(|(low, high)| low <= high);
        let allowed = format!("expected no coordinate below that of low = {low:?}");
        checker.require(&of("high"), format!("{high:?}"), is_box, &allowed)?;
        let Some(agent) = entry.agent else { return Ok(()) };
        let with_distance = "expected no agent, or within_m as well: the distance at which its approach counts";
        checker.require(&of("agent"), agent, entry.within_m.is_some(), with_distance)?;
        let ids = format!("expected the id of an agent, 0 to {}", self.agents.count - 1);
        checker.require(&of("agent"), agent, agent < self.agents.count, &ids)
    }

    /// The scenario of a fork of this one: `changes` hold from the tick `at` on, before which the
    /// run is the same. `parent` is the last digest of the recording that is forked; empty if there
    /// is none. A change of `event` adds events. Changes that change nothing are left out, so that
    /// a fork without any has the scenario of its parent.
    ///
    /// # Errors
    /// If a key may not change, or a value is not legal; names the flag.
    pub fn fork(&self, at: Tick, parent: &str, changes: &[Override]) -> Result<Self, ScenarioError> {
        let mut present = self.without_events();
        for event in self.schedule().into_iter().take_while(|event| event.tick <= at) {
            if let EventAction::Set(changed) = event.action {
                present = *changed;
            }
        }
        let mut set = BTreeMap::new();
        let mut added: Vec<EventEntry> = Vec::new();
        for change in changes {
            let refused = |reason: String| ScenarioError::Override { origin: one_line(&change.origin), reason };
            if change.key == "event" {
                added.extend(new_events(change.value.as_ref(), at).map_err(refused)?);
                continue;
            }
            // Whoever trusts the program of the parent repeats it.
            let command = || toml::Value::from(present.agents.command.clone());
            if change.key == "agents.command" && change.value.as_ref().is_some_and(|value| *value == command()) {
                continue;
            }
            changeable(&change.key).map_err(refused)?;
            let Some(value) = &change.value else { continue };
            let mut with = set.clone();
            with.insert(change.key.clone(), value.clone());
            if present.changed(&with).map_err(refused)? != present.changed(&set).map_err(refused)? {
                set = with;
            }
        }
        let mut forked = self.clone();
        if !set.is_empty() {
            let at_s = at.time_ns() as f64 / 1e9;
            let parent = (!parent.is_empty()).then(|| parent.to_owned());
            added.insert(0, EventEntry { set, parent, ..EventEntry::bare(at_s, EventKind::Set) });
        }
        forked.event.extend(added);
        forked.event.sort_by_key(EventEntry::tick);
        forked.check(&Origins::new("the fork", "", changes))?;
        Ok(forked)
    }
}

/// The events that a fork adds.
fn new_events(value: Option<&toml::Value>, at: Tick) -> Result<Vec<EventEntry>, String> {
    let example = "expected a list such as [{ kind = \"break_down\", at_s = 310.0, agent = 3 }]";
    let value = value.ok_or(example)?;
    let events: Vec<EventEntry> = value
        .clone()
        .try_into()
        .map_err(|error: toml::de::Error| format!("{}; {example}", one_line(error.message())))?;
    for event in &events {
        if event.tick() < at {
            return Err(format!("at_s = {}: expected no event before the fork, tick {at}", event.at_s));
        }
        if event.kind == EventKind::Join {
            return Err("kind = \"join\": the agents of the past were there from the start".to_owned());
        }
    }
    Ok(events)
}

fn shown(set: &BTreeMap<String, toml::Value>) -> String {
    let pairs: Vec<String> = set.iter().map(|(key, value)| format!("\"{key}\" = {value}")).collect();
    format!("{{ {} }}", pairs.join(", "))
}

/// What has happened to each agent so far.
#[derive(Default)]
struct Lives {
    touched: BTreeSet<u32>,
    broken: BTreeSet<u32>,
    gone: BTreeSet<u32>,
    silent: BTreeSet<u32>,
}

impl Lives {
    /// Adds an event of an agent, if it can follow the earlier ones.
    fn live(&mut self, agent: u32, kind: EventKind) -> Result<(), String> {
        let is_first = self.touched.insert(agent);
        let is_broken = self.broken.contains(&agent);
        if self.gone.contains(&agent) {
            return Err(format!("agent {agent} has left before"));
        }
        let fits = match kind {
            EventKind::Join => is_first,
            EventKind::Leave => self.gone.insert(agent),
            EventKind::BreakDown => self.broken.insert(agent),
            EventKind::RadioOff => !is_broken && self.silent.insert(agent),
            EventKind::RadioOn => !is_broken && self.silent.remove(&agent),
            EventKind::Wall | EventKind::Free | EventKind::Set => true,
        };
        if fits {
            return Ok(());
        }
        Err(match kind {
            EventKind::Join => format!("agent {agent} has an earlier event, and joins but once"),
            _ if is_broken => format!("agent {agent} has broken down before"),
            EventKind::RadioOff => format!("the radio of agent {agent} is off already"),
            _ => format!("the radio of agent {agent} is on already"),
        })
    }
}

#[cfg(test)]
mod tests;
