//! Errors of the command line: one line for a value that is not allowed; for everything else the
//! usage of the command, with the nearest name.

use std::error::Error as _;
use std::process::ExitCode;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use sim_server::exit;

use crate::output::say;

/// Prints what is wrong, or the help that was asked for; the exit code.
pub(crate) fn report(error: &clap::Error) -> ExitCode {
    if let Some(line) = one_line(error) {
        say(&format!("error: {line}"));
        return ExitCode::from(exit::BAD_INPUT);
    }
    drop(error.print());
    ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(exit::BAD_INPUT))
}

fn one_line(error: &clap::Error) -> Option<String> {
    let text = |kind| match error.get(kind)? {
        ContextValue::String(text) => Some(text.as_str()),
        _ => None,
    };
    // Without its placeholder, as in `--seed <K>`.
    let name = text(ContextKind::InvalidArg).map(|name| match name.split_once([' ', '[']) {
        Some((name, _)) if name.starts_with('-') => name,
        _ => name,
    })?;
    let value = text(ContextKind::InvalidValue);
    match error.kind() {
        ErrorKind::UnknownArgument if !name.starts_with('-') => {
            Some(format!("unexpected argument: {name} (see --help)"))
        }
        ErrorKind::InvalidValue if value.is_none_or(str::is_empty) => Some(format!("{name} needs a value")),
        ErrorKind::InvalidValue => {
            let Some(ContextValue::Strings(allowed)) = error.get(ContextKind::ValidValue) else { return None };
            let nearest = text(ContextKind::SuggestedValue);
            let nearest = nearest.map_or_else(String::new, |nearest| format!("; did you mean {nearest}?"));
            Some(format!("{name} {}: expected {}{nearest}", value?, listed(allowed)))
        }
        ErrorKind::ValueValidation => Some(format!("{name} {}: {}", value?, error.source()?)),
        _ => None,
    }
}

/// `a, b or c`
fn listed(names: &[String]) -> String {
    match names {
        [first @ .., last] if !first.is_empty() => format!("{} or {last}", first.join(", ")),
        names => names.concat(),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::Cli;

    fn refused(line: &str) -> clap::Error {
        Cli::command().try_get_matches_from(line.split(' ')).unwrap_err()
    }

    #[test]
    fn values_are_refused_in_one_line() {
        for (line, expected) in [
            ("maes run --seed", "--seed needs a value"),
            ("maes run --agents five", "--agents five: invalid digit found in string"),
            ("maes run --size 3x4", "--size 3x4: expected a number of cells, or three joined by x, such as 100x80x30"),
            ("maes run --order sideways", "--order sideways: expected forward, reverse or shuffle"),
            (
                "maes run --order reversed",
                "--order reversed: expected forward, reverse or shuffle; did you mean reverse?",
            ),
            ("maes run --external two", "--external two: expected ids of agents, such as 0,3"),
            ("maes run --agents-per-process 0", "--agents-per-process 0: expected a number from 1, or auto"),
            ("maes run --agent-set speed", "--agent-set speed: expected KEY=VALUE"),
            ("maes run a.toml b.toml", "unexpected argument: b.toml (see --help)"),
            ("maes snapshot a.mcap --at 1 --out a.jpg", "--out a.jpg: expected a name that ends in .png"),
            ("maes batch p.toml --out o --part 4/4", "--part 4/4: expected K/N, such as 0/4, with K from 0 to N - 1"),
        ] {
            assert_eq!(one_line(&refused(line)).as_deref(), Some(expected), "{line}");
        }
    }

    #[test]
    fn unknown_names_are_shown_with_the_usage_and_the_nearest_name() {
        for (line, usage, nearest) in [
            ("maes run --agent 5", "Usage: maes run", "'--agents'"),
            ("maes vierw a.mcap", "Usage: maes", "'view'"),
            ("maes map generte", "Usage: maes map", "'generate'"),
        ] {
            let error = refused(line);
            assert_eq!(one_line(&error), None, "{line}");
            let text = error.to_string();
            assert!(text.contains(usage) && text.contains(nearest), "{text}");
        }
    }
}
