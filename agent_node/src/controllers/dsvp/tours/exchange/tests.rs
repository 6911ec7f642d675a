use std::collections::BTreeSet;

use proptest::prelude::*;

use super::*;

const AT: Cell = Cell { x: 1, y: 2, z: 3 };

/// Ticks between two decisions, and of a lease.
const STEP_TICKS: u64 = 5;
const LEASE_TICKS: u64 = 200;

const TASKS: u32 = 6;

fn task(block: u32) -> TaskId {
    TaskId { block, octants: 1 }
}

/// A team in which all agents know the same tasks and none is ever explored.
struct Team {
    ledgers: Vec<Ledger>,
    now: Tick,
    /// Since when each task has been unallocated.
    free_since: BTreeMap<u32, Tick>,
}

impl Team {
    fn of(agents: u32) -> Self {
        let ledgers = (0..agents).map(|agent| Ledger::new(AgentId(agent))).collect();
        Self { ledgers, now: Tick::ZERO, free_since: BTreeMap::new() }
    }

    /// The tasks that an agent holds.
    fn held(&self, agent: usize) -> BTreeSet<u32> {
        let own = self.ledgers[agent].own;
        (0..TASKS).filter(|&block| self.ledgers[agent].holder(task(block), self.now) == Some(own)).collect()
    }

    /// A decision of all agents that are not lost: each holds what belongs to it and what is
    /// unallocated, proposes to give its first tasks to its first higher contact, and sends its
    /// messages, of which some arrive.
    fn step(
        &mut self,
        is_lost: &[bool],
        contacts: &[(usize, usize)],
        proposals: u8,
        arrives: &mut dyn FnMut() -> bool,
    ) {
        self.now = self.now.after(STEP_TICKS);
        let mut sent = Vec::new();
        for (agent, ledger) in self.ledgers.iter_mut().enumerate().filter(|&(agent, _)| !is_lost[agent]) {
            let now = self.now;
            let beside = contacts.iter().filter_map(|&(a, b)| match agent {
                _ if agent == a => Some(b),
                _ if agent == b => Some(a),
                _ => None,
            });
            let beside: Vec<AgentId> = beside.map(|agent| AgentId(agent as u32)).collect();
            ledger.expire(now);
            let belongs = |block: &u32| ledger.holder(task(*block), now).is_none_or(|holder| holder == ledger.own);
            let own: Vec<TaskId> = (0..TASKS).filter(belongs).map(task).collect();
            ledger.hold(&own, AT, LEASE_TICKS, now);
            let peer = beside.iter().copied().find(|&peer| peer > ledger.own && ledger.record(peer, now).is_some());
            if let Some(peer) = peer.filter(|_| proposals >> agent & 1 == 1) {
                let theirs = ledger.record(peer, now).unwrap().tasks.clone();
                let half = own.len().div_ceil(2);
                // Gives the first half of its tasks and takes all of the other one's.
                let mine = [&own[half..], &theirs[..]].concat();
                ledger.propose(peer, [&mine, &own[..half]], LEASE_TICKS, now);
            }
            sent.extend(ledger.messages(beside, now).into_iter().map(|(to, message)| (ledger.own, to, message)));
        }
        for (from, to, message) in sent {
            if arrives() && !is_lost[to.index()] {
                self.ledgers[to.index()].receive(from, message, self.now.next());
            }
        }
        for block in 0..TASKS {
            let is_held = (0..self.ledgers.len()).any(|agent| !is_lost[agent] && self.held(agent).contains(&block));
            if is_held {
                self.free_since.remove(&block);
            } else {
                self.free_since.entry(block).or_insert(self.now);
            }
        }
    }

    /// The longest time for which a task has been unallocated until now, ticks.
    fn longest_free(&self) -> u64 {
        self.free_since.values().map(|since| self.now.0 - since.0).max().unwrap_or(0)
    }

    /// The tasks that several agents hold.
    fn duplicates(&self) -> Vec<u32> {
        let holders = |block: &u32| (0..self.ledgers.len()).filter(|&agent| self.held(agent).contains(block)).count();
        (0..TASKS).filter(|block| holders(block) > 1).collect()
    }
}

fn pairs(agents: usize) -> Vec<(usize, usize)> {
    (0..agents).flat_map(|a| (a + 1..agents).map(move |b| (a, b))).collect()
}

/// Two agents that know each other's records: agent 0 holds all tasks.
fn met() -> Team {
    let mut team = Team::of(2);
    for _ in 0..3 {
        team.step(&[false; 2], &pairs(2), 0, &mut || true);
    }
    assert_eq!([team.held(0).len(), team.held(1).len()], [TASKS as usize, 0]);
    team
}

#[test]
fn accepted_proposal_moves_tasks() {
    let mut team = met();
    team.step(&[false; 2], &pairs(2), 1, &mut || true);
    team.step(&[false; 2], &pairs(2), 0, &mut || true);
    assert_eq!([team.held(0), team.held(1)], [BTreeSet::from([3, 4, 5]), BTreeSet::from([0, 1, 2])]);
    assert!(team.duplicates().is_empty());
}

/// The messages that two agents send after a proposal, in the order in which they are sent: each of
/// them is lost once, alone and together with all later ones.
#[test]
fn loss_of_any_message_leaves_neither_holes_nor_lasting_duplicates() {
    for first_lost in 0..12 {
        for lost in [1, 1000] {
            let mut team = met();
            let mut number = 0;
            let mut arrives = || {
                number += 1;
                !(first_lost..first_lost + lost).contains(&(number - 1))
            };
            for step in 0..30 {
                team.step(&[false; 2], &pairs(2), u8::from(step == 0), &mut arrives);
                assert!(team.longest_free() <= LEASE_TICKS + STEP_TICKS, "message {first_lost}, step {step}");
            }
            for _ in 0..20 {
                team.step(&[false; 2], &pairs(2), 0, &mut || true);
            }
            assert_eq!(team.duplicates(), [0; 0], "message {first_lost}");
            assert!(team.free_since.is_empty(), "message {first_lost}");
        }
    }
}

#[test]
fn lost_answer_undoes_the_exchange_at_the_next_contact() {
    let mut team = met();
    let mut number = 0;
    // The proposal and the record of the same tick arrive, the answer does not.
    team.step(&[false; 2], &pairs(2), 1, &mut || true);
    let mut arrives = || {
        number += 1;
        false
    };
    team.step(&[false; 2], &pairs(2), 0, &mut arrives);
    assert!(number > 0);
    assert_eq!([team.held(0).len(), team.held(1).len()], [TASKS as usize, 3], "both hold what was given");
    for _ in 0..10 {
        team.step(&[false; 2], &[], 0, &mut || true);
    }
    team.step(&[false; 2], &pairs(2), 0, &mut || true);
    assert_eq!([team.held(0).len(), team.held(1).len()], [TASKS as usize, 0]);
}

#[test]
fn tasks_of_a_lost_agent_become_free_with_its_lease() {
    let mut team = met();
    let steps = LEASE_TICKS / STEP_TICKS + 1;
    for _ in 0..steps {
        team.step(&[true, false], &[], 0, &mut || true);
    }
    assert_eq!(team.held(1).len(), TASKS as usize);
    assert!(team.longest_free() <= LEASE_TICKS + STEP_TICKS);
}

#[test]
fn refused_and_outdated_proposals_change_nothing() {
    let mut team = met();
    let [first, second] = &mut team.ledgers[..] else { panic!() };
    let now = team.now;
    let before = second.own_record().cloned();
    first.propose(AgentId(1), [&[], &[task(0)]], LEASE_TICKS, now);
    second.hold(&[task(9)], AT, LEASE_TICKS, now.next());
    let [(_, proposal), ..] = &first.messages([AgentId(1)], now)[..] else { panic!() };
    assert!(!second.receive(AgentId(0), proposal.clone(), now.next()));
    assert_ne!(second.own_record().cloned(), before);
    assert_eq!(second.own_record().unwrap().tasks, [task(9)]);
    let answers = second.messages([AgentId(0)], now.next());
    assert!(matches!(answers[0].1, Message::Answer { is_accepted: false, .. }), "{answers:?}");
    first.receive(AgentId(1), answers[0].1.clone(), now.next());
    assert!(!first.is_pending() && first.own_record().unwrap().tasks.len() == TASKS as usize);
    assert!(!first.receive(AgentId(1), Message::Answer { proposal: now, is_accepted: true }, now), "not awaited");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Whatever is lost, and whoever meets: a task is free for no longer than two leases (the one
    /// of a belief may begin at the end of another), and once all agents hear each other again each
    /// task has one holder.
    #[test]
    fn exchanges_survive_any_loss(
        steps in proptest::collection::vec(
            (proptest::collection::vec((0usize..4, 0usize..4), 0..6), any::<u8>(), any::<u64>()),
            1..60,
        ),
        lost in proptest::option::of((0usize..4, 0usize..60)),
    ) {
        let mut team = Team::of(4);
        let mut is_lost = [false; 4];
        for (number, (contacts, proposals, fates)) in steps.iter().enumerate() {
            if let Some((agent, from)) = lost {
                is_lost[agent] |= number >= from;
            }
            let contacts: BTreeSet<(usize, usize)> =
                contacts.iter().filter(|(a, b)| a != b).map(|&(a, b)| (a.min(b), a.max(b))).collect();
            let contacts: Vec<(usize, usize)> = contacts.into_iter().collect();
            let mut sent = 0;
            let mut arrives = || {
                sent += 1;
                fates >> (sent % 64) & 1 == 1
            };
            team.step(&is_lost, &contacts, *proposals, &mut arrives);
            prop_assert!(team.longest_free() <= 2 * LEASE_TICKS, "{:?} at {:?}", team.free_since, team.now);
        }
        for _ in 0..2 * LEASE_TICKS / STEP_TICKS {
            team.step(&is_lost, &pairs(4), 0, &mut || true);
        }
        let holders = |block: u32| (0..4).filter(|&agent| !is_lost[agent] && team.held(agent).contains(&block)).count();
        for block in 0..TASKS {
            prop_assert_eq!(holders(block), 1, "task {}", block);
        }
    }
}
