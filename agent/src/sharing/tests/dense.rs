//! Dense neighbourhoods: more contacts than messages are addressed to.

use proptest::prelude::*;

use super::super::*;
use super::team::{BUDGET, SimulatedTeam, all_pairs, extent};
use crate::command::WakeCondition;

/// Copies for all who lack the delta would not fit into a command: nothing was ever sent.
#[test]
fn delta_for_most_of_a_dense_neighbourhood_is_broadcast() {
    let agents = 200;
    let mut team = SimulatedTeam::new(agents, extent(6), 50);
    let pairs = all_pairs(agents);
    team.exchange(0, &pairs);
    // Agent 1 knows from agent 0 what all others lack.
    team.maps[0].note_free(&[7]);
    team.exchange(50, &[(0, 1)]);
    let to_others: Vec<(u32, u32)> = (0..agents).filter(|&other| other != 1).map(|other| (1, other)).collect();
    let before = team.sharings[1].totals().messages_sent;
    team.exchange(100, &to_others);
    assert!(team.maps.iter().all(|map| map.free() == 1));
    assert_eq!(team.sharings[1].totals().messages_sent - before, 4 + 3, "a summary to four, one of each form to all");
    assert_eq!(team.wake(1, &to_others, 103).at, Tick(150));
}

/// Each sent its delta to all others: the square of the dense neighbourhood.
#[test]
fn dense_neighbourhood_leaves_its_delta_to_a_relay_peer() {
    let agents = 60;
    let mut team = SimulatedTeam::new(agents, extent(10), 50);
    for (agent, map) in (0..).zip(&mut team.maps) {
        map.note_free(&[agent, 500]);
    }
    let pairs = all_pairs(agents);
    team.due = Some(vec![(WakeCondition::NEXT_TICK, vec![]); agents as usize]);
    (0..50).for_each(|now| drop(team.tick(now, &pairs, BUDGET)));
    // Summaries to and from four; an update and an acknowledgement of each to the relay peer; and
    // of the relay peer a summary, an update and an acknowledgement to all.
    assert_eq!(team.posted, 4 * 59 + 56 * 4 + 2 * 59 + 3 * 59);
    team.delivered.clear();
    (50..100).for_each(|now| drop(team.tick(now, &pairs, BUDGET)));
    assert!(team.maps.iter().all(|map| map.free() == 61));
    assert_eq!(team.delivered, [], "all know that all know it");
}

proptest! {
    // A case that fails takes a second, and to shrink it hours.
    #![proptest_config(ProptestConfig { max_shrink_iters: 20, ..ProptestConfig::default() })]

    /// Contacts of a dense neighbourhood are not all in contact with each other, and messages get
    /// lost. Most cases take less than 60 periods, one in 1500 up to 300: budgets are small, and
    /// the order of the agents is drawn anew in each period.
    #[test]
    fn maps_of_a_dense_neighbourhood_converge_after_any_losses(
        apart in prop::collection::vec((0u32..40, 0u32..40), 0..500),
        findings in prop::collection::vec((0u32..40, 0u32..1000), 1..60),
        losses in prop::collection::vec(prop::bool::weighted(0.2), 0..4000),
        budget in 3000usize..BUDGET,
    ) {
        let agents = 40;
        let mut team = SimulatedTeam::new(agents, extent(10), 5);
        team.due = Some(vec![(WakeCondition::NEXT_TICK, vec![]); agents as usize]);
        team.losses = losses.into_iter();
        let pairs: Vec<(u32, u32)> = all_pairs(agents).into_iter().filter(|pair| !apart.contains(pair)).collect();
        let mut now = 0;
        for some in findings.chunks(20) {
            some.iter().for_each(|&(agent, cell)| team.maps[agent as usize].note_free(&[cell]));
            for _ in 0..6 {
                team.tick(now, &pairs, budget);
                now += 1;
            }
        }
        team.losses = Vec::new().into_iter();
        let has_contacts = |agent: &usize| pairs.iter().any(|&(one, other)| [one, other].contains(&(*agent as u32)));
        let connected: Vec<usize> = (0..agents as usize).filter(has_contacts).collect();
        let are_alike = |team: &SimulatedTeam| connected.iter().all(|&agent| team.states(agent) == team.states(connected[0]));
        while !are_alike(&team) {
            prop_assert!(now < 5000, "the maps differ");
            team.tick(now, &pairs, budget);
            now += 1;
        }
    }
}
