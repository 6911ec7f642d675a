//! The parameters of an agent's ROS 2 node. All are read-only, since they are part of the run.

use msgs::ids::AgentId;
use msgs::parameters::DeclaredParameter;
use msgs::rcl_interfaces::ParameterValue;

use controllers::settings::{Setting, SettingValue};

/// The parameters before the scenario is known.
#[must_use]
pub fn of_agent(agent: AgentId) -> Vec<DeclaredParameter> {
    vec![
        DeclaredParameter::fixed("id", i64::from(agent.0), "the number of the agent in the run"),
        DeclaredParameter::fixed(
            "use_sim_time",
            false,
            "an agent does not go by /clock: each observation says what time it is",
        ),
    ]
}

/// The parameters of a controller and its settings.
#[must_use]
pub fn of_controller(name: &str, settings: &[Setting]) -> Vec<DeclaredParameter> {
    let mut parameters =
        vec![DeclaredParameter::fixed("controller", name.to_owned(), "the algorithm that the agent runs")];
    let description = format!("setting of the controller {name}");
    parameters.extend(settings.iter().map(|Setting { key, value, allowed }| {
        let parameter = |value: ParameterValue| DeclaredParameter::fixed(&format!("set.{key}"), value, &description);
        let parameter = match value {
            SettingValue::Number(value, low, high) => parameter((*value).into()).with_range(*low, *high),
            SettingValue::Integer(value, low, high) => {
                let whole = i64::try_from(*value).unwrap_or(i64::MAX);
                parameter(whole.into()).with_range(*low as f64, *high as f64)
            }
            SettingValue::Word(word) => parameter(word.clone().into()),
        };
        parameter.with_constraints(allowed)
    }));
    parameters
}

#[cfg(test)]
mod tests {
    use super::*;
    use controllers;

    #[test]
    fn every_setting_is_a_parameter_with_its_range() {
        for name in controllers::NAMES {
            let settings = controllers::resolve_settings(name, &[]).unwrap();
            let parameters = of_controller(name, &settings);
            assert_eq!(parameters.len(), 1 + settings.len(), "{name}");
            assert!(parameters.iter().all(|parameter| parameter.descriptor.read_only));
        }
        let settings = controllers::resolve_settings("nearest-frontier", &["search_ticks=7".to_owned()]).unwrap();
        let parameters = of_controller("nearest-frontier", &settings);
        let ticks = parameters.iter().find(|parameter| parameter.descriptor.name == "set.search_ticks").unwrap();
        assert_eq!(ticks.value, ParameterValue::from(7));
        assert_eq!(ticks.descriptor.integer_range[0].to_value, 1_000_000);
        let time = parameters.iter().find(|parameter| parameter.descriptor.name == "set.search_time").unwrap();
        assert_eq!(time.descriptor.additional_constraints, "expected one of instant, budgeted, background");
    }
}
