//! Limits of a process: the wall time of its start and of its shutdown, and its memory.
//!
//! The middleware can block any thread that calls it (a start that deadlocks, a participant that
//! does not shut down) and can be made to allocate without end. So a thread of its own, which calls
//! nothing of the middleware, watches the process:
//! - A start that takes too long is begun again: the process executes its own program with the same
//!   arguments, under the same process id, so that a supervisor sees no difference.
//! - A process that uses too much memory ends as by SIGTERM, so that a recording is closed, and
//!   reports that it has failed.
//! - A shutdown that takes too long ends the process, whatever its threads do.
//!
//! No limit changes the result of a run: a restarted process has sent nothing before, and the other
//! two limits end the process.

use std::env;
use std::fs;
use std::io;
use std::os::unix::process::CommandExt;
use std::process::Command;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::{Duration, Instant};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::{flag, low_level};
use thiserror::Error;

use system::wall_clock::now;

/// Wall time between two looks at the process.
const PERIOD: Duration = Duration::from_millis(100);

/// Starts of a process before it gives up.
const STARTS_MAX: u32 = 5;

/// Exit code of a process that a limit has ended.
const FAILED: i32 = 1;

/// A process whose memory exceeds its limit this many times does not get the time to end in order.
const AT_ONCE: u64 = 2;

/// Counts the starts of a process that has executed itself again.
const START: &str = "MAES_START";

const START_LIMIT: &str = "MAES_START_LIMIT_S";
const SHUTDOWN_LIMIT: &str = "MAES_SHUTDOWN_LIMIT_S";
const MEMORY_LIMIT: &str = "MAES_MEMORY_LIMIT_MB";

/// An environment variable that is no limit.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{variable} is {value:?}; allowed is a whole number from {min} to {max}")]
pub struct LimitError {
    variable: &'static str,
    value: String,
    min: u32,
    max: u32,
}

/// The limits of a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Wall time of the first start until all endpoints exist. Each later start has as much more.
    pub start: Duration,
    /// Wall time from the first signal, or the end of the run, to the end of the process.
    pub shutdown: Duration,
    /// Resident memory, bytes.
    pub memory_bytes: Option<u64>,
}

impl Limits {
    /// Reads `MAES_START_LIMIT_S` (default 10, and 1 more for each 50 of this many agents, whose
    /// endpoints the process makes), `MAES_SHUTDOWN_LIMIT_S` (default 30) and
    /// `MAES_MEMORY_LIMIT_MB` (default: a quarter of the memory of the machine, or of the control
    /// group; none on systems that do not tell it). An empty variable counts as unset.
    ///
    /// # Errors
    /// If a variable is not a whole number in its range.
    pub fn from_vars(agents: usize, var: impl Fn(&str) -> Option<String>) -> Result<Self, LimitError> {
        let number = |variable, max| match var(variable).filter(|value| !value.is_empty()) {
            None => Ok(None),
            Some(value) => match value.parse() {
                Ok(number) if (1..=max).contains(&number) => Ok(Some(number)),
                _ => Err(LimitError { variable, value, min: 1, max }),
            },
        };
        let seconds = |limit: Option<u32>, default| Duration::from_secs(limit.unwrap_or(default).into());
        Ok(Self {
            start: seconds(number(START_LIMIT, 3600)?, 10 + u32::try_from(agents / 50).unwrap_or(u32::MAX)),
            shutdown: seconds(number(SHUTDOWN_LIMIT, 3600)?, 30),
            memory_bytes: match number(MEMORY_LIMIT, 1 << 24)? {
                Some(mb) => Some(u64::from(mb) * 1_000_000),
                None => memory_of_machine().map(|bytes| bytes / 4),
            },
        })
    }
}

/// What a process is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Starting,
    Running,
    ShuttingDown,
}

/// What a limit demands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Demand {
    Nothing,
    StartAgain,
    Stop,
    Exit,
}

/// The state that the watching thread shares with the process.
#[derive(Debug)]
struct GuardState {
    /// A [`Phase`].
    phase: AtomicU8,
    memory_exceeded: AtomicBool,
}

/// A flag that SIGINT and SIGTERM set; a second signal ends the process with this exit code.
///
/// # Errors
/// If the signal handlers cannot be installed.
pub fn stop_on_signals(second_code: u8) -> io::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        // In this order: the first signal must find the flag unset.
        flag::register_conditional_shutdown(signal, second_code.into(), Arc::clone(&stop))?;
        flag::register(signal, Arc::clone(&stop))?;
    }
    STOP.get_or_init(|| Arc::clone(&stop));
    Ok(stop)
}

/// The flag of [`stop_on_signals`].
static STOP: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Whether the start waits for something outside of this process, so that it has no limit.
static IS_WAITING: AtomicBool = AtomicBool::new(false);

/// Waits as part of the start, without a limit, until a call of `poll`, one in each `period`,
/// returns something or a signal ends the process.
#[cfg(feature = "zenoh")]
#[expect(clippy::disallowed_methods, reason = "there is no event to wait for")]
pub(crate) fn wait_while_starting<T>(period: Duration, mut poll: impl FnMut() -> Option<T>) -> Option<T> {
    let is_stopping = || STOP.get().is_some_and(|stop| stop.load(Ordering::Relaxed));
    IS_WAITING.store(true, Ordering::Relaxed);
    let found = loop {
        match poll() {
            None if !is_stopping() => thread::sleep(period),
            found => break found,
        }
    };
    IS_WAITING.store(false, Ordering::Relaxed);
    found
}

/// The watch over this process.
#[derive(Debug)]
pub struct ProcessGuard {
    shared: Arc<GuardState>,
    starts: u32,
}

impl ProcessGuard {
    /// Begins to watch this process. `stop` is the flag that a signal sets and that ends the run.
    ///
    /// # Errors
    /// If the system has no room for a thread.
    pub fn watch(limits: Limits, stop: Arc<AtomicBool>) -> io::Result<Self> {
        let starts = env::var(START).ok().and_then(|starts| starts.parse().ok()).unwrap_or(1);
        let phase = AtomicU8::new(Phase::Starting as u8);
        let shared = Arc::new(GuardState { phase, memory_exceeded: AtomicBool::new(false) });
        let watch = Watch { limits, starts, since: now(), phase: Phase::Starting };
        let guarded = Arc::clone(&shared);
        thread::Builder::new().name("process_guard".to_owned()).spawn(move || watch.run(&guarded, &stop))?;
        Ok(Self { shared, starts })
    }

    /// Starts of this process so far; 1 unless a limit has begun it again.
    #[must_use]
    pub fn starts(&self) -> u32 {
        self.starts
    }

    /// Says that all endpoints of this process exist.
    pub fn started(&self) {
        self.enter(Phase::Running);
    }

    /// Says that the run has ended and the process is to end.
    pub fn shutting_down(&self) {
        self.enter(Phase::ShuttingDown);
    }

    /// Whether this process is stopping because of its memory.
    #[must_use]
    pub fn memory_exceeded(&self) -> bool {
        self.shared.memory_exceeded.load(Ordering::Relaxed)
    }

    fn enter(&self, phase: Phase) {
        self.shared.phase.store(phase as u8, Ordering::Relaxed);
    }
}

/// What the watching thread knows.
#[derive(Debug)]
struct Watch {
    limits: Limits,
    /// Starts of this process so far.
    starts: u32,
    phase: Phase,
    /// The beginning of the phase.
    since: Instant,
}

impl Watch {
    #[expect(clippy::disallowed_methods, reason = "a look at the process now and then; no result depends on it")]
    fn run(mut self, shared: &GuardState, stop: &AtomicBool) {
        loop {
            thread::sleep(PERIOD);
            let phase = match shared.phase.load(Ordering::Relaxed) {
                _ if stop.load(Ordering::Relaxed) => Phase::ShuttingDown,
                starting if starting == Phase::Starting as u8 => Phase::Starting,
                running if running == Phase::Running as u8 => Phase::Running,
                _ => Phase::ShuttingDown,
            };
            let is_waiting = phase == Phase::Starting && IS_WAITING.load(Ordering::Relaxed);
            if phase != self.phase || is_waiting {
                (self.phase, self.since) = (phase, now());
            }
            let memory = resident_bytes().unwrap_or(0);
            match self.demand(self.since.elapsed(), memory) {
                Demand::Nothing => {}
                Demand::StartAgain => self.start_again(),
                Demand::Stop => {
                    tracing::error!("{}; it ends", self.memory_text(memory));
                    shared.memory_exceeded.store(true, Ordering::Relaxed);
                    stop.store(true, Ordering::Relaxed);
                }
                Demand::Exit => {
                    let over = self.limits.memory_bytes.is_some_and(|limit| memory > limit);
                    let why = if over {
                        self.memory_text(memory)
                    } else {
                        let limit = self.limits.shutdown.as_secs();
                        format!("this process did not end within {limit} s ({SHUTDOWN_LIMIT})")
                    };
                    tracing::error!("{why}; it ends at once");
                    low_level::exit(FAILED);
                }
            }
        }
    }

    /// What the limits demand after a time in the present phase, with so much resident memory.
    fn demand(&self, elapsed: Duration, memory_bytes: u64) -> Demand {
        let limit = self.limits.memory_bytes.unwrap_or(u64::MAX);
        if memory_bytes > limit.saturating_mul(AT_ONCE) {
            return Demand::Exit;
        }
        match self.phase {
            Phase::ShuttingDown if elapsed >= self.limits.shutdown => Demand::Exit,
            Phase::ShuttingDown => Demand::Nothing,
            _ if memory_bytes > limit => Demand::Stop,
            Phase::Starting if elapsed >= self.limits.start * self.starts => Demand::StartAgain,
            Phase::Starting | Phase::Running => Demand::Nothing,
        }
    }

    /// Executes this program again in the place of this process, or ends it after too many starts.
    fn start_again(&self) {
        let waited = (self.limits.start * self.starts).as_secs();
        let stalled = format!("the ROS endpoints do not exist {waited} s after the start ({START_LIMIT})");
        if self.starts >= STARTS_MAX {
            tracing::error!("{stalled}, for the {STARTS_MAX}th time; this process ends");
            low_level::exit(FAILED);
        }
        let starts = self.starts + 1;
        tracing::warn!("{stalled}; starting again: start {starts} of {STARTS_MAX}");
        let error = match env::current_exe() {
            Ok(program) => Command::new(program).args(env::args_os().skip(1)).env(START, starts.to_string()).exec(),
            Err(error) => error,
        };
        tracing::error!("starting again: {error}");
        low_level::exit(FAILED);
    }

    fn memory_text(&self, memory_bytes: u64) -> String {
        let limit = self.limits.memory_bytes.unwrap_or(u64::MAX);
        let mb = |bytes| bytes / 1_000_000;
        format!(
            "this process uses {} MB of memory, and its limit is {} MB ({MEMORY_LIMIT})",
            mb(memory_bytes),
            mb(limit)
        )
    }
}

/// Blocks this thread for ever, as a deadlock in the middleware would: for tests of the limits.
pub fn stall() -> ! {
    loop {
        thread::park();
    }
}

/// The resident memory of this process, if the system reports it.
fn resident_bytes() -> Option<u64> {
    bytes_in(&fs::read_to_string("/proc/self/status").ok()?, "VmRSS:")
}

/// The memory of the machine or of the control group, whichever is smaller, if the system reports
/// it.
fn memory_of_machine() -> Option<u64> {
    let total = bytes_in(&fs::read_to_string("/proc/meminfo").ok()?, "MemTotal:")?;
    let group = fs::read_to_string("/sys/fs/cgroup/memory.max").ok().and_then(|limit| limit.trim().parse().ok());
    Some(total.min(group.unwrap_or(u64::MAX)))
}

/// The value of a line such as `VmRSS:  1234 kB`, bytes.
fn bytes_in(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits =
        Limits { start: Duration::from_secs(10), shutdown: Duration::from_secs(30), memory_bytes: Some(1000) };

    fn demand(phase: Phase, starts: u32, elapsed_s: u64, memory_bytes: u64) -> Demand {
        let watch = Watch { limits: LIMITS, starts, phase, since: now() };
        watch.demand(Duration::from_secs(elapsed_s), memory_bytes)
    }

    #[test]
    fn a_start_has_a_limit_that_grows() {
        assert_eq!(demand(Phase::Starting, 1, 9, 0), Demand::Nothing);
        assert_eq!(demand(Phase::Starting, 1, 10, 0), Demand::StartAgain);
        assert_eq!(demand(Phase::Starting, 3, 29, 0), Demand::Nothing);
        assert_eq!(demand(Phase::Starting, 3, 30, 0), Demand::StartAgain);
        assert_eq!(demand(Phase::Running, 1, 1_000_000, 0), Demand::Nothing);
    }

    #[test]
    fn a_shutdown_has_a_limit() {
        assert_eq!(demand(Phase::ShuttingDown, 1, 29, 0), Demand::Nothing);
        assert_eq!(demand(Phase::ShuttingDown, 1, 30, 0), Demand::Exit);
    }

    #[test]
    fn memory_over_its_limit_ends_the_process_in_order_and_then_at_once() {
        for phase in [Phase::Starting, Phase::Running] {
            assert_eq!(demand(phase, 1, 0, 1000), Demand::Nothing);
            assert_eq!(demand(phase, 1, 0, 1001), Demand::Stop);
        }
        assert_eq!(demand(Phase::ShuttingDown, 1, 0, 2000), Demand::Nothing);
        assert_eq!(demand(Phase::ShuttingDown, 1, 0, 2001), Demand::Exit);
    }

    #[test]
    fn limits_come_from_the_environment() {
        let given =
            |name: &str, value: &str| Limits::from_vars(0, |variable| (variable == name).then(|| value.to_owned()));
        assert_eq!(given(START_LIMIT, "3").unwrap().start, Duration::from_secs(3));
        let usual = |agents| Limits::from_vars(agents, |_| None).unwrap().start.as_secs();
        assert_eq!([usual(1), usual(50), usual(1000)], [10, 11, 30]);
        assert_eq!(given(SHUTDOWN_LIMIT, "").unwrap().shutdown, Duration::from_secs(30));
        assert_eq!(given(MEMORY_LIMIT, "500").unwrap().memory_bytes, Some(500_000_000));
        let error = given(SHUTDOWN_LIMIT, "soon").unwrap_err().to_string();
        assert_eq!(error, "MAES_SHUTDOWN_LIMIT_S is \"soon\"; allowed is a whole number from 1 to 3600");
        assert!(given(MEMORY_LIMIT, "0").is_err());
    }

    #[test]
    fn memory_is_read_from_lines_of_the_system() {
        assert_eq!(bytes_in("VmPeak:\t 7 kB\nVmRSS:\t  12 kB\n", "VmRSS:"), Some(12 * 1024));
        assert_eq!(bytes_in("VmRSS: many kB\n", "VmRSS:"), None);
    }
}
