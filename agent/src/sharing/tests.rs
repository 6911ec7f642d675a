mod dense;
mod team;
mod trust;

use nalgebra::Point3;
use proptest::prelude::*;
use protocol::event_mask::EventMask;
use protocol::message_type::MessageType;
use voxels::Cell;

use super::updates::{BUDGET_MIN, INBOX_BYTES};
use super::*;
use crate::command::{Peer, WakeCondition};
use crate::exploration_map::{CellState, Finding};
use team::{BUDGET, SimulatedTeam, all_pairs, extent};

#[test]
fn two_agents_exchange_at_once_and_then_every_period() {
    let mut team = SimulatedTeam::new(2, extent(10), 5);
    let pair = [(0, 1)];
    assert_eq!(team.wake(0, &[], 0), WakeCondition { at: Tick(u64::MAX), events: EventMask::FIRST_CONTACT });
    team.maps[0].note_free(&[1, 2, 3]);
    team.maps[1].note_wall(&[7, 9]);
    assert_eq!(team.tick(5, &pair, BUDGET), [0, 0], "summaries");
    assert_eq!(team.wake(0, &pair, 5), WakeCondition { at: Tick(6), events: EventMask::FIRST_CONTACT });
    assert_eq!(team.tick(6, &pair, BUDGET), [10, 9]);
    assert_eq!(team.wake(0, &pair, 6).at, Tick(10));
    team.tick(7, &pair, BUDGET);
    assert_eq!(team.states(0), team.states(1));
    team.maps[0].note_covered(Cell::new(2, 0, 0));
    for now in [8, 9, 10] {
        assert_eq!(team.tick(now, &pair, BUDGET), [0, 0], "{now}");
    }
    // Changes received from the peer are not sent back.
    assert_eq!(team.tick(11, &pair, BUDGET), [8, 0]);
    team.tick(12, &pair, BUDGET);
    assert_eq!(team.states(0), team.states(1));
    assert_eq!(team.maps[1].covered(), 1);
    // A missed turn is made up for.
    team.maps[1].note_free(&[100]);
    assert_eq!(team.tick(15, &[], BUDGET), [0, 0]);
    team.tick(17, &pair, BUDGET);
    assert!(team.tick(18, &pair, BUDGET)[1] > 0);
    assert_eq!(team.wake(1, &pair, 18).at, Tick(20));
    let totals = team.sharings[0].totals();
    // Three summaries, two updates, two acknowledgements; and of the other an update less, which
    // has just been sent.
    assert_eq!((totals.messages_sent, totals.messages_taken), (7, 6));
}

#[test]
fn received_changes_are_forwarded_but_not_returned() {
    let mut team = SimulatedTeam::new(3, extent(10), 5);
    team.maps[0].note_free(&[1, 2, 3]);
    team.maps[1].note_free(&[20, 21]);
    team.maps[2].note_wall(&[40]);
    let now = team.exchange(0, &[(0, 1)]);
    let mut now = team.exchange(now, &[(1, 2)]);
    assert_eq!(team.states(1), team.states(2), "C knows what A saw");
    assert_eq!(team.sent_cells(1, 2), [1, 2, 3, 20, 21]);
    assert_eq!(team.sent_cells(2, 1), [40]);
    while now < 30 {
        now = team.exchange(now, &[(0, 1), (1, 2)]);
    }
    assert_eq!(team.sent_cells(1, 0), [20, 21, 40], "nothing is returned, nothing is sent twice");
    assert_eq!(team.sent_cells(1, 2), [1, 2, 3, 20, 21]);
    assert_eq!(team.states(0), team.states(2));
}

/// What a body took to be in its blind spot reached the team as known.
#[test]
fn assumptions_are_shared_once_they_are_found() {
    let mut team = SimulatedTeam::new(3, extent(10), 5);
    let cell = |x| Cell::new(x, 0, 0);
    team.maps[0].assume(&[cell(5)], Finding::Wall);
    let mut now = team.exchange(0, &[(0, 1)]);
    assert_eq!((team.sent_cells(0, 1), team.maps[1].free() + team.maps[1].wall()), (vec![], 0));
    team.maps[0].note_free(&[1]);
    team.maps[0].assume(&[cell(2), cell(3), cell(4)], Finding::Free);
    team.maps[0].note_free(&[9]);
    now = team.exchange(now + 5, &[(0, 1)]);
    assert_eq!(team.sent_cells(0, 1), [1, 9]);
    // Found, reported otherwise, visited, and reported so.
    team.maps[0].note_free(&[2]);
    team.maps[1].note_wall(&[3, 5]);
    team.maps[0].note_covered(cell(4));
    now = team.exchange(now + 5, &[(0, 1)]);
    assert_eq!((team.sent_cells(0, 1), team.sent_cells(1, 0)), (vec![1, 2, 4, 9], vec![3, 5]));
    assert_eq!(team.states(0), team.states(1));
    // No other agent had heard of the assumption that is overruled.
    assert_eq!((team.maps[0].revisions(), team.maps[0].corrections()), (1, 0));
    team.exchange(now + 5, &[(0, 2)]);
    assert_eq!(team.states(0), team.states(2), "what was confirmed is passed on");
}

/// Two that met for the first time sent each other their whole maps, though both had them from a
/// third one.
#[test]
fn what_both_know_from_others_is_not_sent_at_a_first_contact() {
    let mut team = SimulatedTeam::new(4, extent(10), 5);
    team.maps[0].note_free(&[1, 2, 3]);
    let mut now = team.exchange(0, &[(0, 1)]);
    now = team.exchange(now, &[(0, 1), (1, 2)]);
    now = team.exchange(now, &[(0, 3)]);
    team.maps[2].note_free(&[9]);
    now = team.exchange(now, &[(2, 3)]);
    assert_eq!((team.sent_cells(2, 3), team.sent_cells(3, 2)), (vec![9], vec![]));
    now = team.exchange(now, &[(1, 3)]);
    assert_eq!((team.sent_cells(3, 1), team.sent_cells(1, 3)), (vec![9], vec![]));
    team.exchange(now, &all_pairs(4));
    // Not all three send it.
    assert_eq!((1..4).map(|from| team.sent_cells(from, 0).len()).sum::<usize>(), 2);
    assert!((1..4).all(|agent| team.states(agent) == team.states(0)));
}

/// Lost updates were never sent again.
#[test]
fn lost_messages_are_made_up_for() {
    let findings: [&[u32]; 3] = [&[1, 2, 3], &[20, 21], &[40]];
    // In which tick all that is under way is lost.
    for lost in 0..8 {
        let mut team = SimulatedTeam::new(3, extent(10), 5);
        team.maps.iter_mut().zip(findings).for_each(|(map, cells)| map.note_free(cells));
        for now in 0..40 {
            team.tick(now, &[(0, 1), (1, 2)], BUDGET);
            if now == lost {
                team.inboxes.iter_mut().for_each(Vec::clear);
            }
        }
        assert!((1..3).all(|agent| team.states(agent) == team.states(0)), "lost in tick {lost}");
    }
}

#[test]
fn corrections_reach_all_receivers_of_the_error() {
    let mut team = SimulatedTeam::new(4, extent(10), 5);
    let chain = [(0, 1), (1, 2), (2, 3)];
    team.maps[0].note_wall(&[7, 8]);
    (0..20).for_each(|now| drop(team.tick(now, &chain, BUDGET)));
    assert_eq!(team.states(3)[7..9], [CellState::Wall; 2], "forwarded twice");
    team.maps[2].note_free(&[7]);
    team.maps[3].note_wall(&[8]);
    (20..40).for_each(|now| drop(team.tick(now, &chain, BUDGET)));
    for agent in 1..4 {
        assert_eq!(team.states(agent)[7..9], [CellState::Free, CellState::Wall], "agent {agent}");
        assert_eq!((team.maps[agent].corrections(), team.maps[agent].contradictions()), (1, 0));
    }
    assert_eq!(team.states(0)[7], CellState::Wall, "it has seen it");
    assert_eq!((team.maps[0].corrections(), team.maps[0].contradictions()), (0, 1));
}

#[test]
fn content_received_by_all_is_not_forwarded() {
    let mut team = SimulatedTeam::new(4, extent(10), 5);
    let all = all_pairs(4);
    for (agent, map) in (0..).zip(&mut team.maps) {
        map.note_free(&[10 * agent, 10 * agent + 1]);
    }
    for now in 0..20 {
        let sent = team.tick(now, &all, BUDGET);
        assert_eq!(sent.iter().any(|&bytes| bytes > 0), now == 1, "tick {now}");
    }
    assert_eq!(team.delivered.len(), 4 * 3 * 2);
    assert!((1..4).all(|agent| team.states(agent) == team.states(0)));
}

#[test]
fn remainder_is_sent_in_the_next_ticks() {
    let size = 40;
    let mut team = SimulatedTeam::new(2, extent(size), 1000);
    let pair = [(0, 1)];
    let volume = size * size * size;
    // Isolated cells have the longest encoding.
    let scattered: Vec<u32> = (0..volume).filter(|cell| cell % 3 == 0).collect();
    team.maps[0].note_free(&scattered);
    let budget = 2500;
    team.tick(0, &pair, budget);
    let mut ticks = 1;
    loop {
        let sent = team.tick(ticks, &pair, budget)[0];
        let is_left_over = team.wake(0, &pair, ticks).at == Tick(ticks + 1);
        assert!(sent > budget - 2 * BUDGET_MIN || !is_left_over, "{sent}");
        // Later changes have to wait for the next exchange.
        team.maps[0].note_free(&[1 + 3 * ticks as u32]);
        ticks += 1;
        if !is_left_over {
            break;
        }
    }
    assert!((5..9).contains(&ticks), "{ticks}");
    team.tick(ticks, &pair, budget);
    assert_eq!(team.sent_cells(0, 1).len(), scattered.len());
    assert_eq!(team.maps[1].free(), scattered.len());
}

#[test]
fn interrupted_exchange_continues_at_the_next_contact() {
    let mut team = SimulatedTeam::new(2, extent(40), 1000);
    team.maps[0].note_free(&(0..20_000).map(|cell| 3 * cell).collect::<Vec<_>>());
    team.tick(3, &[(0, 1)], 2000);
    team.tick(4, &[(0, 1)], 2000);
    assert_eq!(team.wake(0, &[(0, 1)], 4).at, Tick(5));
    assert_eq!(team.wake(0, &[], 4).at, Tick(u64::MAX));
    assert_eq!(team.tick(5, &[], BUDGET), [0, 0]);
    team.exchange(90, &[(0, 1)]);
    assert_eq!(team.sent_cells(0, 1).len(), 20_000);
    assert_eq!(team.maps[1].free(), 20_000);
}

#[test]
fn exchange_leaves_room_in_the_inbox_for_others() {
    let agents = 20;
    let mut team = SimulatedTeam::new(agents, extent(128), 251);
    team.maps[0].note_free(&(0..600_000).map(|cell| 3 * cell).collect::<Vec<_>>());
    let room = INBOX_BYTES / agents as usize;
    let mut sent = 0;
    for tick in 0..251 {
        sent += team.tick(tick, &[(0, 1)], BUDGET)[0];
    }
    assert!(sent > room / 3 && sent < room, "{sent} of {room}");
    for tick in 251..5000 {
        team.tick(tick, &[(0, 1)], BUDGET);
    }
    assert_eq!(team.maps[1].free(), 600_000);
}

#[test]
fn exchange_takes_few_bytes_per_cell() {
    const HALLS_X: [i32; 3] = [14, 24, 34];
    const RADIUS: f64 = 8.0;
    let mut team = SimulatedTeam::new(2, extent(50), 5);
    let distance =
        |cell: Cell, x: i32| f64::from((cell.x - x).pow(2) + (cell.y - 25).pow(2) + (cell.z - 25).pow(2)).sqrt();
    let is_free = |cell: Cell| HALLS_X.into_iter().any(|x| distance(cell, x) < RADIUS);
    let mut delivered = 0;
    // Three rooms that open into each other; for the second and third, only the part beyond the one
    // before is new.
    for (exchange, x) in (0..).zip(HALLS_X) {
        let map = &mut team.maps[0];
        let seen: Vec<Cell> = map.extent().cells().filter(|&cell| distance(cell, x) < RADIUS + 1.0).collect();
        let (free, wall): (Vec<Cell>, Vec<Cell>) = seen.into_iter().partition(|&cell| is_free(cell));
        let indices = |cells: &[Cell]| -> Vec<u32> {
            cells.iter().filter_map(|&cell| extent(50).index(cell)).map(|index| index as u32).collect()
        };
        map.note_free(&indices(&free));
        map.note_wall(&indices(&wall));
        let cells = map.journal_len() - delivered;
        delivered = map.journal_len();
        let bytes: usize = (0..4).map(|tick| team.tick(5 * exchange + tick, &[(0, 1)], BUDGET)[0]).sum();
        let bytes_per_100_cells = 100 * bytes / cells;
        assert!((5..40).contains(&bytes_per_100_cells), "exchange {exchange}: {bytes} bytes for {cells} cells");
    }
    assert_eq!(team.delivered.len(), delivered);
    assert_eq!(team.maps[0].contradictions(), 0);
}

#[test]
fn period_0_only_receives() {
    let mut team = SimulatedTeam::new(2, extent(10), 5);
    team.sharings[1] = Sharing::new(AgentId(1), 0, 2);
    team.maps.iter_mut().zip([3, 500]).for_each(|(map, cell)| map.note_free(&[cell]));
    assert_eq!(team.wake(1, &[(0, 1)], 0), WakeCondition { at: Tick(u64::MAX), events: EventMask::MESSAGE });
    let sent: Vec<Vec<usize>> = (0..10).map(|now| team.tick(now, &[(0, 1)], BUDGET)).collect();
    assert!(sent.iter().any(|bytes| bytes[0] > 0) && sent.iter().all(|bytes| bytes[1] == 0));
    assert_eq!((team.maps[0].free(), team.maps[1].free()), (1, 2));
    assert_eq!(team.sent_cells(0, 1), [3], "once");
}

#[test]
fn full_first_exchange_of_all_is_accepted() {
    let agents = 6;
    let extent = extent(30);
    let mut team = SimulatedTeam::new(agents, extent, 50);
    let volume = extent.volume() as u32;
    // Each has seen all of the map and visited half of it: the most that an agent can have to send.
    for (id, map) in (0..).zip(&mut team.maps) {
        map.note_free(&(0..volume).collect::<Vec<_>>());
        (0..volume).filter(|cell| cell % 2 == id % 2).for_each(|cell| map.note_covered(extent.cell_at(cell as usize)));
    }
    (0..250).for_each(|now| drop(team.tick(now, &all_pairs(agents), 3000)));
    for agent in 0..agents as usize {
        assert_eq!(team.maps[agent].covered(), volume as usize);
        assert_eq!(team.sharings[agent].totals().messages_refused, 0);
    }
}

proptest! {
    #[test]
    fn random_bytes_are_merged_or_rejected(
        mut datas in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..60), 0..8),
    ) {
        let mut map = ExplorationMap::new(extent(5));
        let mut sharing = Sharing::new(AgentId(0), 5, 3);
        let mut count = 0;
        for (at, data) in datas.iter_mut().enumerate() {
            if at % 2 == 0 && data.len() > 1 {
                data[0] = VERSION;
                data[1] %= 3;
            }
            let message = AgentMessage { peer: Peer::One(AgentId(1)), kind: MessageType::Map.number(), data: data.clone().into() };
            let report = sharing.incoming(&mut map, &[message]);
            count += report.messages + report.for_others + report.refused.len();
        }
        prop_assert_eq!(count, datas.len());
        prop_assert!(map.changes_since(0).all(|change| change.cell < 125));
        let contacts = [1, 2].map(|agent| Contact { agent: AgentId(agent), position: Point3::origin() });
        sharing.outgoing(&map, &contacts, Tick(1), BUDGET);
    }

    #[test]
    fn maps_converge_to_own_findings_and_best_reports(
        findings in prop::collection::vec((0usize..4, 0u32..27, 0u8..3), 0..80),
        meetings in prop::collection::vec((0u32..4, 0u32..4), 1..20),
        pace in 1usize..20,
    ) {
        let agents = 4;
        let mut team = SimulatedTeam::new(agents, extent(3), 3);
        // What each has found, in ascending precedence: nothing, wall, free, covered.
        let mut own = vec![[0u8; 27]; agents as usize];
        let mut now = 0;
        for (at, (agent, cell, what)) in findings.into_iter().enumerate() {
            let map = &mut team.maps[agent];
            // Nothing changes in this world: no sensor contradicts itself.
            let what = match (what, own[agent][cell as usize]) {
                (0, 2..) | (1, 1) => continue,
                (what, _) => what,
            };
            match what {
                0 => map.note_wall(&[cell]),
                1 => map.note_free(&[cell]),
                _ => map.note_covered(map.extent().cell_at(cell as usize)),
            }
            let found = &mut own[agent][cell as usize];
            *found = if *found == 0 || *found > 1 && what > 0 { (what + 1).max(*found) } else { *found };
            if at % pace == 0 {
                now += 1;
                let (one, other) = meetings[at / pace % meetings.len()];
                let pair = (one != other).then_some((one, other));
                team.tick(now, pair.as_slice(), BUDGET);
            }
        }
        for _ in 0..16 {
            now += 1;
            team.tick(now, &all_pairs(agents), BUDGET);
        }
        for agent in 0..agents as usize {
            for cell in 0..27 {
                let heard = own.iter().map(|found| found[cell]).max().unwrap();
                let believed = match own[agent][cell] {
                    0 => heard,
                    2 if heard == 3 => 3,
                    found => found,
                };
                let state =
                    [CellState::Unexplored, CellState::Wall, CellState::Free, CellState::Covered][believed as usize];
                prop_assert_eq!(team.states(agent)[cell], state, "agent {}, cell {}", agent, cell);
            }
        }
    }

    /// Messages get lost, contacts begin and end, exchanges take several ticks, and agents have
    /// periods of their own and are asked only when they are due.
    #[test]
    fn maps_converge_after_any_losses(
        periods in prop::array::uniform3(prop::sample::select(vec![0, 1, 2, 3, 7, 40])),
        ticks in prop::collection::vec((0u32..3, 0u32..8000, 0usize..8), 1..60),
        losses in prop::collection::vec(prop::bool::weighted(0.3), 0..300),
        budget in 1100usize..3000,
    ) {
        let mut team = SimulatedTeam::new(3, extent(20), 5);
        for (agent, period) in (0..).zip(periods) {
            team.sharings[agent as usize] = Sharing::new(AgentId(agent), period, 3);
        }
        team.losses = losses.into_iter();
        team.due = Some(vec![(WakeCondition::NEXT_TICK, vec![]); 3]);
        let all = all_pairs(3);
        let mut now = 0;
        for (agent, cell, edges) in ticks {
            now += 1;
            let scattered: Vec<u32> = (0..80).map(|number| (cell + 37 * number) % 8000).collect();
            team.maps[agent as usize].note_free(&scattered);
            let pairs: Vec<(u32, u32)> = (0..3).filter(|edge| edges >> edge & 1 != 0).map(|edge| all[edge]).collect();
            team.tick(now, &pairs, budget);
        }
        team.losses = Vec::new().into_iter();
        for _ in 0..800 {
            now += 1;
            team.tick(now, &all, budget);
        }
        let known = (0..3).zip(periods).filter(|&(_, period)| period > 0).map(|(agent, _)| agent);
        let senders: Vec<usize> = known.collect();
        for &sender in &senders {
            for agent in 0..3 {
                let lacks = team.states(sender).into_iter().zip(team.states(agent)).any(|(one, other)| {
                    one != CellState::Unexplored && other == CellState::Unexplored
                });
                prop_assert!(!lacks, "agent {} lacks something that agent {} knows", agent, sender);
            }
        }
    }

    #[test]
    fn knowledge_propagates_along_a_chain(
        findings in prop::collection::vec((0u32..5, 0u32..1000, any::<bool>()), 0..60),
    ) {
        let agents = 5;
        let mut team = SimulatedTeam::new(agents, extent(10), 2);
        let chain: Vec<(u32, u32)> = (1..agents).map(|agent| (agent - 1, agent)).collect();
        for (agent, cell, is_visit) in findings {
            let map = &mut team.maps[agent as usize];
            if is_visit {
                map.note_covered(map.extent().cell_at(cell as usize));
            } else {
                map.note_free(&[cell]);
            }
        }
        (0..24).for_each(|now| drop(team.tick(now, &chain, BUDGET)));
        for agent in 1..agents as usize {
            prop_assert_eq!(team.states(agent), team.states(0), "no mark of coverage is lost");
        }
        let count = team.delivered.len();
        team.delivered.sort_unstable();
        team.delivered.dedup();
        prop_assert_eq!(team.delivered.len(), count, "nothing is sent twice");
    }

    #[test]
    fn maps_converge_after_all_pairs_exchange(
        agents in 2u32..6,
        findings in prop::collection::vec((0u32..6, 0u32..1000, any::<bool>()), 0..150),
        meetings in prop::collection::vec((0u32..6, 0u32..6), 0..25),
        budget in 1100usize..4000,
    ) {
        let mut team = SimulatedTeam::new(agents, extent(10), 4);
        let mut meetings = meetings.into_iter();
        let mut now = 0;
        for (at, (agent, cell, is_visit)) in findings.into_iter().enumerate() {
            let map = &mut team.maps[(agent % agents) as usize];
            match cell % 3 {
                0 => map.note_wall(&[cell]),
                _ if is_visit => map.note_covered(map.extent().cell_at(cell as usize)),
                _ => map.note_free(&[cell]),
            }
            if at % 6 == 0 {
                now += 1;
                let pair = meetings.next().map(|(one, other)| (one % agents, other % agents));
                let pair = pair.filter(|(one, other)| one != other);
                team.tick(now, pair.as_slice(), budget);
            }
        }
        let all = all_pairs(agents);
        for _ in 0..32 {
            now += 1;
            team.tick(now, &all, budget);
        }
        for agent in 1..agents as usize {
            prop_assert_eq!(team.states(agent), team.states(0));
            prop_assert_eq!(team.maps[agent].contradictions(), 0);
        }
        let count = team.delivered.len();
        team.delivered.sort_unstable();
        team.delivered.dedup();
        prop_assert_eq!(team.delivered.len(), count, "nothing is sent twice");
    }
}
