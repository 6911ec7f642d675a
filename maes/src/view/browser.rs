//! Opening the page in the user's browser.

use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::Duration;

use sim_server::foxglove::Token;

use crate::output::say;

/// Opens an address on a desktop.
const OPENER: &str = "xdg-open";

/// Wall time between two attempts to connect, and their number.
const PERIOD: Duration = Duration::from_millis(100);
const ATTEMPTS: usize = 600;

/// How the page is shown.
pub(super) enum Browser {
    Opened,
    /// There is no desktop: the user is given the address.
    Named,
    None,
}

/// An attempt to open the page, given up when this is dropped.
pub(super) struct Opening {
    _given_up: Sender<()>,
}

impl Browser {
    /// `wanted` is what the user asks for; without it a browser is opened if there is a desktop.
    pub(super) fn new(wanted: Option<bool>) -> Self {
        let is_set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
        let has_desktop = || is_set("DISPLAY") || is_set("WAYLAND_DISPLAY");
        match wanted {
            Some(false) => Self::None,
            _ if in_path(OPENER).is_some() && (wanted == Some(true) || has_desktop()) => Self::Opened,
            _ => Self::Named,
        }
    }

    /// Shows a page that is served.
    pub(super) fn open(&self, url: &str) {
        match self {
            Self::Opened => {
                let mut opener = Command::new(OPENER);
                opener.arg(url).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
                // Without a browser the address is there still.
                thread::spawn(move || drop(opener.status()));
            }
            Self::Named => say(&format!("open {url} in a browser")),
            Self::None => {}
        }
    }

    /// Shows the page at an address `ADDR:PORT` once a server accepts connections there: whoever
    /// reads the address may open it, or interrupt the command, at once.
    pub(super) fn open_when_served(self, address: &str, token: &Token) -> Opening {
        let (given_up, is_given_up) = channel();
        let url = format!("http://{address}/?token={}", token.as_str());
        let address = address.to_owned();
        if !matches!(self, Self::None) {
            thread::spawn(move || {
                for _ in 0..ATTEMPTS {
                    if TcpStream::connect(&address).is_ok() {
                        return self.open(&url);
                    }
                    if is_given_up.recv_timeout(PERIOD) == Err(RecvTimeoutError::Disconnected) {
                        return;
                    }
                }
            });
        }
        Opening { _given_up: given_up }
    }
}

/// A program of the search path.
pub(super) fn in_path(name: &str) -> Option<PathBuf> {
    let folders = std::env::var_os("PATH")?;
    std::env::split_paths(&folders).map(|folder| folder.join(name)).find(|program| program.is_file())
}
