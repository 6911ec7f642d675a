//! The page: found beside the binaries, built from its sources with npm, or part of this program
//! (feature `embedded_page`).

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::time::SystemTime;

use foxglove_server::FoxgloveServerError;
use sim_server::exit;
use system::wall_clock;
use thiserror::Error;

use super::browser::in_path;

/// What the page is made of, from the folder of its sources; folders with all that is in them.
const SOURCES: [&str; 4] = ["src", "index.html", "package-lock.json", "vite.config.ts"];

/// Why there is no page.
#[derive(Debug, Error)]
pub(super) enum PageError {
    #[error(transparent)]
    NoPage(#[from] FoxgloveServerError),
    #[error("npm is missing: install Node.js 20.19 or later, which builds the page in {0}")]
    NoNpm(String),
    #[error(
        "there is no page: neither beside the binaries, nor the sources of the page (viewer/) two folders above them or \
         here; name the folder of a page with --page"
    )]
    NoSources,
    #[cfg(feature = "embedded_page")]
    #[error("unpacking the page into {0}: {1}")]
    Unpack(String, io::Error),
    #[error("building the page: {0}")]
    Build(String),
}

/// Prints an error; the exit code.
pub(super) fn failed(error: &PageError) -> ExitCode {
    tracing::error!("{error}");
    ExitCode::from(match error {
        PageError::Build(_) => exit::FAILED,
        #[cfg(feature = "embedded_page")]
        PageError::Unpack(..) => exit::FAILED,
        PageError::NoPage(_) | PageError::NoNpm(_) | PageError::NoSources => exit::BAD_INPUT,
    })
}

/// The folder of a page. An unpacked one is removed when this is dropped.
pub(super) struct PageFolder {
    path: PathBuf,
    #[cfg(feature = "embedded_page")]
    _unpacked: Option<tempfile::TempDir>,
}

impl PageFolder {
    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

impl From<PathBuf> for PageFolder {
    fn from(path: PathBuf) -> Self {
        Self {
            path,
            #[cfg(feature = "embedded_page")]
            _unpacked: None,
        }
    }
}

/// The folder of the page, built if its sources are here and newer.
pub(super) fn folder(named: Option<&Path>) -> Result<PageFolder, PageError> {
    if named.is_none()
        && let Some(sources) = sources()
    {
        build(&sources, false)?;
        return Ok(sources.join("dist").into());
    }
    match foxglove_server::page(named)? {
        Some(folder) => Ok(folder.into()),
        None => embedded(),
    }
}

/// The page as it was built last; `None` if there is none.
pub(super) fn built() -> Option<PageFolder> {
    let of_sources = sources().map(|sources| sources.join("dist")).filter(|page| page.join("index.html").is_file());
    let beside = || foxglove_server::page(None).ok().flatten();
    of_sources.or_else(beside).map(PageFolder::from).or_else(|| embedded().ok())
}

#[cfg(not(feature = "embedded_page"))]
fn embedded() -> Result<PageFolder, PageError> {
    Err(PageError::NoSources)
}

/// The page that is part of this program, unpacked into a private temporary folder: the world
/// server and the browser get it from there, as any other page.
#[cfg(feature = "embedded_page")]
fn embedded() -> Result<PageFolder, PageError> {
    static PAGE: include_dir::Dir<'_> = include_dir::include_dir!("$CARGO_MANIFEST_DIR/../viewer/dist");

    let unpacked = tempfile::Builder::new().prefix("maes-page-").tempdir();
    let unpacked = unpacked.map_err(|error| PageError::Unpack(std::env::temp_dir().display().to_string(), error))?;
    let refused = |error| PageError::Unpack(unpacked.path().display().to_string(), error);
    PAGE.extract(unpacked.path()).map_err(refused)?;
    Ok(PageFolder { path: unpacked.path().to_owned(), _unpacked: Some(unpacked) })
}

/// Builds the page, and installs what its tools need.
pub(super) fn build_only() -> Result<(), PageError> {
    build(&sources().ok_or(PageError::NoSources)?, true)
}

/// The sources of the page in the workspace whose `target/release` has this program, or below the
/// present folder.
fn sources() -> Option<PathBuf> {
    let program = std::env::current_exe().and_then(|program| program.canonicalize()).unwrap_or_default();
    let workspace = program.ancestors().nth(3).map(|workspace| workspace.join("viewer"));
    let is_sources = |folder: &PathBuf| folder.join("vite.config.ts").is_file();
    workspace.into_iter().chain([PathBuf::from("viewer")]).find(is_sources)
}

/// Builds the page if it is older than its sources; `is_complete` says whether the packages that
/// build it have to be there even if they have nothing to do.
fn build(sources: &Path, is_complete: bool) -> Result<(), PageError> {
    let [packages, lock, built] =
        ["node_modules", "package-lock.json", "dist/index.html"].map(|name| sources.join(name));
    let is_stale = modified(&built).is_none_or(|built| newest(sources) > Some(built));
    if !is_stale && !is_complete {
        return Ok(());
    }
    let lacks_packages = modified(&packages).is_none_or(|packages| modified(&lock) > Some(packages));
    if !is_stale && !lacks_packages {
        return Ok(());
    }
    if in_path("npm").is_none() {
        return Err(PageError::NoNpm(sources.display().to_string()));
    }
    if lacks_packages {
        tracing::info!("fetching the packages that build the page; this takes some minutes, once");
        npm(sources, &["ci", "--no-audit", "--no-fund", "--loglevel=error"])?;
        touch(&packages).map_err(|error| PageError::Build(format!("{}: {error}", packages.display())))?;
    }
    if is_stale {
        tracing::info!("building the page");
        npm(sources, &["run", "--silent", "build"])?;
    }
    Ok(())
}

fn npm(folder: &Path, arguments: &[&str]) -> Result<(), PageError> {
    let mut npm = Command::new("npm");
    npm.args(arguments).current_dir(folder).stdin(Stdio::null()).stdout(io::stderr());
    match npm.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(PageError::Build(format!("npm {}: {status}", arguments[0]))),
        Err(error) => Err(PageError::Build(format!("npm: {error}"))),
    }
}

fn modified(path: &Path) -> Option<SystemTime> {
    fs::metadata(path).and_then(|metadata| metadata.modified()).ok()
}

/// When the sources were changed last.
fn newest(folder: &Path) -> Option<SystemTime> {
    let mut open: Vec<PathBuf> = SOURCES.iter().map(|name| folder.join(name)).collect();
    let mut newest = None;
    while let Some(path) = open.pop() {
        newest = newest.max(modified(&path));
        open.extend(fs::read_dir(&path).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path())));
    }
    newest
}

/// npm leaves the time of the folder as it was if there is nothing to change.
fn touch(folder: &Path) -> io::Result<()> {
    File::open(folder)?.set_modified(wall_clock::system_time())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_is_stale_when_a_source_is_newer() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::create_dir_all(path("src/app")).unwrap();
        for name in ["src/app/main.ts", "index.html"] {
            fs::write(path(name), "").unwrap();
        }
        let first = newest(folder.path()).unwrap();
        let later = first + std::time::Duration::from_secs(5);
        File::options().write(true).open(path("src/app/main.ts")).unwrap().set_modified(later).unwrap();
        assert_eq!(newest(folder.path()), Some(later));
        assert_eq!(modified(&path("dist/index.html")), None);
    }

    #[test]
    fn a_named_folder_needs_a_page() {
        let empty = tempfile::tempdir().unwrap();
        let Err(refused) = super::folder(Some(empty.path())) else { panic!("an empty folder is no page") };
        let refused = refused.to_string();
        assert!(refused.ends_with(": expected a folder with index.html"), "{refused}");
        fs::write(empty.path().join("index.html"), "a page").unwrap();
        assert_eq!(super::folder(Some(empty.path())).unwrap().path(), empty.path());
    }
}
