//! Settings of a controller: `KEY=VALUE` texts, each of which the controller takes once.

use std::collections::BTreeMap;

use thiserror::Error;

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

    /// Takes a whole number from `low` to `high`.
    ///
    /// # Errors
    /// If the value is no such number.
    pub fn integer(&mut self, key: &'static str, default: u64, low: u64, high: u64) -> Result<u64, SettingError> {
        self.known.push(key);
        let Some(value) = self.left.remove(key) else {
            return Ok(default);
        };
        match value.parse::<u64>() {
            Ok(number) if (low..=high).contains(&number) => Ok(number),
            _ => Err(SettingError::Value {
                key: key.to_owned(),
                value,
                allowed: format!("expected a whole number from {low} to {high}"),
            }),
        }
    }

    /// Takes one of several words, as its position among them. The default is the first one.
    ///
    /// # Errors
    /// If the value is none of them.
    pub fn word(&mut self, key: &'static str, allowed: &[&str]) -> Result<usize, SettingError> {
        self.known.push(key);
        let Some(value) = self.left.remove(key) else {
            return Ok(0);
        };
        allowed.iter().position(|word| *word == value).ok_or_else(|| SettingError::Value {
            key: key.to_owned(),
            value,
            allowed: format!("expected one of {}", allowed.join(", ")),
        })
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
