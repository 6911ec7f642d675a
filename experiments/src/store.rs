//! The folder of a plan: the record and the scenario of each run, and the tables made from these
//! files.
//!
//! Invariant: files are written atomically, so a process may be killed at any time, and several may
//! share a folder. The files of the runs are the whole state; tables can be regenerated from them.

use std::collections::BTreeSet;
use std::fs::{File, TryLockError};
use std::io::Write;
use std::path::{Path, PathBuf};

use system::file_lock::FileLock;
use system::input_file::{self, TEXT_BYTES_MAX};
use system::os;
use thiserror::Error;

use crate::plan::Plan;
use crate::rows::{FailedRun, RunMetadata, RunRecord, StoredRun};
use crate::tables::{self, Table};

/// File name of the copy of the plan.
pub const PLAN: &str = "plan.toml";

/// Subfolder of the records and scenarios of the runs.
pub const RUNS: &str = "runs";

/// Subfolder of the recordings that are kept.
pub const RECORDINGS: &str = "recordings";

#[derive(Debug, Error)]
pub enum StoreError {
    #[error("{file}: {source}")]
    File { file: String, source: std::io::Error },
    #[error("{file}: not the record of a run: {source}")]
    Record { file: String, source: serde_json::Error },
    #[error("{file}: {reason}")]
    Table { file: String, reason: String },
    #[error("{folder}: no folder of a plan; expected one that `maes batch PLAN --out DIR` has made")]
    NoPlan { folder: String },
    #[error("{folder}: is a file; expected a folder for the runs")]
    NoFolder { folder: String },
    #[error("{folder}: another `maes batch` is at work there; wait for its end, or choose another folder (--out)")]
    Busy { folder: String },
}

/// File name of the lock of an execution.
const LOCK: &str = ".lock";

/// Subfolder of the runs that have failed.
const FAILURES: &str = "failures";

/// The folder of a plan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Store {
    folder: PathBuf,
}

impl StoreError {
    /// Whether the system has failed, and not what was asked for.
    #[must_use]
    pub fn is_failure(&self) -> bool {
        !matches!(self, Self::Busy { .. } | Self::NoPlan { .. } | Self::NoFolder { .. })
    }
}

impl Store {
    /// Opens a folder, and creates it if it does not exist.
    ///
    /// # Errors
    /// If it cannot be created, or is a file.
    pub fn create(folder: &Path) -> Result<Self, StoreError> {
        if folder.is_file() {
            return Err(StoreError::NoFolder { folder: name(folder) });
        }
        let runs = folder.join(RUNS);
        std::fs::create_dir_all(&runs).map_err(file_error(&runs))?;
        Ok(Self { folder: folder.to_owned() })
    }

    /// Opens an existing folder.
    ///
    /// # Errors
    /// If it does not exist, or is not the folder of a plan.
    pub fn open(folder: &Path) -> Result<Self, StoreError> {
        let runs = folder.join(RUNS);
        match std::fs::read_dir(&runs) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                Err(StoreError::NoPlan { folder: name(folder) })
            }
            read => read.map(|_| Self { folder: folder.to_owned() }).map_err(file_error(&runs)),
        }
    }

    /// Keeps other executions out of the folder for as long as the result lives: parts of a plan
    /// share it with each other, and nothing else does. `None` on a file system without locks:
    /// nobody is kept out.
    ///
    /// # Errors
    /// If another execution has it, or the file of the lock cannot be made.
    pub fn lock(&self, is_part: bool) -> Result<Option<FileLock>, StoreError> {
        let path = self.folder.join(LOCK);
        let file = File::options().create(true).append(true).open(&path).map_err(file_error(&path))?;
        match if is_part { FileLock::shared(file) } else { FileLock::exclusive(file) } {
            Ok(lock) => Ok(Some(lock)),
            Err(TryLockError::Error(_)) => Ok(None),
            Err(TryLockError::WouldBlock) => Err(StoreError::Busy { folder: name(&self.folder) }),
        }
    }

    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The ids of the runs that have a record.
    ///
    /// # Errors
    /// If the folder cannot be read.
    pub fn done(&self) -> Result<BTreeSet<String>, StoreError> {
        let runs = self.folder.join(RUNS);
        let mut done = BTreeSet::new();
        for entry in std::fs::read_dir(&runs).map_err(file_error(&runs))? {
            let name = entry.map_err(file_error(&runs))?.file_name();
            // A file that is being written has another extension.
            done.extend(name.to_str().and_then(|name| name.strip_suffix(".json")).map(str::to_owned));
        }
        Ok(done)
    }

    /// Saves the record of a run.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save(&self, record: &RunRecord) -> Result<(), StoreError> {
        self.save_run(&StoredRun::new(record.clone(), RunMetadata::default()))
    }

    /// Saves the record of a run with what is known about its execution.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save_run(&self, run: &StoredRun) -> Result<(), StoreError> {
        let file = self.run_file(&run.row.id);
        let text = serde_json::to_string(run).map_err(|source| StoreError::Record { file: name(&file), source })?;
        write_atomically(&file, text.as_bytes())?;
        self.forget_failure(&run.row.id)
    }

    /// Saves that a run has failed.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save_failure(&self, run: &FailedRun) -> Result<(), StoreError> {
        self.make_folder(FAILURES)?;
        let file = self.failure_file(&run.id);
        let text = serde_json::to_string(run).map_err(|source| StoreError::Record { file: name(&file), source })?;
        write_atomically(&file, text.as_bytes())
    }

    /// Removes what is known of a failure, if there is one.
    ///
    /// # Errors
    /// If the file cannot be removed.
    pub fn forget_failure(&self, id: &str) -> Result<(), StoreError> {
        let file = self.failure_file(id);
        match std::fs::remove_file(&file) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(file_error(&file)(error)),
            _ => Ok(()),
        }
    }

    /// The runs that have failed and have no record, by id.
    ///
    /// # Errors
    /// If a file cannot be read or parsed.
    pub fn failures(&self) -> Result<Vec<FailedRun>, StoreError> {
        let folder = self.folder.join(FAILURES);
        if !folder.exists() {
            return Ok(Vec::new());
        }
        let mut failures = Vec::new();
        for entry in std::fs::read_dir(&folder).map_err(file_error(&folder))? {
            let file = entry.map_err(file_error(&folder))?.path();
            let Some(id) = file.file_name().and_then(|name| name.to_str()?.strip_suffix(".json")) else { continue };
            if !self.run_file(id).exists() {
                let text = input_file::read_text(&file, TEXT_BYTES_MAX).map_err(file_error(&file))?;
                let failed = serde_json::from_str(&text);
                failures.push(failed.map_err(|source| StoreError::Record { file: name(&file), source })?);
            }
        }
        failures.sort_by(|one: &FailedRun, other| one.id.cmp(&other.id));
        Ok(failures)
    }

    /// Saves the scenario of a run as `runs/<id>.toml`, from which `maes run` executes it.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save_scenario(&self, id: &str, toml: &str) -> Result<(), StoreError> {
        write_atomically(&self.scenario_file(id), toml.as_bytes())
    }

    /// Whether the folder has the scenario of a run; those of earlier builds do not.
    #[must_use]
    pub fn has_scenario(&self, id: &str) -> bool {
        self.scenario_file(id).exists()
    }

    /// The scenario of a run; `None` if the folder does not have it.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn scenario(&self, id: &str) -> Result<Option<String>, StoreError> {
        if !self.has_scenario(id) {
            return Ok(None);
        }
        let file = self.scenario_file(id);
        input_file::read_text(&file, TEXT_BYTES_MAX).map(Some).map_err(file_error(&file))
    }

    /// Removes the record, the scenario and the recording of a run.
    ///
    /// # Errors
    /// If a file cannot be removed.
    pub fn remove(&self, id: &str) -> Result<(), StoreError> {
        // The record last: without it the run is not known any more.
        for file in [self.recording_file(id), self.scenario_file(id), self.run_file(id)] {
            match std::fs::remove_file(&file) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(file_error(&file)(error)),
                _ => {}
            }
        }
        Ok(())
    }

    /// The recording of a run, if it was kept.
    #[must_use]
    pub fn recording_file(&self, id: &str) -> PathBuf {
        self.folder.join(RECORDINGS).join(format!("{id}.mcap"))
    }

    /// All records, ordered by controller, map size, team size, axes and seed.
    ///
    /// # Errors
    /// If a file cannot be read or parsed.
    pub fn records(&self) -> Result<Vec<RunRecord>, StoreError> {
        Ok(self.stored_runs()?.into_iter().map(|run| run.split().0).collect())
    }

    /// All records with what is known about their execution, in the order of [`Self::records`].
    ///
    /// # Errors
    /// If a file cannot be read or parsed.
    pub fn stored_runs(&self) -> Result<Vec<StoredRun>, StoreError> {
        let mut runs = Vec::new();
        for id in self.done()? {
            runs.push(self.read_run(&id)?);
        }
        runs.sort_by(|one, other| {
            let order = |StoredRun { row, .. }: &StoredRun| {
                (row.controller.clone(), row.size, row.agents, row.axes.clone(), row.seed, row.id.clone())
            };
            order(one).cmp(&order(other))
        });
        Ok(runs)
    }

    /// The record of a run with what is known about its execution; `None` if there is none.
    ///
    /// # Errors
    /// If the file cannot be read or parsed.
    pub fn run(&self, id: &str) -> Result<Option<StoredRun>, StoreError> {
        if self.run_file(id).exists() { self.read_run(id).map(Some) } else { Ok(None) }
    }

    fn read_run(&self, id: &str) -> Result<StoredRun, StoreError> {
        let file = self.run_file(id);
        let text = input_file::read_text(&file, TEXT_BYTES_MAX).map_err(file_error(&file))?;
        serde_json::from_str(&text).map_err(|source| StoreError::Record { file: name(&file), source })
    }

    /// The text of the plan.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn plan(&self) -> Result<String, StoreError> {
        let file = self.folder.join(PLAN);
        input_file::read_text(&file, TEXT_BYTES_MAX).map_err(file_error(&file))
    }

    /// Writes a plan, and copies of the files that it reads.
    ///
    /// # Errors
    /// If a file cannot be read or written.
    pub fn save_plan(&self, plan: &Plan) -> Result<PathBuf, StoreError> {
        let copied = plan.inputs.copy_to(&self.folder);
        copied.map_err(|(file, source)| StoreError::File { file: name(&file), source })?;
        self.write(PLAN, plan.text.as_bytes())
    }

    /// Makes a folder in the folder.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn make_folder(&self, inner: &str) -> Result<(), StoreError> {
        let inner = self.folder.join(inner);
        std::fs::create_dir_all(&inner).map_err(file_error(&inner))
    }

    /// Writes a file of the folder atomically; returns its path.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, file: &str, bytes: &[u8]) -> Result<PathBuf, StoreError> {
        let file = self.folder.join(file);
        write_atomically(&file, bytes)?;
        Ok(file)
    }

    /// Writes a file atomically into any folder, which is made if it does not exist.
    ///
    /// # Errors
    /// If the folder cannot be made, or the file cannot be written.
    pub fn write_in(folder: &Path, file: &str, bytes: &[u8]) -> Result<(), StoreError> {
        std::fs::create_dir_all(folder).map_err(file_error(folder))?;
        write_atomically(&folder.join(file), bytes)
    }

    /// Writes `runs`, `series` and `agents` as `.csv` and `.parquet`, from the files of the runs.
    ///
    /// # Errors
    /// If a file cannot be read or written.
    pub fn write_tables(&self) -> Result<(), StoreError> {
        let records = self.records()?;
        self.write_table("runs", &tables::runs(&records))?;
        self.write_table("series", &tables::series(&records))?;
        self.write_table("agents", &tables::agents(&records))
    }

    fn write_table(&self, stem: &str, table: &Table) -> Result<(), StoreError> {
        for (ending, bytes) in [("csv", tables::csv(table)), ("parquet", tables::parquet(table))] {
            let file = format!("{stem}.{ending}");
            let bytes = bytes.map_err(|reason| StoreError::Table { file: name(&self.folder.join(&file)), reason })?;
            self.write(&file, &bytes)?;
        }
        Ok(())
    }

    fn run_file(&self, id: &str) -> PathBuf {
        self.folder.join(RUNS).join(format!("{id}.json"))
    }

    fn failure_file(&self, id: &str) -> PathBuf {
        self.folder.join(FAILURES).join(format!("{id}.json"))
    }

    fn scenario_file(&self, id: &str) -> PathBuf {
        self.folder.join(RUNS).join(format!("{id}.toml"))
    }
}

/// A record as it is read again from its file, where numbers can differ in the last digit.
///
/// # Errors
/// If it cannot be written as JSON.
pub fn as_stored(record: &RunRecord) -> Result<RunRecord, StoreError> {
    let failed = |source| StoreError::Record { file: record.row.id.clone(), source };
    let text = serde_json::to_string(record).map_err(failed)?;
    serde_json::from_str(&text).map_err(failed)
}

/// Writes a temporary file, synchronises it to disk, and renames it.
fn write_atomically(file: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    let failed = file_error(file);
    let folder = file.parent().unwrap_or(Path::new("."));
    let mut draft = tempfile::Builder::new().prefix(".").suffix(".part").tempfile_in(folder).map_err(&failed)?;
    draft.write_all(bytes).map_err(&failed)?;
    draft.as_file().sync_all().map_err(&failed)?;
    // Temporary files are created with mode 0600; results are readable by all.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let permissions = std::fs::Permissions::from_mode(0o644);
        draft.as_file().set_permissions(permissions).map_err(&failed)?;
    }
    draft.persist(file).map_err(|error| failed(error.error))?;
    // The name is in the folder, which has a cache of its own: without this a power failure can
    // take away a record that a part has reported as done.
    os::sync_folder(folder).map_err(&failed)
}

pub(crate) fn file_error(file: &Path) -> impl Fn(std::io::Error) -> StoreError {
    let file = name(file);
    move |source| StoreError::File { file: file.clone(), source }
}

fn name(file: &Path) -> String {
    file.display().to_string()
}
