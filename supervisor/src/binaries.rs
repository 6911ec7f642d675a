//! The folder of the binaries, and which program of it is called.
//!
//! `cargo install` of `maes` installs that program alone, so `maes` is the world server and the
//! agents as well: `maes sim_server ...` is what `sim_server ...` is.

use std::path::{Path, PathBuf};

use crate::SupervisorError;

/// The environment variable that names another folder than that of the running program.
pub const FOLDER_VARIABLE: &str = "MAES_BIN_DIR";

/// The folder with `sim_server` and `agent_node`: that of `MAES_BIN_DIR`, or that of this program.
///
/// # Errors
/// If the system does not say where this program lies.
pub fn folder() -> Result<PathBuf, SupervisorError> {
    if let Some(folder) = std::env::var_os(FOLDER_VARIABLE).filter(|folder| !folder.is_empty()) {
        return Ok(folder.into());
    }
    let program = std::env::current_exe().and_then(|program| program.canonicalize());
    let program = program.map_err(|source| SupervisorError::io("the folder of the binaries", source))?;
    Ok(program.parent().map(Into::into).unwrap_or_default())
}

/// The program and its first arguments that are `sim_server` or `agent_node`: the one of that name
/// in a folder, or else `maes` there.
#[must_use]
pub fn program(folder: &Path, name: &str) -> Vec<PathBuf> {
    let alone = folder.join(name);
    if !alone.exists() {
        let maes = folder.join("maes");
        if maes.exists() {
            return vec![maes, name.into()];
        }
    }
    vec![alone]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maes_stands_in_for_programs_that_are_not_installed() {
        let folder = tempfile::tempdir().unwrap();
        let [maes, server] = ["maes", "sim_server"].map(|name| folder.path().join(name));
        // An error names the missing program, and not `maes`.
        assert_eq!(program(folder.path(), "sim_server"), std::slice::from_ref(&server));
        std::fs::write(&maes, "").unwrap();
        assert_eq!(program(folder.path(), "sim_server"), [maes, "sim_server".into()]);
        std::fs::write(&server, "").unwrap();
        assert_eq!(program(folder.path(), "sim_server"), [server]);
    }
}
