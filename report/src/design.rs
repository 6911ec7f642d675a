//! What a plan says about its report: its title, what it compares, and the order of the values.
//!
//! Read from the copy of the plan in the folder of the runs, so a report needs no map files and no
//! build that knows the scenarios. It checks nothing: `maes batch` has done so.

use std::collections::BTreeMap;

use serde::Deserialize;

use experiments::plan::{Measure, VARIANT};

/// The keys of a plan that a report uses.
#[derive(Debug, Clone, Default, Deserialize)]
pub(super) struct Design {
    pub(super) title: Option<String>,
    #[serde(default)]
    compare: Option<toml::Value>,
    #[serde(default)]
    primary: Option<String>,
    #[serde(default)]
    variant: Vec<Named>,
    #[serde(default)]
    axes: BTreeMap<String, Vec<toml::Value>>,
}

#[derive(Debug, Clone, Deserialize)]
struct Named {
    name: String,
}

impl Design {
    /// That of a plan; empty for a text that is no plan.
    pub(super) fn of(plan: Option<&str>) -> Self {
        plan.and_then(|text| toml::from_str(text).ok()).unwrap_or_default()
    }

    /// The keys whose values are compared; empty if the plan does not say.
    pub(super) fn compare(&self) -> Vec<String> {
        match &self.compare {
            Some(toml::Value::String(key)) => vec![key.clone()],
            Some(toml::Value::Array(keys)) => keys.iter().filter_map(|key| key.as_str().map(str::to_owned)).collect(),
            _ if !self.variant.is_empty() => vec![VARIANT.to_owned()],
            _ => Vec::new(),
        }
    }

    /// The measure that verdicts are about.
    pub(super) fn primary(&self) -> Measure {
        self.primary.as_deref().and_then(Measure::named).unwrap_or_default()
    }

    /// Whether the plan says so itself.
    pub(super) fn names_primary(&self) -> bool {
        self.primary.is_some()
    }

    /// The place of a value in the plan, as text; that of a value that is not in the plan is last.
    pub(super) fn place(&self, key: &str, value: &str) -> usize {
        let place = if key == VARIANT {
            self.variant.iter().position(|variant| variant.name.trim() == value)
        } else {
            self.axes.get(key).and_then(|values| values.iter().position(|listed| text(listed) == value))
        };
        place.unwrap_or(usize::MAX)
    }
}

/// As in [`experiments::plan::AxisValue::text`].
fn text(value: &toml::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// A value of an axis for readers, given all values of the axis: of tables, the keys that differ
/// between them. `None` for a plain value.
pub(super) fn short_table(value: &str, all: &[&str]) -> Option<String> {
    let leaves = |text: &str| {
        let table: toml::Table = toml::from_str(&format!("value = {text}")).ok()?;
        let mut leaves = BTreeMap::new();
        collect(String::new(), table["value"].as_table()?, &mut leaves);
        Some(leaves)
    };
    let own = leaves(value)?;
    let others: Vec<_> = all.iter().filter_map(|text| leaves(text)).collect();
    let differs = |key: &String| others.iter().any(|other| other.get(key) != own.get(key));
    let mut parts: Vec<String> = Vec::new();
    for (key, value) in own.iter().filter(|(key, _)| differs(key)) {
        // The controller is known by its name alone, and comes first.
        if key == "controller" || key.ends_with(".controller") {
            parts.insert(0, value.clone());
        } else {
            parts.push(format!("{} = {value}", key.strip_prefix("set.").unwrap_or(key)));
        }
    }
    if parts.is_empty() {
        // The others have keys that this one lacks.
        parts.push(if own.is_empty() { "default".to_owned() } else { value.to_owned() });
    }
    Some(in_brackets(&parts))
}

/// The first part, and the others in brackets, so that names in a list stay apart.
pub(super) fn in_brackets(parts: &[String]) -> String {
    match parts {
        [] => "\u{2013}".to_owned(),
        [only] => only.clone(),
        [first, others @ ..] => format!("{first} ({})", others.join(", ")),
    }
}

fn collect(prefix: String, table: &toml::Table, leaves: &mut BTreeMap<String, String>) {
    for (key, value) in table {
        match value {
            toml::Value::Table(inner) => collect(format!("{prefix}{key}."), inner, leaves),
            value => drop(leaves.insert(format!("{prefix}{key}"), text(value))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_shown_by_what_differs() {
        let all = [
            "{ count = 2, controller = \"lvd\", set = { visit_radius_m = 2.0 } }",
            "{ count = 2, controller = \"lvd\", set = { visit_radius_m = 4.0 } }",
            "{ count = 2, controller = \"rbw\" }",
        ];
        let short: Vec<_> = all.iter().map(|value| short_table(value, &all).unwrap()).collect();
        assert_eq!(short, ["lvd (visit_radius_m = 2.0)", "lvd (visit_radius_m = 4.0)", "rbw"]);
        assert_eq!(short_table("{}", &["{}", "{ a = 1 }"]).unwrap(), "default");
        assert_eq!(short_table("dsvp", &["dsvp"]), None);
        assert_eq!(short_table("5", &["5"]), None);
    }

    #[test]
    fn plan_says_what_is_compared() {
        let compare = |text: &str| Design::of(Some(text)).compare();
        assert_eq!(compare("compare = \"a.b\"\nseeds = [1]"), ["a.b"]);
        assert_eq!(compare("compare = [\"a\", \"b\"]"), ["a", "b"]);
        assert_eq!(compare("[[variant]]\nname = \"far\"\nlidar.range_m = 3"), [VARIANT]);
        let primary = |text: &str| Design::of(Some(text)).primary();
        assert_eq!((primary("primary = \"distance\""), primary("seeds = [1]")), (Measure::Distance, Measure::Area));
        assert!(compare("seeds = [1]").is_empty());
        assert!(Design::of(Some("no plan")).compare().is_empty());
        let design = Design::of(Some("axes.\"a\" = [5, 1]"));
        assert!(design.place("a", "5") < design.place("a", "1") && design.place("a", "1") < design.place("a", "2"));
    }
}
