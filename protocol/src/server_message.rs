//! What the data of messages of the server to an agent have in common.

use msgs::cdr;
use msgs::ids::Tick;
use serde::de::DeserializeOwned;

use crate::wire_error::WireError;

/// A number of a message, and the least and the greatest value that a run can have: field, value,
/// least, greatest.
pub(crate) type Bounded = (&'static str, f64, f64, f64);

/// An error about a value in the observation of a tick.
pub(crate) fn wrong(tick: Tick, field: &'static str, value: impl ToString, allowed: impl ToString) -> WireError {
    WireError::Value { tick, field, value: value.to_string(), allowed: allowed.to_string() }
}

/// The message in the data of the observation of a tick. `allowed` names its type.
///
/// # Errors
/// If they are none of that type.
pub(crate) fn decode<M: DeserializeOwned>(data: &[u8], tick: Tick, allowed: &str) -> Result<M, WireError> {
    cdr::decode(data).map_err(|error| wrong(tick, "messages", error, allowed))
}

/// Checks the numbers of a message.
///
/// # Errors
/// For the first that is out of range.
pub(crate) fn check(tick: Tick, numbers: impl IntoIterator<Item = Bounded>) -> Result<(), WireError> {
    match numbers.into_iter().find(|&(_, value, least, most)| !(least..=most).contains(&value)) {
        Some((field, value, least, most)) => Err(wrong(tick, field, value, format_args!("{least} to {most}"))),
        None => Ok(()),
    }
}
