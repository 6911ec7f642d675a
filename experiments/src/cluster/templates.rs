//! The texts of the job files.
//!
//! Each task calls `part.sh` with its number, from 0. What a workload manager cannot be asked for
//! is refused instead of left out. Slurm runs a copy of its script, and with `--output` a task
//! whose folder of logs is not there fails before its first line (JobLaunchFailure of 22.05), so
//! the script asks for its own place and opens the log itself.

use std::num::NonZero;

use super::{EmitError, Job, PART, PLAN, Scheduler};
use crate::plan::PlannedRun;

/// The folder of what the tasks print.
pub(super) const LOGS: &str = "logs";

/// Starts of a task that fails, where the workload manager counts them.
const STARTS_MAX: u32 = 3;

/// File name and text of a job that executes `runs` in `parts`.
pub(super) fn job(job: &Job, runs: &[PlannedRun], parts: usize) -> Result<(&'static str, String), EmitError> {
    let refuse = |flag, value: &Option<String>, reason| match value {
        Some(value) => Err(EmitError::Unknown { flag, value: value.clone(), reason }),
        None => Ok(()),
    };
    let (partition, account) = (("--partition", &job.partition), ("--account", &job.account));
    Ok(match job.scheduler {
        Scheduler::Slurm => ("plan.slurm.sh", slurm(job, parts)),
        Scheduler::Pbs => ("plan.pbs.sh", pbs(job, parts)),
        Scheduler::HtCondor => {
            refuse(partition.0, partition.1, "HTCondor matches requirements, and has no partitions")?;
            ("plan.condor.sub", htcondor(job, parts))
        }
        Scheduler::K8s => {
            for (flag, value) in [partition, account] {
                refuse(flag, value, "Kubernetes has namespaces instead (kubectl --namespace)")?;
            }
            ("plan.k8s.yaml", k8s(job, parts))
        }
        Scheduler::Parallel => {
            for (flag, value) in [partition, account] {
                refuse(flag, value, "GNU parallel has none")?;
            }
            ("plan.parallel.sh", parallel(job, runs, parts))
        }
    })
}

/// The script that executes one part.
pub(super) fn part(parts: usize, flags: &str) -> String {
    format!(
        r#"#!/bin/sh
# Executes one of the {parts} parts of the plan in this folder: part.sh K, with K from 0.
# `maes` is looked for in MAES_BIN_DIR, or else in PATH. Runs that are done are skipped.
set -eu
CDPATH='' cd -- "$(dirname -- "$0")"
exec "${{MAES_BIN_DIR:+$MAES_BIN_DIR/}}maes" batch {PLAN} --out . --jobs 1 --part "$1/{parts}"{flags}
"#
    )
}

/// `HH:MM:SS`.
fn clock(seconds: NonZero<u64>) -> String {
    let seconds = seconds.get();
    format!("{:02}:{:02}:{:02}", seconds / 3600, seconds / 60 % 60, seconds % 60)
}

/// Lines, each of which is left out if it is `None`.
fn lines<const N: usize>(lines: [Option<String>; N]) -> String {
    lines.into_iter().flatten().map(|line| line + "\n").collect()
}

fn percent(limit: Option<NonZero<usize>>) -> String {
    limit.map(|limit| format!("%{limit}")).unwrap_or_default()
}

const SHARED: &str = "\
# All nodes share this folder. `maes` is looked for in MAES_BIN_DIR, or else in PATH. To continue
# after a job that was ended early, submit it again: runs that are done are skipped.";

const ELSEWHERE: &str =
    r#"[ -e part.sh ] || { echo "error: submit this job from the folder of the plan: cd there first" >&2; exit 2; }"#;

fn slurm(job: &Job, parts: usize) -> String {
    let options = lines([
        Some(format!("#SBATCH --array=0-{}{}", parts - 1, percent(job.limit))),
        Some(format!("#SBATCH --mem={}M", job.memory_mib)),
        job.time_s.map(|time| format!("#SBATCH --time={}", clock(time))),
        job.partition.as_ref().map(|partition| format!("#SBATCH --partition={partition}")),
        job.account.as_ref().map(|account| format!("#SBATCH --account={account}")),
        Some(format!("#SBATCH --{}requeue", if job.is_requeued { "" } else { "no-" })),
    ]);
    let again = if job.is_requeued {
        format!(
            r#"sh ./{PART} "$SLURM_ARRAY_TASK_ID" && exit
code=$?
# Slurm starts a task again whose node has failed. One whose process has failed asks for it.
if [ "${{SLURM_RESTART_COUNT:-0}}" -lt {} ]; then
    scontrol requeue "${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID"
fi
exit $code
"#,
            STARTS_MAX - 1
        )
    } else {
        format!("exec sh ./{PART} \"$SLURM_ARRAY_TASK_ID\"\n")
    };
    format!(
        r#"#!/usr/bin/env bash
# Runs the plan in this folder, submitted from any: sbatch plan.slurm.sh
# What tasks print is in {LOGS}. If a node does not find the folder, maes-JOB.err says so, in the
# folder of the submission.
{SHARED}
#SBATCH --job-name=maes
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=1
#SBATCH --output=/dev/null
{options}# Slurm runs a copy of this script, and knows the place of the original.
script=$(scontrol show job "${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID" | sed -n 's/^ *Command=//p')
[[ $script == /* ]] || script=$SLURM_SUBMIT_DIR/$script
if ! {{ cd -- "${{script%/*}}" && [[ -e {PART} && -w {LOGS} ]]; }}; then
    echo "error: ${{script%/*}}: no folder of a plan with {PART} and {LOGS} on $(uname -n); expected one that all nodes share" \
        >>"$SLURM_SUBMIT_DIR/maes-$SLURM_ARRAY_JOB_ID.err"
    exit 2
fi
exec >>"{LOGS}/$SLURM_ARRAY_TASK_ID.log" 2>&1
{again}"#
    )
}

fn pbs(job: &Job, parts: usize) -> String {
    let options = lines([
        // An array of PBS has at least two tasks.
        (parts > 1).then(|| format!("#PBS -J 0-{}{}", parts - 1, percent(job.limit))),
        Some(format!("#PBS -l select=1:ncpus=1:mem={}mb", job.memory_mib)),
        job.time_s.map(|time| format!("#PBS -l walltime={}", clock(time))),
        job.partition.as_ref().map(|queue| format!("#PBS -q {queue}")),
        job.account.as_ref().map(|account| format!("#PBS -A {account}")),
        Some(format!("#PBS -r {}", if job.is_requeued { "y" } else { "n" })),
    ]);
    format!(
        "#!/usr/bin/env bash
# Runs the plan in this folder: cd to it, then qsub plan.pbs.sh
{SHARED}
#PBS -N maes
#PBS -V
#PBS -j oe
#PBS -o {LOGS}/
{options}cd \"$PBS_O_WORKDIR\"
{ELSEWHERE}
exec sh ./{PART} \"${{PBS_ARRAY_INDEX:-0}}\"
"
    )
}

fn htcondor(job: &Job, parts: usize) -> String {
    let options = lines([
        Some(format!("request_memory = {}", job.memory_mib)),
        job.time_s.map(|time| format!("allowed_execute_duration = {time}")),
        job.account.as_ref().map(|account| format!("accounting_group = {account}")),
        job.limit.map(|limit| format!("max_materialize = {limit}")),
        job.is_requeued.then(|| format!("max_retries = {STARTS_MAX}")),
    ]);
    format!(
        "# Runs the plan in this folder: cd to it, then condor_submit plan.condor.sub
{SHARED}
universe = vanilla
executable = /bin/sh
arguments = {PART} $(Process)
transfer_executable = false
should_transfer_files = NO
getenv = PATH, MAES_BIN_DIR
request_cpus = 1
log = {LOGS}/condor.log
output = {LOGS}/$(Process).out
error = {LOGS}/$(Process).err
{options}queue {parts}
"
    )
}

fn k8s(job: &Job, parts: usize) -> String {
    let parallelism = job.limit.map_or(parts, |limit| limit.get().min(parts));
    let retries = if job.is_requeued { STARTS_MAX } else { 0 };
    let memory = job.memory_mib;
    let deadline = lines([job.time_s.map(|time| format!("      activeDeadlineSeconds: {time}"))]);
    format!(
        r#"# Runs the plan in this folder: kubectl apply -f plan.k8s.yaml
# The image is that of launch_scripts/docker/Dockerfile, by the name at your registry; any other that
# has the binary `maes` in its PATH will do. CLAIM: a volume that many pods may write to and that
# holds this folder at its root. To continue after a job that was ended early, delete the job and
# apply it again: runs that are done are kept.
apiVersion: batch/v1
kind: Job
metadata:
  name: maes
spec:
  completionMode: Indexed
  completions: {parts}
  parallelism: {parallelism}
  backoffLimitPerIndex: {retries}
  template:
    spec:
      restartPolicy: Never
      # The volume is for the user of the image.
      securityContext: {{fsGroup: 1000}}
{deadline}      containers:
        - name: maes
          image: maes
          command: ["sh", "-c", "exec sh /plan/{PART} $JOB_COMPLETION_INDEX"]
          resources:
            requests: {{cpu: "1", memory: {memory}Mi}}
            limits: {{memory: {memory}Mi}}
          volumeMounts:
            - {{name: plan, mountPath: /plan}}
      volumes:
        - name: plan
          persistentVolumeClaim: {{claimName: CLAIM}}
"#
    )
}

fn parallel(job: &Job, runs: &[PlannedRun], parts: usize) -> String {
    let jobs = job.limit.map_or_else(|| "100%".to_owned(), |limit| limit.to_string());
    let timeout = job.time_s.map(|time| format!(" --timeout {time}")).unwrap_or_default();
    let retries = if job.is_requeued { format!(" --retries {STARTS_MAX}") } else { String::new() };
    format!(
        "#!/usr/bin/env bash
# Runs the plan in this folder with GNU parallel: plan.parallel.sh [further flags of parallel]
# With --sshlogin HOST,... on several machines, which share this folder. `maes` is looked for in
# MAES_BIN_DIR, or else in PATH. To continue, call it again: runs that are done are skipped. The log of
# jobs has the runs of the plan in its name, since --resume-failed knows jobs by their number alone.
set -eu
cd -- \"$(dirname -- \"${{BASH_SOURCE[0]}}\")\"
export MAES_BIN_DIR=${{MAES_BIN_DIR:-}}
seq 0 {last} | parallel --jobs {jobs}{timeout}{retries} --memfree {memory}M --joblog {LOGS}/parallel-{key}.log \\
    --env MAES_BIN_DIR --workdir \"$PWD\" \"$@\" sh ./{PART}
",
        last = parts - 1,
        memory = job.memory_mib,
        key = key(runs, parts),
    )
}

/// What the numbers of parts mean: 16 hexadecimal digits for these runs in so many parts.
fn key(runs: &[PlannedRun], parts: usize) -> String {
    let mut hasher = blake3::Hasher::new();
    for run in runs {
        hasher.update(run.id.as_bytes()).update(&[0]);
    }
    let hash = hasher.update(parts.to_string().as_bytes()).finalize();
    hash.to_hex()[..16].to_owned()
}
