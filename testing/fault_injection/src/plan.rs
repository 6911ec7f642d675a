//! Fault plans: faults drawn from a seed, each with its time.
//!
//! Invariant: the same seed, team and duration give the same plan; pure.
//!
//! Not decided here: how a time is reached, and which process runs an agent at that time.

use std::fmt;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Maximum number of faults of a plan.
const FAULTS_MAX: u32 = 4;

/// The kinds of faults; a kind is as likely as it is frequent in this list.
const KINDS: [FaultKind; 14] = [
    FaultKind::KillAgent,
    FaultKind::KillAgent,
    FaultKind::KillAgent,
    FaultKind::KillServer,
    FaultKind::KillServer,
    FaultKind::KillServer,
    FaultKind::Hang,
    FaultKind::Hang,
    FaultKind::Hang,
    FaultKind::LateReplies,
    FaultKind::Duplicate,
    FaultKind::Duplicate,
    FaultKind::Garbage,
    FaultKind::Garbage,
];

#[derive(Debug, Clone, Copy)]
enum FaultKind {
    KillAgent,
    KillServer,
    Hang,
    LateReplies,
    Duplicate,
    Garbage,
}

/// The faults of one run, in the order of their times.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    pub seed: u64,
    pub faults: Vec<Timed>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timed {
    pub at: At,
    pub fault: Fault,
}

/// The time of a fault.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub enum At {
    /// Wall time since the agents were started, ms; may come before all agents have joined.
    Joining(u32),
    /// Sim time, s.
    Running(f64),
}

/// The process that a fault hits if an agent has several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Which {
    Oldest,
    Newest,
}

/// A fault. Times are wall time, ms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// Kills a process of an agent, and starts another one `restart_ms` later.
    KillAgent { agent: u32, which: Which, restart_ms: u32 },
    /// Kills the server and all agents, and restarts them to resume the run.
    KillServer {
        /// Time after the restart at which the server is killed once more.
        again_ms: Option<u32>,
    },
    /// Stops a process of an agent (SIGSTOP), and continues it `for_ms` later.
    Hang {
        agent: u32,
        which: Which,
        for_ms: u32,
        /// Time after the stop at which another process of the agent is started.
        successor_ms: Option<u32>,
    },
    /// Delays each reply of an agent at random, from the start of the run on.
    LateReplies {
        agent: u32,
        /// Upper bound of the delay.
        up_to_ms: u32,
    },
    /// Starts a second process of an agent.
    Duplicate { agent: u32 },
    /// Sends invalid messages on the topics of the agents.
    Garbage {
        /// Number of messages.
        messages: u32,
    },
}

impl Plan {
    /// The plan of a seed, for a team of `agents` and a run of `duration_s` of sim time.
    /// `timeout_ms` is the decision timeout of the run.
    #[must_use]
    pub fn of_seed(seed: u64, agents: u32, duration_s: f64, timeout_ms: u32) -> Self {
        let mut rng = voxels::random_streams::stream(seed, 0, "faults");
        let count = rng.random_range(1..=FAULTS_MAX);
        let mut faults: Vec<Timed> = (0..count)
            .map(|_| {
                let fault = fault(&mut rng, agents, timeout_ms);
                let at = match fault {
                    Fault::LateReplies { .. } => At::Joining(0),
                    _ if rng.random_bool(0.2) => At::Joining(rng.random_range(0..1000)),
                    // Tenths: a time is printed exactly.
                    _ => At::Running(f64::from(rng.random_range(0..(duration_s * 10.0) as u32)) / 10.0),
                };
                Timed { at, fault }
            })
            .collect();
        faults.sort_by(|one, two| one.at.partial_cmp(&two.at).unwrap_or(std::cmp::Ordering::Equal));
        Self { seed, faults }
    }
}

fn fault(rng: &mut ChaCha8Rng, agents: u32, timeout_ms: u32) -> Fault {
    let kind = KINDS[rng.random_range(0..KINDS.len())];
    let agent = rng.random_range(0..agents);
    let which = if rng.random_bool(0.5) { Which::Oldest } else { Which::Newest };
    match kind {
        FaultKind::KillAgent => Fault::KillAgent { agent, which, restart_ms: rng.random_range(0..timeout_ms * 2) },
        FaultKind::KillServer => {
            let again_ms = rng.random_bool(0.3).then(|| rng.random_range(0..2000));
            Fault::KillServer { again_ms }
        }
        FaultKind::Hang => {
            let is_long = rng.random_bool(0.6);
            let for_ms =
                if is_long { rng.random_range(timeout_ms..timeout_ms * 3) } else { rng.random_range(1..timeout_ms) };
            let successor_ms = (is_long && rng.random_bool(0.6)).then(|| rng.random_range(0..timeout_ms * 2));
            Fault::Hang { agent, which, for_ms, successor_ms }
        }
        FaultKind::LateReplies => Fault::LateReplies { agent, up_to_ms: rng.random_range(5..40) },
        FaultKind::Duplicate => Fault::Duplicate { agent },
        FaultKind::Garbage => Fault::Garbage { messages: rng.random_range(100..4000) },
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, timed) in self.faults.iter().enumerate() {
            write!(f, "{}{timed}", if number == 0 { "" } else { "; " })?;
        }
        Ok(())
    }
}

impl fmt::Display for Timed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.at {
            At::Joining(ms) => write!(f, "joining+{ms}ms")?,
            At::Running(s) => write!(f, "{s:.1}s")?,
        }
        let of = |which: Which| if which == Which::Oldest { "first" } else { "last" };
        match self.fault {
            Fault::KillAgent { agent, which, restart_ms } => {
                write!(f, " kill agent {agent} ({}), restart+{restart_ms}ms", of(which))
            }
            Fault::KillServer { again_ms: None } => write!(f, " kill server"),
            Fault::KillServer { again_ms: Some(ms) } => write!(f, " kill server, again+{ms}ms"),
            Fault::Hang { agent, which, for_ms, successor_ms } => {
                write!(f, " hang agent {agent} ({}) for {for_ms}ms", of(which))?;
                successor_ms.map_or(Ok(()), |ms| write!(f, ", successor+{ms}ms"))
            }
            Fault::LateReplies { agent, up_to_ms } => write!(f, " agent {agent} late by up to {up_to_ms}ms"),
            Fault::Duplicate { agent } => write!(f, " second agent {agent}"),
            Fault::Garbage { messages } => write!(f, " {messages} garbage messages"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(seed: u64) -> Plan {
        Plan::of_seed(seed, 5, 60.0, 1000)
    }

    #[test]
    fn plan_is_a_function_of_the_seed() {
        for seed in 0..100 {
            assert_eq!(plan(seed), plan(seed));
        }
        assert_ne!(plan(1), plan(2));
    }

    #[test]
    fn faults_are_sorted_and_within_team_and_duration() {
        for seed in 0..500 {
            let Plan { faults, .. } = plan(seed);
            assert!((1..=4).contains(&faults.len()));
            assert!(faults.is_sorted_by(|one, two| one.at <= two.at), "{faults:?}");
            for Timed { at, fault } in faults {
                assert!(!matches!(at, At::Running(s) if !(0.0..60.0).contains(&s)), "{at:?}");
                match fault {
                    Fault::KillAgent { agent, .. }
                    | Fault::Hang { agent, .. }
                    | Fault::LateReplies { agent, .. }
                    | Fault::Duplicate { agent } => assert!(agent < 5),
                    Fault::KillServer { .. } | Fault::Garbage { .. } => {}
                }
            }
        }
    }

    #[test]
    fn every_kind_and_phase_is_drawn() {
        let all: Vec<Timed> = (0..200).flat_map(|seed| plan(seed).faults).collect();
        let has = |fits: &dyn Fn(&Timed) -> bool| assert!(all.iter().any(fits));
        has(&|timed| matches!(timed.at, At::Joining(1..)));
        has(&|timed| matches!(timed.fault, Fault::KillAgent { .. }));
        has(&|timed| matches!(timed.fault, Fault::KillServer { again_ms: None }));
        has(&|timed| matches!(timed.fault, Fault::KillServer { again_ms: Some(_) }));
        has(&|timed| matches!(timed.fault, Fault::Hang { for_ms: ..1000, successor_ms: None, .. }));
        has(&|timed| matches!(timed.fault, Fault::Hang { for_ms: 1000.., successor_ms: Some(_), .. }));
        has(&|timed| matches!(timed.fault, Fault::LateReplies { .. }));
        has(&|timed| matches!(timed.fault, Fault::Duplicate { .. }));
        has(&|timed| matches!(timed.fault, Fault::Garbage { .. }));
    }

    #[test]
    fn plan_prints_as_one_line() {
        let at = At::Running(12.5);
        let faults = vec![
            Timed { at: At::Joining(3), fault: Fault::KillServer { again_ms: Some(7) } },
            Timed { at, fault: Fault::Duplicate { agent: 2 } },
        ];
        let text = Plan { seed: 0, faults }.to_string();
        assert_eq!(text, "joining+3ms kill server, again+7ms; 12.5s second agent 2");
    }
}
