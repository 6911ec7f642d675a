//! Joins the folders of one plan, which several machines have worked on.

use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::rows::RunRecord;
use crate::store::{PLAN, Store, StoreError};

/// Why folders cannot be joined.
#[derive(Debug, Error)]
pub enum MergeError {
    /// A folder cannot be read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// There are several plans.
    #[error("{one}/{PLAN} and {other}/{PLAN} are not the same plan; only folders of one plan can be joined")]
    OtherPlan {
        /// A folder.
        one: String,
        /// Another one.
        other: String,
    },
    /// A run has come out differently in two folders.
    #[error(
        "{folder}: run {id} has other figures than in the folders before; a run has one outcome: was a file changed?"
    )]
    OtherOutcome {
        /// The later folder.
        folder: String,
        /// The run.
        id: String,
    },
}

/// Brings the runs of `folders` together in `out`, and makes its tables. Of a run that several have, the first is kept. Returns how
/// many runs there are.
///
/// # Errors
/// If a folder cannot be read or written, or folders contradict each other.
pub fn merge(folders: &[PathBuf], out: &Path) -> Result<usize, MergeError> {
    let mut plan: Option<(&Path, String)> = None;
    let mut all = std::collections::BTreeMap::<String, RunRecord>::new();
    let joined = Store::create(out)?;
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
        for record in store.records()? {
            match all.get(&record.row.id) {
                Some(first) if !is_same_run(first, &record) => {
                    let folder = folder.display().to_string();
                    return Err(MergeError::OtherOutcome { folder, id: record.row.id });
                }
                Some(_) => {}
                None => {
                    all.insert(record.row.id.clone(), record);
                }
            }
        }
    }
    if let Some((_, text)) = plan {
        joined.write(PLAN, text.as_bytes())?;
    }
    for record in all.values() {
        joined.keep(record)?;
    }
    joined.write_tables()?;
    Ok(all.len())
}

/// Whether two records are equal but for what the machine had to do with them.
#[must_use]
pub fn is_same_run(one: &RunRecord, other: &RunRecord) -> bool {
    let mut like = other.clone();
    like.row.wall = one.row.wall.clone();
    *one == like
}
