//! A recording in the viewer Rerun, by the module `maes.rerun` of the Python package.

use std::io::ErrorKind;
use std::path::Path;
use std::process::{Command, ExitCode};

use anyhow::{Context, bail};
use sim_server::exit;

const PYTHON: &str = "python3";

const REMEDY: &str = "--rerun needs the Python packages maes and rerun-sdk: pip install './python[rerun]'";

/// Opens a recording in Rerun, or writes the file that Rerun opens. The exit code of Python.
pub(super) fn show(recording: &Path, save: Option<&Path>) -> anyhow::Result<ExitCode> {
    check_package()?;
    let mut python = Command::new(PYTHON);
    python.args(["-m", "maes.rerun"]).arg(recording);
    if let Some(file) = save {
        python.arg("--save").arg(file);
    }
    let ended = python.status().context(PYTHON)?;
    Ok(ended.code().map_or(ExitCode::from(exit::FAILED), |code| ExitCode::from(code.clamp(0, 255) as u8)))
}

/// Fails unless Python has what is needed, with the line in which it says what is missing.
fn check_package() -> anyhow::Result<()> {
    let checked = match Command::new(PYTHON).args(["-c", "import maes.rerun"]).output() {
        Ok(checked) => checked,
        Err(error) if error.kind() == ErrorKind::NotFound => bail!("{PYTHON}: no such program; {REMEDY}"),
        Err(error) => return Err(error).context(PYTHON),
    };
    if !checked.status.success() {
        let complaint = String::from_utf8_lossy(&checked.stderr);
        bail!("{PYTHON}: {}; {REMEDY}", complaint.lines().next_back().unwrap_or("it fails"));
    }
    Ok(())
}
