//! A program of the user's own that runs agents of a run in memory, in a process of its own.
//!
//! It gets a socket as its standard input ([`agent_node::pipe`]); what it prints goes to stderr,
//! since stdout is for the result. It is in a process group of its own, so that the interruption of
//! a run lets it end as the others do. It ends when the socket is closed.

use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::Scope;
use std::time::Duration;

use agent_node::pipe::Frame;
use agent_node::transport::Inbound as ToAgents;
use msgs::ids::AgentId;
use nix::sys::signal::{Signal, killpg};
use nix::unistd::Pid;
use protocol::signed::Signed;
use system::program;
use thiserror::Error;
use transport::Inbound as ToServer;

use crate::{AgentsEnd, send};

/// Wall time between two looks at whether the run is over.
const POLL_PERIOD: Duration = Duration::from_millis(50);

/// Wall time that a program has to end after its run.
const END_TIMEOUT: Duration = Duration::from_secs(5);

/// Why a program could not run its agents.
#[derive(Debug, Error)]
#[error("agents.command: {program}: {reason}")]
pub struct OwnProgramError {
    program: String,
    reason: String,
}

/// The program of some agents whose ids follow each other.
pub(crate) struct OwnProgram {
    /// The program, and its arguments.
    words: Vec<String>,
    folder: PathBuf,
    agents: Vec<AgentId>,
}

impl OwnProgram {
    /// `words` are the program and its arguments; a program with a `/` in its name is looked for
    /// from `folder`.
    pub(crate) fn new(words: &[String], folder: &Path, agents: Vec<AgentId>) -> Self {
        Self { words: words.to_vec(), folder: folder.to_owned(), agents }
    }

    /// The agents that it runs.
    pub(crate) fn agents(&self) -> &[AgentId] {
        &self.agents
    }

    /// Starts it, and passes messages on until it ends, or `stop` is set.
    pub(crate) fn run<'scope>(
        self,
        end: AgentsEnd,
        scope: &'scope Scope<'scope, '_>,
        stop: &AtomicBool,
    ) -> Result<(), OwnProgramError> {
        let program = self.words.first().cloned().unwrap_or_default();
        let failed = |reason: String| OwnProgramError { program: program.clone(), reason };
        let (mut child, socket) = self.start().map_err(|error| failed(error.to_string()))?;
        let from_program = socket.try_clone().map_err(|error| failed(error.to_string()))?;
        let AgentsEnd { inbox, server, source, .. } = end;
        let (end_of_messages, has_ended) = channel::<()>();
        let reader = scope.spawn(move || {
            // Dropped at the end of the messages.
            let _end_of_messages = end_of_messages;
            let mut messages = io::BufReader::new(from_program);
            while let Some(frame) = Frame::read(&mut messages)? {
                match frame {
                    Frame::Join(join) => {
                        send(&server, source, join.agent, ToServer::Join(Signed::unsigned(join)));
                    }
                    Frame::Command(command) => {
                        send(&server, source, command.agent, ToServer::Command(Signed::unsigned(command)));
                    }
                    Frame::Scenario(_) | Frame::JoinReply(_) | Frame::Observation(_) => {
                        return Err(io::Error::other("it sends messages of a server"));
                    }
                }
            }
            Ok(())
        });
        let group = Pid::from_raw(child.id().cast_signed());
        pass_on(&inbox, &socket, &has_ended, stop);
        let is_run_over = stop.load(Ordering::Relaxed);
        if is_run_over {
            // Its last messages: whether they come or not, the run has its result.
            let _ = has_ended.recv_timeout(END_TIMEOUT);
        }
        // A program that is well-behaved ends by that.
        drop(socket.shutdown(std::net::Shutdown::Both));
        let read = reader.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        let (ended, end) = channel();
        scope.spawn(move || ended.send(child.wait()));
        let status = end.recv_timeout(END_TIMEOUT).or_else(|_| {
            // It may have ended just now. What it has started is in its group.
            let _ = killpg(group, Signal::SIGKILL);
            end.recv()
        });
        let status = status.map_err(io::Error::other).and_then(|status| status);
        let status = status.map_err(|error| failed(error.to_string()))?;
        match read {
            // What a program does after its run does not change the result.
            _ if is_run_over => Ok(()),
            Err(error) => Err(failed(error.to_string())),
            Ok(()) if status.success() => Ok(()),
            Ok(()) => Err(failed(format!("it has ended with {status}, see what it has printed"))),
        }
    }

    fn start(&self) -> io::Result<(Child, UnixStream)> {
        let (ours, theirs) = UnixStream::pair()?;
        let mut command = program::command(&self.words, &self.folder);
        command.arg("--over-stdin").arg("--id").arg(self.range());
        command.stdin(Stdio::from(OwnedFd::from(theirs))).stdout(io::stderr()).process_group(0);
        Ok((command.spawn()?, ours))
    }

    fn range(&self) -> String {
        match self.agents.as_slice() {
            [only] => only.to_string(),
            [first, .., last] => format!("{first}-{last}"),
            [] => String::new(),
        }
    }
}

/// Passes what the server sends on to the program, until one of them ends.
fn pass_on(inbox: &Receiver<ToAgents>, mut socket: &UnixStream, has_ended: &Receiver<()>, stop: &AtomicBool) {
    loop {
        let frame = match inbox.recv_timeout(POLL_PERIOD) {
            Ok(ToAgents::Scenario(scenario)) => Frame::Scenario(scenario),
            Ok(ToAgents::JoinReply(reply)) => Frame::JoinReply(reply),
            Ok(ToAgents::Observation(fragment)) => Frame::Observation(fragment.trusted().into_inner()),
            Err(RecvTimeoutError::Timeout) => {
                let is_over = stop.load(Ordering::Relaxed);
                let is_gone = matches!(has_ended.try_recv(), Err(std::sync::mpsc::TryRecvError::Disconnected));
                if is_over || is_gone {
                    return;
                }
                continue;
            }
            Err(RecvTimeoutError::Disconnected) => return,
        };
        if frame.write(&mut socket).is_err() {
            return;
        }
    }
}

/// Ids that follow each other, together.
pub(crate) fn ranges(ids: impl Iterator<Item = u32>) -> Vec<Vec<AgentId>> {
    let mut ranges: Vec<Vec<AgentId>> = Vec::new();
    for id in ids {
        match ranges.last_mut() {
            Some(range) if range.last().is_some_and(|last| last.0 + 1 == id) => range.push(AgentId(id)),
            _ => ranges.push(vec![AgentId(id)]),
        }
    }
    ranges
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_that_follow_each_other_are_together() {
        let ids = |range: &[u32]| range.iter().copied().map(AgentId).collect::<Vec<_>>();
        assert_eq!(ranges([0, 1, 4, 6, 7].into_iter()), [ids(&[0, 1]), ids(&[4]), ids(&[6, 7])]);
        assert_eq!(ranges(std::iter::empty()), Vec::<Vec<AgentId>>::new());
    }

    #[test]
    fn programs_that_fail_are_named() {
        let stop = AtomicBool::new(false);
        let run = |words: &[&str]| {
            let words: Vec<String> = words.iter().map(|&word| word.to_owned()).collect();
            let (_server, mut ends) = crate::link(&[vec![AgentId(0)]]);
            let program = OwnProgram::new(&words, Path::new(""), vec![AgentId(0)]);
            std::thread::scope(|scope| program.run(ends.remove(0), scope, &stop)).unwrap_err().to_string()
        };
        assert!(run(&["/none/there"]).starts_with("agents.command: /none/there: No such file"));
        assert_eq!(
            run(&["sh", "-c", "exit 3", "own"]),
            "agents.command: sh: it has ended with exit status: 3, see what it has printed"
        );
        assert!(run(&["sh", "-c", "echo no message >&0", "own"]).contains("expected at most"));
        // It and what it has started are ended.
        assert!(run(&["sh", "-c", "echo no message >&0; sleep 1000", "own"]).contains("expected at most"));
    }
}
