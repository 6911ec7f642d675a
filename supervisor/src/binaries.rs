//! The folder of the binaries.

use std::path::PathBuf;

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
