//! `racer`: two agents that meet divide what is unexplored between them, and each follows a tour
//! over its part.
//!
//! Source: B. Zhou, H. Xu, S. Shen, "RACER: Rapid Collaborative Exploration with a Decentralized
//! Multi-UAV System", IEEE T-RO 2023: the unexplored space is a grid of blocks (its hgrid); a pair
//! in contact divides the union of their blocks by a capacitated vehicle routing problem, and
//! accepts the division if the routes get no longer in all; each follows a coverage path over its
//! blocks, and in them a tour over viewpoints.
//!
//! Here a block counts while a frontier lies in it: most of a cave's unexplored space is rock. The
//! lower id of a pair proposes and the other takes it over, without an answer; the routing problem
//! is solved by insertion and moves ([`super::super::division`]), there by LKH-3. Blocks are not
//! split as exploration proceeds, and within a block the nearest viewpoint is the next one.

use std::collections::BTreeMap;

use msgs::ids::{AgentId, Tick};
use protocol::event_mask::EventMask;

use super::super::coordination::Coordination;
use super::super::obstacles::Obstacles;
use super::super::tasks::{ReachedTask, Surroundings, TaskSearch};
use super::super::{Dsvp, Plan};
use super::parts::{Member, Part, PartsTable, Routes, own_tour, parts_of};
use super::{planner, task_search};
use crate::settings::{SettingError, Settings};
use crate::{Controller, Ctx, Setup};
use agent::abstract_graph::PathLengths;
use agent::command::{Command, WakeCondition};
use agent::observation::Observation;
use voxels::{Cell, Extent};

/// How much longer the routes of a new division may be in all, metres.
const LONGER_MAX_M: f64 = 0.1;

/// What an agent knows of the blocks.
#[derive(Debug)]
struct Racer {
    own: AgentId,
    extent: Extent,
    /// Edge of a block, cells.
    block_cells: i32,
    /// Least time between two divisions with one agent.
    pair_ticks: u64,
    /// Most of the expected free cells that one of a pair gets, a share.
    load_max: f64,
    table: PartsTable,
    /// When it last divided with each other agent.
    divided: BTreeMap<AgentId, Tick>,
    search: TaskSearch,
    lengths: PathLengths,
}

/// The planner `racer`.
///
/// Settings: `block_m`, `pair_s`, `load_max`, `lease_s`, `regions`, `expected_min` (see
/// docs/controllers.md).
///
/// # Errors
/// If a setting is out of range.
pub fn racer(settings: &mut Settings, setup: Setup<'_>) -> Result<impl Controller + use<>, SettingError> {
    let Setup { agent, run_info, .. } = &setup;
    let extent = run_info.extent;
    let block_m = settings.number("block_m", 10.0, 0.1, 1000.0)?;
    let pair_ticks = ticks(settings.number("pair_s", 5.0, 0.1, 600.0)?);
    let load_max = settings.number("load_max", 0.6, 0.5, 1.0)?;
    let lease_ticks = ticks(settings.number("lease_s", 120.0, 1.0, 3600.0)?);
    let racer = Racer {
        own: *agent,
        extent,
        block_cells: ((block_m / extent.cell_m()).round() as i32).max(1),
        pair_ticks,
        load_max,
        table: PartsTable::new(*agent, lease_ticks),
        divided: BTreeMap::new(),
        search: task_search(settings, run_info)?,
        lengths: PathLengths::default(),
    };
    Ok(planner(racer, setup))
}

/// A duration in ticks.
pub(super) fn ticks(seconds: f64) -> u64 {
    (seconds / Tick::TICK_S).round() as u64
}

/// The block of a cell, as a number.
pub(super) fn block_of(cell: Cell, edge: i32, extent: Extent) -> u32 {
    let [x, y, _] = extent.size().map(|cells| cells.div_ceil(edge.cast_unsigned()));
    let [i, j, k] = [cell.x, cell.y, cell.z].map(|along| (along / edge).cast_unsigned());
    (k * y + j) * x + i
}

impl Racer {
    /// Divides the union of the blocks of this agent and another one anew, if that is no worse.
    fn divide(&mut self, pair: [Member; 2], parts: &[Part], tasks: &[ReachedTask], at: &Surroundings<'_>, now: Tick) {
        let other = pair[1].agent;
        let is_of_pair = |part: &&Part| self.table.is_own(part.key) || self.table.holder(part.key) == Some(other);
        let union: Vec<&Part> = parts.iter().filter(is_of_pair).collect();
        if union.is_empty() {
            return;
        }
        let routes = Routes::new(&pair, &union, tasks, &mut self.lengths, at, self.extent);
        let tours = routes.tours(self.load_max);
        let holders: Vec<usize> = union.iter().map(|part| usize::from(!self.table.is_own(part.key))).collect();
        let (present_m, load) = routes.present(&holders);
        if load <= self.load_max && routes.length_m(&tours) > present_m + LONGER_MAX_M {
            return;
        }
        for (member, tour) in pair.iter().zip(tours) {
            tour.into_iter().for_each(|part| self.table.assign(union[part].key, member.agent, now));
        }
    }
}

impl Coordination for Racer {
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
        let (mut at, racer) = planner.split();
        let now = observation.tick;
        let tasks = racer.search.tasks(&mut at, ctx);
        let parts =
            parts_of(tasks.iter().map(|reached| block_of(reached.task.frontier, racer.block_cells, racer.extent)));
        racer.table.renew(&parts, now);
        racer.lengths.renew(at.graph);
        let own = Member { agent: racer.own, cell: ctx.cell() };
        for contact in observation.contacts.iter().filter(|contact| contact.agent > own.agent) {
            let is_due = racer.divided.get(&contact.agent).is_none_or(|last| now >= last.after(racer.pair_ticks));
            if is_due {
                racer.divided.insert(contact.agent, now);
                let other = Member { agent: contact.agent, cell: racer.extent.cell_of(&contact.position) };
                racer.divide([own, other], &parts, &tasks, &at, now);
            }
        }
        let tour = own_tour(own, &parts, &racer.table, &tasks, &mut racer.lengths, &at, racer.extent);
        if tour.is_empty() { Plan::Nothing } else { racer.search.go(tour, &mut at, ctx, obstacles) }
    }

    fn with_messages(&mut self, command: Command, observation: &Observation) -> Command {
        self.table.with_table(command, observation)
    }
}
