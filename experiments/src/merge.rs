//! The merge of folders of one plan that several machines have executed in part: records and
//! scenarios of their runs, the recordings that were kept, and the files that the plan reads.

use std::fs;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::plan::{FOLDER, copy};
use crate::rows::{RunRecord, StoredRun};
use crate::store::{PLAN, Store, StoreError, file_error};

#[derive(Debug, Error)]
pub enum MergeError {
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("{one}/{PLAN} and {other}/{PLAN} are different plans; only folders of one plan can be merged")]
    OtherPlan { one: String, other: String },
    /// Two folders have different records of one run.
    #[error(
        "{folder}: run {id} has other figures than in the folders before; a run has one result: was a file changed?"
    )]
    OtherOutcome {
        /// The later one.
        folder: String,
        id: String,
    },
}

/// Merges the runs of `folders` into `out`, and writes its tables. If several folders have a run,
/// the first record is kept. Returns the number of runs.
///
/// # Errors
/// If a folder cannot be read or written, or folders contradict each other.
pub fn merge(folders: &[PathBuf], out: &Path) -> Result<usize, MergeError> {
    let mut plan: Option<(&Path, String)> = None;
    let mut all = std::collections::BTreeMap::<String, StoredRun>::new();
    let mut failures = Vec::new();
    // Nothing is written before all folders have been read.
    let mut scenarios = Vec::new();
    // The first that has a recording, or a file, counts.
    let (mut recordings, mut inputs) = (Vec::new(), Vec::new());
    let has_plan = out.join(PLAN).exists();
    let before = has_plan.then_some(out);
    for folder in before.into_iter().chain(folders.iter().map(PathBuf::as_path)) {
        let store = Store::open(folder)?;
        let text = store.plan()?;
        match &plan {
            Some((one, first)) if *first != text => {
                let (one, other) = (one.display().to_string(), folder.display().to_string());
                return Err(MergeError::OtherPlan { one, other });
            }
            Some(_) => {}
            None => plan = Some((folder, text)),
        }
        failures.extend(store.failures()?);
        inputs.push(folder.join(FOLDER));
        for run in store.stored_runs()? {
            recordings.push((run.row.id.clone(), store.recording_file(&run.row.id)));
            match all.get(&run.row.id) {
                Some(first) if !is_same_run(&first.clone().split().0, &run.clone().split().0) => {
                    let folder = folder.display().to_string();
                    return Err(MergeError::OtherOutcome { folder, id: run.row.id });
                }
                Some(_) => {}
                None => {
                    if let Some(scenario) = store.scenario(&run.row.id)? {
                        scenarios.push((run.row.id.clone(), scenario));
                    }
                    all.insert(run.row.id.clone(), run);
                }
            }
        }
    }
    let joined = Store::create(out)?;
    for (id, scenario) in &scenarios {
        joined.save_scenario(id, scenario)?;
    }
    if let Some((_, text)) = plan {
        joined.write(PLAN, text.as_bytes())?;
    }
    for folder in inputs {
        copy_folder(&folder, &out.join(FOLDER))?;
    }
    for (id, recording) in &recordings {
        copy_new(recording, &joined.recording_file(id))?;
    }
    for run in all.values() {
        joined.save_run(run)?;
    }
    for failed in failures.iter().filter(|failed| !all.contains_key(&failed.id)) {
        joined.save_failure(failed)?;
    }
    joined.write_tables()?;
    Ok(all.len())
}

/// Copies a folder with all that is in it and not there yet; nothing, if there is none.
fn copy_folder(from: &Path, to: &Path) -> Result<(), StoreError> {
    if !from.is_dir() {
        return Ok(());
    }
    fs::create_dir_all(to).map_err(file_error(to))?;
    for entry in fs::read_dir(from).map_err(file_error(from))? {
        let entry = entry.map_err(file_error(from))?;
        let (inner, target) = (entry.path(), to.join(entry.file_name()));
        if entry.file_type().map_err(file_error(&inner))?.is_dir() {
            copy_folder(&inner, &target)?;
        } else {
            copy_new(&inner, &target)?;
        }
    }
    Ok(())
}

/// Copies a file to where there is none; nothing, if there is no file.
fn copy_new(from: &Path, to: &Path) -> Result<(), StoreError> {
    if !from.is_file() || to.exists() {
        return Ok(());
    }
    copy(from, to).map_err(file_error(from))
}

/// Whether two records are equal except for wall time, and for the oracle and the parts of the
/// redundancy, which one of them may lack.
#[must_use]
pub fn is_same_run(one: &RunRecord, other: &RunRecord) -> bool {
    let mut like = other.clone();
    like.row.wall = one.row.wall.clone();
    like.row.oracle = one.row.oracle;
    if one.row.redundancy_known.is_none() || other.row.redundancy_known.is_none() {
        like.row.redundancy_known = one.row.redundancy_known;
        like.row.redundancy_unknown = one.row.redundancy_unknown;
    }
    *one == like
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_written_if_a_folder_is_missing() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        assert!(merge(&[folder.path().join("none")], &out).is_err());
        assert!(!out.exists());
    }
}
