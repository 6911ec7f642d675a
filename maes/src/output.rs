//! Where text goes: results to stdout, everything else to stderr. A reader that is gone is no
//! failure, and control characters are escaped: text may come from files and messages.

use std::io::Write;

use msgs::printable;

/// Prints a result.
pub(crate) fn print(text: &str) {
    drop(writeln!(std::io::stdout(), "{}", printable::text(text)));
}

/// Prints a note or an error.
pub(crate) fn say(text: &str) {
    drop(writeln!(std::io::stderr(), "{}", printable::text(text)));
}
