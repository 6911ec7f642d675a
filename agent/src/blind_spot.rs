//! The blind spot of a body whose LiDARs see neither all above nor all below it, and what the body
//! takes to be there.
//!
//! A ring on a ground body meets the floor a metre away, and nearer to a wide body it misses much
//! of what the body would touch. So such a body would never leave its start. Planners of the field
//! take the surroundings of the robot for free ([voxblox], `clear_sphere_for_planning`). Here
//! a body that is shut in by what it has not seen takes the floor to go on level, and the height of
//! the body to be free, along level lines from where it is to the nearest column of cells that it
//! has seen: with a floor that it could stand on, if it needs one, or with a wall. Nothing is
//! assumed towards an edge, nor beyond 5 m, nor where nothing was seen.
//!
//! A body that hits something that moves not has assumed too much: what it assumed right ahead of
//! it is a wall then, and no floor.
//!
//! Invariants: only unexplored cells are assumed, and whatever is seen or reported later overrules
//! that; a body that is not shut in assumes nothing, and one whose controller moves it is not
//! asked.
//!
//! [voxblox]: https://voxblox.readthedocs.io/en/latest/pages/The-Voxblox-Node.html

use std::collections::BTreeSet;
use std::ops::{ControlFlow, RangeInclusive};

use nalgebra::{Point3, Vector3};
use protocol::event_mask::EventMask;
use protocol::observation::Observation;
use voxels::{Cell, walk};

use crate::exploration_map::{CellState, ExplorationMap, Finding};
use crate::path::{Graph, Moves};

/// Farthest floor up to which a body takes the floor to be level, metres: that which a ring with
/// rays down to -7 degrees sees from a height of 0.6 m.
const LEVEL_MAX_M: f64 = 5.0;

/// How far above a body a ray may pass that shows that nothing is in the way, metres: LiDARs are
/// mounted on masts.
const MAST_M: f64 = 1.0;

/// One cell up.
const UP: Cell = Cell::new(0, 0, 1);

/// The blind spot of one body.
#[derive(Debug, Default)]
pub struct BlindSpot {
    /// What has been assumed.
    assumed: BTreeSet<Cell>,
    /// Length of the journal of the map up to which it has been looked at.
    read: usize,
}

impl BlindSpot {
    /// Takes back what a collision shows to be wrong, once what was observed is in the map.
    pub fn note_collision(&mut self, map: &mut ExplorationMap, moves: &Moves, observation: &Observation) {
        let has_hit = observation.events.intersects(EventMask::COLLISION)
            && observation.collision.is_some_and(|collision| !collision.with_agent);
        if !has_hit || self.assumed.is_empty() {
            return;
        }
        let (extent, pose) = (map.extent(), &observation.pose);
        let (sin, cos) = libm::sincos(pose.yaw_rad);
        let ahead = pose.position + Vector3::new(cos, sin, 0.0) * extent.cell_m();
        let touched = |position: &Point3<f64>| -> BTreeSet<Cell> {
            let at = moves.lattice().cell_near(extent, position);
            moves.touched().iter().map(|&by| at + by).collect()
        };
        let (here, there) = (touched(&pose.position), touched(&ahead));
        // It stands on what is below it.
        for &cell in there.difference(&here) {
            self.correct(map, cell, Finding::Wall);
            self.correct(map, cell - UP, Finding::Free);
        }
    }

    /// Replaces what is assumed of a cell.
    fn correct(&mut self, map: &mut ExplorationMap, cell: Cell, finding: Finding) {
        let is_other = map.state(cell).is_free() == (finding == Finding::Wall);
        if is_other && self.assumed.remove(&cell) {
            map.correct_assumed(cell, finding);
        }
    }

    /// Adds to a map what a body assumes that is at rest and shut in; returns whether that is
    /// anything.
    pub fn fill(&mut self, map: &mut ExplorationMap, moves: &Moves, observation: &Observation) -> bool {
        if observation.field_of_view.is_none() || !moves.are_confined() || self.read == map.journal_len() {
            return false;
        }
        let centre = &observation.pose.position;
        let here = moves.lattice().cell_near(map.extent(), centre);
        let mut assumes_any = false;
        if is_shut_in(Graph::new(map, moves), here) {
            let (free, floor) = Columns::around(map, moves, here).assumed(centre);
            map.assume(&free, Finding::Free);
            map.assume(&floor, Finding::Wall);
            assumes_any = !(free.is_empty() && floor.is_empty());
            self.assumed.extend(free.into_iter().chain(floor));
        }
        self.read = map.journal_len();
        assumes_any
    }
}

/// Whether a body at the place of a cell gets nowhere where it would not overlap itself.
fn is_shut_in(graph: Graph<'_>, here: Cell) -> bool {
    let [low, high] = graph.moves().layers();
    let width = high - low + 1;
    let is_clear_of_start = |cell: Cell| {
        let by = cell - here;
        by.x.abs().max(by.y.abs()).max(by.z.abs()) >= width
    };
    let mut steps = graph.steps();
    let (mut reached, mut next) = (BTreeSet::from([here]), vec![here]);
    while let Some(cell) = next.pop() {
        if is_clear_of_start(cell) {
            return false;
        }
        next.extend(steps.next_to(cell, cell == here).filter(|&beside| reached.insert(beside)));
    }
    true
}

/// What is known of the columns of cells around a body.
struct Columns<'a> {
    map: &'a ExplorationMap,
    moves: &'a Moves,
    here: Cell,
    /// The layers of cells that the body touches.
    layers: RangeInclusive<i32>,
}

/// What is known of a column.
enum Column {
    /// A wall at the height of the body.
    Wall,
    /// No floor, or nothing.
    Unknown,
    /// It is clear at some height.
    Clear {
        /// Whether it closes the blind spot: a floor is there, or for other bodies all of it is
        /// free.
        is_seen: bool,
        /// Whether nothing of it is unexplored that matters.
        is_whole: bool,
    },
}

impl<'a> Columns<'a> {
    /// Those around a body at the place of a cell.
    fn around(map: &'a ExplorationMap, moves: &'a Moves, here: Cell) -> Self {
        let [low, high] = moves.layers();
        Self { map, moves, here, layers: here.z + low..=here.z + high }
    }

    /// The free cells and the floor that are assumed around a body with its centre at a point
    /// (metres, frame `map`).
    fn assumed(&self, centre: &Point3<f64>) -> (Vec<Cell>, Vec<Cell>) {
        let extent = self.map.extent();
        let level = Point3::new(centre.x, centre.y, extent.centre(self.here).z);
        let reach = libm::ceil(LEVEL_MAX_M / extent.cell_m()) as i32;
        let mut columns = BTreeSet::new();
        for along in -reach..=reach {
            for by in [(along, -reach), (along, reach), (-reach, along), (reach, along)] {
                let direction = Vector3::new(f64::from(by.0), f64::from(by.1), 0.0).normalize();
                let (mut blind, mut is_beyond) = (Vec::new(), false);
                let _: ControlFlow<()> = walk(extent, &level, &direction, LEVEL_MAX_M, |cell, _| {
                    let column = self.column(cell);
                    if let Column::Clear { is_seen: false, .. } | Column::Clear { is_whole: false, .. } = column {
                        blind.push((cell.y, cell.x));
                    }
                    if let Column::Wall | Column::Clear { is_seen: true, .. } = column {
                        is_beyond |= !blind.is_empty();
                        columns.extend(blind.drain(..));
                    }
                    match column {
                        Column::Wall | Column::Unknown => ControlFlow::Break(()),
                        Column::Clear { is_whole: true, .. } if is_beyond => ControlFlow::Break(()),
                        Column::Clear { .. } => ControlFlow::Continue(()),
                    }
                });
            }
        }
        let (mut free, mut floor) = (Vec::new(), Vec::new());
        let is_unexplored = |cell: &Cell| self.map.state(*cell) == CellState::Unexplored;
        for (y, x) in columns {
            free.extend(self.layers.clone().map(|z| Cell::new(x, y, z)).filter(is_unexplored));
            let below = Cell::new(x, y, self.layers.start() - 1);
            if !self.has_floor(x, y) && is_unexplored(&below) {
                floor.push(below);
            }
        }
        (free, floor)
    }

    /// Whether a column has a floor that is known, no deeper than the body climbs, or needs none.
    fn has_floor(&self, x: i32, y: i32) -> bool {
        let top = self.layers.start() - 1;
        let state = |z: i32| self.map.state(Cell::new(x, y, z));
        // Who has seen the bottom of a step has seen what is above it; below the map all is wall.
        let is_floor = |z: i32| state(z) == CellState::Wall && (z == top || state(z + 1).is_free());
        self.moves.climb_cells().is_none_or(|climb_cells| (top - climb_cells..=top).any(is_floor))
    }

    /// What is known of the column of a cell.
    fn column(&self, Cell { x, y, .. }: Cell) -> Column {
        let state = |z: i32| self.map.state(Cell::new(x, y, z));
        let layers = &self.layers;
        if layers.clone().any(|z| state(z) == CellState::Wall) {
            return Column::Wall;
        }
        let mast_cells = (MAST_M / self.map.extent().cell_m()) as i32;
        let is_clear = (*layers.start()..=layers.end() + mast_cells).any(|z| state(z).is_free());
        let has_floor = self.has_floor(x, y);
        let is_edge = !has_floor && state(layers.start() - 1).is_free();
        if !is_clear || is_edge {
            return Column::Unknown;
        }
        let is_free = layers.clone().all(|z| state(z).is_free());
        let needs_floor = self.moves.are_on_ground();
        let is_seen = if needs_floor { has_floor } else { is_free };
        Column::Clear { is_seen, is_whole: is_free && has_floor }
    }
}

#[cfg(test)]
mod tests;
