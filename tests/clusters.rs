//! Plans on a real Slurm of one node, whose daemon and tasks are killed, and with GNU parallel: the
//! tables are the same.
//!
//! The programs are installed by tests/install_workload_managers.sh; a test without them is
//! skipped.

use std::fs;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::support::binaries;
use crate::support::processes::{self, Process, signal};
use crate::support::runs::{Site, text};

/// Twelve runs of some seconds.
const PLAN: &str = "seeds = \"1..6\"\n[axes]\n\"agents.controller\" = [\"rbw\", \"nearest-frontier\"]\n\
                    \"map.file\" = [\"../maps/box.txt\"]\n[scenario]\nduration_s = 4000.0\nstop_when_explored = false\n\
                    map = { kind = \"file\", file = \"../maps/box.txt\", cell_m = 1.0 }\nagents = { count = 3 }\n";

/// A box of 40 by 40 by 12 cells with columns.
fn map() -> String {
    let row = |y: usize| -> String {
        (0..40)
            .map(|x| if [0, 39].contains(&x) || [0, 39].contains(&y) || (x % 6, y % 6) == (3, 3) { '#' } else { '.' })
            .collect()
    };
    let floor = "#".repeat(40) + "\n";
    let slice = (0..40).map(|y| row(y) + "\n").collect::<String>();
    let mut slices = vec![floor.repeat(40)];
    slices.extend(vec![slice; 10]);
    slices.push(floor.repeat(40));
    slices.join("\n")
}

/// Whether these programs are there; says so if not.
fn has(programs: &[&str]) -> bool {
    let is_there = |program: &str| {
        let mut command = Command::new("bash");
        let found = command.args(["-c", &format!("command -v {program}")]).env("PATH", path()).output();
        found.is_ok_and(|found| found.status.success())
    };
    let missing = programs.iter().find(|program| !is_there(program));
    if let Some(program) = missing {
        eprintln!("skipped: there is no {program}; tests/install_workload_managers.sh installs it");
    }
    missing.is_none()
}

/// A cluster of one node with two processors, in a folder. Dropping it kills it and its tasks.
struct Cluster {
    folder: PathBuf,
    _munged: Process,
    controller: Process,
    node: Option<Process>,
}

impl Cluster {
    fn start(folder: &Path) -> Self {
        for name in ["state", "spool"] {
            fs::create_dir_all(folder.join(name)).expect("a folder");
        }
        let host = fs::read_to_string("/proc/sys/kernel/hostname").expect("the machine has a name");
        let host = host.trim().split('.').next().unwrap_or_default();
        let user = String::from_utf8(output(Command::new("id").arg("-un")).stdout).expect("a name");
        let [controller_port, node_port] = free_ports();
        let place = text(folder);
        let conf = format!(
            "ClusterName=test\nSlurmctldHost={host}(127.0.0.1)\nSlurmctldPort={controller_port}\nSlurmdPort={node_port}\n\
             AuthType=auth/munge\nAuthInfo=socket={place}/munge.socket\nSlurmUser={user}SlurmdUser={user}\
             StateSaveLocation={place}/state\nSlurmdSpoolDir={place}/spool\nSlurmctldPidFile={place}/slurmctld.pid\n\
             SlurmdPidFile={place}/slurmd.pid\nSlurmctldLogFile={place}/slurmctld.log\nSlurmdLogFile={place}/slurmd.log\n\
             ProctrackType=proctrack/pgid\nTaskPlugin=task/none\nMpiDefault=none\nReturnToService=2\nSlurmdTimeout=5\n\
             KillWait=2\nUnkillableStepTimeout=5\nMessageTimeout=5\nSlurmdParameters=config_overrides\n\
             SelectType=select/cons_tres\n\
             SelectTypeParameters=CR_CPU\nSchedulerParameters=sched_min_interval=1,bf_interval=5\n\
             NodeName=node NodeHostname={host} NodeAddr=127.0.0.1 CPUs=2 RealMemory=1000\n\
             PartitionName=main Nodes=node Default=YES MaxTime=INFINITE State=UP\n"
        );
        fs::write(folder.join("slurm.conf"), conf).expect("a file");
        let file = folder.join("munge.key");
        fs::write(&file, key()).expect("a file");
        output(Command::new("chmod").arg("600").arg(&file));
        let mut munged = command(folder, "munged");
        for (flag, name) in [("key-file", "munge.key"), ("socket", "munge.socket"), ("pid-file", "munged.pid")] {
            munged.arg(format!("--{flag}={place}/{name}"));
        }
        munged.arg(format!("--log-file={place}/munged.log")).arg(format!("--seed-file={place}/munge.seed"));
        let mut munged = Process::start(munged.args(["--force", "--foreground"]));
        munged.waits_until(|| folder.join("munge.socket").exists());
        let mut controller = Process::start(command(folder, "slurmctld").arg("-D"));
        controller.waits_until(|| output(command(folder, "scontrol").arg("ping")).status.success());
        let mut cluster = Self { folder: folder.to_owned(), _munged: munged, controller, node: None };
        cluster.start_node();
        cluster
    }

    fn start_node(&mut self) {
        let mut node = Process::start(command(&self.folder, "slurmd").args(["-D", "-N", "node"]));
        node.waits_until(|| {
            let state = output(command(&self.folder, "sinfo").args(["--noheader", "--format=%t"]));
            ["idle", "mix", "alloc"].contains(&String::from_utf8_lossy(&state.stdout).trim())
        });
        self.node = Some(node);
    }

    /// Kills the daemon of the node and all that it runs, as a power failure does. The keepers of
    /// the tasks come first: one that outlives its task reports that the task has failed, and then
    /// Slurm does not start it again.
    fn kill_node(&mut self) {
        self.node = None;
        let tasks = || processes::marked(text(&self.folder)).into_keys();
        for keeper in tasks().filter_map(processes::parent).filter(|&pid| processes::name(pid) == "slurmstepd") {
            signal(keeper, "KILL");
        }
        // The configuration of their cluster is in the environment of tasks, and the mark of their
        // job.
        tasks().for_each(|pid| signal(pid, "KILL"));
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        self.kill_node();
    }
}

/// A key that no other cluster has.
fn key() -> Vec<u8> {
    (0..64).flat_map(|_| std::process::id().to_le_bytes()).collect()
}

fn free_ports() -> [u16; 2] {
    let listeners = [(); 2].map(|()| TcpListener::bind("127.0.0.1:0").expect("a free port"));
    listeners.map(|listener| listener.local_addr().expect("it is bound").port())
}

fn command(folder: &Path, program: &str) -> Command {
    let mut command = Command::new(program);
    command.env("SLURM_CONF", folder.join("slurm.conf")).env("PATH", path());
    command
}

/// Debian has the daemons where only administrators look.
fn path() -> String {
    format!("{}:/usr/sbin:/sbin", std::env::var("PATH").unwrap_or_default())
}

#[track_caller]
fn output(command: &mut Command) -> Output {
    command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"))
}

fn tables(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let without_wall = |file: &str| {
        let table = fs::read_to_string(folder.join(file)).expect("there is a table");
        let heads: Vec<&str> = table.lines().next().expect("a head").split(',').collect();
        let kept = heads.iter().position(|head| head.starts_with("wall_")).unwrap_or(heads.len());
        let line = |line: &str| line.split(',').take(kept).collect::<Vec<_>>().join(",") + "\n";
        (file.to_owned(), table.lines().map(line).collect::<String>().into_bytes())
    };
    ["runs.csv", "series.csv", "agents.csv"].map(without_wall).into()
}

fn records(folder: &Path) -> usize {
    let files = fs::read_dir(folder.join("runs")).into_iter().flatten().filter_map(Result::ok);
    files.filter(|file| file.path().extension().is_some_and(|is| is == "json")).count()
}

/// Executes the plan into the folder `whole`, and emits a job into the folder `moved`, beside which
/// nothing else is left.
fn executed_and_moved(site: &Site, scheduler: &str, request: &[&str]) {
    for (name, content) in [("maps/box.txt", map()), ("plans/plan.toml", PLAN.to_owned())] {
        fs::create_dir_all(site.path(name).parent().expect("it is in a folder")).expect("a folder");
        site.file(name, content);
    }
    let batch = |flags: &[&str]| {
        let arguments = [&["batch", "plans/plan.toml"][..], flags].concat();
        site.start(site.binary("maes").args(arguments)).ended().with_code(0);
    };
    batch(&["--out", "whole"]);
    batch(&[&["--out", "emitted", "--emit", scheduler, "--parts", "9"][..], request].concat());
    fs::rename(site.path("emitted"), site.path("moved")).expect("a folder can be moved");
    for name in ["maps", "plans"] {
        fs::remove_dir_all(site.path(name)).expect("a folder can be removed");
    }
}

#[track_caller]
fn assert_same_tables(site: &Site) {
    for ((name, one), (_, other)) in tables(&site.path("moved")).into_iter().zip(tables(&site.path("whole"))) {
        assert!(one == other, "{name} differs:\n{}", String::from_utf8_lossy(&one));
    }
}

#[test]
fn parallel_executes_every_part() {
    if !has(&["parallel"]) {
        return;
    }
    let site = Site::new();
    executed_and_moved(&site, "parallel", &["--limit", "2", "--memory", "50M", "--time", "60"]);
    let mut job = site.command("bash");
    let path = format!("{}:{}", text(binaries::folder()), path());
    job.arg(site.path("moved/plan.parallel.sh")).env("PATH", path).env_remove("MAES_BIN_DIR");
    site.start(&mut job).ended().with_code(0);
    assert_same_tables(&site);
}

/// A folder with a `maes` that stops the first two tasks of a plan that begin after two others have
/// left records: each is under way, and stays so, until it is killed. The file `held/N` has the
/// process id of the stopped process.
fn folder_of_holding_maes(site: &Site, held: &Path) -> PathBuf {
    let (real, held) = (site.binary("maes").get_program().to_owned(), text(held));
    let script = format!(
        r#"#!/bin/sh
if [ "$(ls runs | grep -c 'json$')" -ge 2 ]; then
    for number in 1 2; do
        if mkdir "{held}$number" 2>/dev/null; then
            {real} "$@" &
            kill -STOP $!
            echo $! >"{held}$number/pid.part"
            mv "{held}$number/pid.part" "{held}$number/pid"
            wait $!
            exit $?
        fi
    done
fi
exec {real} "$@"
"#,
        real = text(Path::new(&real)),
    );
    let folder = site.path("holding");
    fs::create_dir_all(&folder).expect("a folder");
    site.file("holding/maes", script);
    output(Command::new("chmod").arg("755").arg(folder.join("maes")));
    folder
}

#[test]
fn killed_tasks_and_nodes_leave_the_tables_as_they_are() {
    if !has(&["munged", "slurmctld", "slurmd", "sbatch"]) {
        return;
    }
    let site = Site::new();
    let request = ["--limit", "2", "--memory", "200M", "--time", "60", "--partition", "main"];
    executed_and_moved(&site, "slurm", &request);
    let (cluster_folder, held) = (site.path("cluster"), site.path("held"));
    let mut cluster = Cluster::start(&cluster_folder);
    let mut submit = site.command("sbatch");
    submit.env("SLURM_CONF", cluster_folder.join("slurm.conf"));
    submit.env("MAES_BIN_DIR", folder_of_holding_maes(&site, &held));
    let submitted = output(submit.env(processes::MARKER, &cluster_folder).args(["--parsable", "moved/plan.slurm.sh"]));
    assert!(submitted.status.success(), "{submitted:?}");
    let job = String::from_utf8_lossy(&submitted.stdout).trim().to_owned();

    let moved = site.path("moved");
    let stopped = |number: u32| {
        let pid = fs::read_to_string(format!("{}{number}/pid", text(&held))).ok()?;
        Some(pid.trim().parse::<u32>().expect("a process id"))
    };
    // The process of one task is killed, as for want of memory, and the node under another one.
    cluster.controller.waits_until(|| stopped(1).is_some());
    signal(stopped(1).expect("it is there"), "KILL");
    cluster.controller.waits_until(|| stopped(2).is_some());
    cluster.kill_node();
    let kept = records(&moved);
    assert!((2..12).contains(&kept), "{kept} records: the node was not killed while a task was under way");
    cluster.start_node();
    cluster.controller.waits_until(|| {
        // A task that is put back waits for two minutes, unless its start time is set.
        output(command(&cluster_folder, "scontrol").args(["update", &format!("JobId={job}"), "StartTime=now"]));
        let queue = output(command(&cluster_folder, "squeue").args(["--noheader", "--array"]));
        queue.status.success() && queue.stdout.is_empty()
    });
    let log = fs::read_to_string(cluster_folder.join("slurmctld.log")).expect("the controller writes a log");
    assert_eq!(records(&moved), 12, "{}\n{log}", logs(&moved));
    assert_same_tables(&site);
    drop(cluster);
    assert!(processes::marked(text(&cluster_folder)).is_empty());
}

/// What the tasks have printed.
fn logs(folder: &Path) -> String {
    let files = fs::read_dir(folder.join("logs")).into_iter().flatten().filter_map(Result::ok);
    files.map(|file| fs::read_to_string(file.path()).unwrap_or_default()).collect()
}
