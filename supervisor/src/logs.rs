//! The folder of a run's logs.

use std::path::{Path, PathBuf};

use chrono::Local;

/// Where logs go unless a folder is named: `out/logs/<time>-<pid>` below the present folder.
#[must_use]
pub fn default_folder() -> PathBuf {
    let time = Local::now().format("%Y%m%d-%H%M%S");
    Path::new("out/logs").join(format!("{time}-{}", std::process::id()))
}
