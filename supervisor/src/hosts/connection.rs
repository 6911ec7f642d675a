//! The supervisor's end of the connection to a host.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use super::log::BoundedLog;
use super::messages::{FromHost, ToHost, line};
use super::serve::{SUBCOMMAND, lines};
use super::{Host, Launcher};
use crate::SupervisorError;
use crate::child::{ChildGuard, Signal, exit_code};
use crate::team::Group;

/// Wall time that the process on a host has to end its agents.
const SHUTDOWN: Duration = Duration::from_secs(6);

/// Maximum length of what a launcher prints before the process on the host greets, bytes: banners
/// and warnings, and not another program.
const NOISE_MAX: usize = 64 << 10;

/// Wall time that is waited for the end of what a launcher says that has ended.
const LAST_WORDS: Duration = Duration::from_secs(2);

/// What has come from a host.
#[derive(Debug, Default)]
struct State {
    hello: Option<(String, usize)>,
    /// Whether the launcher has printed too much else.
    is_noise: bool,
    /// The last line on stderr that is not blank.
    last_error: Option<String>,
    /// Exit codes of processes that have ended.
    ended: BTreeMap<Group, u8>,
    logs: BTreeMap<Group, BoundedLog>,
    /// Processes that were started.
    started: BTreeSet<Group>,
}

/// A connection to a host. Dropping it ends the agents there.
#[derive(Debug)]
pub(crate) struct Connection {
    name: String,
    launcher: RefCell<ChildGuard>,
    /// `None` while it is dropped.
    requests: Option<Sender<ToHost>>,
    state: Arc<Mutex<State>>,
    closed: Receiver<()>,
    /// Closed once all that the launcher says on stderr is in the log.
    errors: Receiver<()>,
    log: PathBuf,
}

impl Connection {
    /// Starts the launcher of a host. What it prints goes to a file in `logs`.
    pub(crate) fn open(host: &Host, binaries: &Path, logs: &Path) -> Result<Self, SupervisorError> {
        let log = logs.join(format!("host_{}.log", host.name));
        let of_file = |source| SupervisorError::of(&log)(source);
        let file = Arc::new(Mutex::new(BoundedLog::open(&log).map_err(of_file)?));
        let mut command = command(host, binaries);
        let (said, stderr) = io::pipe().map_err(of_file)?;
        command.stderr(stderr);
        let program = command.get_program().to_owned();
        let failed = SupervisorError::of(Path::new(&program));
        let (launcher, input, output) = ChildGuard::start_connected(command).map_err(failed)?;
        let (requests, to_send) = channel::<ToHost>();
        thread::spawn(move || send(input, &to_send));
        let state = Arc::new(Mutex::new(State::default()));
        let shared = Arc::clone(&state);
        let (is_read, errors) = channel();
        let (of_errors, told) = (Arc::clone(&file), Arc::clone(&state));
        thread::spawn(move || {
            for line in lines(BufReader::new(said)) {
                lock(&of_errors).line(&line);
                if !line.trim().is_empty() {
                    lock(&told).last_error = Some(line);
                }
            }
            drop::<Sender<()>>(is_read);
        });
        let (close, closed) = channel();
        thread::spawn(move || {
            receive(output, &shared, &file);
            // The connection may be gone.
            let _ = close.send(());
        });
        let launcher = RefCell::new(launcher);
        Ok(Self { name: host.name.clone(), launcher, requests: Some(requests), state, closed, errors, log })
    }

    /// Build and cores of the host, once it has said so; an error if its launcher has ended.
    pub(crate) fn hello(&self) -> Result<Option<(String, usize)>, SupervisorError> {
        let hello = lock(&self.state).hello.clone();
        if hello.is_some() {
            return Ok(hello);
        }
        let (name, log) = (&self.name, self.log.display());
        if lock(&self.state).is_noise {
            let reason = format!(
                "host {name:?}: its launcher prints {} KiB and more, and no greeting of `maes {SUBCOMMAND}`; expected a \
                 command that starts the program that follows it; its log: {log}",
                NOISE_MAX >> 10
            );
            return Err(SupervisorError::Host(reason));
        }
        match self.launcher_code() {
            None => Ok(None),
            Some(code) => {
                // Its last words may still be on the way; a process that it has left says more.
                let _ = self.errors.recv_timeout(LAST_WORDS);
                let error = lock(&self.state).last_error.clone();
                let last = error.map_or_else(|| last_line(&self.log), |line| format!(": {line}"));
                let reason = format!("host {name:?}: its launcher ended with exit code {code}{last}; its log: {log}");
                Err(SupervisorError::Host(reason))
            }
        }
    }

    /// Starts a process of agents. Its output is appended to `log`.
    pub(crate) fn start(
        &self,
        group: Group,
        arguments: Vec<String>,
        environment: BTreeMap<String, String>,
        log: &Path,
    ) -> Result<(), SupervisorError> {
        let file = BoundedLog::open(log).map_err(SupervisorError::of(log))?;
        let mut state = lock(&self.state);
        state.logs.insert(group, file);
        state.ended.remove(&group);
        state.started.insert(group);
        drop(state);
        self.request(ToHost::Start { agents: group, arguments, environment });
        Ok(())
    }

    pub(crate) fn signal(&self, agents: Group, signal: Signal) {
        self.request(ToHost::Signal { agents, number: signal as i32 });
    }

    /// The exit code of a process, if it has ended: that of the launcher if the connection is gone.
    pub(crate) fn ended(&self, agents: Group) -> Option<u8> {
        if let Some(&code) = lock(&self.state).ended.get(&agents) {
            return Some(code);
        }
        // A launcher that ends well without such a word has lost the host all the same.
        self.launcher_code().map(|code| if code == 0 { 1 } else { code })
    }

    /// The exit code of the launcher, if it has ended.
    pub(crate) fn launcher_code(&self) -> Option<u8> {
        let ended = self.launcher.borrow_mut().ended();
        ended.ok().flatten().map(exit_code)
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    fn request(&self, request: ToHost) {
        if let Some(requests) = &self.requests {
            // The thread has ended if the launcher has.
            drop(requests.send(request));
        }
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        drop(self.requests.take());
        // The launcher is killed afterwards.
        let _ = self.closed.recv_timeout(SHUTDOWN);
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The command that starts the process on a host.
fn command(host: &Host, binaries: &Path) -> Command {
    let maes = host.binaries.as_deref().unwrap_or(binaries).join("maes");
    let maes = maes.to_string_lossy();
    let words = match &host.launcher {
        Launcher::Local => vec![maes.into_owned(), SUBCOMMAND.to_owned()],
        Launcher::Words(words) => [&words[..], &[maes.into_owned(), SUBCOMMAND.to_owned()]].concat(),
        Launcher::Shell(words) => [&words[..], &[format!("exec {} {SUBCOMMAND}", quoted(&maes))]].concat(),
    };
    let mut command = Command::new(&words[0]);
    command.args(&words[1..]);
    command
}

/// A word as a shell takes it.
fn quoted(word: &str) -> String {
    format!("'{}'", word.replace('\'', r"'\''"))
}

fn send(mut input: impl Write, requests: &Receiver<ToHost>) {
    let send = |request: ToHost| input.write_all(line(&request).as_bytes()).and_then(|()| input.flush());
    // Whoever waits for an answer learns of the end from the launcher.
    drop(requests.iter().try_for_each(send));
}

/// Takes note of what comes, to the end of the stream, or until too much of it is no greeting.
fn receive(output: impl io::Read, state: &Mutex<State>, log: &Mutex<BoundedLog>) {
    let mut noise = 0;
    for line in lines(BufReader::new(output)) {
        let message = serde_json::from_str(&line);
        let mut state = lock(state);
        match message {
            Ok(FromHost::Hello { build, cores }) => state.hello = Some((build, cores)),
            Ok(FromHost::Log { agents, line }) => {
                if let Some(file) = state.logs.get_mut(&agents) {
                    file.line(&line);
                }
            }
            Ok(FromHost::Ended { agents, code }) => {
                if state.started.remove(&agents) {
                    state.ended.insert(agents, code);
                }
            }
            // Launchers print, too.
            Err(_) => {
                noise += line.len() + 1;
                state.is_noise = state.hello.is_none() && noise > NOISE_MAX;
                if state.is_noise {
                    return;
                }
                lock(log).line(&line);
            }
        }
    }
}

/// The last line of a file, after a colon.
fn last_line(file: &Path) -> String {
    let text = std::fs::read_to_string(file).unwrap_or_default();
    text.lines().rfind(|line| !line.trim().is_empty()).map(|line| format!(": {line}")).unwrap_or_default()
}

#[cfg(test)]
mod tests;
