//! Why a run has not seen 99 % of the free cells, as far as its record says.

use experiments::rows::RunRecord;
use simulation::end_reason::EndReason;

use super::metrics::explored_at;

/// The last part of a run, by which it is decided whether the team still saw something new.
const LAST_SHARE: f64 = 0.2;

/// More collisions than this, for each agent and minute, are the cause of a standstill.
const COLLISIONS_PER_MIN: f64 = 1.0;

/// A greater share of decisions than this whose search found no path is the cause of a standstill.
const FAILED_SEARCHES: f64 = 0.1;

/// The cause for which a run has not seen 99 % of the free cells: the first one that holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Cause {
    Failed,
    OutOfEnergy,
    OutOfSight,
    Collision,
    NoPath,
    Stuck,
    TimeOver,
}

impl Cause {
    pub(super) const ALL: [Self; 7] =
        [Self::Failed, Self::OutOfEnergy, Self::OutOfSight, Self::Collision, Self::NoPath, Self::Stuck, Self::TimeOver];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Failed => "failed",
            Self::OutOfEnergy => "out of energy",
            Self::OutOfSight => "out of sight",
            Self::Collision => "collision",
            Self::NoPath => "no path",
            Self::Stuck => "stuck",
            Self::TimeOver => "time over",
        }
    }

    pub(super) fn meaning(self) -> &'static str {
        match self {
            Self::Failed => "the run has no result: an agent or the system failed",
            Self::OutOfEnergy => "a body has run out of energy",
            Self::OutOfSight => "the run ended because nothing more can be seen from where bodies can be",
            Self::Collision => {
                "nothing new in the last fifth of the run, and more than one collision a minute for each agent"
            }
            Self::NoPath => {
                "nothing new in the last fifth of the run, and more than a tenth of the decisions found no path"
            }
            Self::Stuck => "nothing new in the last fifth of the run, for another reason",
            Self::TimeOver => "the team still saw something new when the time was over",
        }
    }

    /// The cause of a run; `None` if it has seen 99 % of the free cells.
    pub(super) fn of(run: &RunRecord) -> Option<Self> {
        let row = &run.row;
        if row.failure().is_some() {
            return Some(Self::Failed);
        }
        if row.t99_s.is_some() {
            return None;
        }
        let is_new = row.explored > explored_at(run, row.end_s * (1.0 - LAST_SHARE));
        let agent_minutes = f64::from(row.agents) * row.end_s / 60.0;
        Some(if row.ran_empty.is_some_and(|times| times > 0) {
            Self::OutOfEnergy
        } else if row.reason == EndReason::NothingMoreSeen {
            Self::OutOfSight
        } else if is_new && row.reason != EndReason::StandsStill {
            Self::TimeOver
        } else if row.collisions as f64 > COLLISIONS_PER_MIN * agent_minutes {
            Self::Collision
        } else if row.search_failures as f64 > FAILED_SEARCHES * row.decisions as f64 {
            Self::NoPath
        } else {
            Self::Stuck
        })
    }
}

#[cfg(test)]
mod tests {
    use experiments::rows::{RunRow, Sample};

    use super::*;

    /// A run of 100 s of two agents that has seen this share after 80 s and at the end.
    fn run(after_80_s: f64, at_end: f64, change: impl FnOnce(&mut RunRow)) -> RunRecord {
        let mut row = RunRow {
            agents: 2,
            end_s: 100.0,
            explored: at_end,
            decisions: 100,
            reason: EndReason::Duration,
            ..RunRow::default()
        };
        change(&mut row);
        let sample = |t_s, explored| Sample {
            t_s,
            explored,
            covered: 0.0,
            believed_mean: 0.0,
            known_at_base: None,
            distance_m: 0.0,
            message_bytes: 0,
            pairs_in_contact: 0,
            agents: Vec::new(),
        };
        RunRecord { row, series: vec![sample(0.0, 0.0), sample(80.0, after_80_s), sample(100.0, at_end)] }
    }

    #[test]
    fn causes_follow_from_the_record() {
        let of = |after_80_s, at_end, change: &dyn Fn(&mut RunRow)| Cause::of(&run(after_80_s, at_end, change));
        assert_eq!(of(0.9, 0.995, &|row| row.t99_s = Some(95.0)), None);
        assert_eq!(
            of(0.0, 0.0, &|row| row.reason = EndReason::Failed("an agent was lost".to_owned())),
            Some(Cause::Failed)
        );
        assert_eq!(of(0.5, 0.5, &|row| row.ran_empty = Some(1)), Some(Cause::OutOfEnergy));
        assert_eq!(of(0.5, 0.6, &|row| row.reason = EndReason::NothingMoreSeen), Some(Cause::OutOfSight));
        assert_eq!(of(0.5, 0.6, &|row| row.collisions = 1000), Some(Cause::TimeOver));
        assert_eq!(of(0.5, 0.5, &|row| row.collisions = 4), Some(Cause::Collision));
        assert_eq!(of(0.5, 0.5, &|row| (row.collisions, row.search_failures) = (3, 11)), Some(Cause::NoPath));
        assert_eq!(of(0.5, 0.5, &|row| row.search_failures = 10), Some(Cause::Stuck));
    }
}
