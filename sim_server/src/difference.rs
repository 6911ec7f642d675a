//! A field in which two messages differ: the first by name.
//!
//! Messages are compared as they are encoded: numbers bit by bit, so that NaN is equal to itself and 0 is not -0.
//!
//! This module knows no message in particular.

use msgs::cdr;
use serde::Serialize;
use serde_json::Value;

/// Says what is different, such as `position.x: 1.0 is now 2.0`, or nothing if the messages are the same.
#[must_use]
pub fn between<M: Serialize>(before: &M, now: &M) -> Option<String> {
    if cdr::encode(before) == cdr::encode(now) {
        return None;
    }
    let value = |message: &M| serde_json::to_value(message).unwrap_or(Value::Null);
    let words = first("", &value(before), &value(now));
    // Numbers that JSON cannot say.
    Some(words.unwrap_or_else(|| "a number that is none, or the sign of a zero".to_owned()))
}

fn first(field: &str, before: &Value, now: &Value) -> Option<String> {
    match (before, now) {
        (Value::Object(before), Value::Object(now)) => before.iter().find_map(|(name, value)| {
            let field = if field.is_empty() { name.clone() } else { format!("{field}.{name}") };
            first(&field, value, now.get(name).unwrap_or(&Value::Null))
        }),
        (Value::Array(before), Value::Array(now)) if before.len() != now.len() => {
            Some(format!("{field}: {} values are now {}", before.len(), now.len()))
        }
        (Value::Array(before), Value::Array(now)) => {
            let pairs = before.iter().zip(now).enumerate();
            pairs.into_iter().find_map(|(at, (before, now))| first(&format!("{field}[{at}]"), before, now))
        }
        _ if before == now => None,
        _ => Some(format!("{field}: {before} is now {now}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use msgs::maes_msgs::{Command, Observation};

    #[test]
    fn the_first_field_is_named_with_both_values() {
        let before = Command::default();
        assert_eq!(between(&before, &before.clone()), None);
        let mut now = before.clone();
        now.task.distance_m = 1.5;
        now.want_view = true;
        assert_eq!(between(&before, &now).unwrap(), "task.distance_m: 0.0 is now 1.5");
        let seen = |cells| {
            let mut observation = Observation::default();
            observation.seen_free.length = cells;
            observation
        };
        assert_eq!(between(&seen(vec![1, 2]), &seen(vec![1, 3])).unwrap(), "seen_free.length[1]: 2 is now 3");
        assert_eq!(between(&seen(vec![1]), &seen(vec![1, 3])).unwrap(), "seen_free.length: 1 values are now 2");
    }

    #[test]
    fn numbers_are_compared_bit_by_bit() {
        let with = |distance_m| {
            let mut command = Command::default();
            command.task.distance_m = distance_m;
            command
        };
        assert_eq!(between(&with(f64::NAN), &with(f64::NAN)), None);
        assert!(between(&with(0.0), &with(-0.0)).is_some());
        assert!(between(&with(f64::NAN), &with(f64::INFINITY)).unwrap().contains("a number that is none"));
    }
}
