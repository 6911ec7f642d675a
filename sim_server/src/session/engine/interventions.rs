//! Interventions: what services and the page change in a run under way, as recorded and digested
//! messages.

use msgs::ids::AgentId;
use protocol::wake_condition::WakeCondition;
use simulation::wire::{self, Change, MapChangeCause};
use voxels::Terrain;
use world::Presence;
use world::body::Pose;
use world::map_change::CellBox;

use super::{Engine, standstill};
use crate::session::RunError;
use crate::session::log::{EntryKind, SessionLog};

impl Engine<'_> {
    /// Makes the cells of a box free or wall, as a request says, and returns how many have changed;
    /// or returns the reason why they stay as they are.
    pub(in crate::session) fn change_cells(
        &mut self,
        cells: CellBox,
        terrain: Terrain,
        log: &mut SessionLog<'_>,
    ) -> Result<Result<u32, &'static str>, RunError> {
        if terrain == Terrain::Wall && self.world.is_anything_in(cells) {
            return Ok(Err("a body, a relay or an obstacle is in the box: move it away, or choose other cells"));
        }
        self.flush_scans();
        let changed = self.world.change_map(cells, terrain);
        if changed > 0 {
            let tick = self.tick();
            self.interventions += 1;
            let message = wire::map_change(tick, cells, terrain, MapChangeCause::Request);
            log.write_digested(EntryKind::MapChange, tick, &message, &mut self.chain)?;
            self.rested_at = None;
            self.standstill = standstill::Standstill::default();
        }
        Ok(Ok(changed))
    }

    /// Moves an agent to a pose at rest, or returns the reason why it cannot be there.
    pub(in crate::session) fn place(
        &mut self,
        agent: AgentId,
        pose: Pose,
        log: &mut SessionLog<'_>,
    ) -> Result<Result<(), &'static str>, RunError> {
        let placed = self.world.place(agent, pose);
        if placed.is_ok() {
            // Its wake-up condition was meant for another place.
            self.wake_conditions[agent.index()] = WakeCondition::NEXT_TICK;
            self.standstill = standstill::Standstill::default();
            self.record_intervention(agent, &Change::Place(pose), log)?;
        }
        Ok(placed)
    }

    /// Removes an agent from the run as builds did whose services left the body in the world.
    pub(in crate::session) fn remove(&mut self, agent: AgentId, log: &mut SessionLog<'_>) -> Result<(), RunError> {
        self.lost.insert(agent);
        self.removed.push(agent);
        self.record_intervention(agent, &Change::Remove, log)
    }

    /// Takes an agent and its body out of the world.
    pub(in crate::session) fn leave(&mut self, agent: AgentId, log: &mut SessionLog<'_>) -> Result<(), RunError> {
        self.lost.insert(agent);
        self.retired.insert(agent);
        self.world.leave(agent);
        self.record_intervention(agent, &Change::Leave, log)
    }

    /// Lets an agent of the reserve join at a pose, or returns the reason why it cannot be there.
    pub(in crate::session) fn join(
        &mut self,
        agent: AgentId,
        pose: Pose,
        log: &mut SessionLog<'_>,
    ) -> Result<Result<(), &'static str>, RunError> {
        let joined = self.world.join_at(agent, pose);
        if joined.is_ok() {
            self.record_intervention(agent, &Change::Join(pose), log)?;
        }
        Ok(joined)
    }

    /// The agents of the reserve that have not joined, ascending.
    pub(in crate::session) fn reserve(&self) -> Vec<AgentId> {
        let is_absent = |agent: &AgentId| self.world.presence(*agent) == Presence::Absent && !self.lost.contains(agent);
        let mut reserve: Vec<AgentId> = self.scenario.agents.reserve.iter().copied().map(AgentId).collect();
        reserve.retain(is_absent);
        reserve.sort_unstable();
        reserve
    }

    fn record_intervention(
        &mut self,
        agent: AgentId,
        change: &Change,
        log: &mut SessionLog<'_>,
    ) -> Result<(), RunError> {
        let tick = self.tick();
        self.interventions += 1;
        Ok(log.write_digested(
            EntryKind::Intervention,
            tick,
            &wire::intervention(tick, agent, change),
            &mut self.chain,
        )?)
    }
}
