//! The dimensions of a plan: variants and axes, and the combinations of their values.
//!
//! A setting of a controller is no dimension for controllers that lack it: a plan may vary
//! `agents.set.visit_radius_m` of `lvd` beside `rbw`, which is then run once and not once for each
//! value. Likewise a setting of the base scenario applies to the controllers that have it.

use std::collections::BTreeMap;

use agent_node::controllers;
use simulation::scenario::Override;

use super::{Axis, Variant};

/// Prefix of the keys of settings.
const SETTING: &str = "agents.set.";
/// The key of the controller.
const CONTROLLER: &str = "agents.controller";
/// The name of the dimension of the variants, in [`super::PlannedRun::axes`].
pub(super) const VARIANT: &str = "variant";

/// A change of the base scenario by a plan.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Change {
    /// The place in the plan and the text, for error messages.
    pub(super) origin: String,
    /// Line of the plan, counted from 1.
    pub(super) line: usize,
    pub(super) key: String,
    /// `None` removes the key.
    pub(super) value: Option<toml::Value>,
}

impl Change {
    pub(super) fn to_override(&self) -> Override {
        Override { origin: self.origin.clone(), key: self.key.clone(), value: self.value.clone() }
    }
}

/// A combination of values.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Choice {
    /// Name of each dimension, and the text of its value.
    pub(super) labels: BTreeMap<String, String>,
    pub(super) changes: Vec<Change>,
}

impl Choice {
    /// This combination with another value.
    pub(super) fn with(&self, name: &str, text: String, changes: impl IntoIterator<Item = Change>) -> Self {
        let mut choice = self.clone();
        choice.labels.insert(name.to_owned(), text);
        choice.changes.extend(changes);
        choice
    }

    /// The controller of the combination, if it sets one.
    fn controller(&self) -> Option<&str> {
        self.changes.iter().rev().find_map(|change| match change.key.as_str() {
            CONTROLLER => change.value.as_ref()?.as_str(),
            "agents" => change.value.as_ref()?.get("controller")?.as_str(),
            _ => None,
        })
    }
}

/// The product of variants and axes; the last axis varies fastest. `base` is the base scenario.
pub(super) fn combinations(file: &str, variants: &[Variant], axes: &[Axis], base: &toml::Table) -> Vec<Choice> {
    let mut choices = vec![Choice::default()];
    if !variants.is_empty() {
        let of = |variant: &Variant| Choice::default().with(VARIANT, variant.name.clone(), variant.changes.clone());
        choices = variants.iter().map(of).collect();
    }
    // Settings come last: whether one applies depends on the controller.
    let (settings, others): (Vec<&Axis>, Vec<&Axis>) = axes.iter().partition(|axis| axis.key.starts_with(SETTING));
    for axis in others {
        choices = choices.iter().flat_map(|choice| with_values(file, choice, axis)).collect();
    }
    let base_agents = base.get("agents");
    let base_controller = base_agents.and_then(|agents| agents.get("controller")).and_then(toml::Value::as_str);
    let base_controller = base_controller.unwrap_or("rbw");
    let controller = |choice: &Choice| choice.controller().unwrap_or(base_controller).to_owned();
    for axis in settings {
        let key = &axis.key[SETTING.len()..];
        let applies = |choice: &Choice| has_setting(&controller(choice), key);
        // A setting of no controller is a mistake, which the check of the settings reports.
        let is_known = choices.iter().any(applies);
        let values = |choice: &Choice| {
            if !is_known || applies(choice) { with_values(file, choice, axis) } else { vec![choice.clone()] }
        };
        choices = choices.iter().flat_map(values).collect();
    }
    let base_settings = base_agents.and_then(|agents| agents.get("set")).and_then(toml::Value::as_table);
    for choice in &mut choices {
        let controller = controller(choice);
        let others = base_settings.into_iter().flat_map(toml::Table::keys);
        if controller != base_controller && !choice.changes.iter().any(|change| change.key == "agents") {
            let lacking = others.filter(|key| !has_setting(&controller, key));
            let remove =
                |key: &String| Change { origin: file.to_owned(), line: 1, key: format!("{SETTING}{key}"), value: None };
            // Before all others, which may set them again.
            choice.changes.splice(0..0, lacking.map(remove));
        }
    }
    choices
}

fn with_values(file: &str, choice: &Choice, axis: &Axis) -> Vec<Choice> {
    let with = |value: &super::AxisValue| {
        let change = Change {
            origin: format!("{file}:{}: axes.\"{}\" = {}", value.line, axis.key, value.value),
            line: value.line,
            key: axis.key.clone(),
            value: Some(value.value.clone()),
        };
        choice.with(&axis.key, value.text(), [change])
    };
    axis.values.iter().map(with).collect()
}

/// Whether a controller has a setting; also true for a controller that is not known here, which
/// another check reports.
fn has_setting(controller: &str, key: &str) -> bool {
    controllers::resolve_settings(controller, &[])
        .map_or(true, |settings| settings.iter().any(|setting| setting.key == key))
}
