//! Runs on the page: one that begins paused, at five times real time, or one after the other as
//! they are started there.

use std::net::{SocketAddr, TcpStream};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::Duration;

use anyhow::bail;
use clap::ArgMatches;
use foxglove_server::{ServerAddress, Token};
use supervisor::idle::IdleServer;
use supervisor::{binaries, logs};

use super::Shown;
use super::browser::Browser;
use crate::run::{RunArgs, flag, is_given, processes};
use crate::signals;

/// Wall time between two attempts to connect, and their number.
const PERIOD: Duration = Duration::from_millis(100);
const ATTEMPTS: usize = 600;

/// An attempt to open the page, given up when this is dropped.
struct Opening {
    _given_up: Sender<()>,
}

/// Shows a run that begins paused.
pub(super) fn show_run(mut run: RunArgs, given: &ArgMatches, shown: Shown) -> anyhow::Result<ExitCode> {
    if is_given(given, "view") {
        bail!("--view: here, the page is at --address ADDR:PORT");
    }
    run.view = Some(shown.address.clone());
    run.page = Some(shown.page);
    let mut server_flags = run.server_flags(given);
    if !is_given(given, "paused") {
        run.begin_paused();
        server_flags.push("--paused=true".into());
    }
    run.check_transport()?;
    server_flags.extend(run.flags_of_view(given, true)?);
    let _opening = open_when_served(Browser::new(shown.browser), &shown.address, &shown.token);
    processes::run(&run, server_flags, Some(&shown.token))
}

/// Shows the runs that are started on the page. `folders` are flags of the server by their names.
pub(super) fn serve_idle(
    run: &RunArgs,
    folders: [(&str, Option<PathBuf>); 2],
    shown: Shown,
) -> anyhow::Result<ExitCode> {
    let folders = folders.into_iter().filter_map(|(name, folder)| Some(flag(name, folder?)));
    let server_flags = run.origin_flags().chain(folders).collect();
    let Shown { page, address, browser, token, .. } = shown;
    let interruptions = signals::count()?;
    let logs = logs::default_folder();
    let server_env = processes::token_env(&token);
    let binaries = binaries::folder()?;
    let server = IdleServer { binaries, address, page: Some(page), server_flags, server_env, logs };
    let mut opening = None;
    let begun = || opening = Some(open_when_served(Browser::new(browser), &server.address, &token));
    let code = server.supervise(&interruptions, begun)?;
    drop(opening);
    Ok(ExitCode::from(code))
}

/// Shows the page at an address `ADDR:PORT` once a server accepts connections there: whoever
/// reads the address may open it, or interrupt the command, at once.
fn open_when_served(browser: Browser, address: &str, token: &Token) -> Opening {
    let (given_up, is_given_up) = channel();
    let bound = address.parse::<SocketAddr>();
    let address = bound.map_or_else(|_| address.to_owned(), |bound| ServerAddress::from(bound).to_string());
    let url = format!("http://{address}/?token={}", token.as_str());
    if !matches!(browser, Browser::None) {
        thread::spawn(move || {
            for _ in 0..ATTEMPTS {
                if TcpStream::connect(&address).is_ok() {
                    return browser.open(&url);
                }
                if is_given_up.recv_timeout(PERIOD) == Err(RecvTimeoutError::Disconnected) {
                    return;
                }
            }
        });
    }
    Opening { _given_up: given_up }
}
