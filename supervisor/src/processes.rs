//! What a run and an idle server share: their processes, and waiting for one of them to end.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use protocol::signing;
use signal_hook::SigId;
use signal_hook::consts::SIGCHLD;
use system::diagnostics;
use system::wall_clock::now;

use crate::SupervisorError;
use crate::binaries;
use crate::child::{ChildGuard, Signal, exit_code};
use crate::domain;
use crate::remote::RemoteProcess;
use crate::team::Group;

/// Wall time after which a supervisor looks for interruptions again.
const PERIOD: Duration = Duration::from_millis(100);

/// Wall time that agents have to end once the server has ended.
const SHUTDOWN: Duration = Duration::from_secs(5);

/// Wakes a supervisor when a child process ends.
pub(crate) struct ChildEvents {
    pipe: UnixStream,
    id: SigId,
}

impl ChildEvents {
    pub(crate) fn new() -> Result<Self, SupervisorError> {
        let open = || {
            let (pipe, sender) = UnixStream::pair()?;
            pipe.set_nonblocking(true)?;
            let id = signal_hook::low_level::pipe::register(SIGCHLD, sender)?;
            Ok(Self { pipe, id })
        };
        open().map_err(|source| SupervisorError::io("handling SIGCHLD", source))
    }

    /// Waits until a child process ends, `other` can be read, or a tenth of a second is over.
    pub(crate) fn wait(&mut self, other: Option<BorrowedFd<'_>>) -> Result<(), SupervisorError> {
        let mut awaited: Vec<PollFd<'_>> =
            other.into_iter().chain([self.pipe.as_fd()]).map(|fd| PollFd::new(fd, PollFlags::POLLIN)).collect();
        let timeout = PollTimeout::try_from(PERIOD).unwrap_or(PollTimeout::ZERO);
        match poll(&mut awaited, timeout) {
            Ok(_) | Err(Errno::EINTR) => {}
            Err(errno) => return Err(SupervisorError::io("waiting for processes", errno.into())),
        }
        // Every wake-up is followed by a look at all processes, so one stands for many.
        let mut bytes = [0; 64];
        while matches!(io::Read::read(&mut self.pipe, &mut bytes), Ok(1..)) {}
        Ok(())
    }
}

impl Drop for ChildEvents {
    fn drop(&mut self) {
        signal_hook::low_level::unregister(self.id);
    }
}

/// The join secret of the processes of one supervisor. They get it in their environment, which only
/// the same user can read, and nowhere else.
pub(crate) struct JoinSecret(Option<String>);

impl JoinSecret {
    /// That of the environment, which is inherited, or a random one.
    pub(crate) fn of_environment() -> Result<Self, SupervisorError> {
        if std::env::var_os(signing::JOIN_SECRET).is_some() {
            return Ok(Self(None));
        }
        let mut random = [0; 32];
        let no_random = |error: getrandom::Error| SupervisorError::io("join secret", io::Error::other(error));
        getrandom::fill(&mut random).map_err(no_random)?;
        Ok(Self(Some(random.iter().map(|byte| format!("{byte:02x}")).collect())))
    }

    /// The secret itself, for a process that has another environment.
    pub(crate) fn text(&self) -> Option<String> {
        self.0.clone().or_else(|| std::env::var(signing::JOIN_SECRET).ok())
    }

    /// Gives it to a process that does not inherit it.
    pub(crate) fn give_to(&self, command: &mut Command) {
        if let Self(Some(secret)) = self {
            command.env(signing::JOIN_SECRET, secret);
        }
    }
}

/// A program with the join secret, in a ROS domain: that of the environment if none is named.
pub(crate) fn command(binaries: &Path, name: &str, ros_domain: Option<u32>, secret: &JoinSecret) -> Command {
    let program = binaries::program(binaries, name);
    let mut command = Command::new(&program[0]);
    command.args(&program[1..]);
    enter(&mut command, ros_domain);
    secret.give_to(&mut command);
    command.envs(diagnostics::format_to_pass_on());
    command
}

/// Puts a program into a ROS domain: that of the environment if none is named.
pub(crate) fn enter(command: &mut Command, ros_domain: Option<u32>) {
    if let Some(id) = ros_domain {
        command.env(domain::VARIABLE, id.to_string());
    }
}

/// Lets the system kill a process when this one is killed: one that would stay for ever.
#[cfg(target_os = "linux")]
pub(crate) fn kill_with_this_process(command: &mut Command) {
    use std::os::unix::process::CommandExt;

    #[expect(unsafe_code, reason = "the system kills the children of a process that is killed")]
    // SAFETY: the closure makes one system call and touches no memory.
    unsafe {
        command.pre_exec(|| nix::sys::prctl::set_pdeathsig(Signal::SIGKILL).map_err(io::Error::from));
    }
}

/// Other systems leave it alone: agents end when their server does.
#[cfg(not(target_os = "linux"))]
pub(crate) fn kill_with_this_process(_command: &mut Command) {}

/// Starts a child process, and names the program if the system does not.
pub(crate) fn start(command: Command) -> Result<ChildGuard, SupervisorError> {
    let program = command.get_program().to_owned();
    ChildGuard::start(command).map_err(SupervisorError::of(Path::new(&program)))
}

/// Names a group of agents to an `agent_node`.
pub(crate) fn with_ids(mut command: Command, group: Group) -> Command {
    command.arg("--id").arg(format!("{}-{}", group.first, group.last));
    command
}

/// Starts the process of some agents; all that it prints is appended to `log`.
pub(crate) fn start_agents(mut command: Command, log: &Path) -> Result<ChildGuard, SupervisorError> {
    let open = || -> io::Result<(File, File)> {
        let file = OpenOptions::new().create(true).append(true).open(log)?;
        Ok((file.try_clone()?, file))
    };
    let (stdout, stderr) = open().map_err(SupervisorError::of(log))?;
    command.stdout(stdout).stderr(stderr);
    start(command)
}

/// A process of agents, here or on a host.
pub(crate) enum AgentProcess {
    Local(ChildGuard),
    Remote(RemoteProcess),
}

impl AgentProcess {
    /// Its exit code, if it has ended.
    pub(crate) fn ended(&mut self) -> Result<Option<u8>, SupervisorError> {
        match self {
            Self::Local(child) => {
                let status = child.ended().map_err(|source| SupervisorError::io("agent_node", source))?;
                Ok(status.map(exit_code))
            }
            Self::Remote(process) => Ok(process.ended()),
        }
    }

    pub(crate) fn signal(&self, signal: Signal) {
        match self {
            Self::Local(child) => send(child, signal),
            Self::Remote(process) => process.signal(signal),
        }
    }
}

/// Waits for agent processes whose server has ended; those that do not end are killed.
pub(crate) fn await_end(mut agents: Vec<AgentProcess>, events: &mut ChildEvents) -> Result<(), SupervisorError> {
    let begun = now();
    loop {
        agents.retain_mut(|agent| matches!(agent.ended(), Ok(None)));
        // Dropping them kills them.
        if agents.is_empty() || begun.elapsed() >= SHUTDOWN {
            return Ok(());
        }
        events.wait(None)?;
    }
}

/// Sends a signal to a process; one that is not there needs none.
pub(crate) fn send(child: &ChildGuard, signal: Signal) {
    drop(child.signal(signal));
}
