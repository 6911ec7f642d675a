//! Processes: what they say, how they end, and what they leave behind.

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use super::HANG;

/// Wall time between two looks at something that does not tell when it changes.
const POLL: Duration = Duration::from_millis(20);

/// Environment variable by which everything that a test has started can be found.
const MARKER: &str = "MAES_END_TO_END";

/// A process that a test has started. All its descendants are killed when this is dropped.
pub(crate) struct Process {
    what: String,
    pid: u32,
    marker: String,
    status: Receiver<ExitStatus>,
    stdout: Lines,
    stderr: Lines,
}

/// How a process has ended.
#[derive(Debug)]
pub(crate) struct Ended {
    /// The exit code; none if it was killed.
    pub(crate) code: Option<i32>,
    /// What it has said.
    pub(crate) stdout: String,
    /// What it has complained about.
    pub(crate) stderr: String,
}

impl Process {
    /// Starts a command.
    pub(crate) fn start(command: &mut Command) -> Self {
        static STARTED: AtomicU32 = AtomicU32::new(0);
        let marker = format!("{}-{}", std::process::id(), STARTED.fetch_add(1, Ordering::Relaxed));
        // A group of its own, as a terminal makes it for each command.
        command.process_group(0);
        command.env(MARKER, &marker).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let what = format!("{command:?}");
        let mut child = command.spawn().unwrap_or_else(|error| panic!("{what}: {error}"));
        let stdout = Lines::of(child.stdout.take().expect("stdout is piped"));
        let stderr = Lines::of(child.stderr.take().expect("stderr is piped"));
        let pid = child.id();
        let (ended, status) = channel();
        thread::spawn(move || {
            let status = child.wait().expect("a child can be waited for");
            // Nobody is there any more if the test has failed.
            let _ = ended.send(status);
        });
        Self { what, pid, marker, status, stdout, stderr }
    }

    /// Its process id.
    pub(crate) fn pid(&self) -> u32 {
        self.pid
    }

    /// The first line of stderr, from where it was last looked at, that holds `text`.
    #[track_caller]
    pub(crate) fn says(&mut self, text: &str) -> String {
        let found = self.stderr.find(text, HANG);
        found.unwrap_or_else(|| panic!("never said on stderr: {text}\n{}", self.story()))
    }

    /// Whether such a line comes within `time`; what came before it has been looked at then.
    pub(crate) fn says_within(&mut self, text: &str, time: Duration) -> bool {
        self.stderr.find(text, time).is_some()
    }

    /// As [`Process::says`], on stdout.
    #[track_caller]
    pub(crate) fn prints(&mut self, text: &str) -> String {
        let found = self.stdout.find(text, HANG);
        found.unwrap_or_else(|| panic!("never printed on stdout: {text}\n{}", self.story()))
    }

    /// Waits, between the lines that it says, until `holds`.
    #[track_caller]
    pub(crate) fn waits_until(&mut self, holds: impl Fn() -> bool) {
        for _ in 0..HANG.as_millis() / POLL.as_millis() {
            if holds() {
                return;
            }
            self.says_within("\u{0}", POLL);
        }
        panic!("it never came to that\n{}", self.story());
    }

    /// Waits until it handles a signal by itself.
    #[track_caller]
    pub(crate) fn handles(&mut self, name: &str) {
        let bit = 1_u64
            << (match name {
                "INT" => 2,
                "TERM" => 15,
                "CONT" => 18,
                other => panic!("{other} is not looked for"),
            } - 1);
        let pid = self.pid;
        self.waits_until(|| {
            let status = fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
            let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
            caught.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask & bit != 0)
        });
    }

    /// This process and its descendants that are still there: command lines by process id.
    pub(crate) fn family(&self) -> BTreeMap<u32, String> {
        marked(&self.marker)
    }

    /// Waits until somebody in the family has a command line that holds all of `words`.
    #[track_caller]
    pub(crate) fn waits_for_member(&mut self, words: &[&str]) {
        let marker = self.marker.clone();
        let fits = |line: &String| words.iter().all(|word| line.contains(word));
        self.waits_until(|| marked(&marker).values().any(fits));
    }

    /// The one member of the family whose command line holds all of `words`.
    #[track_caller]
    pub(crate) fn member(&self, words: &[&str]) -> u32 {
        let family = self.family();
        let mut fitting = family.iter().filter(|(_, line)| words.iter().all(|word| line.contains(word)));
        match (fitting.next(), fitting.next()) {
            (Some((&pid, _)), None) => pid,
            _ => panic!("not exactly one process with {words:?} in {family:#?}\n{}", self.story()),
        }
    }

    /// Waits for the end.
    ///
    /// # Panics
    /// If it does not come, or a descendant is left behind.
    #[track_caller]
    pub(crate) fn ended(mut self) -> Ended {
        let Ok(status) = self.status.recv_timeout(HANG) else {
            panic!("does not end: {:#?}\n{}", self.family(), self.story());
        };
        let left = self.family();
        assert!(left.is_empty(), "left behind: {left:#?}\n{}", self.story());
        Ended { code: status.code(), stdout: self.stdout.all(), stderr: self.stderr.all() }
    }

    /// Everything it has said so far, for people.
    fn story(&self) -> String {
        let Self { what, stdout, stderr, .. } = self;
        format!("{what}\nstdout:\n{}\nstderr:\n{}", stdout.so_far(), stderr.so_far())
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // Who is killed may have started somebody just before.
        for _ in 0..10 {
            let family = self.family();
            if family.is_empty() {
                return;
            }
            for pid in family.into_keys() {
                signal(pid, "KILL");
            }
        }
    }
}

impl Ended {
    /// The digest: the last line on stdout.
    #[track_caller]
    pub(crate) fn digest(&self) -> String {
        let last = self.stdout.lines().last().unwrap_or_default();
        match last.strip_prefix("digest: ") {
            Some(hex) if hex.len() == 64 => hex.to_owned(),
            _ => panic!("the last line is no digest\n{self}"),
        }
    }

    /// Itself, if it has ended with this exit code.
    #[track_caller]
    pub(crate) fn with_code(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "exit code\n{self}");
        self
    }
}

impl std::fmt::Display for Ended {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "exit code {:?}\nstdout:\n{}\nstderr:\n{}", self.code, self.stdout, self.stderr)
    }
}

/// Lines that a thread reads from a stream.
struct Lines {
    coming: Receiver<String>,
    seen: Vec<String>,
}

impl Lines {
    fn of(stream: impl Read + Send + 'static) -> Self {
        let (lines, coming) = channel();
        thread::spawn(move || {
            let lossy = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
            let read = BufReader::new(stream).split(b'\n').map_while(Result::ok).map(lossy);
            // A test that has failed listens no more, but the process may still have something to say.
            read.for_each(|line| drop(lines.send(line)));
        });
        Self { coming, seen: Vec::new() }
    }

    fn find(&mut self, text: &str, time: Duration) -> Option<String> {
        loop {
            let line = self.coming.recv_timeout(time).ok()?;
            self.seen.push(line.clone());
            if line.contains(text) {
                return Some(line);
            }
        }
    }

    /// All lines that have come, for people.
    fn so_far(&self) -> String {
        let coming: Vec<String> = self.coming.try_iter().collect();
        [&self.seen[..], &coming].concat().join("\n")
    }

    /// All lines, to the end of the stream.
    fn all(&mut self) -> String {
        loop {
            match self.coming.recv_timeout(HANG) {
                Ok(line) => self.seen.push(line),
                Err(RecvTimeoutError::Disconnected) => return self.seen.join("\n"),
                Err(RecvTimeoutError::Timeout) => panic!("a stream of a process that has ended does not"),
            }
        }
    }
}

/// Sends a signal, such as `INT`, to a process; that it is gone already is no failure.
pub(crate) fn signal(pid: u32, name: &str) {
    kill(&pid.to_string(), name);
}

/// Sends a signal to the group of a process that was started here, as a terminal does.
pub(crate) fn signal_group(pid: u32, name: &str) {
    kill(&format!("-{pid}"), name);
}

fn kill(target: &str, name: &str) {
    let kill = Command::new("bash").args(["-c", &format!("kill -s {name} -- {target}")]).stderr(Stdio::null()).status();
    kill.expect("bash runs");
}

/// Living processes whose environment has the marker.
fn marked(marker: &str) -> BTreeMap<u32, String> {
    let entry = format!("{MARKER}={marker}");
    let has_marker = |folder: &Path| {
        // A process that ends while it is looked at has no environment any more.
        let environment = fs::read(folder.join("environ")).unwrap_or_default();
        environment.split(|&byte| byte == 0).any(|variable| variable == entry.as_bytes())
    };
    let processes = fs::read_dir("/proc").expect("the tests run on Linux").filter_map(Result::ok);
    processes
        .filter_map(|process| Some((process.file_name().to_str()?.parse().ok()?, process.path())))
        .filter(|(_, folder)| has_marker(folder))
        .map(|(pid, folder)| {
            let line = fs::read(folder.join("cmdline")).unwrap_or_default();
            (pid, String::from_utf8_lossy(&line).replace('\0', " "))
        })
        .collect()
}
