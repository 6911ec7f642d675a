//! `maes view`: a recording in a browser or in Rerun, a map, a run that begins paused, or runs that
//! are started on the page, one after the other.

mod browser;
mod export;
#[cfg(feature = "ros")]
mod live;
mod map_room;
mod page;
mod rerun;

use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::bail;
use clap::{ArgMatches, Args};
use foxglove_server::{DEFAULT_ADDRESS, FoxgloveServerError, PageOrigin, StaticFileServer, Token};
use map_files::MapReader;
use mapgen::ImportOptions;
use recording::Recording;
use recording::location::is_recording;
use sim_server::cli::recording_path;
use sim_server::exit;

use crate::map::{self, MapCliError};
use crate::output::print;
use crate::run::RunArgs;
use crate::signals;
use browser::Browser;
use map_room::MapRoom;

const FILE_HELP: &str = "A recording (.mcap, or its rosbag2 folder), a map of any known format, or a scenario (.toml) with any flag of \
                         `maes run` [default: runs are started on the page]";

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
    /// A second recording, shown beside the first one with the time linked
    #[arg(long, value_name = "FILE.mcap", value_parser = recording_path())]
    beside: Option<PathBuf>,
    /// Write a folder with the page and the recording, or both of them, for any static web server,
    /// and show nothing; a folder with files in it is refused
    #[arg(long, value_name = "DIR", conflicts_with_all = ["address", "browser", "view_allow_origin"])]
    export: Option<PathBuf>,
    /// Show a recording in the viewer Rerun instead of a browser, also while a run writes it; needs
    /// Python with the packages `maes` and `rerun-sdk`
    #[arg(long, conflicts_with_all = ["address", "beside", "browser", "export"])]
    rerun: bool,
    /// Save a recording as a file for the viewer Rerun, and show nothing
    #[arg(long, value_name = "FILE.rrd", conflicts_with_all = ["address", "beside", "browser", "export", "rerun"])]
    rerun_save: Option<PathBuf>,
    /// Whether to open a browser [default: if there is a desktop]
    #[arg(long, value_name = "true|false")]
    browser: Option<bool>,
    /// Build the page, and nothing else
    #[arg(long, value_name = "true|false", num_args = 0..=1, default_missing_value = "true")]
    build_only: Option<bool>,
    /// The folder of the recordings of runs that are started on the page; the server names them
    /// [default: out/recordings]
    #[arg(long, value_name = "DIR")]
    record_dir: Option<PathBuf>,
    /// The folder of the map files that runs started on the page may name [default: the folder of
    /// the project's scenarios, if it is here]
    #[arg(long, value_name = "DIR")]
    map_dir: Option<PathBuf>,
    #[command(flatten)]
    run: RunArgs,
    /// Length of a cell's edge of a map in metres [default: that of the file, or 1]
    #[arg(long, value_name = "M", help_heading = "Maps")]
    cell_m: Option<f64>,
    /// How a map is read.
    #[command(flatten, next_help_heading = "Maps")]
    import: ImportOptions,
}

/// Flags that are not of a run.
const OF_THE_PAGE: [&str; 2] = ["page", "view_allow_origin"];

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
    let ViewArgs { run, address, beside, export, rerun, rerun_save, browser, build_only, record_dir, map_dir, .. } =
        args;
    let ViewArgs { cell_m, import, .. } = args;
    let file = run.scenario.clone();
    let is_recording = file.as_deref().is_some_and(is_recording);
    let is_map = file.as_deref().is_some_and(is_map);
    if let Some(file) = &file
        && !file.is_file()
        && !is_map
    {
        bail!("{}: no such file; expected a recording (.mcap), a map or a scenario (.toml)", file.display());
    }
    let of_maps = import.given().next().or(cell_m.map(|_| "cell_m"));
    if let Some(name) = of_maps.filter(|_| !is_map) {
        bail!("--{}: only with a map, as in `maes view cave.obj`", name.replace('_', "-"));
    }
    if let Some(flag) = RunArgs::first_flag(given, &OF_THE_PAGE) {
        match &file {
            Some(_) if is_recording => bail!("{flag}: a recording is shown as it is; leave it out"),
            Some(_) if is_map => bail!("{flag}: a map is shown without a run; leave it out"),
            None => bail!("{flag}: runs that are started on the page have their settings from there; leave it out"),
            Some(_) => {}
        }
    }
    let folders = [("record-dir", record_dir), ("map-dir", map_dir)];
    if let (Some(_), Some((name, _))) = (&file, folders.iter().find(|(_, folder)| folder.is_some())) {
        bail!("--{name}: only for runs that are started on the page; leave it out, or the file");
    }
    if build_only == Some(true) {
        return Ok(match page::build_only() {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => page::failed(&error),
        });
    }
    if beside.is_some() && !is_recording {
        bail!("--beside: expected two recordings, as in `maes view a.mcap --beside b.mcap`");
    }
    if let Some(folder) = &export {
        if !is_recording {
            bail!("--export: expected a recording, as in `maes view run.mcap --export DIR`");
        }
        export::check_folder(folder)?;
    }
    let for_rerun = if rerun { Some("--rerun") } else { rerun_save.is_some().then_some("--rerun-save") };
    if let Some(flag) = for_rerun.filter(|_| !is_recording) {
        bail!("{flag}: expected a recording; that of a run under way is the file of `maes run --record run.mcap`");
    }
    for recording in file.iter().filter(|_| is_recording).chain(&beside) {
        // What is no recording is reported here, and not in the browser.
        Recording::open_messages(recording)?;
    }
    if let (Some(recording), Some(flag)) = (&file, for_rerun) {
        return Ok(rerun::show(recording, flag, rerun_save));
    }
    #[cfg(not(feature = "ros"))]
    if !is_recording && !is_map {
        bail!("{}; expected a recording (.mcap) or a map", crate::run::WITHOUT_ROS);
    }
    let room = match &file {
        Some(file) if is_map => Some(room_of(file, &import, cell_m)?),
        _ => None,
    };
    if export.is_none()
        && let Err(error) = TcpListener::bind(&address)
    {
        // Before the page is built, and before a server names it as its own flag.
        tracing::error!("--address {address}: {error}; choose another port, or 0 for a free one");
        return Ok(ExitCode::from(exit::FAILED));
    }
    let page = match page::folder(run.page.as_deref()) {
        Ok(page) => page,
        Err(error) => return Ok(page::failed(&error)),
    };
    if let (Some(folder), Some(recording)) = (&export, &file) {
        return Ok(export_recording(folder, page.path(), recording, beside.as_deref()));
    }
    let shown = Shown {
        page: page.path().to_owned(),
        address,
        browser,
        token: Token::of_environment()?,
        origins: run.view_allow_origin.clone(),
    };
    if let (Some(file), Some(room)) = (&file, room) {
        return show_map(file, room, shown);
    }
    match file {
        Some(file) if is_recording => show(shown, |page, address, token, origins| {
            StaticFileServer::open(address, page, &file, beside.as_deref(), token, origins)
        }),
        #[cfg(feature = "ros")]
        Some(_) => live::show_run(run, given, shown),
        #[cfg(feature = "ros")]
        None => live::serve_idle(&run, folders, shown),
        #[cfg(not(feature = "ros"))]
        _ => unreachable!("refused above"),
    }
}

/// Copies the page into a folder, if one was built or is part of this program; returns whether.
pub(crate) fn copy_page(folder: &Path) -> anyhow::Result<bool> {
    let Some(page) = page::built() else { return Ok(false) };
    export::copy_folder(page.path(), folder)?;
    Ok(true)
}

/// Where something is shown, and to whom.
struct Shown {
    page: PathBuf,
    address: String,
    browser: Option<bool>,
    token: Token,
    /// Origins whose pages may connect as well.
    origins: Vec<PageOrigin>,
}

/// Whether a path is that of a map: a known format, or a folder of pictures.
fn is_map(file: &Path) -> bool {
    (file.is_file() && MapReader::of(file).is_ok()) || file.is_dir()
}

fn export_recording(folder: &Path, page: &Path, recording: &Path, beside: Option<&Path>) -> ExitCode {
    match export::export(folder, page, recording, beside) {
        Ok(lines) => {
            lines.iter().for_each(|line| print(line));
            ExitCode::SUCCESS
        }
        Err(error) => {
            tracing::error!("{error}");
            ExitCode::from(error.exit_code())
        }
    }
}

/// Reads and repairs a map, as a run does.
fn room_of(file: &Path, import: &ImportOptions, cell_m: Option<f64>) -> Result<MapRoom, MapCliError> {
    let spec = map::import(file, import, cell_m)?;
    let imported = spec.read()?;
    for note in imported.notes.iter().filter(|note| note.is_warning) {
        tracing::warn!("{}", note.text);
    }
    let terrain = mapgen::repair(&spec.file, imported.terrain, 0)?.terrain;
    Ok(MapRoom::new(file.to_owned(), &spec, terrain))
}

/// Shows a map, in a format that the page reads, from a folder that lasts as long.
fn show_map(file: &Path, room: MapRoom, shown: Shown) -> anyhow::Result<ExitCode> {
    let folder = tempfile::tempdir()?;
    let mut name = file.file_name().unwrap_or_default().to_os_string();
    if file.extension().is_none_or(|extension| extension != "m3dm") {
        name.push(".m3dm");
    }
    let packed = folder.path().join(name);
    std::fs::write(&packed, room.packed())?;
    let answers = room.answers();
    show(shown, |page, address, token, origins| {
        StaticFileServer::open_map(address, page, &packed, answers, token, origins)
    })
}

/// Shows what a server serves until it is interrupted.
fn show(
    shown: Shown,
    serve: impl FnOnce(&Path, &str, Token, &[PageOrigin]) -> Result<StaticFileServer, FoxgloveServerError>,
) -> anyhow::Result<ExitCode> {
    let Shown { page, address, browser, token, origins } = shown;
    let server = match serve(&page, &address, token, &origins) {
        Ok(server) => server,
        Err(error) => {
            tracing::error!("{error}");
            return Ok(ExitCode::from(exit::FAILED));
        }
    };
    // Before the address is printed: whoever reads it may interrupt this at once.
    let interrupted = signals::first()?;
    print(&server.url());
    if let Some(note) = server.address().note() {
        tracing::info!("{note}");
    }
    Browser::new(browser).open(&server.url());
    interrupted();
    Ok(ExitCode::SUCCESS)
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
