//! Changes of the true map during a run: the cells of a box become wall or free, by an event of the
//! scenario or by a request.
//!
//! **What holds up a change.** A cell becomes wall only where no body, relay or moving obstacle is:
//! a change of an event that would enclose one waits, as a whole, until the last has left the
//! cells; a request is refused. The outermost layer of the map stays wall.
//!
//! **Who notices.** No message announces a change. Every sensor forgets the cells that have
//! changed, so that its next scan that meets one reports it anew (`lidar::SensorMemory::revise`).
//! An agent whose sensor reports a cell that it had reported before is due with
//! [`EventMask::REVISED`].
//!
//! **What counts.** Shares are of the cells that are free at present. A cell that becomes wall
//! counts as neither explored nor covered any more, and one that becomes free counts once a scan
//! has crossed it, or a body has been in it, since then. A milestone that the present share does
//! not reach any more is open again ([`super::Coverage`]).
//!
//! Invariants: no body and no relay is inside a wall; a scan after a change finds what one without
//! memory of the map before it would find; a world whose map has not changed pays nothing.

use msgs::ids::AgentId;
use nalgebra::{Point3, Vector3};
use protocol::event_mask::EventMask;
use voxels::{Cell, Extent, Terrain};

use super::lidar::ForgottenCells;
use super::{PendingObservation, Presence, World};

/// A box of cells that become wall or free.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapChange {
    /// What the cells become.
    pub terrain: Terrain,
    /// Lowest corner of the box: cells with their centres in it change. Metres, frame `map`.
    pub low: Point3<f64>,
    /// Highest corner of the box.
    pub high: Point3<f64>,
    /// What it waits for; `None`: nothing.
    pub trigger: Option<Proximity>,
}

/// The approach of an agent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Proximity {
    /// Greatest distance of the centre of the body from the cells, metres.
    pub within_m: f64,
    /// Which agent; `None`: any.
    pub agent: Option<AgentId>,
}

/// The cells of a box.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CellBox {
    /// The lowest cell.
    pub low: Cell,
    /// The highest cell, which belongs to the box.
    pub high: Cell,
}

impl MapChange {
    /// The cells of the box that can change: those inside the outermost layer of the map. `None` if
    /// there are none.
    #[must_use]
    pub fn cells(&self, extent: Extent) -> Option<CellBox> {
        let along = [0, 1, 2].map(|axis: usize| {
            let last = extent.size()[axis].cast_signed() - 2;
            let is_inside =
                |cell: &i32| (self.low[axis]..=self.high[axis]).contains(&((f64::from(*cell) + 0.5) * extent.cell_m()));
            let mut cells = (1..=last).filter(is_inside);
            let first = cells.next()?;
            Some((first, cells.next_back().unwrap_or(first)))
        });
        let [Some(x), Some(y), Some(z)] = along else { return None };
        Some(CellBox { low: Cell::new(x.0, y.0, z.0), high: Cell::new(x.1, y.1, z.1) })
    }
}

impl CellBox {
    /// All cells, in the order of their indices.
    pub fn cells(self) -> impl Iterator<Item = Cell> {
        let Self { low, high } = self;
        (low.z..=high.z)
            .flat_map(move |z| (low.y..=high.y).flat_map(move |y| (low.x..=high.x).map(move |x| Cell::new(x, y, z))))
    }

    fn contains(self, cell: Cell) -> bool {
        let Self { low, high } = self;
        (low.x..=high.x).contains(&cell.x) && (low.y..=high.y).contains(&cell.y) && (low.z..=high.z).contains(&cell.z)
    }

    /// Distance of a point from the cells, metres.
    fn distance_m(self, extent: Extent, point: &Point3<f64>) -> f64 {
        distance_m(extent, self.low, self.high, point)
    }
}

/// Distance of a point from the cells from `low` to `high`, metres.
fn distance_m(extent: Extent, low: Cell, high: Cell, point: &Point3<f64>) -> f64 {
    let corner = |cell: Cell| Point3::new(f64::from(cell.x), f64::from(cell.y), f64::from(cell.z)) * extent.cell_m();
    let (low, high) = (corner(low), corner(high) + Vector3::repeat(extent.cell_m()));
    (point - point.sup(&low).inf(&high)).norm()
}

impl World {
    /// How often the map has changed.
    #[must_use]
    pub fn map_revision(&self) -> u32 {
        self.map_revision
    }

    /// Whether what a change waits for has happened, and nothing is in the cells that become wall.
    #[must_use]
    pub fn is_due(&self, change: &MapChange) -> bool {
        let Some(cells) = change.cells(self.terrain.extent()) else { return true };
        let is_triggered = change.trigger.is_none_or(|Proximity { within_m, agent: only }| {
            let comes_near = |agent: AgentId| {
                let is_meant = self.presence(agent).is_in_world() && only.is_none_or(|only| only == agent);
                is_meant && cells.distance_m(self.terrain.extent(), &self.body(agent).pose().position) <= within_m
            };
            self.agents().any(comes_near)
        });
        is_triggered && (change.terrain == Terrain::Free || !self.is_anything_in(cells))
    }

    /// Whether a body, a relay or a moving obstacle is in cells of a box that are free.
    #[must_use]
    pub fn is_anything_in(&self, cells: CellBox) -> bool {
        let extent = self.terrain.extent();
        let is_free = |cell: &Cell| cells.contains(*cell) && self.terrain.get(*cell) == Some(&Terrain::Free);
        let has_relay = self.relays().iter().any(|relay| is_free(&extent.cell_of(&relay.position)));
        has_relay
            || self.moving_obstacles().iter().any(|obstacle| obstacle.is_in(extent, |cell| is_free(&cell)))
            || self.spheres.iter().filter(|sphere| sphere.is_solid()).any(|sphere| {
                let reach = Vector3::repeat(sphere.radius_m);
                let touched = CellBox {
                    low: extent.cell_of(&(sphere.centre - reach)),
                    high: extent.cell_of(&(sphere.centre + reach)),
                };
                let own = extent.cell_of(&sphere.centre);
                let is_touched =
                    |cell: Cell| cell == own || distance_m(extent, cell, cell, &sphere.centre) < sphere.radius_m;
                touched.cells().any(|cell| is_free(&cell) && is_touched(cell))
            })
    }

    /// Changes the map at the start of a tick, before its scans. Returns how many cells have
    /// changed.
    ///
    /// # Panics
    /// If the world is not settled (see [`World::flush_scans`]), or a body is in a cell that
    /// becomes wall.
    pub fn change_map(&mut self, cells: CellBox, terrain: Terrain) -> u32 {
        assert!(self.has_no_pending_scans(), "the map changes while scans are not counted");
        assert!(terrain == Terrain::Free || !self.is_anything_in(cells), "a body is in a cell that becomes wall");
        let extent = self.terrain.extent();
        let indices = cells.cells().filter_map(|cell| extent.index(cell));
        let changed: Vec<u32> =
            indices.filter(|&index| self.terrain[index] != terrain).map(|index| index as u32).collect();
        if changed.is_empty() {
            return 0;
        }
        changed.iter().for_each(|&index| self.terrain[index as usize] = terrain);
        (0..self.agents.len()).for_each(|index| self.collect_scans(index));
        let explored_by = self.revise_sensors(&changed, terrain);
        self.coverage.revise(&changed, terrain, &explored_by, self.tick);
        self.map_changed_at = Some(self.tick);
        self.map_revision += 1;
        (self.contacts, self.open_space) = (None, None);
        if !self.relays().is_empty() {
            self.radio.relays.reconnect(&self.params.comms.contact, &self.terrain);
        }
        // What can be reached from now on is what can be reached from here.
        for agent in self.agents().filter(|&agent| self.presence(agent) == Presence::Active).collect::<Vec<_>>() {
            self.put(agent);
        }
        self.attainable.take();
        changed.len() as u32
    }

    /// Has all sensors forget cells that have changed; by agent, how many of them counted as
    /// explored by it.
    fn revise_sensors(&mut self, changed: &[u32], terrain: Terrain) -> Vec<usize> {
        let sensors: Vec<_> = self.agents.iter().map(|state| state.sensor.clone()).collect();
        // All of them at once, so that no helper casts in a map that is half the one before.
        let mut states: Vec<_> = sensors.iter().map(|sensor| sensor.state()).collect();
        let mut memories: Vec<_> = states.iter_mut().map(|state| state.without_scans_ahead()).collect();
        super::lidar::change_kinds(&mut memories, changed, terrain);
        let mut explored_by = Vec::with_capacity(memories.len());
        let forgotten: Vec<ForgottenCells> = memories.into_iter().map(|memory| memory.revise(changed)).collect();
        drop(states);
        for (index, forgotten) in forgotten.into_iter().enumerate() {
            let (cells, explored) = self.revise_belief(index, changed).unwrap_or_else(|| {
                self.agents[index].pending_observation.forget(changed);
                (forgotten.cells, forgotten.explored)
            });
            explored_by.push(explored);
            self.agents[index].outdated.extend(cells);
        }
        explored_by
    }
}

impl PendingObservation {
    /// Adds the event of those among new cells that the sensor has reported in another state, and
    /// takes them off `outdated`.
    pub(super) fn note_revised(&mut self, outdated: &mut std::collections::BTreeSet<u32>, new: &[u32]) {
        for cell in new {
            if outdated.remove(cell) {
                self.events |= EventMask::REVISED;
            }
        }
    }
}

#[cfg(test)]
mod tests;
