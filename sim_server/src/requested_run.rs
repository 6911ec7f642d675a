//! The scenario of a run that a client of an idle server requests: which files it may touch.
//!
//! A client does not choose a path to write: it asks for a recording, and the server makes its name
//! in one folder. A client reads maps of one folder only, and starts no program: a scenario with
//! `agents.command` is refused. So is a map that names a file outside its folder. The answer is the
//! same for a file that is missing and one that is outside, so that it does not tell which files
//! exist.

use std::fs;
use std::path::{Path, PathBuf};

use simulation::scenario::{Override, Scenario};
use thiserror::Error;

use crate::map_file;
use crate::setup::{self, SetupError};
use foxglove_server::StartRequest;

/// The default folder of the recordings of requested runs.
pub const RECORD_DIR: &str = "out/recordings";

/// What the scenario is called in errors.
const NAME: &str = "the scenario";

/// The key of the recording, as table and key.
const RECORD: [&str; 2] = ["execution", "record"];

/// The key of the map file, as table and key.
const MAP_FILE: [&str; 2] = ["map", "file"];

/// Maximum memory of a requested run, bytes: 256 cells along each axis with ten agents have room.
const MEMORY_MAX_BYTES: u64 = 1 << 30;

/// Memory of the world and its generator for each cell of the map, and of an agent for each cell;
/// bytes, rounded up.
const CELL_BYTES: u64 = 4;
const AGENT_CELL_BYTES: u64 = 5;

/// The folders of an idle server.
#[derive(Debug, Clone)]
pub struct RunFolders {
    /// Recordings are written here, under names of the server's own making.
    pub recordings: PathBuf,
    /// Map files are read from here; from nowhere if `None`.
    pub maps: Option<PathBuf>,
}

/// Why a request is refused.
#[derive(Debug, Error)]
pub enum RequestError {
    /// The scenario names its recording.
    #[error(
        "{NAME}: execution.record: the server names the recordings of requested runs itself; \
         leave the key out, and request the recording (\"record\": true)"
    )]
    Record,
    /// The scenario names a map file that it may not have.
    #[error("{NAME}: map.file = {0:?}: no map file of this name in the folder of maps (sim_server run --map-dir)")]
    Map(String),
    /// The scenario names other files for its map.
    #[error(
        "{NAME}: map.import: a requested run reads no trajectory and no model_path; leave the keys out, or start it by \
         maes run"
    )]
    Import,
    /// The scenario names a program.
    #[error("{NAME}: agents.command: a requested run starts no program; leave the key out, or start it by maes run")]
    Command,
    /// The map and what the team knows of it would take too much memory.
    #[error(
        "{NAME}: map.size: {cells} cells and {agents} agents take about {mib} MiB of memory, and a requested run may \
         take {}: choose a smaller map or team, or start the run by maes run",
        MEMORY_MAX_BYTES >> 20
    )]
    Memory { cells: u64, agents: u32, mib: u64 },
    /// The folder of recordings cannot be made.
    #[error("{NAME}: the folder of recordings cannot be made ({0}); choose another one (sim_server run --record-dir)")]
    Folder(std::io::ErrorKind),
    /// The scenario is not legal.
    #[error(transparent)]
    Setup(#[from] SetupError),
}

/// A requested run.
#[derive(Debug)]
pub struct RequestedRun {
    pub scenario: Scenario,
    /// File name of its recording, in the folder of recordings.
    pub recording: Option<String>,
}

/// Makes scenarios of requests.
#[derive(Debug)]
pub struct RequestedRuns {
    folders: RunFolders,
    /// Part of the names of all recordings of this server.
    start: u64,
    recordings: u32,
}

impl RequestedRuns {
    /// For the requests of one server.
    #[must_use]
    pub fn new(folders: RunFolders) -> Self {
        Self { folders, start: getrandom::u64().unwrap_or_default(), recordings: 0 }
    }

    /// The scenario of a request, with the keys that the user of the server overrides.
    ///
    /// # Errors
    /// If the scenario is not legal, or touches files that it may not.
    pub fn scenario(&mut self, request: &StartRequest, overrides: &[Override]) -> Result<RequestedRun, RequestError> {
        self.resolve(&request.scenario, request.is_recorded, overrides)
    }

    fn resolve(&mut self, text: &str, is_recorded: bool, overrides: &[Override]) -> Result<RequestedRun, RequestError> {
        // What is no TOML is refused below, with the place of the error.
        let table: toml::Table = toml::from_str(text).unwrap_or_default();
        if value(&table, RECORD).is_some() {
            return Err(RequestError::Record);
        }
        let mut resolved = Vec::new();
        let mut set = |key: [&str; 2], file: &Path| {
            let value = Some(file.display().to_string().into());
            resolved.push(Override { origin: NAME.to_owned(), key: key.join("."), value });
        };
        if let Some(file) = value(&table, MAP_FILE).and_then(toml::Value::as_str) {
            let map = self.folders.maps.as_deref().and_then(|folder| file_below(folder, Path::new(file)));
            let map = map.filter(|map| map_file::is_self_contained(map));
            set(MAP_FILE, &map.ok_or_else(|| RequestError::Map(file.to_owned()))?);
        }
        let mut recording = None;
        if is_recorded {
            let name = self.name();
            set(RECORD, &self.recordings_folder().map_err(|error| RequestError::Folder(error.kind()))?.join(&name));
            recording = Some(name);
        }
        resolved.extend_from_slice(overrides);
        let scenario = setup::parse(NAME, text, &resolved)?;
        if scenario.map.import.has_paths() {
            return Err(RequestError::Import);
        }
        if !scenario.agents.command.is_empty() {
            return Err(RequestError::Command);
        }
        check_memory(&scenario)?;
        Ok(RequestedRun { scenario, recording })
    }

    /// A name that no recording has.
    fn name(&mut self) -> String {
        self.recordings += 1;
        format!("run_{:016x}_{:03}.mcap", self.start, self.recordings)
    }

    fn recordings_folder(&self) -> std::io::Result<PathBuf> {
        fs::create_dir_all(&self.folders.recordings)?;
        self.folders.recordings.canonicalize()
    }
}

/// Refuses a generated map whose run would take more memory than [`MEMORY_MAX_BYTES`], before any
/// of it is made: the request has no more than a few numbers.
fn check_memory(scenario: &Scenario) -> Result<(), RequestError> {
    let Some(size) = scenario.map.size else { return Ok(()) };
    let cells: u64 = size.cells().into_iter().map(u64::from).product();
    let agents = scenario.phases().iter().map(|phase| phase.agents.count).max().unwrap_or_default();
    let bytes = cells.saturating_mul(CELL_BYTES + AGENT_CELL_BYTES * u64::from(agents));
    if bytes <= MEMORY_MAX_BYTES { Ok(()) } else { Err(RequestError::Memory { cells, agents, mib: bytes >> 20 }) }
}

fn value<'a>(table: &'a toml::Table, [section, key]: [&str; 2]) -> Option<&'a toml::Value> {
    table.get(section)?.as_table()?.get(key)
}

/// The regular file of this name below a folder, without links.
fn file_below(folder: &Path, file: &Path) -> Option<PathBuf> {
    let folder = folder.canonicalize().ok()?;
    let file = folder.join(file).canonicalize().ok()?;
    (file.starts_with(&folder) && file.is_file()).then_some(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GENERATED: &str = "seed = 1\nduration_s = 1\n[map]\nkind = \"spheres\"\nsize = 20\n[agents]\ncount = 1\n";

    fn of_file(file: &str) -> String {
        GENERATED.replace("\"spheres\"\nsize = 20", &format!("\"file\"\nfile = \"{file}\""))
    }

    #[test]
    fn recordings_have_names_of_the_server() {
        let folder = tempfile::tempdir().unwrap();
        let mut runs = RequestedRuns::new(RunFolders { recordings: folder.path().join("new"), maps: None });
        for text in [
            format!("{GENERATED}[execution]\nrecord = \"x.mcap\"\n"),
            format!("execution = {{ record = \"x.mcap\" }}\n{GENERATED}"),
            format!("execution.\"record\" = 3\n{GENERATED}"),
        ] {
            let refused = runs.resolve(&text, false, &[]).unwrap_err();
            assert!(matches!(refused, RequestError::Record), "{refused}");
        }
        assert!(runs.resolve(GENERATED, false, &[]).unwrap().scenario.execution.record.is_none());
        assert!(!folder.path().join("new").exists());
        let [first, second] = [(), ()].map(|()| runs.resolve(GENERATED, true, &[]).unwrap());
        let file = first.scenario.execution.record.unwrap();
        assert_eq!(file.parent().unwrap(), folder.path().canonicalize().unwrap().join("new"));
        assert_eq!(file.file_name().unwrap().to_str(), first.recording.as_deref());
        assert_ne!(first.recording, second.recording);
    }

    #[test]
    fn programs_are_not_started() {
        let folder = tempfile::tempdir().unwrap();
        let mut runs = RequestedRuns::new(RunFolders { recordings: folder.path().to_owned(), maps: None });
        for text in
            [format!("{GENERATED}command = [\"sh\"]"), format!("{GENERATED}command = [\"sh\"]\ncommand_ids = [0]")]
        {
            assert!(matches!(runs.resolve(&text, true, &[]).unwrap_err(), RequestError::Command));
        }
    }

    #[test]
    fn what_a_run_takes_is_known_before_it_is_granted() {
        let folder = tempfile::tempdir().unwrap();
        let mut runs = RequestedRuns::new(RunFolders { recordings: folder.path().join("new"), maps: None });
        let mut ask = |kind: &str, size: &str, agents: u32| {
            let text = GENERATED.replace("spheres", kind).replace("size = 20", &format!("size = {size}"));
            runs.resolve(&text.replace("count = 1", &format!("count = {agents}")), true, &[])
        };
        for (kind, size, agents) in [("noise", "1024", 1), ("spheres", "[1024, 1024, 300]", 1), ("mine", "200", 30)] {
            let refused = ask(kind, size, agents).unwrap_err();
            assert!(matches!(refused, RequestError::Memory { .. }), "{refused}");
            assert!(refused.to_string().ends_with("choose a smaller map or team, or start the run by maes run"));
        }
        assert!(ask("noise", "256", 10).is_ok());
    }

    #[test]
    fn maps_are_of_one_folder() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        fs::create_dir(path("maps")).unwrap();
        for name in ["secret.txt", "maps/cave.txt"] {
            fs::write(path(name), "#####\n#...#\n#####\n").unwrap();
        }
        std::os::unix::fs::symlink(path("secret.txt"), path("maps/link.txt")).unwrap();
        let folders = RunFolders { recordings: path("out"), maps: Some(path("maps")) };
        let mut runs = RequestedRuns::new(folders.clone());
        let scenario = runs.resolve(&of_file("cave.txt"), false, &[]).unwrap().scenario;
        assert_eq!(scenario.map.file, Some(path("maps/cave.txt").canonicalize().unwrap()));
        for option in ["trajectory = \"/etc/passwd\"", "model_path = [\"/\"]"] {
            let text = format!("{}[map.import]\n{option}\n", of_file("cave.txt"));
            assert!(matches!(runs.resolve(&text, false, &[]).unwrap_err(), RequestError::Import), "{option}");
        }
        let mut reasons = Vec::new();
        for wrong in ["../secret.txt", "link.txt", "none.txt", "/etc/passwd", "/none/at/all", ".", "../maps"] {
            let refused = runs.resolve(&of_file(wrong), false, &[]).unwrap_err().to_string();
            reasons.push(refused.replace(&format!("{wrong:?}"), ""));
        }
        reasons.dedup();
        assert_eq!(reasons.len(), 1, "one answer for what is missing and what is outside: {reasons:?}");
        let mut runs = RequestedRuns::new(RunFolders { maps: None, ..folders });
        assert!(matches!(runs.resolve(&of_file("cave.txt"), false, &[]).unwrap_err(), RequestError::Map(_)));
    }
}
