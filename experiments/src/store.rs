//! The folder of a plan: one file for each run, and the tables made from them.
//!
//! Invariant: a file has its name only once it is whole, so a process may be killed at any time, and several may work on one
//! folder. The files of the runs are the whole state; the tables can be made anew from them.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::rows::RunRecord;
use crate::tables::{self, Table};

/// Name of the copy of the plan.
pub const PLAN: &str = "plan.toml";

/// Why a folder cannot be used.
#[derive(Debug, Error)]
pub enum StoreError {
    /// A file or folder cannot be read or made.
    #[error("{file}: {source}")]
    File {
        /// Which.
        file: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file of a run is none.
    #[error("{file}: not the record of a run: {source}")]
    Record {
        /// Which.
        file: String,
        /// What is wrong.
        source: serde_json::Error,
    },
    /// A table cannot be made.
    #[error("{file}: {reason}")]
    Table {
        /// Which.
        file: String,
        /// What is wrong.
        reason: String,
    },
}

/// The folder of a plan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Store {
    folder: PathBuf,
}

impl Store {
    /// A folder that may be there already, and is made otherwise.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn create(folder: &Path) -> Result<Self, StoreError> {
        let runs = folder.join("runs");
        std::fs::create_dir_all(&runs).map_err(file_error(&runs))?;
        Ok(Self { folder: folder.to_owned() })
    }

    /// A folder that is there.
    ///
    /// # Errors
    /// If it is not, or not the folder of a plan.
    pub fn open(folder: &Path) -> Result<Self, StoreError> {
        let runs = folder.join("runs");
        std::fs::read_dir(&runs).map_err(file_error(&runs))?;
        Ok(Self { folder: folder.to_owned() })
    }

    /// Where it is.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The runs that are done.
    ///
    /// # Errors
    /// If the folder cannot be read.
    pub fn done(&self) -> Result<BTreeSet<String>, StoreError> {
        let runs = self.folder.join("runs");
        let mut done = BTreeSet::new();
        for entry in std::fs::read_dir(&runs).map_err(file_error(&runs))? {
            let name = entry.map_err(file_error(&runs))?.file_name();
            // What is being written has another ending.
            done.extend(name.to_str().and_then(|name| name.strip_suffix(".json")).map(str::to_owned));
        }
        Ok(done)
    }

    /// Keeps a run.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn keep(&self, record: &RunRecord) -> Result<(), StoreError> {
        let file = self.run_file(&record.row.id);
        let text = serde_json::to_string(record).map_err(|source| StoreError::Record { file: name(&file), source })?;
        write_whole(&file, text.as_bytes())
    }

    /// Takes a run out.
    ///
    /// # Errors
    /// If the file cannot be removed.
    pub fn remove(&self, id: &str) -> Result<(), StoreError> {
        let file = self.run_file(id);
        std::fs::remove_file(&file).map_err(file_error(&file))
    }

    /// All runs, by what was run and then by seed.
    ///
    /// # Errors
    /// If a file cannot be read or is no record.
    pub fn records(&self) -> Result<Vec<RunRecord>, StoreError> {
        let mut records = Vec::new();
        for id in self.done()? {
            let file = self.run_file(&id);
            let text = std::fs::read_to_string(&file).map_err(file_error(&file))?;
            let record: RunRecord =
                serde_json::from_str(&text).map_err(|source| StoreError::Record { file: name(&file), source })?;
            records.push(record);
        }
        records.sort_by(|one, other| {
            let order = |record: &RunRecord| {
                let row = &record.row;
                (row.controller.clone(), row.size, row.agents, row.axes.clone(), row.seed, row.id.clone())
            };
            order(one).cmp(&order(other))
        });
        Ok(records)
    }

    /// The plan.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn plan(&self) -> Result<String, StoreError> {
        let file = self.folder.join(PLAN);
        std::fs::read_to_string(&file).map_err(file_error(&file))
    }

    /// Writes a file of the folder as a whole; returns where it is.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, file: &str, bytes: &[u8]) -> Result<PathBuf, StoreError> {
        let file = self.folder.join(file);
        write_whole(&file, bytes)?;
        Ok(file)
    }

    /// Makes `runs.csv`, `series.csv`, `agents.csv` and the same as Parquet from the files of the runs.
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
        self.folder.join("runs").join(format!("{id}.json"))
    }
}

/// Writes a file under another name, and gives it its own when it is on the disk.
fn write_whole(file: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    let failed = file_error(file);
    let folder = file.parent().unwrap_or(Path::new("."));
    let mut draft = tempfile::Builder::new().prefix(".").suffix(".part").tempfile_in(folder).map_err(&failed)?;
    draft.write_all(bytes).map_err(&failed)?;
    draft.as_file().sync_all().map_err(&failed)?;
    // Others may read it, as any other file: a temporary file is its owner's alone.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let permissions = std::fs::Permissions::from_mode(0o644);
        draft.as_file().set_permissions(permissions).map_err(&failed)?;
    }
    draft.persist(file).map_err(|error| failed(error.error))?;
    Ok(())
}

fn file_error(file: &Path) -> impl Fn(std::io::Error) -> StoreError {
    let file = name(file);
    move |source| StoreError::File { file: file.clone(), source }
}

fn name(file: &Path) -> String {
    file.display().to_string()
}
