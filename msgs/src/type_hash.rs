//! Type hashes of messages, by which ROS 2 checks that two sides mean the same type.
//!
//! REP-2016, version RIHS01: SHA-256 of the description of a type and of all types that it refers
//! to, as JSON in one form. The descriptions follow from the `.msg` and `.srv` files alone: names
//! and types of fields, without constants, defaults and comments.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::OnceLock;

use sha2::{Digest, Sha256};

use crate::definition::{Definition, Item, Length, PART_SEPARATOR};
use crate::message::{ALL, MessageType, find};

/// The number of a bounded string.
const BOUNDED_STRING: u32 = 21;

/// The number of a type that has a description of its own.
const NESTED: u32 = 1;

/// What is added to the number of an element for arrays, bounded and unbounded sequences.
const ARRAY: u32 = 48;
const BOUNDED_SEQUENCE: u32 = 96;
const UNBOUNDED_SEQUENCE: u32 = 144;

/// The hash of a message type: `RIHS01_` and 64 hexadecimal digits.
#[must_use]
pub fn of(message: MessageType) -> String {
    static HASHES: OnceLock<BTreeMap<String, String>> = OnceLock::new();
    let computed =
        |message: MessageType| of_parts(&message.to_string(), message.definition, message.package, &BTreeMap::new());
    // A recording names those of all its topics again and again.
    let hashes = HASHES.get_or_init(|| ALL.iter().map(|message| (message.to_string(), computed(*message))).collect());
    hashes.get(&message.to_string()).cloned().unwrap_or_else(|| computed(message))
}

/// The hash of a service type, whose definition has a request and a response.
pub fn of_service(package: &str, name: &str, definition: &str) -> String {
    let (request, response) = definition.split_once(PART_SEPARATOR).unwrap_or((definition, ""));
    service(&format!("{package}/srv/{name}"), package, request, response, BTreeMap::new())
}

/// The hashes of the types of an action that are its own.
pub struct ActionHashes {
    /// Of the service that sends goals.
    pub send_goal: String,
    /// Of the service that returns results.
    pub get_result: String,
    /// Of the message with feedback.
    pub feedback: String,
}

/// The hashes of an action type, whose definition has a goal, a result and feedback.
pub fn of_action(package: &str, name: &str, definition: &str) -> ActionHashes {
    let full_name = format!("{package}/action/{name}");
    let names = ["Goal", "Result", "Feedback"].map(|part| format!("{full_name}_{part}"));
    let parts: BTreeMap<_, _> = names.into_iter().zip(definition.split(PART_SEPARATOR).map(str::to_owned)).collect();
    let goal_id = "unique_identifier_msgs/UUID goal_id";
    let service = |name: &str, request: &str, response: &str| {
        service(&format!("{full_name}_{name}"), package, request, response, parts.clone())
    };
    let goal = format!("{goal_id}\n{full_name}_Goal goal");
    let feedback = format!("{goal_id}\n{full_name}_Feedback feedback");
    ActionHashes {
        send_goal: service("SendGoal", &goal, "bool accepted\nbuiltin_interfaces/Time stamp"),
        get_result: service("GetResult", goal_id, &format!("int8 status\n{full_name}_Result result")),
        feedback: of_parts(&format!("{full_name}_FeedbackMessage"), &feedback, package, &parts),
    }
}

/// The hash of a service type by its full name and the definitions of its parts. It is that of a
/// message with three fields: the request, the response, and the event of service introspection
/// (REP-2012).
fn service(
    full_name: &str,
    package: &str,
    request: &str,
    response: &str,
    mut parts: BTreeMap<String, String>,
) -> String {
    for (part, definition) in [("Request", request), ("Response", response)] {
        parts.insert(format!("{full_name}_{part}"), definition.to_owned());
    }
    let event = format!(
        "service_msgs/ServiceEventInfo info\n{full_name}_Request[<=1] request\n{full_name}_Response[<=1] response"
    );
    parts.insert(format!("{full_name}_Event"), event);
    let whole = format!(
        "{full_name}_Request request_message\n{full_name}_Response response_message\n{full_name}_Event event_message"
    );
    of_parts(full_name, &whole, package, &parts)
}

/// The hash of a type of a package by its full name and its definition. `parts` has the definitions
/// of types of the same package that have no file of their own, by full name.
fn of_parts(full_name: &str, definition: &str, package: &str, parts: &BTreeMap<String, String>) -> String {
    let mut referred = BTreeMap::new();
    collect(definition, package, parts, &mut referred);
    let referred = referred.into_values().collect::<Vec<_>>().join(", ");
    let own = description(full_name, definition, package);
    let text = format!("{{\"type_description\": {own}, \"referenced_type_descriptions\": [{referred}]}}");
    let digest = Sha256::digest(text);
    let hex: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
    format!("RIHS01_{hex}")
}

fn parsed(definition: &str) -> Definition<'_> {
    Definition::parse(definition).expect("the build script has read it, or it is made here")
}

/// The full name of the type of a field, unless that is primitive. Types that have no file of their
/// own are referred to by their full name.
fn nested_name(field: &Item<'_>, package: &str) -> Option<String> {
    let (package, name) = match field.of_type.primitive() {
        Some(_) => return None,
        None => field.of_type.message(package),
    };
    Some(find(package, name).map_or_else(|| field.of_type.element.to_owned(), |message| message.to_string()))
}

/// Adds the descriptions of the types that a definition refers to, by full name.
fn collect(definition: &str, package: &str, parts: &BTreeMap<String, String>, referred: &mut BTreeMap<String, String>) {
    for field in parsed(definition).fields() {
        let Some(full_name) = nested_name(field, package) else { continue };
        let known = || {
            let (package, name) = field.of_type.message(package);
            find(package, name).map(|of| (of.definition, of.package))
        };
        let nested = parts.get(&full_name).map(|definition| (definition.as_str(), package)).or_else(known);
        if let (Some((definition, package)), Entry::Vacant(entry)) = (nested, referred.entry(full_name.clone())) {
            entry.insert(description(&full_name, definition, package));
            collect(definition, package, parts, referred);
        }
    }
}

fn description(full_name: &str, definition: &str, package: &str) -> String {
    let is_empty = parsed(definition).fields().next().is_none();
    let definition = parsed(if is_empty { "uint8 structure_needs_at_least_one_member" } else { definition });
    let fields: Vec<String> = definition.fields().map(|field| described(field, package)).collect();
    format!("{{\"type_name\": \"{full_name}\", \"fields\": [{}]}}", fields.join(", "))
}

/// A field as JSON.
fn described(field: &Item<'_>, package: &str) -> String {
    let Item { name, of_type, .. } = field;
    let element = match (of_type.string_bound, of_type.primitive()) {
        (Some(_), _) => BOUNDED_STRING,
        (None, Some((number, _))) => number,
        (None, None) => NESTED,
    };
    let (added, capacity) = match of_type.length {
        Length::One => (0, 0),
        Length::Array(length) => (ARRAY, length),
        Length::Bounded(bound) => (BOUNDED_SEQUENCE, bound),
        Length::Unbounded => (UNBOUNDED_SEQUENCE, 0),
    };
    let (number, string_capacity) = (element + added, of_type.string_bound.unwrap_or(0));
    let nested = nested_name(field, package).unwrap_or_default();
    format!(
        "{{\"name\": \"{name}\", \"type\": {{\"type_id\": {number}, \"capacity\": {capacity}, \"string_capacity\": \
         {string_capacity}, \"nested_type_name\": \"{nested}\"}}}}"
    )
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use crate::action_msgs::{CancelGoal, GoalStatusArray};
    use crate::maes_msgs::{Progress, SignedObservation};
    use crate::message::Message;
    use crate::rcl_interfaces::{self, Log, ParameterEvent};
    use crate::rosgraph_msgs::Clock;
    use crate::service::{Action, Service};
    use crate::service_msgs::ServiceEventInfo;
    use crate::simulation_interfaces::{self, SimulateSteps};

    use super::*;

    #[test]
    fn fields_have_number_capacity_and_name() {
        let of = |line: &'static str| described(parsed(line).fields().next().unwrap(), "geometry_msgs");
        let expected = |number: u32, capacity: u32, string: u32, nested: &str| {
            format!(
                "{{\"name\": \"a\", \"type\": {{\"type_id\": {number}, \"capacity\": {capacity}, \"string_capacity\": \
                 {string}, \"nested_type_name\": \"{nested}\"}}}}"
            )
        };
        assert_eq!(of("float64[36] a"), expected(59, 36, 0, ""));
        assert_eq!(of("uint8[] a # comment"), expected(147, 0, 0, ""));
        assert_eq!(of("string[<=3] a"), expected(113, 3, 0, ""));
        assert_eq!(of("string<=22 a"), expected(21, 0, 22, ""));
        assert_eq!(of("Point[] a"), expected(145, 0, 0, "geometry_msgs/msg/Point"));
        assert_eq!(of("std_msgs/Header a"), expected(1, 0, 0, "std_msgs/msg/Header"));
        assert_eq!(of("float64 a 1.0"), expected(11, 0, 0, ""));
    }

    #[test]
    fn every_type_has_a_hash() {
        let hashes: BTreeSet<String> = ALL.iter().map(|&message| of(message)).collect();
        assert_eq!(hashes.len(), ALL.len());
        assert!(hashes.iter().all(|hash| hash.len() == 71));
    }

    /// Those that ROS 2 Kilted installs, from the packages `ros-rcl-interfaces`,
    /// `ros-rosgraph-msgs`, `ros-service-msgs`, `ros-action-msgs` and `ros-std-srvs` of PyPI; those
    /// of `simulation_interfaces` and `maes_msgs` by its generator,
    /// `ros-rosidl-generator-type-description` 4.9.5, from the definitions of this project.
    #[test]
    fn hashes_are_those_of_ros() {
        fn of_type<S: Service>(_: S) -> String {
            of_service(S::PACKAGE, S::NAME, S::DEFINITION)
        }
        let steps = of_action(SimulateSteps::PACKAGE, SimulateSteps::NAME, SimulateSteps::DEFINITION);
        for (hash, expected) in [
            (of(Clock::TYPE), "692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564"),
            (of(Log::TYPE), "e28ce254ca8abc06abf92773b74602cdbf116ed34fbaf294fb9f81da9f318eac"),
            (of(ParameterEvent::TYPE), "043e627780fcad87a22d225bc2a037361dba713fca6a6b9f4b869a5aa0393204"),
            (of(GoalStatusArray::TYPE), "6c1684b00f177d37438febe6e709fc4e2b0d4248dca4854946f9ed8b30cda83e"),
            (of_type(CancelGoal), "573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a"),
            (steps.send_goal, "504407b9ff5617a737df8222cf581452b4f2e699e11e940d8d36590c5fb07d01"),
            (steps.get_result, "a1dae0516ab5c70d6d797e1bcd55c9448dfbb1966643f1ebd3e3f153d8169ae0"),
            (steps.feedback, "a30dee7ee7380769e616406ec5067b238aa2b27e1dbd7a5957fba1d908d7754d"),
            (
                of_type(simulation_interfaces::GetEntitiesStates),
                "0a76170d0c1c90e1eaf805cfab78ea801d1f82df309a28c1f0fae4b570f19754",
            ),
            (
                of_type(simulation_interfaces::GetSimulatorFeatures),
                "abb9439c8cf196722a469fb6c68b44b484f198c2a1356ac38849a29c2a20a794",
            ),
            (of(SignedObservation::TYPE), "b418c94394ec1eea415d651a60e58bc591e143e79ee51e116387c2345469340c"),
            (of(Progress::TYPE), "7054c40bd979883f7fcb6b088db9aaed0223d4f15d50949de7ec2fdb9b6a81f2"),
            (of(ServiceEventInfo::TYPE), "41bcbbe07a75c9b52bc96bfd5c24d7f0fc0a08c0cb7921b3373c5732345a6f45"),
            (
                of_type(rcl_interfaces::GetParameters),
                "bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc",
            ),
            (
                of_type(rcl_interfaces::DescribeParameters),
                "845b484d71eb0673dae682f2e3ba3c4851a65a3dcfb97bddd82c5b57e91e4cff",
            ),
            (
                of_type(rcl_interfaces::SetParameters),
                "56eed9a67e169f9cb6c1f987bc88f868c14a8fc9f743a263bc734c154015d7e0",
            ),
            (
                of_type(rcl_interfaces::SetParametersAtomically),
                "0e192ef259c07fc3c07a13191d27002222e65e00ccec653ca05e856f79285fcd",
            ),
            (
                of_type(rcl_interfaces::ListParameters),
                "3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d",
            ),
            (
                of_type(rcl_interfaces::GetParameterTypes),
                "da199c878688b3e530bdfe3ca8f74cb9fa0c303101e980a9e8f260e25e1c80ca",
            ),
            (
                // A request without fields (`std_srvs`).
                of_service("std_srvs", "Empty", "---\n"),
                "5888399dedec5ccc85ea6451949fd2c9f97bfdf963f9a588821639fcd31b5d19",
            ),
        ] {
            assert_eq!(hash, format!("RIHS01_{expected}"));
        }
    }
}
