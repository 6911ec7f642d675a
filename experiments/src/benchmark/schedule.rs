//! How long a whole benchmark takes on many cores: a simulated schedule of measured run times.
//!
//! The schedule is that of the job files ([`crate::cluster`]): runs in the order of their expected
//! cost, the greatest first, each to the next core that is free, without a second thought. It is no
//! optimum: the order knows the expected cost, not the measured time.
//!
//! Runs that are missing are taken to last as long as those of the same track, in turn, so that a
//! few seeds of every track are enough. Nothing is executed here.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;
use std::num::NonZero;
use std::path::Path;

use super::{Benchmark, BenchmarkError, BenchmarkWorld, Run, SEEDS, run};
use crate::plan::Plan;
use crate::rows::RunRecord;
use crate::store::{PLAN, Store};

/// A simulated schedule of a whole benchmark.
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule {
    pub cores: usize,
    /// Runs whose time was measured.
    pub measured: usize,
    /// All runs.
    pub runs: usize,
    /// Processor time of all runs, s.
    pub total_s: f64,
    /// The longest run, s.
    pub longest_s: f64,
    /// From the start of the first run to the end of the last one, s.
    pub makespan_s: f64,
}

impl Schedule {
    /// No schedule on these cores is shorter, s.
    #[must_use]
    pub fn bound_s(&self) -> f64 {
        self.longest_s.max(self.total_s / self.cores as f64)
    }
}

/// The schedule of the whole benchmark on so many cores, from the runs in a folder of
/// [`execute`](super::execute()). `extra_s` is what a run takes beside its measured wall time: the
/// start of a process, and the making of the map.
///
/// # Errors
/// If there is no run of a track, or no folder, or it cannot be read.
pub fn schedule(folder: &Path, cores: NonZero<usize>, extra_s: f64) -> Result<Schedule, BenchmarkError> {
    let unfit = |reason: String| Err(BenchmarkError::Unfit { file: folder.display().to_string(), reason });
    let commands = Benchmark::ALL.map(|benchmark| format!("`maes bench {} --out`", benchmark.name)).join(" or ");
    if !folder.is_dir() {
        return unfit(format!("no folder; expected that of {commands}"));
    }
    // No two benchmarks have a world in common.
    let has_world = |benchmark: &&&Benchmark| benchmark.worlds().any(|world| folder.join(world).is_dir());
    let benchmark = match Benchmark::ALL.iter().filter(has_world).collect::<Vec<_>>()[..] {
        [benchmark] => benchmark,
        [] => return unfit(format!("no runs of a benchmark; expected those of {commands}")),
        _ => return unfit("runs of several benchmarks; expected a folder for each".to_owned()),
    };
    let mut tracks = Vec::new();
    for world in benchmark.worlds {
        let runs = runs(benchmark, world, folder)?;
        for &team in benchmark.teams {
            for (radio, localisation) in conditions(benchmark) {
                let is_of =
                    |run: &Run| (run.agents, &*run.radio, run.localisation.as_deref()) == (team, radio, localisation);
                let mut times: Vec<&Timed> = runs.iter().filter(|timed| is_of(&timed.run)).collect();
                if times.is_empty() {
                    let localisation = localisation.map_or_else(String::new, |name| format!(", {name}"));
                    return unfit(format!(
                        "no run of {}, {team} agents, {radio} radio{localisation}; expected one of each track at least, \
                         as with --seeds 1",
                        world.name
                    ));
                }
                times.sort_by_key(|timed| timed.run.seed);
                tracks.push(times.iter().map(|timed| (timed.cost, timed.wall_s)).collect());
            }
        }
    }
    Ok(of_tracks(&tracks, cores, extra_s))
}

/// The schedule of tracks, each with the expected cost and the wall time of the runs that are
/// there.
fn of_tracks(tracks: &[Vec<(u64, f64)>], cores: NonZero<usize>, extra_s: f64) -> Schedule {
    let of_track = |times: &'_ Vec<(u64, f64)>| times.clone().into_iter().cycle().take(SEEDS);
    let mut runs: Vec<(u64, f64)> = tracks.iter().flat_map(of_track).collect();
    // Stable: runs of equal cost stay in the order of the tracks.
    runs.sort_by_key(|&(cost, _)| Reverse(cost));
    let times_s: Vec<f64> = runs.into_iter().map(|(_, time_s)| time_s + extra_s).collect();
    Schedule {
        cores: cores.get(),
        measured: tracks.iter().map(|times| times.len().min(SEEDS)).sum(),
        runs: times_s.len(),
        total_s: times_s.iter().sum(),
        longest_s: times_s.iter().copied().fold(0.0, f64::max),
        makespan_s: makespan_s(&times_s, cores),
    }
}

/// A run that is there.
struct Timed {
    run: Run,
    /// Expected cost of the runs of its team.
    cost: u64,
    wall_s: f64,
}

/// The radios and localisations of a benchmark.
fn conditions(benchmark: &Benchmark) -> impl Iterator<Item = (&'static str, Option<&'static str>)> {
    benchmark.radios().flat_map(|radio| benchmark.localisations().map(move |localisation| (radio, localisation)))
}

/// The runs of a world that are there.
fn runs(benchmark: &Benchmark, world: &BenchmarkWorld, folder: &Path) -> Result<Vec<Timed>, BenchmarkError> {
    let folder = folder.join(world.name);
    if !folder.join(PLAN).is_file() {
        return Ok(Vec::new());
    }
    let plan = Plan::load(&folder.join(PLAN))?;
    let cost_of =
        |agents: u32| plan.runs.iter().find(|run| run.scenario.agents.count == agents).map_or(0, |run| run.cost);
    let records = Store::open(&folder)?.records()?;
    let timed = |record: &RunRecord| {
        let run = run(benchmark, world, &record.row)?;
        Ok(Timed { cost: cost_of(run.agents), run, wall_s: record.row.wall.wall_s })
    };
    records.iter().map(timed).collect()
}

/// The time until all tasks have ended, if each in turn goes to the first core that is free. The
/// unit is that of the times.
#[must_use]
pub fn makespan_s(times_s: &[f64], cores: NonZero<usize>) -> f64 {
    let mut free_at: BinaryHeap<Reverse<Moment>> = (0..cores.get()).map(|_| Reverse(Moment(0.0))).collect();
    let mut end = 0.0_f64;
    for &time_s in times_s {
        let Some(mut first) = free_at.peek_mut() else { break };
        first.0.0 += time_s;
        end = end.max(first.0.0);
    }
    end
}

/// A time in a queue.
#[derive(Debug, Clone, Copy)]
struct Moment(f64);

impl Ord for Moment {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl PartialOrd for Moment {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Moment {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Moment {}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use agent_node::controllers::Registry;
    use proptest::prelude::*;

    use super::*;
    use crate::benchmark::{EXPLORATION_1, Entry, Scope, execute};
    use crate::execute::{Options, Part, Stop, Transport};

    fn on(cores: usize, times_s: &[f64]) -> f64 {
        makespan_s(times_s, NonZero::new(cores).unwrap())
    }

    #[test]
    fn tasks_go_to_the_first_free_core() {
        assert_eq!(on(1, &[3.0, 1.0, 2.0]), 6.0);
        assert_eq!(on(2, &[3.0, 1.0, 2.0]), 3.0);
        // In this order: 2 and 2, then 3 after the first of them; the best is 4.
        assert_eq!(on(2, &[2.0, 2.0, 3.0]), 5.0);
        assert_eq!(on(2, &[3.0, 2.0, 2.0]), 4.0);
        assert_eq!(on(100, &[0.5; 7]), 0.5);
        assert_eq!(on(3, &[]), 0.0);
    }

    proptest! {
        /// Graham's bounds for list scheduling.
        #[test]
        fn makespan_lies_between_the_bounds(times in prop::collection::vec(0.0..100.0, 1..60), cores in 1_usize..12) {
            let total: f64 = times.iter().sum();
            let longest = times.iter().copied().fold(0.0, f64::max);
            let makespan = on(cores, &times);
            let tolerance = 1e-9 * total;
            prop_assert!(makespan >= longest.max(total / cores as f64) - tolerance);
            prop_assert!(makespan <= total / cores as f64 + longest * (1.0 - 1.0 / cores as f64) + tolerance);
        }
    }

    #[test]
    fn missing_runs_last_as_long_as_those_of_their_track() {
        let hundred = NonZero::new(100).unwrap();
        let short: Vec<(u64, f64)> = (0..SEEDS).map(|seed| (1, seed as f64)).collect();
        let long = vec![(9, 50.0), (9, 70.0)];
        let all = of_tracks(&[short, long], hundred, 0.5);
        assert_eq!((all.measured, all.runs, all.longest_s), (SEEDS + 2, 2 * SEEDS, 70.5));
        assert_eq!(all.total_s, 435.0 + 15.0 * (50.0 + 70.0) + 30.0);
        assert_eq!((all.makespan_s, all.bound_s()), (70.5, 70.5));
        // The expensive track starts first: 30 runs of 50 and 70 in turn, on two cores.
        let alone = of_tracks(&[vec![(1, 0.0)], vec![(9, 50.0), (9, 70.0)]], NonZero::new(2).unwrap(), 0.0);
        assert_eq!((alone.makespan_s, alone.bound_s()), (930.0, 900.0));
    }

    #[test]
    fn every_track_needs_a_run() {
        let site = tempfile::tempdir().unwrap();
        let hundred = NonZero::new(100).unwrap();
        let refused = |world: &str| {
            let error = schedule(site.path(), hundred, 0.0).unwrap_err().to_string();
            assert!(error.contains(&format!("no run of {world}, 1 agents, perfect radio; expected one")), "{error}");
        };
        let nothing = schedule(site.path(), hundred, 0.0).unwrap_err().to_string();
        assert!(nothing.contains("expected those of `maes bench exploration-1 --out` or `maes bench exploration-2"));
        let entry =
            Entry { controller: "rbw".to_owned(), set: BTreeMap::new(), command: Vec::new(), files: BTreeMap::new() };
        let options = Options {
            jobs: NonZero::new(2).unwrap(),
            transport: Transport::Memory,
            part: Part::WHOLE,
            registry: Registry::BUILT_IN,
            prune: false,
        };
        let worlds = BTreeSet::from(["cave-50".to_owned()]);
        let scope = Scope { worlds, seeds: vec![2, 1], phrase: None };
        execute(&EXPLORATION_1, &entry, &scope, site.path(), &options, &mut (), &Stop::default()).unwrap();
        refused("cave-75");
        let runs = runs(&EXPLORATION_1, &EXPLORATION_1.worlds[0], site.path()).unwrap();
        let of_track = |agents| {
            let is_of = move |timed: &&Timed| timed.run.agents == agents && timed.run.radio == "lossy";
            runs.iter().filter(is_of).collect::<Vec<_>>()
        };
        let (small, large) = (of_track(1), of_track(20));
        assert_eq!((small.len(), large.len()), (2, 2));
        assert!(small[0].cost < large[0].cost, "the larger team costs more");
        let records = Store::open(&site.path().join("cave-50")).unwrap().records().unwrap();
        let is_first = |record: &&RunRecord| {
            let row = &record.row;
            row.seed == 1 && row.agents == 20 && row.axes["communication"].contains("loss")
        };
        let first = large.iter().find(|timed| timed.run.seed == 1).unwrap();
        assert_eq!(first.wall_s, records.iter().find(is_first).unwrap().row.wall.wall_s);
    }
}
