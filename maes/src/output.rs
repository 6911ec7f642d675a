//! Results go to stdout, everything else to stderr ([`system::diagnostics`]). A reader that is gone
//! is no failure, and control characters are escaped: text may come from files and messages.

use std::io;
use std::sync::OnceLock;

use msgs::printable;
use system::results;

/// Why a result could not be printed, the first time.
static FAILURE: OnceLock<String> = OnceLock::new();

/// Prints a result.
pub(crate) fn print(text: &str) {
    note(results::write_line(&printable::text(text)));
}

/// Why results could not be printed: the command has failed then, though it has done its work.
pub(crate) fn failure() -> Option<&'static str> {
    FAILURE.get().map(String::as_str)
}

fn note(written: io::Result<()>) {
    if let Err(error) = written {
        let _ = FAILURE.set(format!("stdout: {error}"));
    }
}

/// An error without the system's number of it, which is said in words before: `(os error 2)`.
pub(crate) fn without_numbers(text: &str) -> String {
    let mut parts = text.split(" (os error ");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |said, part| match part.split_once(')') {
        Some((number, rest)) if number.bytes().all(|byte| byte.is_ascii_digit()) => said + rest,
        _ => said + " (os error " + part,
    })
}

/// Prints a text of this program's own making as it is.
pub(crate) fn print_bytes(bytes: &[u8]) {
    note(results::write(bytes));
}

#[cfg(test)]
mod tests {
    use super::without_numbers;

    #[test]
    fn errors_are_words() {
        let plain = |text| without_numbers(text);
        assert_eq!(plain("a.toml: No such file or directory (os error 2)"), "a.toml: No such file or directory");
        assert_eq!(plain("a (os error 2); b (os error 13): c"), "a; b: c");
        assert_eq!(plain("a (os error x) b (os error 3"), "a (os error x) b (os error 3");
    }
}
