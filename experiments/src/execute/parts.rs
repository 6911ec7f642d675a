//! Parts of a plan, for machines that share no queue: the workload manager of a cluster takes the
//! next part whenever a worker is free, so parts need not be equal, but many, and the longest
//! first.
//!
//! The parts depend on the plan and their number alone, so every machine finds the same ones.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::num::NonZero;

use crate::plan::PlannedRun;

/// One of `parts` parts of a plan, of about equal expected cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    pub index: usize,
    pub parts: NonZero<usize>,
}

impl Part {
    pub const WHOLE: Self = Self { index: 0, parts: NonZero::<usize>::MIN };

    /// The runs of the part, in the order of the plan.
    ///
    /// Each run, the most expensive first, goes to the part with the least cost so far (LPT). So
    /// the first part has the most expensive run, alone if that is as long as the mean part, and
    /// the most expensive part costs at most 4/3 of what it has to.
    #[must_use]
    pub fn of<'a>(&self, runs: &'a [PlannedRun]) -> Vec<&'a PlannedRun> {
        let mut by_cost: Vec<usize> = (0..runs.len()).collect();
        by_cost.sort_by_key(|&run| Reverse(runs[run].cost));
        let mut loads: BinaryHeap<Reverse<(u64, usize)>> =
            (0..self.parts.get()).map(|part| Reverse((0, part))).collect();
        let mut mine = Vec::new();
        for run in by_cost {
            let Some(mut least) = loads.peek_mut() else { break };
            let Reverse((load, part)) = &mut *least;
            if *part == self.index {
                mine.push(run);
            }
            *load = load.saturating_add(runs[run].cost);
        }
        mine.sort_unstable();
        mine.into_iter().map(|run| &runs[run]).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::path::Path;

    use super::*;
    use crate::plan::Plan;

    fn plan(axes: &str, seeds: u32) -> Plan {
        let text = format!(
            "seeds = \"1..{seeds}\"\n[axes]\n{axes}\n[scenario]\nduration_s = 1.0\nmap = {{ kind = \"noise\", size = 20 }}\n\
             agents = {{ count = 1 }}\n"
        );
        Plan::parse("p.toml", &text, Path::new("")).unwrap()
    }

    fn parts(plan: &Plan, number: usize) -> Vec<Vec<&PlannedRun>> {
        let parts = NonZero::new(number).unwrap();
        (0..number).map(|index| Part { index, parts }.of(&plan.runs)).collect()
    }

    fn cost(part: &[&PlannedRun]) -> u64 {
        part.iter().map(|run| run.cost).sum()
    }

    #[test]
    fn every_run_is_in_one_part_of_about_equal_cost() {
        let plan = plan("\"agents.count\" = [1, 2, 5, 10]\n\"map.size\" = [20, 25, 30]", 10);
        for number in [1, 2, 7, 16, 50] {
            let parts = parts(&plan, number);
            let all: Vec<&String> = parts.iter().flatten().map(|run| &run.id).collect();
            assert_eq!(all.len(), plan.runs.len());
            assert_eq!(all.into_iter().collect::<BTreeSet<_>>().len(), plan.runs.len());
            let mean = plan.runs.iter().map(|run| run.cost).sum::<u64>() / number as u64;
            let longest = plan.runs.iter().map(|run| run.cost).max().unwrap();
            let greatest = parts.iter().map(|part| cost(part)).max().unwrap();
            assert!(
                greatest * 3 <= 4 * mean.max(longest),
                "{number} parts: {greatest}, mean {mean}, longest {longest}"
            );
        }
    }

    #[test]
    fn longest_runs_are_alone_and_first() {
        let plan = plan("\"map.size\" = [20, 80]", 3);
        let parts = parts(&plan, 5);
        let sizes: Vec<Vec<u32>> = parts
            .iter()
            .map(|part| part.iter().map(|run| run.scenario.map.size.unwrap().cells()[0]).collect())
            .collect();
        assert_eq!(sizes, [vec![80], vec![80], vec![80], vec![20, 20], vec![20]]);
    }

    #[test]
    fn parts_beyond_the_runs_are_empty() {
        let plan = plan("\"agents.count\" = [1]", 2);
        assert_eq!(parts(&plan, 4).iter().map(Vec::len).collect::<Vec<_>>(), [1, 1, 0, 0]);
    }
}
