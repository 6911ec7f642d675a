//! `maes view`: a recording in a browser, a run that begins paused, or runs that are started on the
//! page, one after the other.

mod browser;
mod page;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, bail};
use clap::{ArgMatches, Args};
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use sim_server::exit;
use sim_server::foxglove::{DEFAULT_ADDRESS, StaticFileServer};
use sim_server::recording::Recording;
use supervisor::idle::IdleServer;
use supervisor::{binaries, logs};

use crate::output::{print, say};
use crate::run::{self, RunArgs, is_given};
use crate::signals;
use browser::Browser;

const FILE_HELP: &str = "A recording (.mcap), or a scenario (.toml) with any flag of `maes run` \
                         [default: runs are started on the page]";

/// Arguments of `view`.
#[derive(Debug, Args)]
#[command(
    mut_arg("scenario", |arg| arg.value_name("FILE").help(FILE_HELP)),
    mut_arg("view", |arg| arg.hide(true)),
)]
pub(crate) struct ViewArgs {
    /// Where the page is; port 0: a free one
    #[arg(long, value_name = "ADDR:PORT", default_value = DEFAULT_ADDRESS, value_parser = address)]
    address: String,
    /// Whether to open a browser [default: if there is a desktop]
    #[arg(long, value_name = "true|false")]
    browser: Option<bool>,
    /// Build the page, and nothing else
    #[arg(long, value_name = "true|false", num_args = 0..=1, default_missing_value = "true")]
    build_only: Option<bool>,
    #[command(flatten)]
    run: RunArgs,
}

/// Flags that are not of a run.
const OF_THE_PAGE: [&str; 1] = ["page"];

fn address(text: &str) -> Result<String, String> {
    let port = text.rsplit_once(':').map(|(_, port)| port.parse::<u16>());
    if matches!(port, Some(Ok(_))) {
        Ok(text.to_owned())
    } else {
        Err("expected ADDR:PORT, such as 127.0.0.1:8765".to_owned())
    }
}

/// Shows something in a browser until it ends or is interrupted.
pub(crate) fn view(args: ViewArgs, given: &ArgMatches) -> anyhow::Result<ExitCode> {
    let ViewArgs { run, address, browser, build_only } = args;
    let file = run.scenario.clone();
    let is_recording = file.as_deref().is_some_and(is_recording);
    if let Some(file) = &file
        && !file.is_file()
    {
        bail!("{}: no such file; expected a recording (.mcap) or a scenario (.toml)", file.display());
    }
    if let Some(flag) = RunArgs::first_flag(given, &OF_THE_PAGE) {
        match &file {
            Some(_) if is_recording => bail!("{flag}: a recording is shown as it is; leave it out"),
            None => bail!("{flag}: runs that are started on the page have their settings from there; leave it out"),
            Some(_) => {}
        }
    }
    if build_only == Some(true) {
        return Ok(match page::build_only() {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => page::failed(&error),
        });
    }
    if is_recording {
        // What is no recording is reported here, and not in the browser.
        Recording::open(file.as_deref().unwrap_or(Path::new("")))?;
    }
    let page = match page::folder(run.page.as_deref()) {
        Ok(page) => page,
        Err(error) => return Ok(page::failed(&error)),
    };
    match file {
        Some(file) if is_recording => show_recording(&file, &page, &address, browser),
        Some(_) => show_run(run, given, page, &address, browser),
        None => serve_idle(page, address, browser),
    }
}

fn is_recording(file: &Path) -> bool {
    file.extension().is_some_and(|extension| extension == "mcap")
}

fn show_recording(file: &Path, page: &Path, address: &str, browser: Option<bool>) -> anyhow::Result<ExitCode> {
    let server = match StaticFileServer::open(address, page, file) {
        Ok(server) => server,
        Err(error) => {
            say(&format!("error: {error}"));
            return Ok(ExitCode::from(exit::FAILED));
        }
    };
    // Before the address is printed: whoever reads it may interrupt this at once.
    let mut signals = Signals::new([SIGINT, SIGTERM]).context("handling signals")?;
    print(&server.url());
    Browser::new(browser).open(&server.url());
    signals.forever().next();
    Ok(ExitCode::SUCCESS)
}

fn show_run(
    mut run: RunArgs,
    given: &ArgMatches,
    page: PathBuf,
    address: &str,
    browser: Option<bool>,
) -> anyhow::Result<ExitCode> {
    if is_given(given, "view") {
        bail!("--view: here, the page is at --address ADDR:PORT");
    }
    run.view = Some(address.to_owned());
    run.page = Some(page);
    let mut server_flags = run.server_flags(given);
    if !is_given(given, "paused") {
        run.begin_paused();
        server_flags.push("--paused=true".into());
    }
    let _opening = Browser::new(browser).open_when_served(address);
    run::run_with(&run, server_flags)
}

fn serve_idle(page: PathBuf, address: String, browser: Option<bool>) -> anyhow::Result<ExitCode> {
    let interruptions = signals::count()?;
    let logs = logs::default_folder();
    let server = IdleServer { binaries: binaries::folder()?, address, page: Some(page), logs };
    let mut opening = None;
    let begun = || opening = Some(Browser::new(browser).open_when_served(&server.address));
    let code = server.supervise(&interruptions, begun)?;
    drop(opening);
    Ok(ExitCode::from(code))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses() {
        for right in ["127.0.0.1:8765", "[::1]:0", "host:65535", ":80"] {
            assert_eq!(address(right).as_deref(), Ok(right));
        }
        for wrong in ["", "8765", "host", "host:", "host:70000", "host:-1"] {
            assert!(address(wrong).is_err(), "{wrong}");
        }
    }
}
