//! Errors of the command line: one line for a value that is not allowed; for everything else the
//! usage of the command, with the nearest name.

use std::error::Error as _;
use std::num::{IntErrorKind, ParseFloatError, ParseIntError};
use std::process::ExitCode;

use agent_node::controllers::did_you_mean;
use clap::CommandFactory as _;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use sim_server::exit;

/// Prints what is wrong, or the help that was asked for; the exit code.
pub(crate) fn report(error: &clap::Error) -> ExitCode {
    if let Some(line) = one_line(error) {
        tracing::error!("{line}");
        return ExitCode::from(exit::BAD_INPUT);
    }
    if let Err(failure) = error.print()
        && !error.use_stderr()
        && failure.kind() != std::io::ErrorKind::BrokenPipe
    {
        tracing::error!("stdout: {failure}");
        return ExitCode::from(exit::FAILED);
    }
    ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(exit::BAD_INPUT))
}

fn one_line(error: &clap::Error) -> Option<String> {
    if error.kind() == ErrorKind::InvalidSubcommand {
        return unknown_command(error);
    }
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
        ErrorKind::ValueValidation => Some(format!("{name} {}: {}", value?, reason(error.source()?))),
        _ => None,
    }
}

/// What is expected, in words: the library's own errors speak of digits and literals.
fn reason(source: &(dyn std::error::Error + 'static)) -> String {
    if let Some(error) = source.downcast_ref::<ParseIntError>() {
        return match error.kind() {
            IntErrorKind::PosOverflow | IntErrorKind::NegOverflow => "out of range; expected a whole number".to_owned(),
            IntErrorKind::Zero => "expected a whole number from 1".to_owned(),
            _ => "expected a whole number, in digits".to_owned(),
        };
    }
    if source.is::<ParseFloatError>() {
        return "expected a number, such as 2.5".to_owned();
    }
    let text = source.to_string();
    match text.rsplit_once(" is not in ").and_then(|(_, range)| range.split_once("..")) {
        Some((low, high)) if high.starts_with('=') => format!("expected a whole number from {low} to {}", &high[1..]),
        Some((low, "")) => format!("expected a whole number from {low}"),
        _ => text,
    }
}

/// A word that is no command: the nearest one, and where all are listed.
fn unknown_command(error: &clap::Error) -> Option<String> {
    let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidSubcommand) else { return None };
    let Some(ContextValue::StyledStr(usage)) = error.get(ContextKind::Usage) else { return None };
    let usage = usage.to_string();
    // `Usage: maes map <COMMAND>`
    let path: Vec<&str> = usage.split_whitespace().skip(1).take_while(|part| !part.starts_with(['<', '['])).collect();
    let program = crate::Cli::command();
    let command = path.iter().skip(1).try_fold(&program, |command, name| command.find_subcommand(name));
    let names: Vec<&str> =
        command?.get_subcommands().filter(|command| !command.is_hide_set()).map(clap::Command::get_name).collect();
    let nearest = did_you_mean(word, &names);
    Some(format!("no command {word:?}{nearest} (`{} --help` lists all)", path.join(" ")))
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
            ("maes run --agents five", "--agents five: expected an integer, 1 to 1000"),
            ("maes run --agents -1", "--agents -1: expected an integer, 1 to 1000"),
            ("maes run --agents 4294967296", "--agents 4294967296: expected an integer, 1 to 1000"),
            ("maes run --seed -1", "--seed -1: expected a seed from 0 to 9223372036854775807"),
            ("maes run --threads x", "--threads x: expected an integer, 0 to 1024"),
            ("maes batch p.toml --out o --jobs two", "--jobs two: expected a whole number from 1"),
            ("maes batch p.toml --out o --first-domain x", "--first-domain x: expected a whole number from 0 to 101"),
            (
                "maes map generate --size 30 --radius-max big --output a.m3dm",
                "--radius-max big: expected an integer (cells), 0 to 510",
            ),
            ("maes rnu", "no command \"rnu\"; did you mean `run`? (`maes --help` lists all)"),
            ("maes vierw a.mcap", "no command \"vierw\"; did you mean `view`? (`maes --help` lists all)"),
            ("maes map generte", "no command \"generte\"; did you mean `generate`? (`maes map --help` lists all)"),
            ("maes something", "no command \"something\" (`maes --help` lists all)"),
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
            ("maes map convert --step-max 1", "Usage: maes map convert", "'--steps-max'"),
        ] {
            let error = refused(line);
            assert_eq!(one_line(&error), None, "{line}");
            let text = error.to_string();
            assert!(text.contains(usage) && text.contains(nearest), "{text}");
        }
    }
}
