//! Commands that are part of `maes` now: their old names work for one more version.

use std::ffi::OsString;
use std::io;
use std::path::PathBuf;
use std::process::{Command, ExitCode};

use crate::exit;
use system::os;

/// Replaces this process by `maes`, and prints a line about it on stderr: `old` and `new` are the
/// command as people know it and as it is called now. Returns if there is no such program.
pub fn exec(old: &str, new: &str, arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    eprintln!("note: `{old}` is now `{new}`");
    let failed = |what: String, error: io::Error| {
        eprintln!("error: {what}: {error}; `cargo build --release` builds it");
        ExitCode::from(exit::FAILED)
    };
    match maes() {
        Ok(program) => {
            let became = os::become_program(Command::new(&program).args(arguments));
            became.unwrap_or_else(|error| failed(program.display().to_string(), error))
        }
        Err(error) => failed("maes".to_owned(), error),
    }
}

/// The program in the folder that `MAES_BIN_DIR` names, or beside this one.
fn maes() -> io::Result<PathBuf> {
    let folder = match std::env::var_os("MAES_BIN_DIR").filter(|folder| !folder.is_empty()) {
        Some(folder) => PathBuf::from(folder),
        None => std::env::current_exe()?.parent().map(PathBuf::from).unwrap_or_default(),
    };
    Ok(folder.join("maes"))
}
