//! Parameters of a node, as ROS 2 has them: a list with descriptions and ranges, and the messages
//! of the services which read and set them.
//!
//! Invariants: what is read-only does not change; what is set has the type that it had and lies in
//! its range; setting several at once sets all or none. Plain data: this module knows no transport,
//! and what a parameter does is its owner's affair.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::builtin_interfaces::Time;
use crate::cdr;
use crate::limits::ANSWER_BYTES_MAX;
use crate::message::{Message, MessageType};
use crate::service::services;

/// Most names of one request that are answered.
const NAMES_MAX: usize = 64;

/// What stands between the parts of a name.
const SEPARATOR: char = '.';

/// The value of a parameter. What the type does not name is empty.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Value {
    /// Which of the fields holds it; one of the constants.
    pub kind: u8,
    /// A truth value.
    pub bool_value: bool,
    /// A whole number.
    pub integer_value: i64,
    /// A number.
    pub double_value: f64,
    /// A text.
    pub string_value: String,
    /// Bytes.
    pub byte_array_value: Vec<u8>,
    /// Truth values.
    pub bool_array_value: Vec<bool>,
    /// Whole numbers.
    pub integer_array_value: Vec<i64>,
    /// Numbers.
    pub double_array_value: Vec<f64>,
    /// Texts.
    pub string_array_value: Vec<String>,
}

impl Value {
    /// There is no such parameter.
    pub const NOT_SET: u8 = 0;
    /// A truth value.
    pub const BOOL: u8 = 1;
    /// A whole number.
    pub const INTEGER: u8 = 2;
    /// A number.
    pub const DOUBLE: u8 = 3;
    /// A text.
    pub const STRING: u8 = 4;
    /// Whole numbers.
    pub const INTEGER_ARRAY: u8 = 7;
    /// Numbers.
    pub const DOUBLE_ARRAY: u8 = 8;
}

impl From<bool> for Value {
    fn from(value: bool) -> Self {
        Value { kind: Self::BOOL, bool_value: value, ..Value::default() }
    }
}

impl From<i64> for Value {
    fn from(value: i64) -> Self {
        Value { kind: Self::INTEGER, integer_value: value, ..Value::default() }
    }
}

impl From<f64> for Value {
    fn from(value: f64) -> Self {
        Value { kind: Self::DOUBLE, double_value: value, ..Value::default() }
    }
}

impl From<String> for Value {
    fn from(value: String) -> Self {
        Value { kind: Self::STRING, string_value: value, ..Value::default() }
    }
}

impl From<Vec<i64>> for Value {
    fn from(value: Vec<i64>) -> Self {
        Value { kind: Self::INTEGER_ARRAY, integer_array_value: value, ..Value::default() }
    }
}

impl From<Vec<f64>> for Value {
    fn from(value: Vec<f64>) -> Self {
        Value { kind: Self::DOUBLE_ARRAY, double_array_value: value, ..Value::default() }
    }
}

/// A parameter by name.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Named {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: Value,
}

/// Which numbers are allowed, both ends included. A step of 0 means any.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Range<N> {
    /// The least.
    pub from_value: N,
    /// The greatest.
    pub to_value: N,
    /// How far apart.
    pub step: N,
}

/// What there is to know of a parameter beside its value.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Descriptor {
    /// Its name.
    pub name: String,
    /// The type of its value; one of the constants of [`Value`].
    pub kind: u8,
    /// What it means.
    pub description: String,
    /// What is allowed, in words.
    pub additional_constraints: String,
    /// Whether it stays as it is.
    pub read_only: bool,
    /// Whether its type may change.
    pub dynamic_typing: bool,
    /// At most one.
    pub floating_point_range: Vec<Range<f64>>,
    /// At most one.
    pub integer_range: Vec<Range<i64>>,
}

/// A parameter.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parameter {
    /// Its value.
    pub value: Value,
    /// Everything else.
    pub descriptor: Descriptor,
}

impl Parameter {
    /// One that stays as it is.
    #[must_use]
    pub fn fixed(name: &str, value: impl Into<Value>, description: &str) -> Self {
        let value = value.into();
        let descriptor = Descriptor {
            name: name.to_owned(),
            kind: value.kind,
            description: description.to_owned(),
            read_only: true,
            ..Descriptor::default()
        };
        Parameter { value, descriptor }
    }

    /// With a range of numbers; that of a whole number has whole ends.
    #[must_use]
    pub fn with_range(mut self, low: f64, high: f64) -> Self {
        match self.value.kind {
            Value::INTEGER => {
                let range = Range { from_value: low as i64, to_value: high as i64, step: 0 };
                self.descriptor.integer_range = vec![range];
            }
            Value::DOUBLE => {
                self.descriptor.floating_point_range = vec![Range { from_value: low, to_value: high, step: 0.0 }]
            }
            _ => {}
        }
        self
    }

    /// With words that say what is allowed.
    #[must_use]
    pub fn with_constraints(mut self, words: &str) -> Self {
        words.clone_into(&mut self.descriptor.additional_constraints);
        self
    }

    /// A parameter that may be set.
    #[must_use]
    pub fn settable(mut self) -> Self {
        self.descriptor.read_only = false;
        self
    }

    fn check(&self, value: &Value) -> Result<(), String> {
        let Descriptor { name, read_only, floating_point_range, integer_range, .. } = &self.descriptor;
        if *read_only {
            return Err(format!("{name} is read-only"));
        }
        if value.kind != self.value.kind {
            return Err(format!("{name} has type {}, not {}", kind_name(self.value.kind), kind_name(value.kind)));
        }
        if let [Range { from_value, to_value, .. }] = floating_point_range[..]
            && !(from_value..=to_value).contains(&value.double_value)
        {
            return Err(format!("{name} = {}: expected {from_value} to {to_value}", value.double_value));
        }
        if let [Range { from_value, to_value, .. }] = integer_range[..]
            && !(from_value..=to_value).contains(&value.integer_value)
        {
            return Err(format!("{name} = {}: expected {from_value} to {to_value}", value.integer_value));
        }
        Ok(())
    }
}

fn kind_name(kind: u8) -> &'static str {
    const NAMES: [&str; 10] = [
        "not set",
        "bool",
        "integer",
        "double",
        "string",
        "byte array",
        "bool array",
        "integer array",
        "double array",
        "string array",
    ];
    NAMES.get(usize::from(kind)).copied().unwrap_or("unknown")
}

/// The parameters of a node, by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parameters {
    by_name: BTreeMap<String, Parameter>,
}

impl Parameters {
    /// Adds parameters, in the place of those with the same name.
    pub fn declare(&mut self, parameters: impl IntoIterator<Item = Parameter>) {
        self.by_name.extend(parameters.into_iter().map(|parameter| (parameter.descriptor.name.clone(), parameter)));
    }

    /// The values of these, in this order, as many as fit into an answer; of what there is not,
    /// [`Value::NOT_SET`].
    #[must_use]
    pub fn values(&self, names: &[String]) -> Vec<Value> {
        let value = |name: &String| self.by_name.get(name).map(|known| known.value.clone()).unwrap_or_default();
        fitting(names.iter().take(NAMES_MAX).map(value))
    }

    /// What there is to know of these, in this order, as many as fit into an answer; of what there
    /// is not, its name.
    #[must_use]
    pub fn descriptors(&self, names: &[String]) -> Vec<Descriptor> {
        let descriptor = |name: &String| match self.by_name.get(name) {
            Some(known) => known.descriptor.clone(),
            None => Descriptor { name: name.clone(), ..Descriptor::default() },
        };
        fitting(names.iter().take(NAMES_MAX).map(descriptor))
    }

    /// The names that begin with one of the prefixes (none: all), and have at most `depth` parts
    /// more than it (0: any), as many as fit into an answer; if there is room, with the prefixes
    /// that lead to them.
    #[must_use]
    pub fn list(&self, prefixes: &[String], depth: u64) -> Listed {
        let is_shallow = |rest: &str| depth == 0 || (rest.matches(SEPARATOR).count() as u64) < depth;
        let is_meant = |name: &str| match prefixes {
            [] => is_shallow(name),
            some => some.iter().any(|prefix| match name.strip_prefix(prefix.as_str()) {
                Some("") => true,
                Some(rest) => rest.strip_prefix(SEPARATOR).is_some_and(is_shallow),
                None => false,
            }),
        };
        let names: Vec<String> = self.by_name.keys().filter(|name| is_meant(name)).cloned().collect();
        let leading = names.iter().filter_map(|name| name.rsplit_once(SEPARATOR)).map(|(before, _)| before.to_owned());
        let prefixes: BTreeSet<String> = leading.collect();
        let listed = Listed { prefixes: prefixes.into_iter().collect(), names };
        if fits(&listed) { listed } else { Listed { prefixes: Vec::new(), names: fitting(listed.names) } }
    }

    /// Sets one.
    ///
    /// # Errors
    /// If there is none of that name, or it cannot have that value; then nothing changes.
    pub fn set(&mut self, parameter: &Named) -> Result<(), String> {
        self.check(parameter)?;
        if let Some(known) = self.by_name.get_mut(&parameter.name) {
            known.value = parameter.value.clone();
        }
        Ok(())
    }

    /// Sets all.
    ///
    /// # Errors
    /// If one of them cannot be set; then nothing changes.
    pub fn set_all(&mut self, parameters: &[Named]) -> Result<(), String> {
        parameters.iter().try_for_each(|parameter| self.check(parameter))?;
        parameters.iter().try_for_each(|parameter| self.set(parameter))
    }

    fn check(&self, Named { name, value }: &Named) -> Result<(), String> {
        self.by_name.get(name).ok_or_else(|| format!("there is no parameter {name}"))?.check(value)
    }
}

fn fits(answer: &impl Serialize) -> bool {
    cdr::encode(answer).len() <= ANSWER_BYTES_MAX
}

/// As many of the first parts of an answer as fit into it.
fn fitting<V: Serialize>(parts: impl IntoIterator<Item = V>) -> Vec<V> {
    let mut taken = Vec::new();
    for part in parts {
        taken.push(part);
        // With room for what the answer has beside them.
        if !fits(&(&taken, 0_u64)) {
            taken.pop();
            break;
        }
    }
    taken
}

/// Names of parameters, and what leads to them.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Listed {
    /// In full.
    pub names: Vec<String>,
    /// The part before the last.
    pub prefixes: Vec<String>,
}

/// Whether a parameter was set.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetOutcome {
    /// Whether it was.
    pub successful: bool,
    /// Why not.
    pub reason: String,
}

impl From<Result<(), String>> for SetOutcome {
    fn from(set: Result<(), String>) -> Self {
        SetOutcome { successful: set.is_ok(), reason: set.err().unwrap_or_default() }
    }
}

/// What has changed at a node.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParameterEvent {
    /// When: wall time in other nodes, nothing here.
    pub stamp: Time,
    /// The node, with its namespace.
    pub node: String,
    /// Those that there were not.
    pub new_parameters: Vec<Named>,
    /// Those that have another value.
    pub changed_parameters: Vec<Named>,
    /// Those that there are no more.
    pub deleted_parameters: Vec<Named>,
}

impl Message for ParameterEvent {
    const TYPE: MessageType = MessageType {
        package: "rcl_interfaces",
        name: "ParameterEvent",
        definition: include_str!("standard/rcl_interfaces/ParameterEvent.msg"),
    };
}

/// A request that names parameters.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct NamesRequest {
    /// Which.
    pub names: Vec<String>,
}

/// A request for the names.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ListRequest {
    /// What they begin with; none: anything.
    pub prefixes: Vec<String>,
    /// How many parts more they may have; 0: any.
    pub depth: u64,
}

/// A request to set parameters.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SetRequest {
    /// To what.
    pub parameters: Vec<Named>,
}

/// Values, as they were asked for.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ValuesResponse {
    /// In that order.
    pub values: Vec<Value>,
}

/// Types of values, as they were asked for.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct KindsResponse {
    /// In that order.
    pub types: Vec<u8>,
}

/// Descriptors, as they were asked for.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DescriptorsResponse {
    /// In that order.
    pub descriptors: Vec<Descriptor>,
}

/// The names.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ListResponse {
    /// The list.
    pub result: Listed,
}

/// What became of each.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetResponse {
    /// In that order.
    pub results: Vec<SetOutcome>,
}

impl SetResponse {
    /// What became of these, as many as fit into an answer.
    #[must_use]
    pub fn of(outcomes: impl IntoIterator<Item = Result<(), String>>) -> Self {
        SetResponse { results: fitting(outcomes.into_iter().map(SetOutcome::from)) }
    }
}

/// What became of all together.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetAtomicallyResponse {
    /// Set, or not one of them.
    pub result: SetOutcome,
}

services! { "rcl_interfaces" {
    /// Values by name.
    GetParameters: NamesRequest => ValuesResponse;
    /// Types by name.
    GetParameterTypes: NamesRequest => KindsResponse;
    /// Descriptors by name.
    DescribeParameters: NamesRequest => DescriptorsResponse;
    /// Names.
    ListParameters: ListRequest => ListResponse;
    /// Sets each that can be set.
    SetParameters: SetRequest => SetResponse;
    /// Sets all, or none.
    SetParametersAtomically: SetRequest => SetAtomicallyResponse;
} }

#[cfg(test)]
mod tests;
