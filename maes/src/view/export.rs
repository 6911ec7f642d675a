//! `maes view --export`: a folder with the page and recordings, for any static web server.
//!
//! Links that the page copies while `maes view` serves the same recordings have the same queries.
//! The exported page knows its recordings by a `meta` element, so that its address alone opens them
//! (`viewer/src/app/exported.ts`).

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use foxglove_server::RecordingPaths;
use sim_server::exit;
use thiserror::Error;

/// The port of `python3 -m http.server`.
const TRIED_PORT: u16 = 8000;

/// Where a page names itself as such, before what an exported one adds.
const HEAD: &str = "<head>";

/// Why nothing can be exported.
#[derive(Debug, Error)]
pub(super) enum ExportError {
    #[error("--export {}: {what}; expected a new or an empty folder", .folder.display())]
    Folder { folder: PathBuf, what: &'static str },
    #[error("{}: not a page: it has no {HEAD}", .0.display())]
    Page(PathBuf),
    #[error("{}: {source}", .path.display())]
    Io { path: PathBuf, source: io::Error },
}

impl ExportError {
    fn of(path: &Path) -> impl FnOnce(io::Error) -> Self {
        |source| Self::Io { path: path.to_owned(), source }
    }

    pub(super) fn exit_code(&self) -> u8 {
        match self {
            Self::Folder { .. } | Self::Page(_) => exit::BAD_INPUT,
            Self::Io { .. } => exit::FAILED,
        }
    }
}

/// Refuses a folder that has something in it.
pub(super) fn check_folder(folder: &Path) -> Result<(), ExportError> {
    let refused = |what| Err(ExportError::Folder { folder: folder.to_owned(), what });
    match fs::read_dir(folder).map(|mut entries| entries.next().is_none()) {
        Ok(true) => Ok(()),
        Ok(false) => refused("not empty"),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        Err(error) if error.kind() == io::ErrorKind::NotADirectory => refused("not a folder"),
        Err(error) => Err(ExportError::of(folder)(error)),
    }
}

/// Writes the folder; returns how to try it, in lines.
pub(super) fn export(
    folder: &Path,
    page: &Path,
    recording: &Path,
    beside: Option<&Path>,
) -> Result<Vec<String>, ExportError> {
    check_folder(folder)?;
    let paths = RecordingPaths::of(recording, beside);
    copy_folder(page, folder)?;
    let index = folder.join("index.html");
    let html = fs::read_to_string(&index).map_err(ExportError::of(&index))?;
    let html = with_query(&html, &paths.query()).ok_or_else(|| ExportError::Page(page.join("index.html")))?;
    fs::write(&index, html).map_err(ExportError::of(&index))?;
    for (file, path) in [(Some(recording), Some(&paths.recording)), (beside, paths.beside.as_ref())] {
        let (Some(file), Some(path)) = (file, path) else { continue };
        copy(file, &folder.join(path))?;
    }
    let shown = folder.display().to_string();
    let is_plain = shown.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"/._-".contains(&byte));
    let quoted = if is_plain { shown.clone() } else { format!("{shown:?}") };
    Ok(vec![
        format!("exported to {shown}: any static web server shows it"),
        format!("to try it: python3 -m http.server --directory {quoted}"),
        format!("http://127.0.0.1:{TRIED_PORT}/?{}", paths.query()),
    ])
}

/// The page with the query that it has if its address names no recording.
fn with_query(html: &str, query: &str) -> Option<String> {
    let at = html.find(HEAD)? + HEAD.len();
    let (before, after) = html.split_at(at);
    let content = query.replace('&', "&amp;");
    Some(format!("{before}\n    <meta name=\"maes-query\" content=\"{content}\" />{after}"))
}

pub(super) fn copy_folder(from: &Path, to: &Path) -> Result<(), ExportError> {
    for entry in fs::read_dir(from).map_err(ExportError::of(from))? {
        let entry = entry.map_err(ExportError::of(from))?;
        let (source, copied) = (entry.path(), to.join(entry.file_name()));
        if source.is_dir() {
            copy_folder(&source, &copied)?;
        } else {
            copy(&source, &copied)?;
        }
    }
    Ok(())
}

/// Copies a file, into a folder that is made.
fn copy(from: &Path, to: &Path) -> Result<(), ExportError> {
    if let Some(folder) = to.parent() {
        fs::create_dir_all(folder).map_err(ExportError::of(folder))?;
    }
    fs::copy(from, to).map_err(ExportError::of(to))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exported_folder_is_complete() {
        let site = tempfile::tempdir().unwrap();
        let path = |name: &str| site.path().join(name);
        fs::create_dir_all(path("page/assets")).unwrap();
        for (name, text) in [
            ("page/index.html", "<html><head><title>MAES</title></head></html>"),
            ("page/assets/page.js", "code"),
            ("a.mcap", "one"),
            ("b c.mcap", "two"),
        ] {
            fs::write(path(name), text).unwrap();
        }
        let output = export(&path("out/it's"), &path("page"), &path("a.mcap"), Some(&path("b c.mcap"))).unwrap();
        let query = "recording=recording/a.mcap&beside=beside/recording.mcap";
        assert_eq!(output[2], format!("http://127.0.0.1:8000/?{query}"));
        assert!(output[1].ends_with("/out/it's\""), "{}", output[1]);
        let read = |name: &str| fs::read_to_string(path("out/it's").join(name)).unwrap();
        assert_eq!(read("assets/page.js"), "code");
        assert_eq!(read("recording/a.mcap"), "one");
        assert_eq!(read("beside/recording.mcap"), "two");
        let meta =
            "<meta name=\"maes-query\" content=\"recording=recording/a.mcap&amp;beside=beside/recording.mcap\" />";
        assert!(read("index.html").starts_with(&format!("<html><head>\n    {meta}<title>")));
    }

    #[test]
    fn a_folder_with_files_is_refused() {
        let site = tempfile::tempdir().unwrap();
        let message = |folder: &Path| check_folder(folder).err().map(|error| error.to_string());
        assert_eq!(message(site.path()), None);
        assert_eq!(message(&site.path().join("new")), None);
        let file = site.path().join("file");
        fs::write(&file, "").unwrap();
        for (folder, what) in [(site.path(), "not empty"), (&file, "not a folder")] {
            let expected = format!("--export {}: {what}; expected a new or an empty folder", folder.display());
            assert_eq!(message(folder), Some(expected));
        }
    }
}
