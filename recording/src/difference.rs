//! The first field, by name, in which two messages differ.
//!
//! Messages are compared in encoded form: numbers bitwise, so that NaN equals itself and 0 differs
//! from -0.
//!
//! This module works for any message type.

use std::fmt;

use msgs::cdr;
use serde::Serialize;
use serde_json::Value;

/// A field with its two values as JSON, displayed as `position.x was 1.0 and is 2.0`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    /// Path in the message, such as `motion.path[3].x`.
    pub name: String,
    /// Value in the first message.
    pub before: String,
    /// Value in the second message.
    pub now: String,
}

impl fmt::Display for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, before, now } = self;
        write!(f, "{name} was {before} and is {now}")
    }
}

/// The first field that differs, or `None` if the messages are equal.
#[must_use]
pub fn between<M: Serialize>(before: &M, now: &M) -> Option<Field> {
    if cdr::encode(before) == cdr::encode(now) {
        return None;
    }
    let value = |message: &M| serde_json::to_value(message).unwrap_or(Value::Null);
    Some(first("", &value(before), &value(now)).unwrap_or_else(|| Field {
        name: "a number".to_owned(),
        before: "none or infinite".to_owned(),
        now: "another of these".to_owned(),
    }))
}

fn first(field: &str, before: &Value, now: &Value) -> Option<Field> {
    let named = |before: String, now: String| Some(Field { name: field.to_owned(), before, now });
    match (before, now) {
        (Value::Object(before), Value::Object(now)) => before.iter().find_map(|(name, value)| {
            let field = if field.is_empty() { name.clone() } else { format!("{field}.{name}") };
            first(&field, value, now.get(name).unwrap_or(&Value::Null))
        }),
        (Value::Array(before), Value::Array(now)) if before.len() != now.len() => {
            let count = |values: &[Value]| format!("a list of {}", values.len());
            named(count(before), count(now))
        }
        (Value::Array(before), Value::Array(now)) => {
            let pairs = before.iter().zip(now).enumerate();
            pairs.into_iter().find_map(|(at, (before, now))| first(&format!("{field}[{at}]"), before, now))
        }
        // As text, in which 0.0 differs from -0.0.
        _ => {
            let (before, now) = (before.to_string(), now.to_string());
            if before == now { None } else { named(before, now) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use msgs::maes_msgs::{Command, Observation};

    #[test]
    fn first_different_field_is_named() {
        let before = Command::default();
        assert_eq!(between(&before, &before.clone()), None);
        let mut now = before.clone();
        now.motion.distance_m = 1.5;
        now.want_view = true;
        let words = |before, now| between(before, now).unwrap().to_string();
        assert_eq!(words(&before, &now), "motion.distance_m was 0.0 and is 1.5");
        let seen = |cells| {
            let mut observation = Observation::default();
            observation.seen_free.length = cells;
            observation
        };
        let words = |before, now| between(&seen(before), &seen(now)).unwrap().to_string();
        assert_eq!(words(vec![1, 2], vec![1, 3]), "seen_free.length[1] was 2 and is 3");
        assert_eq!(words(vec![1], vec![1, 3]), "seen_free.length was a list of 1 and is a list of 2");
    }

    #[test]
    fn numbers_are_compared_bitwise() {
        let with = |distance_m| {
            let mut command = Command::default();
            command.motion.distance_m = distance_m;
            command
        };
        assert_eq!(between(&with(f64::NAN), &with(f64::NAN)), None);
        assert_eq!(between(&with(0.0), &with(-0.0)).unwrap().to_string(), "motion.distance_m was 0.0 and is -0.0");
        assert_eq!(between(&with(f64::NAN), &with(f64::INFINITY)).unwrap().name, "a number");
    }
}
