//! `c2-explorer`: agents in contact divide the connected components of the unexplored space into
//! contiguous regions.
//!
//! Source: "C2-Explorer", IROS 2026 (arXiv 2603.07699): a block whose unexplored cells are not
//! connected is several tasks, one for each component; the tasks are divided among all agents that
//! meet by a capacitated vehicle routing problem, in which steps between tasks that do not adjoin
//! cost a penalty, so that the parts are contiguous.
//!
//! Here a component counts while a frontier adjoins it; the lowest id of those in contact divides,
//! and the others take it over; the routing problem is solved by insertion and moves
//! ([`super::super::division`]). Within a component the nearest viewpoint is the next one.

use std::collections::BTreeMap;

use msgs::ids::{AgentId, Tick};
use protocol::event_mask::EventMask;

use super::super::coordination::Coordination;
use super::super::obstacles::Obstacles;
use super::super::tasks::TaskSearch;
use super::super::{Dsvp, Plan};
use super::parts::{Member, Part, PartsTable, Routes, own_tour, parts_of};
use super::racer::{block_of, ticks};
use super::{planner, task_search};
use crate::settings::{SettingError, Settings};
use crate::{Controller, Ctx, Setup};
use agent::abstract_graph::PathLengths;
use agent::command::{Command, WakeCondition};
use agent::exploration_map::{CellState, ExplorationMap};
use agent::observation::Observation;
use voxels::{Cell, FACES};

/// What an agent knows of the components.
#[derive(Debug)]
struct C2Explorer {
    own: AgentId,
    /// Edge of a block, cells.
    block_cells: i32,
    /// Least time between two divisions.
    divide_ticks: u64,
    /// How much more than its equal share of the expected free cells an agent may get.
    slack: f64,
    /// What a step between components that do not adjoin costs more, metres.
    contiguity_m: f64,
    table: PartsTable,
    /// When it last divided.
    divided: Option<Tick>,
    search: TaskSearch,
    lengths: PathLengths,
}

/// The planner `c2-explorer`.
///
/// Settings: `block_m`, `divide_s`, `slack`, `contiguity_m`, `lease_s`, `regions`, `expected_min`
/// (see docs/controllers.md).
///
/// # Errors
/// If a setting is out of range.
pub fn c2_explorer(settings: &mut Settings, setup: Setup<'_>) -> Result<impl Controller + use<>, SettingError> {
    let Setup { agent, run_info, .. } = &setup;
    let block_m = settings.number("block_m", 10.0, 0.1, 1000.0)?;
    let divide_ticks = ticks(settings.number("divide_s", 5.0, 0.1, 600.0)?);
    let slack = settings.number("slack", 0.2, 0.0, 10.0)?;
    let contiguity_m = settings.number("contiguity_m", 10.0, 0.0, 1000.0)?;
    let lease_ticks = ticks(settings.number("lease_s", 120.0, 1.0, 3600.0)?);
    let explorer = C2Explorer {
        own: *agent,
        block_cells: ((block_m / run_info.extent.cell_m()).round() as i32).max(1),
        divide_ticks,
        slack,
        contiguity_m,
        table: PartsTable::new(*agent, lease_ticks),
        divided: None,
        search: task_search(settings, run_info)?,
        lengths: PathLengths::default(),
    };
    Ok(planner(explorer, setup))
}

/// The connected components of the unexplored cells of some blocks, over faces within a block.
#[derive(Debug)]
struct Components<'m> {
    map: &'m ExplorationMap,
    edge: i32,
    /// By block, the component of each of its cells, 0 for none; x fastest.
    labels: BTreeMap<u32, Vec<u32>>,
    /// By component, its key: the index of its cell nearest to its mean.
    keys: Vec<u32>,
}

impl<'m> Components<'m> {
    fn new(map: &'m ExplorationMap, edge: i32) -> Self {
        Self { map, edge, labels: BTreeMap::new(), keys: Vec::new() }
    }

    /// The component of an unexplored cell, from 1; 0 for other cells.
    fn of(&mut self, cell: Cell) -> u32 {
        let extent = self.map.extent();
        if !extent.contains(cell) {
            return 0;
        }
        let block = block_of(cell, self.edge, extent);
        if !self.labels.contains_key(&block) {
            let labels = self.label(corner(cell, self.edge));
            self.labels.insert(block, labels);
        }
        self.labels[&block][place(cell, self.edge)]
    }

    /// The components of the block with this lowest cell.
    fn label(&mut self, corner: Cell) -> Vec<u32> {
        let edge = self.edge;
        let is_inside = |cell: Cell| {
            let by = cell - corner;
            [by.x, by.y, by.z].iter().all(|along| (0..edge).contains(along))
        };
        let mut labels = vec![0; (edge * edge * edge) as usize];
        let rows = (0..edge).flat_map(|z| (0..edge).map(move |y| (y, z)));
        for start in rows.flat_map(|(y, z)| (0..edge).map(move |x| corner + Cell::new(x, y, z))) {
            if labels[place(start, edge)] != 0 || self.map.state(start) != CellState::Unexplored {
                continue;
            }
            let label = self.keys.len() as u32 + 1;
            labels[place(start, edge)] = label;
            let mut members = vec![start];
            let mut next = 0;
            while let Some(&cell) = members.get(next) {
                next += 1;
                for beside in FACES.map(|face| cell + face) {
                    let is_new = is_inside(beside) && labels[place(beside, edge)] == 0;
                    if is_new && self.map.state(beside) == CellState::Unexplored {
                        labels[place(beside, edge)] = label;
                        members.push(beside);
                    }
                }
            }
            self.keys.push(self.key(&members));
        }
        labels
    }

    /// The index of the cell nearest to the mean of some cells.
    fn key(&self, members: &[Cell]) -> u32 {
        let count = members.len() as i64;
        let sum = members.iter().fold([0; 3], |sum: [i64; 3], cell| {
            [sum[0] + i64::from(cell.x), sum[1] + i64::from(cell.y), sum[2] + i64::from(cell.z)]
        });
        let off = |cell: &&Cell| {
            let along = [cell.x, cell.y, cell.z].map(i64::from);
            (0..3).map(|axis| (along[axis] * count - sum[axis]).pow(2)).sum::<i64>()
        };
        let nearest = members.iter().min_by_key(|cell| (off(cell), **cell));
        nearest.and_then(|&cell| self.map.extent().index(cell)).unwrap_or_default() as u32
    }

    /// The key of the component beside a frontier; that of the frontier itself if none is left.
    fn key_beside(&mut self, frontier: Cell) -> u32 {
        let beside = FACES.map(|face| frontier + face).into_iter().map(|cell| self.of(cell)).find(|&label| label != 0);
        match beside {
            Some(label) => self.keys[label as usize - 1],
            None => self.map.extent().index(frontier).unwrap_or_default() as u32,
        }
    }

    /// The present key of the component that contains the cell of a key.
    fn present_key(&mut self, key: u32) -> Option<u32> {
        let extent = self.map.extent();
        if key as usize >= extent.volume() {
            return None;
        }
        let label = self.of(extent.cell_at(key as usize));
        Some(self.keys[label.checked_sub(1)? as usize])
    }

    /// Whether the components of two keys adjoin over a face between their blocks.
    fn adjoin(&mut self, one: u32, other: u32) -> bool {
        let extent = self.map.extent();
        let [from, to] = [one, other].map(|key| extent.cell_at(key as usize));
        let labels = [self.of(from), self.of(to)];
        let (from, to) = (corner(from, self.edge), corner(to, self.edge));
        let by = to - from;
        let Some(face) =
            FACES.into_iter().find(|face| Cell::new(face.x * self.edge, face.y * self.edge, face.z * self.edge) == by)
        else {
            return false;
        };
        let last = self.edge - 1;
        let along = |step: i32, a: i32| match step {
            1 => last,
            -1 => 0,
            _ => a,
        };
        for a in 0..self.edge {
            for b in 0..self.edge {
                let (x, y, z) = match (face.x, face.y) {
                    (0, 0) => (a, b, 0),
                    (0, _) => (a, 0, b),
                    _ => (0, a, b),
                };
                let cell = from + Cell::new(along(face.x, x), along(face.y, y), along(face.z, z));
                if self.of(cell) == labels[0] && labels[0] != 0 && self.of(cell + face) == labels[1] {
                    return true;
                }
            }
        }
        false
    }
}

/// The lowest cell of the block of a cell.
fn corner(cell: Cell, edge: i32) -> Cell {
    Cell::new(cell.x / edge * edge, cell.y / edge * edge, cell.z / edge * edge)
}

/// The place of a cell within its block.
fn place(cell: Cell, edge: i32) -> usize {
    let by = cell - corner(cell, edge);
    ((by.z * edge + by.y) * edge + by.x) as usize
}

impl Coordination for C2Explorer {
    fn wake(&self) -> WakeCondition {
        WakeCondition::on(EventMask::CONTACTS | EventMask::MESSAGE)
    }

    fn receive(&mut self, observation: &Observation, agents: u32) {
        self.table.receive(&observation.messages, observation.tick, agents);
    }

    fn first_stage(
        planner: &mut Dsvp<Self>,
        observation: &Observation,
        ctx: &mut Ctx<'_>,
        obstacles: &Obstacles,
    ) -> Plan {
        let (mut at, explorer) = planner.split();
        let (now, extent) = (observation.tick, ctx.map().extent());
        let tasks = explorer.search.tasks(&mut at, ctx);
        let mut components = Components::new(ctx.map(), explorer.block_cells);
        let keys: Vec<u32> = tasks.iter().map(|reached| components.key_beside(reached.task.frontier)).collect();
        let parts = parts_of(keys.into_iter());
        explorer.table.rename(|key| components.present_key(key));
        explorer.table.renew(&parts, now);
        explorer.lengths.renew(at.graph);
        let own = Member { agent: explorer.own, cell: ctx.cell() };
        let is_lowest = observation.contacts.first().is_some_and(|contact| own.agent < contact.agent);
        if is_lowest && explorer.divided.is_none_or(|last| now >= last.after(explorer.divide_ticks)) {
            explorer.divided = Some(now);
            let others = observation.contacts.iter();
            let others = others.map(|contact| Member { agent: contact.agent, cell: extent.cell_of(&contact.position) });
            let members: Vec<Member> = std::iter::once(own).chain(others).collect();
            let is_of_members = |part: &&Part| {
                let holder = explorer.table.holder(part.key);
                holder.is_none_or(|holder| members.iter().any(|member| member.agent == holder))
            };
            let union: Vec<&Part> = parts.iter().filter(is_of_members).collect();
            let mut routes = Routes::new(&members, &union, &tasks, &mut explorer.lengths, &at, extent);
            for (from, row) in routes.between_m.iter_mut().enumerate() {
                for (to, between_m) in row.iter_mut().enumerate().filter(|&(to, _)| to != from) {
                    if !components.adjoin(union[from].key, union[to].key) {
                        *between_m += explorer.contiguity_m;
                    }
                }
            }
            let tours = routes.tours((1.0 + explorer.slack) / members.len() as f64);
            for (member, tour) in members.iter().zip(tours) {
                tour.into_iter().for_each(|part| explorer.table.assign(union[part].key, member.agent, now));
            }
        }
        let tour = own_tour(own, &parts, &explorer.table, &tasks, &mut explorer.lengths, &at, extent);
        if tour.is_empty() { Plan::Nothing } else { explorer.search.go(tour, &mut at, ctx, obstacles) }
    }

    fn with_messages(&mut self, command: Command, observation: &Observation) -> Command {
        self.table.with_table(command, observation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{drawn, flat};

    /// Two blocks of five cells side by side; a wall divides what is unexplored in the left one,
    /// and only its upper part (y from 3) extends into the right one.
    const SPLIT: &str = "\
        ??????????\n\
        ??????????\n\
        ##########\n\
        ?????#....\n\
        ?????#....\n";

    #[test]
    fn unconnected_parts_of_a_block_are_two_components() {
        let map = drawn(SPLIT);
        let mut components = Components::new(&map, 5);
        let [low, high, right] = [flat(2, 0), flat(2, 4), flat(7, 4)].map(|cell| components.of(cell));
        assert!(low != 0 && high != 0 && low != high && right != 0, "{low} {high} {right}");
        assert_eq!((components.of(flat(7, 0)), components.of(flat(20, 4))), (0, 0), "known, and outside");
        let [low, high, right] = [low, high, right].map(|label| components.keys[label as usize - 1]);
        assert!(components.adjoin(high, right) && components.adjoin(right, high));
        assert!(!components.adjoin(low, right) && !components.adjoin(low, high));
    }

    #[test]
    fn component_that_shrinks_keeps_its_holder() {
        let mut map = drawn(SPLIT);
        let mut components = Components::new(&map, 5);
        let before = components.key_beside(flat(7, 2));
        let mut table = PartsTable::new(AgentId(0), 1000);
        table.assign(before, AgentId(1), Tick(1));
        map.note_free(&[38, 39]);
        let mut components = Components::new(&map, 5);
        let after = components.key_beside(flat(7, 2));
        assert_ne!(before, after);
        table.rename(|key| components.present_key(key));
        assert_eq!(table.holder(after), Some(AgentId(1)));
    }
}
