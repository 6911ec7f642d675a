//! Parsers of flags with whole numbers: their errors say what is allowed, and not what the type of
//! the number allows.

use std::num::NonZero;
use std::ops::RangeInclusive;
use std::str::FromStr;

use simulation::scenario::keys;

/// The parser of a flag that sets a key with a whole number: its errors say what the key allows,
/// and not what the type of the number does.
///
/// # Panics
/// When it parses, if there is no such key.
pub fn of_key<T: FromStr>(key: &'static str) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync {
    move |text| {
        let known = keys::find(key).expect("a flag sets a key of the scenario");
        text.parse().map_err(|_| known.expected())
    }
}

/// The parser of a flag with a whole number in a range: its errors say which.
pub fn whole<T: FromStr>(range: RangeInclusive<u64>) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync {
    move |text| {
        let is_in_range = text.parse::<u64>().is_ok_and(|number| range.contains(&number));
        let number = is_in_range.then(|| text.parse().ok()).flatten();
        number.ok_or_else(|| match (range.start(), range.end()) {
            (low, &u64::MAX) => format!("expected a whole number from {low}"),
            (low, high) => format!("expected a whole number from {low} to {high}"),
        })
    }
}

/// Parses a flag with a count of one or more.
///
/// # Errors
/// What is expected.
pub fn positive(text: &str) -> Result<NonZero<usize>, String> {
    whole(1..=u64::MAX)(text)
}
