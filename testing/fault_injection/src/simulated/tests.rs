use simulation::scenario::OnAgentLoss;

use super::adversary::Adversary;
use super::network::Network;
use super::*;

/// Seeds of the test suite; `maes faults --simulated` has the long runs.
const SEEDS: u64 = 200;

/// Seeds within which every broken promise is found.
const MUTATION_SEEDS: u64 = 60;

#[test]
fn disturbed_runs_equal_the_undisturbed_one() {
    let options = Options { first_seed: 0, seeds: SEEDS, jobs: NonZero::new(2).unwrap() };
    let failures = Mutex::new(Vec::new());
    let report = |line: &str| failures.lock().unwrap().push(line.to_owned());
    let Summary { seeds, failures: failed, counts, .. } = run(&options, &AtomicBool::new(false), &report);
    assert!(failed.is_empty(), "{:#?}", failures.lock().unwrap());
    assert_eq!(seeds, SEEDS);
    // Everything that may go wrong has gone wrong.
    let Counts { messages, lost, duplicated, agents_killed, servers_killed, .. } = counts;
    let Counts { power_failures, disk_failures, resumed, refused, .. } = counts;
    assert!([messages, lost, duplicated].iter().all(|&count| count > 1000), "{counts:?}");
    assert!([agents_killed, servers_killed, power_failures, resumed, refused].iter().all(|&n| n > 20), "{counts:?}");
    assert!(disk_failures > 5, "{counts:?}");
}

/// Each has found a defect that was mended since; the seeds below [`SEEDS`] have found more.
#[test]
fn seeds_that_have_found_defects_pass() {
    for seed in [552, 581, 669, 721, 728, 3856, 3893, 81022] {
        assert_eq!(of_seed(seed, None, false).verdict.err(), None, "seed {seed}");
    }
}

/// Two processes for the same two agents hear of the run at once, and joins are lost and overtaken:
/// one of them must get both ids. If each gets one, each is refused as the other agent and ends.
#[test]
fn one_of_two_processes_gets_all_agents() {
    let is_one_of_two = |scenario: &Scenario| {
        scenario.agents.count.is_multiple_of(2) && scenario.faults.on_agent_loss != OnAgentLoss::Wait
    };
    let scenarios = (0..).filter_map(|seed| Some((seed, scenarios::of_seed(seed).ok()?)));
    for (seed, scenario) in scenarios.filter(|(_, scenario)| is_one_of_two(scenario)).take(20) {
        let usual = Adversary::of_seed(seed, scenario.faults.on_agent_loss);
        // The servers that are killed leave agents behind that wait for the next one.
        let adversary = Adversary { loss: 0.15, losses_max: 2, reorders: true, server_kills: 4, ..usual };
        let network = Network::new(seed, adversary, None, false);
        let report = execute(Cluster::over(network, &scenario, 2), &scenario);
        assert_eq!(report.verdict.err(), None, "seed {seed}");
    }
}

#[test]
fn seed_determines_every_event() {
    let is_eventful = |report: &SeedReport| report.counts.resumed > 0 && report.counts.agents_killed > 0;
    let eventful = (0..).map(|seed| (seed, of_seed(seed, None, true))).filter(|(_, report)| is_eventful(report));
    for (seed, first) in eventful.take(5) {
        assert!(first.log.len() > 100);
        let second = of_seed(seed, None, true);
        let difference = first.log.iter().zip(&second.log).find(|(one, two)| one != two);
        assert!(first == second, "seed {seed}: {difference:?}");
    }
}

#[test]
fn broken_promises_are_found() {
    use Mutation::{ForgottenTick, NoResends, NoSyncs, OtherDecisions, StaleCommands};
    for mutation in [NoResends, NoSyncs, ForgottenTick, OtherDecisions, StaleCommands] {
        let fails = |seed: &u64| of_seed(*seed, Some(mutation), false).verdict.is_err();
        let found = (0..MUTATION_SEEDS).find(fails);
        let seed = found.unwrap_or_else(|| panic!("{mutation:?} was not found"));
        assert_eq!(of_seed(seed, None, false).verdict.err(), None, "seed {seed} without {mutation:?}");
    }
}
