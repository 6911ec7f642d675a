//! The table of who explores which part of the unexplored space, for planners that divide it when
//! agents meet ([`super::racer`], [`super::c2_explorer`]).
//!
//! Agents in contact send each other their tables. Of two entries for a part the later one holds,
//! then that of the lower id. An agent renews the entries of the parts that it holds at each of its
//! plans, and an entry that is not renewed ends with its lease: so the parts of a lost agent come
//! back to the others.
//!
//! Invariants: the table depends on the messages and on the divisions of its agent alone; a
//! malformed message changes nothing.

use std::collections::BTreeMap;

use msgs::ids::{AgentId, Tick};
use protocol::message_type::MessageType;

use super::super::division::Division;
use super::super::tasks::{ReachedTask, Surroundings, Task, lengths_between};
use super::metres;
use agent::abstract_graph::PathLengths;
use agent::command::{AgentMessage, Command};
use agent::observation::Observation;
use voxels::{Cell, Extent};

const VERSION: u8 = 1;

/// Bytes of an entry: part, agent, tick.
const ENTRY_BYTES: usize = 4 + 4 + 8;

/// Most entries of a message: 16 KiB.
const ENTRIES_MAX: usize = 1024;

/// Who explores a part, and when that was decided or renewed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Entry {
    holder: AgentId,
    as_of: Tick,
}

/// A part of the unexplored space, with the tasks that see into it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Part {
    /// Its key in the table.
    pub(super) key: u32,
    /// Its tasks, numbers of those of the plan, in ascending order.
    pub(super) tasks: Vec<usize>,
}

/// The tasks of a plan by the part that they see into: parts ascend by key.
pub(super) fn parts_of(keys: impl Iterator<Item = u32>) -> Vec<Part> {
    let mut parts: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (task, key) in keys.enumerate() {
        parts.entry(key).or_default().push(task);
    }
    parts.into_iter().map(|(key, tasks)| Part { key, tasks }).collect()
}

/// An agent of a division.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Member {
    pub(super) agent: AgentId,
    pub(super) cell: Cell,
}

/// The table of one agent.
#[derive(Debug, Clone)]
pub(super) struct PartsTable {
    own: AgentId,
    lease_ticks: u64,
    entries: BTreeMap<u32, Entry>,
}

impl PartsTable {
    pub(super) fn new(own: AgentId, lease_ticks: u64) -> Self {
        Self { own, lease_ticks, entries: BTreeMap::new() }
    }

    /// Merges received tables and drops entries whose lease has ended. `agents` is the team size.
    pub(super) fn receive(&mut self, messages: &[AgentMessage], now: Tick, agents: u32) {
        for message in messages.iter().filter(|message| message.kind == MessageType::Parts.number()) {
            for (part, entry) in decode(&message.data, agents).into_iter().flatten() {
                let later = |known: &Entry| (known.as_of, entry.holder) < (entry.as_of, known.holder);
                if entry.as_of <= now && self.entries.get(&part).is_none_or(later) {
                    self.entries.insert(part, entry);
                }
            }
        }
        self.entries.retain(|_, entry| now < entry.as_of.after(self.lease_ticks));
    }

    /// Who explores a part, if that has been divided.
    pub(super) fn holder(&self, part: u32) -> Option<AgentId> {
        self.entries.get(&part).map(|entry| entry.holder)
    }

    /// Whether the agent explores a part: one that it holds, or that is not divided.
    pub(super) fn is_own(&self, part: u32) -> bool {
        self.holder(part).is_none_or(|holder| holder == self.own)
    }

    /// Gives entries the keys that their parts have now; of two for one part the later one holds.
    pub(super) fn rename(&mut self, mut present: impl FnMut(u32) -> Option<u32>) {
        for (key, entry) in std::mem::take(&mut self.entries) {
            let key = present(key).unwrap_or(key);
            let is_later = |known: &Entry| (known.as_of, entry.holder) < (entry.as_of, known.holder);
            if self.entries.get(&key).is_none_or(is_later) {
                self.entries.insert(key, entry);
            }
        }
    }

    /// Assigns a part.
    pub(super) fn assign(&mut self, part: u32, holder: AgentId, now: Tick) {
        self.entries.insert(part, Entry { holder, as_of: now });
    }

    /// Renews the parts that the agent holds among these, and drops its others, which have nothing
    /// left to see.
    pub(super) fn renew(&mut self, parts: &[Part], now: Tick) {
        let own = self.own;
        self.entries
            .retain(|key, entry| entry.holder != own || parts.binary_search_by_key(key, |part| part.key).is_ok());
        for entry in self.entries.values_mut().filter(|entry| entry.holder == own) {
            entry.as_of = now;
        }
    }

    /// Adds the table for the agents in contact to a command: the version (uint8), and for each
    /// part its key and the id of its holder (uint32) and the tick of the division or renewal
    /// (uint64), little-endian.
    pub(super) fn with_table(&self, command: Command, observation: &Observation) -> Command {
        if observation.contacts.is_empty() || self.entries.is_empty() {
            return command;
        }
        let mut bytes = vec![VERSION];
        for (part, Entry { holder, as_of }) in self.entries.iter().take(ENTRIES_MAX) {
            bytes.extend(part.to_le_bytes());
            bytes.extend(holder.0.to_le_bytes());
            bytes.extend(as_of.0.to_le_bytes());
        }
        command.with_message(None, MessageType::Parts.number(), bytes)
    }
}

/// The entries of a message, or nothing if it is malformed.
fn decode(data: &[u8], agents: u32) -> Option<Vec<(u32, Entry)>> {
    let (&VERSION, entries) = data.split_first()? else { return None };
    let (entries, []) = entries.as_chunks::<ENTRY_BYTES>() else { return None };
    if entries.len() > ENTRIES_MAX {
        return None;
    }
    let entry = |bytes: &[u8; ENTRY_BYTES]| {
        let (part, rest) = bytes.split_first_chunk()?;
        let (holder, as_of) = rest.split_first_chunk()?;
        let holder = AgentId(u32::from_le_bytes(*holder));
        let as_of = Tick(u64::from_le_bytes(as_of.try_into().ok()?));
        (holder.0 < agents).then_some((u32::from_le_bytes(*part), Entry { holder, as_of }))
    };
    entries.iter().map(entry).collect()
}

/// Parts with the paths between them, as the members of a division see them.
pub(super) struct Routes {
    /// By member and part, metres.
    first_m: Vec<Vec<f64>>,
    /// By part and part, metres.
    pub(super) between_m: Vec<Vec<f64>>,
    /// By part, its share of all expected free cells.
    weights: Vec<f64>,
}

impl Routes {
    /// The routes of some members over some parts: the place of a part is its task with most
    /// expected free cells.
    pub(super) fn new(
        members: &[Member],
        parts: &[&Part],
        tasks: &[ReachedTask],
        lengths: &mut PathLengths,
        at: &Surroundings<'_>,
        extent: Extent,
    ) -> Self {
        let most = |part: &&Part| {
            let by_cells = |&&a: &&usize, &&b: &&usize| {
                tasks[a].task.expected_cells.total_cmp(&tasks[b].task.expected_cells).then(b.cmp(&a))
            };
            tasks[*part.tasks.iter().max_by(by_cells).expect("a part has a task")].task
        };
        let places: Vec<Task> = parts.iter().map(most).collect();
        let first_m = members.iter().map(|member| {
            lengths.begin(at.graph, member.cell, places.iter().map(|task| task.region));
            places.iter().map(|task| metres(lengths.to(at.graph, task.region), extent)).collect()
        });
        let first_m: Vec<Vec<f64>> = first_m.collect();
        let order: Vec<usize> = (0..places.len()).collect();
        let between = lengths_between(lengths, at.graph, &places, &order);
        let between_m = between.into_iter().map(|row| row.into_iter().map(|to| metres(to, extent)).collect()).collect();
        let cells = |part: &&Part| part.tasks.iter().map(|&task| tasks[task].task.expected_cells).sum::<f64>();
        let cells: Vec<f64> = parts.iter().map(|part| cells(part).max(f64::MIN_POSITIVE)).collect();
        let whole: f64 = cells.iter().sum();
        let weights = cells.iter().map(|cells| cells / whole).collect();
        Self { first_m, between_m, weights }
    }

    /// The shortest tours in all, of which none has more than this share of the expected cells; by
    /// member.
    pub(super) fn tours(&self, load_max: f64) -> Vec<Vec<usize>> {
        self.division(self.first_m.clone(), load_max).tours()
    }

    /// The lengths of the shortest tours over the parts that each member has now, metres; and the
    /// largest share of the expected cells.
    pub(super) fn present(&self, holders: &[usize]) -> (f64, f64) {
        let mut sum_m = 0.0;
        let mut load = 0.0_f64;
        for (member, first_m) in self.first_m.iter().enumerate() {
            let held: Vec<usize> = (0..holders.len()).filter(|&part| holders[part] == member).collect();
            let take = |row: &Vec<f64>| held.iter().map(|&part| row[part]).collect::<Vec<f64>>();
            let between_m: Vec<Vec<f64>> = held.iter().map(|&part| take(&self.between_m[part])).collect();
            let weights = take(&self.weights);
            let own = Division {
                first_s: vec![take(first_m)],
                between_s: &between_m,
                weights: &weights,
                latency_weight: 0.0,
                load_max: f64::INFINITY,
            };
            sum_m += own.end_s(0, &own.tours()[0]);
            load = load.max(weights.iter().sum());
        }
        (sum_m, load)
    }

    /// The sum of the lengths of some tours, metres.
    pub(super) fn length_m(&self, tours: &[Vec<usize>]) -> f64 {
        let division = self.division(self.first_m.clone(), f64::INFINITY);
        tours.iter().enumerate().map(|(member, tour)| division.end_s(member, tour)).sum()
    }

    /// A division by length alone: metres take the place of seconds.
    fn division(&self, first_m: Vec<Vec<f64>>, load_max: f64) -> Division<'_> {
        Division { first_s: first_m, between_s: &self.between_m, weights: &self.weights, latency_weight: 0.0, load_max }
    }
}

/// The own tasks in the order of a tour over the own parts, and within a part from the nearest on.
pub(super) fn own_tour<'t>(
    own: Member,
    parts: &[Part],
    table: &PartsTable,
    tasks: &'t [ReachedTask],
    lengths: &mut PathLengths,
    at: &Surroundings<'_>,
    extent: Extent,
) -> Vec<&'t Task> {
    let parts: Vec<&Part> = parts.iter().filter(|part| table.is_own(part.key)).collect();
    if parts.is_empty() {
        return Vec::new();
    }
    let routes = Routes::new(&[own], &parts, tasks, lengths, at, extent);
    let tour = routes.tours(f64::INFINITY).swap_remove(0);
    let in_order = tour.into_iter().flat_map(|part| {
        let mut of_part: Vec<&ReachedTask> = parts[part].tasks.iter().map(|&task| &tasks[task]).collect();
        of_part.sort_by(|a, b| a.own_m.total_cmp(&b.own_m));
        of_part.into_iter().map(|reached| &reached.task)
    });
    in_order.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::idle;
    use agent::command::{Peer, WakeCondition};
    use agent::observation::Contact;
    use nalgebra::Point3;

    fn message(table: &PartsTable) -> AgentMessage {
        let contacts = vec![Contact { agent: AgentId(9), position: Point3::origin() }];
        let command = Command::keep(WakeCondition::NEXT_TICK);
        let message = table.with_table(command, &Observation { contacts, ..idle() }).messages.remove(0);
        AgentMessage { peer: Peer::One(table.own), kind: message.kind, data: message.data }
    }

    #[test]
    fn later_entry_holds_and_ends_with_its_lease() {
        let [mut a, mut b] = [AgentId(0), AgentId(1)].map(|own| PartsTable::new(own, 100));
        a.assign(5, AgentId(0), Tick(10));
        b.assign(5, AgentId(1), Tick(20));
        b.assign(6, AgentId(0), Tick(20));
        let [from_a, from_b] = [message(&a), message(&b)];
        a.receive(&[from_b], Tick(21), 2);
        b.receive(&[from_a], Tick(21), 2);
        for table in [&a, &b] {
            assert_eq!([5, 6, 7].map(|part| table.holder(part)), [Some(AgentId(1)), Some(AgentId(0)), None]);
        }
        assert!(!a.is_own(5) && a.is_own(6) && a.is_own(7));
        b.renew(&parts_of([5].into_iter()), Tick(60));
        a.receive(&[message(&b)], Tick(130), 2);
        assert_eq!([5, 6].map(|part| a.holder(part)), [Some(AgentId(1)), None]);
    }

    #[test]
    fn parts_without_tasks_are_dropped_by_their_holder() {
        let mut table = PartsTable::new(AgentId(0), 100);
        table.assign(1, AgentId(0), Tick(1));
        table.assign(2, AgentId(1), Tick(1));
        table.renew(&[], Tick(2));
        assert_eq!([1, 2].map(|part| table.holder(part)), [None, Some(AgentId(1))]);
    }

    #[test]
    fn malformed_messages_are_ignored() {
        let mut table = PartsTable::new(AgentId(0), 100);
        table.assign(1, AgentId(1), Tick(1));
        let good = message(&table);
        for data in [vec![], good.data[..good.data.len() - 1].to_vec(), [&[9], &good.data[1..]].concat()] {
            let mut other = PartsTable::new(AgentId(1), 100);
            other.receive(&[AgentMessage { data: data.into(), ..good.clone() }], Tick(2), 2);
            assert_eq!(other.holder(1), None);
        }
        let mut other = PartsTable::new(AgentId(1), 100);
        other.receive(std::slice::from_ref(&good), Tick(2), 1);
        assert_eq!(other.holder(1), None, "no such agent");
        other.receive(&[good], Tick(0), 2);
        assert_eq!(other.holder(1), None, "from a later tick");
    }
}
