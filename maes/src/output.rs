//! Where text goes: results to stdout, everything else to stderr. A reader that is gone is no
//! failure.

use std::io::Write;

/// Prints a result.
pub(crate) fn print(text: &str) {
    drop(writeln!(std::io::stdout(), "{text}"));
}

/// Prints a note or an error.
pub(crate) fn say(text: &str) {
    drop(writeln!(std::io::stderr(), "{text}"));
}
