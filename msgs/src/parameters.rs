//! Parameters of a node, as ROS 2 has them: a list with descriptions and ranges.
//!
//! Invariants: what is read-only does not change; what is set has the type that it had and lies in
//! its range; setting several at once sets all or none. Plain data: this module knows no transport,
//! and what a parameter does is its owner's affair.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use crate::cdr;
use crate::rcl_interfaces::{
    FloatingPointRange, IntegerRange, ListParametersResult, Parameter, ParameterDescriptor, ParameterType,
    ParameterValue, SetParametersResponse, SetParametersResult,
};
use crate::service::ANSWER_BYTES_MAX;

/// Most names of one request that are answered.
const NAMES_MAX: usize = 64;

/// What stands between the parts of a name.
const SEPARATOR: char = '.';

impl From<bool> for ParameterValue {
    fn from(value: bool) -> Self {
        ParameterValue { r#type: ParameterType::PARAMETER_BOOL, bool_value: value, ..ParameterValue::default() }
    }
}

impl From<i64> for ParameterValue {
    fn from(value: i64) -> Self {
        ParameterValue { r#type: ParameterType::PARAMETER_INTEGER, integer_value: value, ..ParameterValue::default() }
    }
}

impl From<f64> for ParameterValue {
    fn from(value: f64) -> Self {
        ParameterValue { r#type: ParameterType::PARAMETER_DOUBLE, double_value: value, ..ParameterValue::default() }
    }
}

impl From<String> for ParameterValue {
    fn from(value: String) -> Self {
        ParameterValue { r#type: ParameterType::PARAMETER_STRING, string_value: value, ..ParameterValue::default() }
    }
}

impl From<Vec<i64>> for ParameterValue {
    fn from(value: Vec<i64>) -> Self {
        ParameterValue {
            r#type: ParameterType::PARAMETER_INTEGER_ARRAY,
            integer_array_value: value,
            ..ParameterValue::default()
        }
    }
}

impl From<Vec<f64>> for ParameterValue {
    fn from(value: Vec<f64>) -> Self {
        ParameterValue {
            r#type: ParameterType::PARAMETER_DOUBLE_ARRAY,
            double_array_value: value,
            ..ParameterValue::default()
        }
    }
}

/// A parameter with what there is to know of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DeclaredParameter {
    /// Its value.
    pub value: ParameterValue,
    /// Everything else.
    pub descriptor: ParameterDescriptor,
}

impl DeclaredParameter {
    /// One that stays as it is.
    #[must_use]
    pub fn fixed(name: &str, value: impl Into<ParameterValue>, description: &str) -> Self {
        let value = value.into();
        let descriptor = ParameterDescriptor {
            name: name.to_owned(),
            r#type: value.r#type,
            description: description.to_owned(),
            read_only: true,
            ..ParameterDescriptor::default()
        };
        DeclaredParameter { value, descriptor }
    }

    /// With a range of numbers; that of a whole number has whole ends.
    #[must_use]
    pub fn with_range(mut self, low: f64, high: f64) -> Self {
        match self.value.r#type {
            ParameterType::PARAMETER_INTEGER => {
                let range = IntegerRange { from_value: low as i64, to_value: high as i64, step: 0 };
                self.descriptor.integer_range = vec![range];
            }
            ParameterType::PARAMETER_DOUBLE => {
                self.descriptor.floating_point_range =
                    vec![FloatingPointRange { from_value: low, to_value: high, step: 0.0 }]
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

    fn check(&self, value: &ParameterValue) -> Result<(), String> {
        let ParameterDescriptor { name, read_only, floating_point_range, integer_range, .. } = &self.descriptor;
        if *read_only {
            return Err(format!("{name} is read-only"));
        }
        if value.r#type != self.value.r#type {
            return Err(format!("{name} has type {}, not {}", kind_name(self.value.r#type), kind_name(value.r#type)));
        }
        if let [FloatingPointRange { from_value, to_value, .. }] = floating_point_range[..]
            && !(from_value..=to_value).contains(&value.double_value)
        {
            return Err(format!("{name} = {}: expected {from_value} to {to_value}", value.double_value));
        }
        if let [IntegerRange { from_value, to_value, .. }] = integer_range[..]
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
    by_name: BTreeMap<String, DeclaredParameter>,
}

impl Parameters {
    /// Adds parameters, in the place of those with the same name.
    pub fn declare(&mut self, parameters: impl IntoIterator<Item = DeclaredParameter>) {
        self.by_name.extend(parameters.into_iter().map(|parameter| (parameter.descriptor.name.clone(), parameter)));
    }

    /// The values of these, in this order, as many as fit into an answer; of what there is not,
    /// [`PARAMETER_NOT_SET`](ParameterType::PARAMETER_NOT_SET).
    #[must_use]
    pub fn values(&self, names: &[String]) -> Vec<ParameterValue> {
        let value = |name: &String| self.by_name.get(name).map(|known| known.value.clone()).unwrap_or_default();
        fitting(names.iter().take(NAMES_MAX).map(value))
    }

    /// What there is to know of these, in this order, as many as fit into an answer; of what there
    /// is not, its name.
    #[must_use]
    pub fn descriptors(&self, names: &[String]) -> Vec<ParameterDescriptor> {
        let descriptor = |name: &String| match self.by_name.get(name) {
            Some(known) => known.descriptor.clone(),
            None => ParameterDescriptor { name: name.clone(), ..ParameterDescriptor::default() },
        };
        fitting(names.iter().take(NAMES_MAX).map(descriptor))
    }

    /// The names that begin with one of the prefixes (none: all), and have at most `depth` parts
    /// more than it (0: any), as many as fit into an answer; if there is room, with the prefixes
    /// that lead to them.
    #[must_use]
    pub fn list(&self, prefixes: &[String], depth: u64) -> ListParametersResult {
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
        let listed = ListParametersResult { prefixes: prefixes.into_iter().collect(), names };
        if fits(&listed) { listed } else { ListParametersResult { prefixes: Vec::new(), names: fitting(listed.names) } }
    }

    /// Sets one.
    ///
    /// # Errors
    /// If there is none of that name, or it cannot have that value; then nothing changes.
    pub fn set(&mut self, parameter: &Parameter) -> Result<(), String> {
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
    pub fn set_all(&mut self, parameters: &[Parameter]) -> Result<(), String> {
        parameters.iter().try_for_each(|parameter| self.check(parameter))?;
        parameters.iter().try_for_each(|parameter| self.set(parameter))
    }

    fn check(&self, Parameter { name, value }: &Parameter) -> Result<(), String> {
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

impl From<Result<(), String>> for SetParametersResult {
    fn from(set: Result<(), String>) -> Self {
        SetParametersResult { successful: set.is_ok(), reason: set.err().unwrap_or_default() }
    }
}

impl SetParametersResponse {
    /// What became of these, as many as fit into an answer.
    #[must_use]
    pub fn of(outcomes: impl IntoIterator<Item = Result<(), String>>) -> Self {
        SetParametersResponse { results: fitting(outcomes.into_iter().map(SetParametersResult::from)) }
    }
}

#[cfg(test)]
mod tests;
