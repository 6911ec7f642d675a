//! The oracle on many maps: no run is faster than its bound, and its flights see everything.

use std::num::NonZero;
use std::path::Path;

use experiments::execute::{self, Options, Part, Stop, Transport};
use experiments::oracle;
use experiments::plan::Plan;
use experiments::rows::{Marks, RunRow};
use experiments::store::Store;
use simulation::scenario::Scenario;

fn scenario(map: &str, agents: u32, seed: u64, more: &str) -> Scenario {
    let text = format!(
        "seed = {seed}\nduration_s = 1800.0\nmap = {map}\nagents = {{ count = {agents}, controller = \"rbw\" }}\n{more}\n"
    );
    Scenario::parse("oracle.toml", &text, &[]).expect("a legal scenario")
}

fn times(marks: &Marks) -> [Option<f64>; 3] {
    [marks.t90_s, marks.t99_s, marks.t100_s]
}

/// Narrow passages, crowded starts, other bodies and LiDARs: bodies that get into each other's way
/// have to get out of it again.
#[test]
fn flights_see_everything() {
    let cases = [
        ("{ kind = \"spheres\", size = 32 }", 8, ""),
        ("{ kind = \"noise\", size = 24 }", 3, ""),
        ("{ kind = \"building\", size = [30, 30, 13] }", 6, "spawn = { kind = \"entrances\" }"),
        ("{ kind = \"spheres\", size = 30 }", 3, "lidar = { range_m = 6.0 }"),
        ("{ kind = \"spheres\", size = 28 }", 4, "body = { kind = \"aerial\" }\nlidar = { range_m = 8.0 }"),
        ("{ kind = \"spheres\", size = 24 }", 2, "lidar = { pattern = \"shell\" }"),
        ("{ kind = \"spheres\", size = 28 }", 3, "lidar = { schedule = \"maes3d\", range_m = 10.0 }"),
    ];
    for (map, agents, more) in cases {
        for seed in 0..2 {
            let scenario = scenario(map, agents, seed, more);
            let row = oracle::of(&scenario).unwrap();
            let what = format!("{map}, {agents} agents, {more}, seed {seed}: {row:?}");
            assert!(row.flown.t100_s.is_some(), "{what}");
            for (bound, flown) in times(&row.bound).into_iter().zip(times(&row.flown)) {
                assert!(bound.unwrap() <= flown.unwrap(), "{what}");
            }
            if seed == 0 {
                assert_eq!(oracle::of(&scenario).unwrap(), row, "{what}");
            }
        }
    }
}

#[test]
fn limited_field_of_view_has_a_bound_and_no_flight() {
    let row = oracle::of(&scenario("{ kind = \"spheres\", size = 24 }", 2, 1, "lidar = { fov_rad = 2.0 }")).unwrap();
    assert_eq!(row.flown, Marks::default());
    assert!(row.bound.t100_s.is_some());
}

/// Noise lets rays go on behind walls, so cells are seen that are in no line of sight.
#[test]
fn noise_in_ranges_leaves_no_bound_and_the_same_flight() {
    let map = "{ kind = \"spheres\", size = 24 }";
    let exact = oracle::of(&scenario(map, 2, 1, "")).unwrap();
    let noisy = scenario(map, 2, 1, "sensor = { range_sigma_m = 0.5, pose_bound_m = 0.2 }");
    let row = oracle::of(&noisy).unwrap();
    assert_eq!((row.bound, row.flown), (Marks::default(), exact.flown));
    assert_ne!(oracle::world(&noisy), oracle::world(&scenario(map, 2, 1, "")));
}

/// Whoever knows the map needs neither radio nor sharing.
#[test]
fn oracle_is_the_same_for_all_radios_and_controllers() {
    let map = "{ kind = \"spheres\", size = 24 }";
    let one = scenario(map, 2, 1, "");
    let mut other = scenario(map, 2, 1, "communication = { model = \"global\", loss = 0.5 }");
    other.agents.controller = "lvd".to_owned();
    other.agents.share_period_ticks = 7;
    assert_eq!(oracle::world(&one), oracle::world(&other));
    assert_eq!(oracle::of(&one).unwrap(), oracle::of(&other).unwrap());
    assert_ne!(oracle::world(&one), oracle::world(&scenario(map, 3, 1, "")));
}

/// A plan over maps, teams, LiDARs, bodies and controllers; one team has a slow and a fast body.
const PLAN: &str = "seeds = \"1..2\"\noracle = true\n\
                    [axes]\n\"agents.controller\" = [\"lvd\", \"nearest-frontier\"]\n\
                    map = [{ kind = \"spheres\", size = 24 }, { kind = \"noise\", size = 20 }]\n\
                    lidar = [{}, { range_m = 4.0 }, { pattern = \"shell\", shell_radius_cells = 3 }]\n\
                    [[variant]]\nname = \"one\"\nagents.count = 1\n\
                    [[variant]]\nname = \"many\"\nagents.count = 4\nbody = { kind = \"aerial\" }\n\
                    bodies = [{ agents = [1, 2], kind = \"submarine\", speed_max_m_s = 0.4 }]\n\
                    [scenario]\nduration_s = 300.0\nmap = { kind = \"spheres\", size = 24 }\nagents = { count = 1 }\n";

#[test]
fn no_run_is_faster_than_its_bound() {
    let site = tempfile::tempdir().unwrap();
    let plan = Plan::parse("p.toml", PLAN, Path::new("")).unwrap();
    let jobs = NonZero::new(2).unwrap();
    let options = Options {
        jobs,
        transport: Transport::Memory,
        part: Part::WHOLE,
        registry: agent_node::controllers::Registry::BUILT_IN,
        prune: false,
    };
    let go = |plan: &Plan| execute::execute(plan, site.path().to_owned(), &options, &mut (), &Stop::default()).unwrap();
    // A folder of a plan that did not ask for the oracle gets it when it does.
    go(&Plan { oracle: false, ..plan.clone() });
    let store = Store::open(site.path()).unwrap();
    let before = store.records().unwrap();
    assert!(before.iter().all(|record| record.row.oracle.is_none()));
    assert_eq!(go(&plan).skipped, plan.runs.len());
    let records = store.records().unwrap();
    let (mut compared, mut positive) = (0, 0);
    for RunRow { id, oracle, t90_s, t99_s, t100_s, .. } in records.iter().map(|record| &record.row) {
        let bound = times(&oracle.unwrap().bound);
        for (run, bound) in [t90_s, t99_s, t100_s].into_iter().zip(bound) {
            if let Some(run) = run {
                assert!(*run >= bound.unwrap(), "run {id}: {run} s, bound {bound:?} s");
                compared += 1;
                positive += usize::from(bound.unwrap() > 0.0);
            }
        }
    }
    assert!(compared > 60 && positive > 10, "{compared} times compared, {positive} with a bound above 0");
    let mut without = records.clone();
    without.iter_mut().for_each(|record| record.row.oracle = None);
    assert_eq!(without, before, "all else is as it was");
    let table = std::fs::read_to_string(site.path().join("runs.csv")).unwrap();
    assert!(table.lines().next().unwrap().contains("digest,oracle_t90_s,oracle_t99_s,oracle_t100_s,bound_t90_s"));
}

#[test]
fn flight_ends_with_the_duration() {
    let mut scenario = scenario("{ kind = \"noise\", size = 30 }", 2, 5, "");
    scenario.duration_s = 2.0;
    let row = oracle::of(&scenario).unwrap();
    assert!(row.flown.t100_s.is_none_or(|time_s| time_s <= 2.0));
}
