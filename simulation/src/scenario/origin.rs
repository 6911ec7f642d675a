//! Where the values of a scenario come from: a line of the file, or a flag. Only error messages
//! need it, so nothing is looked up before there is an error.

use toml::Spanned;
use toml::de::{DeArray, DeTable, Error};

use super::diagnosis::first_problem;
use super::{Override, ScenarioError, one_line};

/// What the parser of TOML says of a key that is there twice.
const DUPLICATE_KEY: &str = "duplicate key";

/// The text of a scenario and the flags that change it.
#[derive(Debug, Clone, Copy)]
pub struct Origins<'a> {
    file: &'a str,
    text: &'a str,
    overrides: &'a [Override],
}

impl<'a> Origins<'a> {
    /// `file` is the name for error messages; later overrides win.
    #[must_use]
    pub fn new(file: &'a str, text: &'a str, overrides: &'a [Override]) -> Self {
        Self { file, text, overrides }
    }

    /// What gave a key its value: the flag as typed, or `FILE:LINE`; the file alone if nothing
    /// names the key.
    #[must_use]
    pub fn of(&self, key: &str) -> String {
        let is_part = |whole: &str, part: &str| {
            part.strip_prefix(whole).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
        };
        let flag = self.overrides.iter().rev().find(|change| is_part(&change.key, key) || is_part(key, &change.key));
        if let Some(flag) = flag {
            return one_line(&flag.origin);
        }
        match self.place(key) {
            Some((line, _)) => format!("{}:{line}", self.file),
            None => self.file.to_owned(),
        }
    }

    /// The error of a text that is no scenario.
    pub(super) fn syntax(&self, error: &Error) -> ScenarioError {
        let spans = DeTable::parse(self.text).ok();
        let table: Option<toml::Table> = toml::from_str(self.text).ok();
        let spans = spans.as_ref().map(Spanned::get_ref);
        let first = table.as_ref().and_then(|table| first_problem(table, spans, &|_| true).0);
        let (at, reason) = match first {
            Some(problem) => (problem.at.unwrap_or(0), problem.text),
            None => (error.span().map_or(0, |span| span.start), syntax_text(error, self.text)),
        };
        let (line, column) = position(self.text, at);
        ScenarioError::Syntax { file: self.file.to_owned(), line, column, reason: one_line(&reason) }
    }

    /// The error of an override after which the keys are no scenario.
    pub(super) fn unfit(change: &Override, keys: &toml::Table, error: &Error) -> ScenarioError {
        let (first, _) = first_problem(keys, None, &|name| name.starts_with(&change.key));
        let reason = first.map_or_else(|| error.message().to_owned(), |problem| problem.text);
        ScenarioError::Override { origin: one_line(&change.origin), reason: one_line(&reason) }
    }

    /// Line and column, from 1, of the innermost part of a path that the text names.
    fn place(&self, key: &str) -> Option<(usize, usize)> {
        let root = DeTable::parse(self.text).ok()?;
        let mut table = Some(root.get_ref());
        let mut list: Option<&DeArray<'_>> = None;
        let mut start = None;
        for part in key.replace('[', ".[").split('.') {
            let (at, value) = match (table, list) {
                (Some(keys), _) => {
                    let Some((key, value)) = keys.get_key_value(part) else { break };
                    (key.span().start, value)
                }
                (None, Some(entries)) => {
                    let index = part.trim_matches(['[', ']']).parse::<usize>().ok();
                    let Some(value) = index.and_then(|index| entries.get(index)) else { break };
                    (value.span().start, value)
                }
                (None, None) => break,
            };
            start = Some(at);
            table = value.get_ref().as_table();
            list = value.get_ref().as_array();
        }
        start.map(|start| position(self.text, start))
    }
}

/// Line and column of a byte, both from 1, the column in characters.
fn position(text: &str, byte: usize) -> (usize, usize) {
    let before = &text[..byte.min(text.len())];
    let line_start = before.rfind('\n').map_or(0, |at| at + 1);
    (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
}

/// What is wrong with a text that is no TOML; a key that is there twice is named.
#[must_use]
pub fn syntax_text(error: &Error, text: &str) -> String {
    let named = error.span().filter(|_| error.message() == DUPLICATE_KEY).and_then(|span| text.get(span));
    named.map_or_else(|| error.message().to_owned(), |key| format!("{DUPLICATE_KEY} {key}"))
}
