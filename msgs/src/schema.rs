//! Definitions that stand alone: the text that a recording keeps so that anybody can decode it.
//!
//! The form is the `ros2msg` schema encoding of MCAP: the definition of the type, then the
//! definition of every type that it refers to, directly or not, once each. The order is that of
//! rosbag2: depth first, alphabetically at each level. This module does not write recordings.

use std::collections::BTreeSet;

use crate::definition::Definition;
use crate::message::{MessageType, find};
use crate::service::Service;

/// What stands between two definitions, before the name of the second.
const SEPARATOR: &str = "================================================================================";

/// The definition of `message` followed by the definitions of all types it refers to.
///
/// ```
/// use msgs::{message::Message, rosgraph_msgs::Clock, schema};
///
/// let rule = "=".repeat(80);
/// let expected =
///     format!("builtin_interfaces/Time clock\n\n{rule}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n");
/// assert_eq!(schema::text(Clock::TYPE), expected);
/// ```
pub fn text(message: MessageType) -> String {
    let mut text = message.definition.to_owned();
    let mut seen = BTreeSet::new();
    append_dependencies(message, &mut seen, &mut text);
    text
}

/// A service type with its definitions.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ServiceSchema {
    /// Its full name, for example `simulation_interfaces/srv/StepSimulation`.
    pub of_type: String,
    /// The definition of its request, followed by those of the types that it refers to.
    pub request: String,
    /// The same of its response.
    pub response: String,
}

/// The definitions of a service.
///
/// # Panics
/// Never: the build script has read its file, which has two parts.
pub fn service<S: Service>() -> ServiceSchema {
    let (request, response) = S::DEFINITION.split_once("---\n").expect("an interface file of a service has two parts");
    let whole = |definition: &'static str| text(MessageType { package: S::PACKAGE, name: "", definition });
    ServiceSchema {
        of_type: format!("{}/srv/{}", S::PACKAGE, S::NAME),
        request: whole(request),
        response: whole(response),
    }
}

fn append_dependencies(message: MessageType, seen: &mut BTreeSet<MessageType>, text: &mut String) {
    for dependency in dependencies(message) {
        if seen.insert(dependency) {
            let MessageType { package, name, definition } = dependency;
            text.push_str(&format!("\n{SEPARATOR}\nMSG: {package}/{name}\n{definition}"));
            append_dependencies(dependency, seen, text);
        }
    }
}

/// The types that the fields of `message` have, without the primitive ones.
fn dependencies(message: MessageType) -> BTreeSet<MessageType> {
    let definition = Definition::parse(message.definition).expect("the build script has read it");
    let nested = definition.fields().filter(|field| field.of_type.primitive().is_none());
    let types = nested.map(|field| field.of_type.message(message.package));
    types.map(|(package, name)| find(package, name).expect("the build script has found it")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::maes_msgs::{ChangeMap, Command, Observation};
    use crate::message::{ALL, Message};
    use crate::simulation_interfaces::{
        GetSimulationState, GetSimulatorFeatures, ResetSimulation, SetSimulationState, StepSimulation,
    };

    /// The names after the separators, in order.
    fn appended(message: MessageType) -> Vec<String> {
        text(message).lines().filter_map(|line| line.strip_prefix("MSG: ")).map(str::to_owned).collect()
    }

    /// The names of all types that `message` refers to, found by comparing every line with every
    /// type there is.
    fn referred(message: MessageType) -> BTreeSet<String> {
        let mut found = BTreeSet::new();
        let mut open = vec![message];
        while let Some(user) = open.pop() {
            for &other in ALL {
                let full = format!("{}/{}", other.package, other.name);
                let used = user
                    .definition
                    .lines()
                    .map(|line| line.split([' ', '[']).next().unwrap())
                    .any(|word| word == full || (word == other.name && user.package == other.package));
                if used && found.insert(full) {
                    open.push(other);
                }
            }
        }
        found
    }

    #[test]
    fn every_dependency_is_there_exactly_once() {
        for &message in ALL {
            let mut names = appended(message);
            names.sort();
            assert_eq!(names, referred(message).into_iter().collect::<Vec<_>>(), "{message}");
        }
    }

    #[test]
    fn the_order_is_depth_first_and_alphabetical() {
        assert_eq!(
            appended(Command::TYPE),
            [
                "maes_msgs/AgentMessage",
                "maes_msgs/Motion",
                "geometry_msgs/Point",
                "geometry_msgs/Vector3",
                "maes_msgs/ScanRequest",
                "maes_msgs/WakeCondition"
            ]
        );
        assert_eq!(
            appended(Observation::TYPE),
            [
                "geometry_msgs/Point",
                "geometry_msgs/Vector3",
                "maes_msgs/AgentMessage",
                "maes_msgs/CellRuns",
                "maes_msgs/Contact",
                "std_msgs/Header",
                "builtin_interfaces/Time"
            ]
        );
    }

    #[test]
    fn both_parts_of_a_service_are_complete() {
        let described = [
            service::<GetSimulatorFeatures>(),
            service::<GetSimulationState>(),
            service::<SetSimulationState>(),
            service::<StepSimulation>(),
            service::<ResetSimulation>(),
        ];
        for ServiceSchema { of_type: name, request, response } in described {
            assert!(!request.contains("---\n") && !response.contains("---\n"), "{name}");
            for part in ["Result", "SimulationState", "SimulatorFeatures"] {
                let used = format!("simulation_interfaces/{part} ");
                for text in [&request, &response] {
                    let is_there = text.contains(&format!("MSG: simulation_interfaces/{part}\n"));
                    assert_eq!(text.contains(&used), is_there, "{name}: {part}");
                }
            }
        }
        let change_map = service::<ChangeMap>();
        assert_eq!(change_map.of_type, "maes_msgs/srv/ChangeMap");
        assert!(change_map.request.contains("MSG: geometry_msgs/Point\n") && !change_map.response.contains("MSG: "));
    }

    #[test]
    fn the_definition_itself_comes_first_and_unchanged() {
        for &message in ALL {
            assert!(text(message).starts_with(message.definition), "{message}");
            assert!(message.definition.ends_with('\n'), "{message}");
        }
    }
}
