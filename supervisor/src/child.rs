//! Child processes: each in a session of its own, and killed when its guard is dropped.
//!
//! Ctrl-C on a terminal reaches the foreground process group alone, so it does not reach them: the
//! supervisor decides which process is signalled when.
//!
//! This module does not know what the processes do.

use std::io;
use std::os::unix::process::ExitStatusExt;
use std::process::{ChildStdin, ChildStdout, Command, ExitStatus, Stdio};

use nix::errno::Errno;
pub use nix::sys::signal::Signal;
use process_wrap::std::{ChildWrapper, CommandWrap, ProcessSession};

/// A process that is killed when this is dropped, so that neither a failure nor a panic leaves it
/// behind.
#[derive(Debug)]
pub struct ChildGuard {
    child: Box<dyn ChildWrapper>,
    status: Option<ExitStatus>,
}

impl ChildGuard {
    /// Starts a command, without input.
    ///
    /// # Errors
    /// If the system does not start it.
    pub fn start(mut command: Command) -> io::Result<Self> {
        command.stdin(Stdio::null());
        let child = CommandWrap::from(command).wrap(ProcessSession).spawn()?;
        Ok(Self { child, status: None })
    }

    /// Starts a command whose input and output this process writes and reads.
    ///
    /// # Errors
    /// If the system does not start it.
    pub fn start_connected(mut command: Command) -> io::Result<(Self, ChildStdin, ChildStdout)> {
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = CommandWrap::from(command).wrap(ProcessSession).spawn()?;
        let pipes = (child.stdin().take(), child.stdout().take());
        let guard = Self { child, status: None };
        match pipes {
            (Some(stdin), Some(stdout)) => Ok((guard, stdin, stdout)),
            _ => Err(io::Error::other("no pipes")),
        }
    }

    /// Process id.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// How it has ended, if it has.
    ///
    /// # Errors
    /// If the system does not say.
    pub fn ended(&mut self) -> io::Result<Option<ExitStatus>> {
        if self.status.is_none() {
            self.status = self.child.try_wait()?;
        }
        Ok(self.status)
    }

    /// Sends a signal; that the process has ended is no failure.
    ///
    /// # Errors
    /// If the system refuses.
    pub fn signal(&self, signal: Signal) -> io::Result<()> {
        if self.status.is_some() {
            return Ok(());
        }
        match self.child.signal(signal as i32) {
            Err(error) if error.raw_os_error() == Some(Errno::ESRCH as i32) => Ok(()),
            sent => sent,
        }
    }
}

impl Drop for ChildGuard {
    fn drop(&mut self) {
        if self.status.is_none() {
            // Neither fails but for a process that has ended.
            drop(self.child.start_kill());
            drop(self.child.wait());
        }
    }
}

/// The exit code as a shell has it: 128 and the signal for a process that a signal has ended.
#[must_use]
pub fn exit_code(status: ExitStatus) -> u8 {
    let code = status.code().or_else(|| status.signal().map(|signal| 128 + signal));
    code.and_then(|code| u8::try_from(code).ok()).unwrap_or(u8::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str) -> ChildGuard {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        ChildGuard::start(command).unwrap()
    }

    fn end(child: &mut ChildGuard) -> u8 {
        loop {
            if let Some(status) = child.ended().unwrap() {
                return exit_code(status);
            }
            std::thread::yield_now();
        }
    }

    #[test]
    fn exit_codes_are_those_of_a_shell() {
        assert_eq!(end(&mut shell("exit 5")), 5);
        assert_eq!(end(&mut shell("kill -9 $$")), 137);
    }

    #[test]
    fn a_process_leads_a_session_of_its_own() {
        let mut child = shell("test $(ps -o sid= -p $$) -eq $$");
        assert_eq!(end(&mut child), 0);
    }

    #[test]
    fn signals_reach_a_process_until_it_has_ended() {
        let mut child = shell("exec sleep 600");
        child.signal(Signal::SIGTERM).unwrap();
        assert_eq!(end(&mut child), 143);
        child.signal(Signal::SIGTERM).unwrap();
    }
}
