//! Opening the page in the user's browser.

use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::thread;

use system::diagnostics::REQUESTED;

/// The program that opens an address on a desktop, with its first arguments.
const OPENER: &[&str] = if cfg!(windows) {
    &["rundll32.exe", "url.dll,FileProtocolHandler"]
} else if cfg!(target_os = "macos") {
    &["open"]
} else {
    &["xdg-open"]
};

/// How the page is shown.
pub(super) enum Browser {
    Opened,
    /// There is no desktop: the user is given the address.
    Named,
    None,
}

impl Browser {
    /// `wanted` is what the user asks for; without it a browser is opened if there is a desktop.
    pub(super) fn new(wanted: Option<bool>) -> Self {
        let is_set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
        let has_desktop = || cfg!(any(windows, target_os = "macos")) || is_set("DISPLAY") || is_set("WAYLAND_DISPLAY");
        match wanted {
            Some(false) => Self::None,
            _ if in_path(OPENER[0]).is_some() && (wanted == Some(true) || has_desktop()) => Self::Opened,
            _ => Self::Named,
        }
    }

    /// Shows a page that is served.
    pub(super) fn open(&self, url: &str) {
        match self {
            Self::Opened => {
                let mut opener = Command::new(OPENER[0]);
                opener.args(&OPENER[1..]).arg(url).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
                // Without a browser the address is there still.
                thread::spawn(move || drop(opener.status()));
            }
            Self::Named => tracing::info!(target: REQUESTED, "open {url} in a browser"),
            Self::None => {}
        }
    }
}

/// A program of the search path.
pub(super) fn in_path(name: &str) -> Option<PathBuf> {
    let folders = std::env::var_os("PATH")?;
    std::env::split_paths(&folders).map(|folder| folder.join(name)).find(|program| program.is_file())
}
