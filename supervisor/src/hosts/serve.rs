//! The process on a host: starts agents as the supervisor says, and reports what they print and
//! how they end.
//!
//! No agent outlives it: at the end of its input it ends them, and if it is killed, Linux kills
//! them.

use std::collections::BTreeMap;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::num::NonZero;
use std::path::Path;
use std::process::Command;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use system::wall_clock::now;

use super::messages::{FromHost, LINE_MAX, ToHost, line};
use crate::SupervisorError;
use crate::child::{ChildGuard, Signal, exit_code};
use crate::processes;
use crate::team::Group;

/// The subcommand of `maes` that does this.
pub const SUBCOMMAND: &str = "serve-agents";

/// Wall time between two looks at the processes of the agents.
const PERIOD: Duration = Duration::from_millis(50);

/// Wall time that agents have to end once the input has ended.
const SHUTDOWN: Duration = Duration::from_secs(5);

/// Starts agents as the standard input says, with `maes` at this place, until the input ends.
///
/// # Errors
/// If the standard output cannot be written to.
pub fn serve(maes: &Path, build: &str) -> Result<(), SupervisorError> {
    let failed = |source| SupervisorError::io("standard output", source);
    let (requests, received) = channel();
    thread::spawn(move || read_requests(io::stdin().lock(), &requests));
    let (said, to_say) = channel::<FromHost>();
    let (written, failure) = channel();
    thread::spawn(move || {
        let mut out = io::stdout().lock();
        let write = |message: FromHost| out.write_all(line(&message).as_bytes()).and_then(|()| out.flush());
        // Without this reader the process ends.
        drop(written.send(to_say.into_iter().try_for_each(write)));
    });
    let say = |message: FromHost| drop(said.send(message));
    say(FromHost::Hello { build: build.to_owned(), cores: thread::available_parallelism().map_or(1, NonZero::get) });
    let mut processes: BTreeMap<Group, ChildGuard> = BTreeMap::new();
    let mut ending: Option<Instant> = None;
    loop {
        match received.recv_timeout(PERIOD) {
            Ok(ToHost::Start { agents, arguments, environment }) => {
                // One of the same name has ended, or is killed here.
                drop(processes.remove(&agents));
                match start(maes, agents, &arguments, &environment, &said) {
                    Ok(process) => drop(processes.insert(agents, process)),
                    Err(error) => {
                        say(FromHost::Log { agents, line: format!("error: {}: {error}", maes.display()) });
                        say(FromHost::Ended { agents, code: 1 });
                    }
                }
            }
            Ok(ToHost::Signal { agents, number }) => {
                if let (Some(process), Ok(signal)) = (processes.get(&agents), Signal::try_from(number)) {
                    drop(process.signal(signal));
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) if ending.is_none() => {
                ending = Some(now());
                processes.values().for_each(|process| drop(process.signal(Signal::SIGTERM)));
            }
            // Nothing but ends of processes can come any more.
            Err(RecvTimeoutError::Disconnected) => drop(channel::<()>().1.recv_timeout(PERIOD)),
        }
        processes.retain(|&agents, process| match process.ended() {
            Ok(None) => true,
            Ok(Some(status)) => {
                say(FromHost::Ended { agents, code: exit_code(status) });
                false
            }
            Err(_) => false,
        });
        if let Ok(result) = failure.try_recv() {
            return result.map_err(failed);
        }
        if ending.is_some_and(|begun| processes.is_empty() || begun.elapsed() >= SHUTDOWN) {
            return Ok(());
        }
    }
}

fn read_requests(input: impl BufRead, requests: &Sender<ToHost>) {
    for line in lines(input) {
        let request = serde_json::from_str(&line).ok();
        if request.is_none_or(|request| requests.send(request).is_err()) {
            // Nonsense from a supervisor is as good as none.
            return;
        }
    }
}

/// The lines of a stream; longer ones are cut.
pub(super) fn lines(mut input: impl BufRead) -> impl Iterator<Item = String> {
    std::iter::from_fn(move || {
        let mut line = Vec::new();
        let read = input.by_ref().take(LINE_MAX as u64).read_until(b'\n', &mut line).ok()?;
        if read == 0 {
            return None;
        }
        let end = line.strip_suffix(b"\n").unwrap_or(&line);
        Some(String::from_utf8_lossy(end).into_owned())
    })
}

fn start(
    maes: &Path,
    agents: Group,
    arguments: &[String],
    environment: &BTreeMap<String, String>,
    said: &Sender<FromHost>,
) -> io::Result<ChildGuard> {
    let mut command = Command::new(maes);
    command.arg("agent_node").args(arguments).envs(environment);
    let (output, for_stdout) = io::pipe()?;
    command.stdout(for_stdout.try_clone()?).stderr(for_stdout);
    processes::kill_with_this_process(&mut command);
    let process = ChildGuard::start(command)?;
    let said = said.clone();
    thread::spawn(move || {
        for line in lines(BufReader::new(output)) {
            // The longest message is longer than its text.
            let line: String = line.chars().take(LINE_MAX / 16).collect();
            drop(said.send(FromHost::Log { agents, line }));
        }
    });
    Ok(process)
}
