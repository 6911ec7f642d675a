//! A recording in the viewer Rerun, by the Python package.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use sim_server::exit;
use system::os;
use thiserror::Error;

use super::browser::in_path;
use crate::run;

/// Names the interpreter.
const INTERPRETER: &str = "MAES_PYTHON";

/// Without it, the first of these in the path that has the packages.
const INTERPRETERS: [&str; 2] = ["python3", "python"];

/// The module that sends a recording to Rerun.
const MODULE: &str = "maes.rerun";

/// Why there is no interpreter with the packages.
#[derive(Debug, Error)]
enum NoInterpreter {
    #[error("there is no python3 in the path")]
    None,
    #[error("{}: {reason}", interpreter.display())]
    Unfit { interpreter: PathBuf, reason: String },
}

/// Shows a recording in a window of Rerun, or saves it as a file of Rerun, as `flag` asks. Replaces
/// this process; returns if that fails.
pub(super) fn show(recording: &Path, flag: &str, save: Option<PathBuf>) -> ExitCode {
    let interpreter = match interpreter() {
        Ok(interpreter) => interpreter,
        Err(reason) => {
            tracing::error!(
                "{flag}: it needs Python with the packages `maes` and `rerun-sdk`, and {reason}; `pip \
                 install './python[rerun]'` in a checkout installs both, and {INTERPRETER} names another interpreter"
            );
            return ExitCode::from(exit::FAILED);
        }
    };
    let mut command = command(&interpreter);
    command.args(["-m", MODULE]).args(save.map(|file| run::flag("save", file))).arg("--").arg(recording);
    os::become_program(&mut command).unwrap_or_else(|error| {
        tracing::error!("{}: {error}", interpreter.display());
        ExitCode::from(exit::FAILED)
    })
}

fn interpreter() -> Result<PathBuf, NoInterpreter> {
    let given = std::env::var_os(INTERPRETER).filter(|given| !given.is_empty());
    let candidates: Vec<PathBuf> = match given {
        Some(given) => vec![PathBuf::from(given)],
        None => INTERPRETERS.iter().filter_map(|name| in_path(name)).collect(),
    };
    let mut first_unfit = None;
    for interpreter in candidates {
        match import(&interpreter) {
            Ok(()) => return Ok(interpreter),
            Err(reason) => {
                first_unfit.get_or_insert(NoInterpreter::Unfit { interpreter, reason });
            }
        }
    }
    Err(first_unfit.unwrap_or(NoInterpreter::None))
}

/// Whether an interpreter has the packages; otherwise why not.
fn import(interpreter: &Path) -> Result<(), String> {
    let output = command(interpreter).arg("-c").arg(format!("import {MODULE}")).output();
    let output = output.map_err(|error| error.to_string())?;
    if output.status.success() {
        return Ok(());
    }
    let text = String::from_utf8_lossy(&output.stderr);
    Err(text.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it fails without a word").to_owned())
}

/// An interpreter that imports nothing from the working folder, which may be anybody's.
fn command(interpreter: &Path) -> Command {
    let mut command = Command::new(interpreter);
    command.env("PYTHONSAFEPATH", "1");
    command
}
