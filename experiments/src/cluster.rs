//! Job files that run a plan on a cluster: a job array for Slurm, an indexed job for Kubernetes.
//!
//! Each job runs a part of the plan and writes into one shared folder, so no merge is needed; the
//! job that ends last writes the tables of all. This module submits nothing.

use std::num::NonZero;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::plan::Plan;
use crate::store::{PLAN, Store, StoreError};

/// The workload manager of a cluster.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scheduler {
    /// Slurm: a job array, submitted with `sbatch plan.slurm.sh`.
    Slurm,
    /// Kubernetes: an indexed job, submitted with `kubectl apply -f plan.k8s.yaml`.
    K8s,
}

#[derive(Debug, Error)]
pub enum EmitError {
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The folder has no absolute path.
    #[error("{folder}: {source}")]
    Place { folder: String, source: std::io::Error },
}

/// Writes the plan and a job file with so many parts into a folder; returns the path of the job
/// file.
///
/// # Errors
/// If the folder cannot be used.
pub fn emit(plan: &Plan, folder: &Path, scheduler: Scheduler, parts: NonZero<usize>) -> Result<PathBuf, EmitError> {
    let store = Store::create(folder)?;
    store.write(PLAN, plan.text.as_bytes())?;
    let place = std::fs::canonicalize(folder)
        .map_err(|source| EmitError::Place { folder: folder.display().to_string(), source })?;
    let parts = parts.get().min(plan.runs.len());
    let (name, text) = match scheduler {
        Scheduler::Slurm => ("plan.slurm.sh", slurm(&place, parts)),
        Scheduler::K8s => ("plan.k8s.yaml", k8s(parts)),
    };
    Ok(store.write(name, text.as_bytes())?)
}

/// One core per part: a plan has more parts than a cluster has cores to spare.
fn slurm(folder: &Path, parts: usize) -> String {
    let quoted = format!("'{}'", folder.display().to_string().replace('\'', r"'\''"));
    format!(
        r#"#!/usr/bin/env bash
# Runs the plan in this folder: sbatch plan.slurm.sh
# The folder has to be shared by all nodes. `maes` is looked for in MAES_BIN_DIR, or else in PATH. To
# continue after a job that was ended early, submit it again: runs that are done are skipped.
#SBATCH --job-name=maes
#SBATCH --array=0-{last}
#SBATCH --cpus-per-task=1
#SBATCH --mem-per-cpu=4G
set -eu
folder={quoted}
exec "${{MAES_BIN_DIR:+$MAES_BIN_DIR/}}maes" batch "$folder/{PLAN}" --out "$folder" --jobs 1 --part "$SLURM_ARRAY_TASK_ID/{parts}"
"#,
        last = parts - 1
    )
}

fn k8s(parts: usize) -> String {
    format!(
        r#"# Runs the plan in this folder: kubectl apply -f plan.k8s.yaml
# IMAGE: any that has the binary `maes` in its PATH. CLAIM: a volume that many pods may write to and
# that holds this folder at its root. To continue after a job that was ended early, delete the job
# and apply it again: runs that are done are kept.
apiVersion: batch/v1
kind: Job
metadata:
  name: maes
spec:
  completionMode: Indexed
  completions: {parts}
  parallelism: {parts}
  backoffLimitPerIndex: 3
  template:
    spec:
      restartPolicy: Never
      containers:
        - name: maes
          image: IMAGE
          command: ["sh", "-c", "exec maes batch /plan/{PLAN} --out /plan --jobs 1 --part $JOB_COMPLETION_INDEX/{parts}"]
          resources:
            requests: {{cpu: "1", memory: 4Gi}}
            limits: {{memory: 4Gi}}
          volumeMounts:
            - {{name: plan, mountPath: /plan}}
      volumes:
        - name: plan
          persistentVolumeClaim: {{claimName: CLAIM}}
"#
    )
}

#[cfg(test)]
mod tests;
