//! The adversary of a run: what may go wrong in it, and how often.
//!
//! Every seed has a mixture of its own: many faults together hide each other.
//!
//! Invariants: a function of seed and policy; if the scenario does not wait for lost agents, none
//! is lost, because the run would be another one.

use std::time::Duration;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use simulation::scenario::OnAgentLoss;

/// Longest delay of a message that is not held up.
pub(super) const DELAY_MAX: Duration = Duration::from_millis(3);

/// A promise that the simulated world breaks, as a faulty program would. It shows that the
/// comparison finds what it is there for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mutation {
    /// Repeated messages are lost, as if no side resent any.
    NoResends,
    /// A sync returns before anything is on the disk: a recording takes its name unsynced.
    NoSyncs,
    /// The recording of a killed server lacks the commands of one of its ticks.
    ForgottenTick,
    /// A restarted agent starts with other random numbers than its predecessor.
    OtherDecisions,
    /// A command of an earlier tick arrives as one of the present tick.
    StaleCommands,
}

/// The mixture of faults of a run.
#[derive(Debug, Clone)]
pub(super) struct Adversary {
    /// Probability that a message is lost.
    pub(super) loss: f64,
    /// Most messages that a link loses in a row.
    pub(super) losses_max: u32,
    /// Probability that a message arrives twice.
    pub(super) duplication: f64,
    /// Probability that a message is held up, and the longest time.
    pub(super) hold_up: f64,
    pub(super) hold_up_max: Duration,
    /// Whether messages overtake each other.
    pub(super) reorders: bool,
    /// Probability that a message cuts its link, and the longest time.
    pub(super) cut: f64,
    pub(super) cut_max: Duration,
    /// Probability that a process hangs when a message arrives, and the longest time.
    pub(super) hang: f64,
    pub(super) hang_max: Duration,
    /// Probability that the server hangs when it receives; the longest time is the same.
    pub(super) server_hang: f64,
    /// Agent processes that are killed.
    pub(super) agent_kills: u32,
    /// Server processes that are killed.
    pub(super) server_kills: u32,
    /// Probability that the power of the server's machine fails instead.
    pub(super) power_failure: f64,
    /// Second processes that are started for an agent.
    pub(super) intruders: u32,
    /// Probability that a file operation is slow, and the longest time.
    pub(super) slow_disk: f64,
    pub(super) slow_disk_max: Duration,
    /// Servers whose disk fails: it is full, or reports an error.
    pub(super) disk_failures: u32,
}

impl Adversary {
    /// Draws the adversary of a seed.
    pub(super) fn of_seed(seed: u64, policy: OnAgentLoss) -> Self {
        let random = &mut voxels::random_streams::stream(seed, 0, "simulated.adversary");
        let may_lose_agents = policy == OnAgentLoss::Wait;
        let longest =
            |waiting_ms: u64, other_ms: u64| Duration::from_millis(if may_lose_agents { waiting_ms } else { other_ms });
        let loss_max = if may_lose_agents { 0.4 } else { 0.15 };
        Self {
            loss: if random.random_bool(0.6) { random.random_range(0.0..loss_max) } else { 0.0 },
            losses_max: if may_lose_agents { 8 } else { 2 },
            duplication: if random.random_bool(0.5) { random.random_range(0.0..0.3) } else { 0.0 },
            hold_up: if random.random_bool(0.5) { random.random_range(0.0..0.2) } else { 0.0 },
            hold_up_max: longest(5_000, 500),
            reorders: random.random_bool(0.6),
            cut: if random.random_bool(0.3) { 0.005 } else { 0.0 },
            cut_max: longest(8_000, 1_000),
            hang: if random.random_bool(0.3) { 0.005 } else { 0.0 },
            hang_max: longest(5_000, 1_000),
            server_hang: if random.random_bool(0.3) { 0.005 } else { 0.0 },
            agent_kills: if may_lose_agents && random.random_bool(0.6) { random.random_range(1..=4) } else { 0 },
            server_kills: if random.random_bool(0.7) { random.random_range(1..=4) } else { 0 },
            power_failure: [0.0, 0.3, 1.0][random.random_range(0..3_usize)],
            intruders: if may_lose_agents && random.random_bool(0.3) { random.random_range(1..=2) } else { 0 },
            slow_disk: if random.random_bool(0.3) { 0.1 } else { 0.0 },
            slow_disk_max: Duration::from_secs(2),
            disk_failures: if random.random_bool(0.2) { random.random_range(1..=2) } else { 0 },
        }
    }
}

/// A number of steps until something happens: small and large ones are as likely.
pub(super) fn steps(random: &mut ChaCha8Rng) -> u64 {
    let scale = 1_u64 << random.random_range(0..12_u32);
    random.random_range(scale / 2..scale) + 1
}

/// A random time up to a limit.
pub(super) fn up_to(random: &mut ChaCha8Rng, limit: Duration) -> Duration {
    limit.mul_f64(random.random_range(0.0..1.0))
}
