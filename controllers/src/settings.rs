//! Settings of a controller: `KEY=VALUE` texts, each of which the controller takes once.

use std::collections::BTreeMap;
use std::fmt;
use std::num::NonZeroU64;

use thiserror::Error;

use super::suggestion::did_you_mean;
use agent::navigation::SearchTime;
use agent::path::Budgeted;

/// Why a setting is refused.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum SettingError {
    /// The text is no `KEY=VALUE`.
    #[error("setting `{text}`: expected KEY=VALUE")]
    NoAssignment {
        /// The text.
        text: String,
    },
    /// The controller has no such key.
    #[error("setting `{key}`: unknown; {}", known_are(key, known))]
    Unknown {
        /// The key.
        key: String,
        /// The keys of the controller.
        known: Vec<&'static str>,
    },
    /// The value is out of range.
    #[error("setting {key} = {value}: {allowed}")]
    Value {
        /// The key.
        key: String,
        /// The value.
        value: String,
        /// The legal values, in words.
        allowed: String,
    },
}

fn known_are(key: &str, known: &[&str]) -> String {
    match known {
        [] => "there are none".to_owned(),
        _ => format!("known are {}{}", known.join(", "), did_you_mean(key, known)),
    }
}

/// Keys as builds with protocol 6 or earlier named them, and their present names. Scenarios and
/// recordings of before have the old ones.
const RENAMED: [(&str, &str); 5] = [
    ("aerial_urgency", "aerial_latency_weight"),
    ("beside_wall", "wall_adjacency_factor"),
    ("pace_m_s", "cruise_speed_m_s"),
    ("trespass_m", "conflict_penalty_m"),
    ("urgency", "latency_weight"),
];

fn present_key(key: &str) -> &str {
    RENAMED.iter().find(|(old, _)| *old == key).map_or(key, |(_, present)| present)
}

/// Ticks that a search takes in the background: 0.5 s.
const BACKGROUND_TICKS: u64 = 25;

/// A setting that a controller has taken.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// The key.
    pub key: &'static str,
    /// The value given, or the default.
    pub value: SettingValue,
    /// The legal values, in words.
    pub allowed: String,
}

/// The value of a setting.
#[derive(Debug, Clone, PartialEq)]
pub enum SettingValue {
    /// A number with its least and greatest legal value.
    Number(f64, f64, f64),
    /// A whole number with its least and greatest legal value.
    Integer(u64, u64, u64),
    /// One of several words.
    Word(String),
}

impl fmt::Display for SettingValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(value, ..) => value.fmt(f),
            Self::Integer(value, ..) => value.fmt(f),
            Self::Word(word) => word.fmt(f),
        }
    }
}

/// The settings of a controller while it takes them.
#[derive(Debug, Clone, Default)]
pub struct Settings {
    left: BTreeMap<String, String>,
    taken: Vec<Setting>,
}

impl Settings {
    /// Parses `KEY=VALUE` texts; of equal keys the last one wins. Keys of earlier builds are read.
    ///
    /// # Errors
    /// If a text has no `=`.
    pub fn parse(texts: &[String]) -> Result<Self, SettingError> {
        let left = texts
            .iter()
            .map(|text| {
                let assignment = text.split_once('=').ok_or_else(|| SettingError::NoAssignment { text: text.clone() });
                assignment.map(|(key, value)| (present_key(key.trim()).to_owned(), value.trim().to_owned()))
            })
            .collect::<Result<_, _>>()?;
        Ok(Self { left, taken: Vec::new() })
    }

    /// Takes a number from `low` to `high`.
    ///
    /// # Errors
    /// If the value is not in the range.
    pub fn number(&mut self, key: &'static str, default: f64, low: f64, high: f64) -> Result<f64, SettingError> {
        let allowed = format!("expected a number from {low} to {high}");
        let number = self.parsed(key, default, &allowed, |text| {
            text.parse().ok().filter(|number: &f64| *number >= low && *number <= high)
        })?;
        self.taken.push(Setting { key, value: SettingValue::Number(number, low, high), allowed });
        Ok(number)
    }

    /// Takes `search_time`, the sim time of path searches: `instant` (none, the default),
    /// `budgeted` (a tick for every `search_cells_per_tick` expanded cells, 100 by default, as in
    /// the reference) or `background` (`search_ticks` ticks, 25 by default).
    ///
    /// # Errors
    /// If a value is out of range.
    pub fn search_time(&mut self) -> Result<SearchTime, SettingError> {
        let per_tick = Budgeted::PER_TICK.get();
        let per_tick = self.integer("search_cells_per_tick", per_tick, 1, 1_000_000_000)?;
        let ticks = self.integer("search_ticks", BACKGROUND_TICKS, 1, 1_000_000)?;
        Ok(match self.word("search_time", &["instant", "budgeted", "background"])? {
            0 => SearchTime::Instant,
            1 => SearchTime::Budgeted(NonZeroU64::new(per_tick).unwrap_or(Budgeted::PER_TICK)),
            _ => SearchTime::Background(ticks),
        })
    }

    /// Takes a whole number from `low` to `high`.
    ///
    /// # Errors
    /// If the value is not in the range.
    pub fn integer(&mut self, key: &'static str, default: u64, low: u64, high: u64) -> Result<u64, SettingError> {
        let allowed = format!("expected a whole number from {low} to {high}");
        let number = self
            .parsed(key, default, &allowed, |text| text.parse().ok().filter(|number| (low..=high).contains(number)))?;
        self.taken.push(Setting { key, value: SettingValue::Integer(number, low, high), allowed });
        Ok(number)
    }

    /// Takes one of several words, as its index. The default is the first one.
    ///
    /// # Errors
    /// If the value is none of them.
    pub fn word(&mut self, key: &'static str, words: &[&str]) -> Result<usize, SettingError> {
        let allowed = format!("expected one of {}", words.join(", "));
        let position = self.parsed(key, 0, &allowed, |text| words.iter().position(|word| *word == text))?;
        let value = words.get(position).map(ToString::to_string).unwrap_or_default();
        self.taken.push(Setting { key, value: SettingValue::Word(value), allowed });
        Ok(position)
    }

    /// Takes the value parsed by `parse`, or the default if there is none.
    fn parsed<V>(
        &mut self,
        key: &'static str,
        default: V,
        allowed: &str,
        parse: impl FnOnce(&str) -> Option<V>,
    ) -> Result<V, SettingError> {
        let Some(value) = self.left.remove(key) else {
            return Ok(default);
        };
        parse(&value).ok_or_else(|| SettingError::Value { key: key.to_owned(), value, allowed: allowed.to_owned() })
    }

    /// Ends the taking of settings, and returns all of them.
    ///
    /// # Errors
    /// If there are unknown keys.
    pub fn finish(self) -> Result<Vec<Setting>, SettingError> {
        match self.left.into_keys().next() {
            None => Ok(self.taken),
            Some(key) => {
                let known = self.taken.iter().map(|setting| setting.key).collect();
                Err(SettingError::Unknown { key, known })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn search_time_is_one_of_three_words() {
        let taken = |texts: &[&str]| {
            let texts: Vec<String> = texts.iter().map(ToString::to_string).collect();
            Settings::parse(&texts).unwrap().search_time()
        };
        assert_eq!(taken(&[]), Ok(SearchTime::Instant));
        assert_eq!(taken(&["search_time=instant"]), Ok(SearchTime::Instant));
        assert_eq!(taken(&["search_time=budgeted"]), Ok(SearchTime::BUDGETED));
        assert_eq!(taken(&["search_time = background"]), Ok(SearchTime::Background(25)));
        let refused = taken(&["search_time=none"]).unwrap_err().to_string();
        assert_eq!(refused, "setting search_time = none: expected one of instant, budgeted, background");
    }

    #[test]
    fn keys_of_earlier_builds_are_read() {
        for (old, present) in RENAMED {
            assert_eq!(parsed(&format!("{old}=2")).number(present, 1.0, 0.0, 3.0), Ok(2.0), "{old}");
        }
    }

    fn parsed(text: &str) -> Settings {
        Settings::parse(&[text.to_owned()]).unwrap()
    }

    #[test]
    fn whole_numbers_and_words_are_checked() {
        assert_eq!(parsed("n=7").integer("n", 1, 0, 9), Ok(7));
        assert_eq!(parsed("m=7").integer("n", 1, 0, 9), Ok(1));
        let refused = parsed("n=1.5").integer("n", 1, 0, 9).unwrap_err();
        assert_eq!(refused.to_string(), "setting n = 1.5: expected a whole number from 0 to 9");
        assert!(parsed("n=10").integer("n", 1, 0, 9).is_err());
        assert_eq!(parsed("w=b").word("w", &["a", "b"]), Ok(1));
        assert_eq!(parsed("n=b").word("w", &["a", "b"]), Ok(0));
        let refused = parsed("w=c").word("w", &["a", "b"]).unwrap_err();
        assert_eq!(refused.to_string(), "setting w = c: expected one of a, b");
    }
}
