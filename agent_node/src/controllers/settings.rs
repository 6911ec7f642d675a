//! Settings of a controller: `KEY=VALUE` texts, each of which the controller takes once.

use std::collections::BTreeMap;

use thiserror::Error;

use crate::travel::SearchTime;

/// Why a setting does not fit.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SettingError {
    /// It is no `KEY=VALUE`.
    #[error("setting `{text}`: expected KEY=VALUE")]
    NoAssignment {
        /// The text.
        text: String,
    },
    /// The controller has no such key.
    #[error("setting `{key}`: unknown; {}", if known.is_empty() { "there are none".to_owned() } else { format!("known are {known}") })]
    Unknown {
        /// The key.
        key: String,
        /// The keys there are.
        known: String,
    },
    /// The value is not allowed.
    #[error("setting {key} = {value}: {allowed}")]
    Value {
        /// The key.
        key: String,
        /// The value.
        value: String,
        /// What is allowed.
        allowed: String,
    },
}

/// Ticks that a search takes in the background: 0.5 s.
const BACKGROUND_TICKS: u64 = 25;

/// The settings that have not been taken yet.
#[derive(Debug, Clone, Default)]
pub struct Settings {
    left: BTreeMap<String, String>,
    known: Vec<&'static str>,
}

impl Settings {
    /// Parses `KEY=VALUE` texts; of two with the same key the later one holds.
    ///
    /// # Errors
    /// If one of them has no `=`.
    pub fn parse(texts: &[String]) -> Result<Self, SettingError> {
        let left = texts
            .iter()
            .map(|text| {
                let assignment = text.split_once('=').ok_or_else(|| SettingError::NoAssignment { text: text.clone() });
                assignment.map(|(key, value)| (key.trim().to_owned(), value.trim().to_owned()))
            })
            .collect::<Result<_, _>>()?;
        Ok(Self { left, known: Vec::new() })
    }

    /// Takes a number from `low` to `high`.
    ///
    /// # Errors
    /// If the value is no such number.
    pub fn number(&mut self, key: &'static str, default: f64, low: f64, high: f64) -> Result<f64, SettingError> {
        self.known.push(key);
        let Some(value) = self.left.remove(key) else {
            return Ok(default);
        };
        match value.parse::<f64>() {
            Ok(number) if number >= low && number <= high => Ok(number),
            _ => Err(SettingError::Value {
                key: key.to_owned(),
                value,
                allowed: format!("expected a number from {low} to {high}"),
            }),
        }
    }

    /// Takes `search_time`, what the search for a path costs: `instant` (nothing), `budgeted` (a tick for every 100 cells that are
    /// looked at: the reference's default) or `background` (half a second); `instant` if it is not given.
    ///
    /// # Errors
    /// If the value is another one.
    pub fn search_time(&mut self) -> Result<SearchTime, SettingError> {
        const KEY: &str = "search_time";
        self.known.push(KEY);
        let Some(value) = self.left.remove(KEY) else {
            return Ok(SearchTime::Instant);
        };
        match value.as_str() {
            "instant" => Ok(SearchTime::Instant),
            "budgeted" => Ok(SearchTime::BUDGETED),
            "background" => Ok(SearchTime::Background(BACKGROUND_TICKS)),
            _ => {
                let allowed = "expected instant, budgeted or background".to_owned();
                Err(SettingError::Value { key: KEY.to_owned(), value, allowed })
            }
        }
    }

    /// To be called when all known keys have been taken.
    ///
    /// # Errors
    /// If there are others.
    pub fn finish(self) -> Result<(), SettingError> {
        match self.left.into_keys().next() {
            None => Ok(()),
            Some(key) => Err(SettingError::Unknown { key, known: self.known.join(", ") }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_search_time_is_one_of_three_words() {
        let taken = |texts: &[&str]| {
            let texts: Vec<String> = texts.iter().map(ToString::to_string).collect();
            Settings::parse(&texts).unwrap().search_time()
        };
        assert_eq!(taken(&[]), Ok(SearchTime::Instant));
        assert_eq!(taken(&["search_time=instant"]), Ok(SearchTime::Instant));
        assert_eq!(taken(&["search_time=budgeted"]), Ok(SearchTime::BUDGETED));
        assert_eq!(taken(&["search_time = background"]), Ok(SearchTime::Background(25)));
        let refused = taken(&["search_time=none"]).unwrap_err().to_string();
        assert_eq!(refused, "setting search_time = none: expected instant, budgeted or background");
    }
}
