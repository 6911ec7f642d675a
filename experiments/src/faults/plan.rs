//! What is done to a run: faults drawn from a seed, each with its time.
//!
//! Invariant: the same seed, team and duration give the same plan; pure.
//!
//! Not decided here: how a time is reached, and which process runs an agent by then.

use std::fmt;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Faults of a plan at the most.
const FAULTS_MAX: u32 = 4;

/// What can happen, each as often as it stands here.
const KINDS: [Kind; 14] = [
    Kind::KillAgent,
    Kind::KillAgent,
    Kind::KillAgent,
    Kind::KillServer,
    Kind::KillServer,
    Kind::KillServer,
    Kind::Hang,
    Kind::Hang,
    Kind::Hang,
    Kind::LateAnswers,
    Kind::Duplicate,
    Kind::Duplicate,
    Kind::Garbage,
    Kind::Garbage,
];

#[derive(Debug, Clone, Copy)]
enum Kind {
    KillAgent,
    KillServer,
    Hang,
    LateAnswers,
    Duplicate,
    Garbage,
}

/// The faults of one run, in the order of their times.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// From which it was drawn.
    pub seed: u64,
    /// What happens.
    pub faults: Vec<Timed>,
}

/// A fault and its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Timed {
    /// When.
    pub at: At,
    /// What.
    pub fault: Fault,
}

/// When a fault happens.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub enum At {
    /// So many milliseconds of wall time after the agents were started, which may be before all have joined.
    Joining(u32),
    /// When the run has come this far, seconds of sim time.
    Running(f64),
}

/// Which process, if an agent has several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Which {
    /// The one that was started first.
    Oldest,
    /// The one that was started last.
    Newest,
}

/// What happens. Times are milliseconds of wall time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// A process of an agent is killed, and another one started later.
    KillAgent {
        /// Of whom.
        agent: u32,
        /// Which process.
        which: Which,
        /// How much later.
        restart_ms: u32,
    },
    /// The server is killed, and all agents with it; all are started again, and the run goes on.
    KillServer {
        /// When it is killed once more after that.
        again_ms: Option<u32>,
    },
    /// A process of an agent is stopped, and goes on later.
    Hang {
        /// Of whom.
        agent: u32,
        /// Which process.
        which: Which,
        /// How much later.
        for_ms: u32,
        /// When another one is started beside it.
        successor_ms: Option<u32>,
    },
    /// An agent waits before each answer, at random, from the start on.
    LateAnswers {
        /// Who.
        agent: u32,
        /// How long at the most.
        up_to_ms: u32,
    },
    /// A second process is started for an agent.
    Duplicate {
        /// Whom.
        agent: u32,
    },
    /// Somebody says things on the topics of the agents that no agent may say.
    Garbage {
        /// How many messages.
        messages: u32,
    },
}

impl Plan {
    /// The plan of a seed, for a team of so many `agents` and a run of `duration_s` of sim time; `timeout_ms` is the wall time
    /// after which an agent is given up.
    #[must_use]
    pub fn of_seed(seed: u64, agents: u32, duration_s: f64, timeout_ms: u32) -> Self {
        let mut rng = random_streams::stream(seed, 0, "faults");
        let count = rng.random_range(1..=FAULTS_MAX);
        let mut faults: Vec<Timed> = (0..count)
            .map(|_| {
                let fault = fault(&mut rng, agents, timeout_ms);
                let at = match fault {
                    Fault::LateAnswers { .. } => At::Joining(0),
                    _ if rng.random_bool(0.2) => At::Joining(rng.random_range(0..1000)),
                    // Tenths, so that a time is written as it is.
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
        Kind::KillAgent => Fault::KillAgent { agent, which, restart_ms: rng.random_range(0..timeout_ms * 2) },
        Kind::KillServer => {
            let again_ms = rng.random_bool(0.3).then(|| rng.random_range(0..2000));
            Fault::KillServer { again_ms }
        }
        Kind::Hang => {
            let is_long = rng.random_bool(0.6);
            let for_ms =
                if is_long { rng.random_range(timeout_ms..timeout_ms * 3) } else { rng.random_range(1..timeout_ms) };
            let successor_ms = (is_long && rng.random_bool(0.6)).then(|| rng.random_range(0..timeout_ms * 2));
            Fault::Hang { agent, which, for_ms, successor_ms }
        }
        Kind::LateAnswers => Fault::LateAnswers { agent, up_to_ms: rng.random_range(5..40) },
        Kind::Duplicate => Fault::Duplicate { agent },
        Kind::Garbage => Fault::Garbage { messages: rng.random_range(100..4000) },
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
            Fault::LateAnswers { agent, up_to_ms } => write!(f, " agent {agent} late by up to {up_to_ms}ms"),
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
    fn a_seed_has_one_plan() {
        for seed in 0..100 {
            assert_eq!(plan(seed), plan(seed));
        }
        assert_ne!(plan(1), plan(2));
    }

    #[test]
    fn plans_are_in_order_and_of_the_team() {
        for seed in 0..500 {
            let Plan { faults, .. } = plan(seed);
            assert!((1..=4).contains(&faults.len()));
            assert!(faults.is_sorted_by(|one, two| one.at <= two.at), "{faults:?}");
            for Timed { at, fault } in faults {
                assert!(!matches!(at, At::Running(s) if !(0.0..60.0).contains(&s)), "{at:?}");
                match fault {
                    Fault::KillAgent { agent, .. }
                    | Fault::Hang { agent, .. }
                    | Fault::LateAnswers { agent, .. }
                    | Fault::Duplicate { agent } => assert!(agent < 5),
                    Fault::KillServer { .. } | Fault::Garbage { .. } => {}
                }
            }
        }
    }

    #[test]
    fn every_kind_comes_up_and_so_does_each_phase() {
        let all: Vec<Timed> = (0..200).flat_map(|seed| plan(seed).faults).collect();
        let has = |fits: &dyn Fn(&Timed) -> bool| assert!(all.iter().any(fits));
        has(&|timed| matches!(timed.at, At::Joining(1..)));
        has(&|timed| matches!(timed.fault, Fault::KillAgent { .. }));
        has(&|timed| matches!(timed.fault, Fault::KillServer { again_ms: None }));
        has(&|timed| matches!(timed.fault, Fault::KillServer { again_ms: Some(_) }));
        has(&|timed| matches!(timed.fault, Fault::Hang { for_ms: ..1000, successor_ms: None, .. }));
        has(&|timed| matches!(timed.fault, Fault::Hang { for_ms: 1000.., successor_ms: Some(_), .. }));
        has(&|timed| matches!(timed.fault, Fault::LateAnswers { .. }));
        has(&|timed| matches!(timed.fault, Fault::Duplicate { .. }));
        has(&|timed| matches!(timed.fault, Fault::Garbage { .. }));
    }

    #[test]
    fn a_plan_is_one_line() {
        let at = At::Running(12.5);
        let faults = vec![
            Timed { at: At::Joining(3), fault: Fault::KillServer { again_ms: Some(7) } },
            Timed { at, fault: Fault::Duplicate { agent: 2 } },
        ];
        let text = Plan { seed: 0, faults }.to_string();
        assert_eq!(text, "joining+3ms kill server, again+7ms; 12.5s second agent 2");
    }
}
