//! Child processes: their output, exit codes and descendants.

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

/// Wall time between two polls of something that sends no event.
const POLL: Duration = Duration::from_millis(20);

/// Environment variable that marks every descendant of a test.
pub(crate) const MARKER: &str = "MAES_END_TO_END";

/// A child process of a test. Dropping it kills all its descendants.
pub(crate) struct Process {
    what: String,
    pid: u32,
    marker: String,
    status: Receiver<ExitStatus>,
    stdout: Lines,
    stderr: Lines,
}

/// Exit code and output of a process that has ended.
#[derive(Debug)]
pub(crate) struct Ended {
    /// The exit code; none if it was killed.
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
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
            // The receiver is gone if the test has failed.
            let _ = ended.send(status);
        });
        Self { what, pid, marker, status, stdout, stderr }
    }

    /// Its process id.
    pub(crate) fn pid(&self) -> u32 {
        self.pid
    }

    /// Waits for a line of stderr with `text`, behind the lines that were read before.
    #[track_caller]
    pub(crate) fn says(&mut self, text: &str) -> String {
        let found = self.stderr.find(text, HANG);
        found.unwrap_or_else(|| panic!("never said on stderr: {text}\n{}", self.story()))
    }

    /// Whether such a line comes within `time`. The lines up to it count as read.
    pub(crate) fn says_within(&mut self, text: &str, time: Duration) -> bool {
        self.stderr.find(text, time).is_some()
    }

    /// As [`Process::says`], on stdout.
    #[track_caller]
    pub(crate) fn prints(&mut self, text: &str) -> String {
        let found = self.stdout.find(text, HANG);
        found.unwrap_or_else(|| panic!("never printed on stdout: {text}\n{}", self.story()))
    }

    /// Polls until `holds`. Lines of stderr that come meanwhile count as read.
    #[track_caller]
    pub(crate) fn waits_until(&mut self, holds: impl Fn() -> bool) {
        for _ in 0..HANG.as_millis() / POLL.as_millis() {
            if holds() {
                return;
            }
            self.says_within("\u{0}", POLL);
        }
        panic!("the condition never held\n{}", self.story());
    }

    /// Waits until the process has a handler for a signal.
    #[track_caller]
    pub(crate) fn handles(&mut self, name: &str) {
        let bit = 1_u64
            << (match name {
                "INT" => 2,
                "TERM" => 15,
                "CONT" => 18,
                other => panic!("{other}: no number of this signal here"),
            } - 1);
        let pid = self.pid;
        self.waits_until(|| {
            let status = fs::read_to_string(format!("/proc/{pid}/status")).unwrap_or_default();
            let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"));
            caught.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask & bit != 0)
        });
    }

    /// Command lines of this process and its living descendants, by process id.
    pub(crate) fn family(&self) -> BTreeMap<u32, String> {
        marked(&self.marker)
    }

    /// Waits for a process of the family whose command line has all of `words`.
    #[track_caller]
    pub(crate) fn waits_for_member(&mut self, words: &[&str]) {
        let marker = self.marker.clone();
        let fits = |line: &String| words.iter().all(|word| line.contains(word));
        self.waits_until(|| marked(&marker).values().any(fits));
    }

    /// The only process of the family whose command line has all of `words`.
    #[track_caller]
    pub(crate) fn member(&self, words: &[&str]) -> u32 {
        let family = self.family();
        let mut fitting = family.iter().filter(|(_, line)| words.iter().all(|word| line.contains(word)));
        match (fitting.next(), fitting.next()) {
            (Some((&pid, _)), None) => pid,
            _ => panic!("not exactly one process with {words:?} in {family:#?}\n{}", self.story()),
        }
    }

    /// Waits for the end of the process.
    ///
    /// # Panics
    /// If it does not end, or leaves a descendant behind.
    #[track_caller]
    pub(crate) fn ended(mut self) -> Ended {
        let Ok(status) = self.status.recv_timeout(HANG) else {
            panic!("does not end: {:#?}\n{}", self.family(), self.story());
        };
        let left = self.family();
        assert!(left.is_empty(), "left: {left:#?}\n{}", self.story());
        Ended { code: status.code(), stdout: self.stdout.all(), stderr: self.stderr.all() }
    }

    /// Command line and output so far, for messages of failures.
    fn story(&self) -> String {
        let Self { what, stdout, stderr, .. } = self;
        format!("{what}\nstdout:\n{}\nstderr:\n{}", stdout.so_far(), stderr.so_far())
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // A process may have started another one just before it was killed.
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

    /// Fails unless the process has ended with this exit code.
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

/// The lines of a stream, read by a thread.
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
            // After a failed test the receiver is gone; the stream is read to its end all the same.
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

    /// All lines so far.
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

/// Sends a signal, such as `INT`, to a process, which may have ended already.
pub(crate) fn signal(pid: u32, name: &str) {
    kill(&pid.to_string(), name);
}

/// Sends a signal to the process group of a child, as a terminal does.
pub(crate) fn signal_group(pid: u32, name: &str) {
    kill(&format!("-{pid}"), name);
}

fn kill(target: &str, name: &str) {
    let kill = Command::new("bash").args(["-c", &format!("kill -s {name} -- {target}")]).stderr(Stdio::null()).status();
    kill.expect("bash runs");
}

/// The parent of a process, which may have ended.
pub(crate) fn parent(pid: u32) -> Option<u32> {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    status.lines().find_map(|line| line.strip_prefix("PPid:"))?.trim().parse().ok()
}

/// The name of a process; empty if it has ended.
pub(crate) fn name(pid: u32) -> String {
    fs::read_to_string(format!("/proc/{pid}/comm")).unwrap_or_default().trim().to_owned()
}

/// Living processes whose environment has the marker.
pub(crate) fn marked(marker: &str) -> BTreeMap<u32, String> {
    let entry = format!("{MARKER}={marker}");
    let has_marker = |folder: &Path| {
        // A process that has just ended has no environment.
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
