//! A small world drawn as text for tests: one agent that learns by looking around, and is moved by what its controller says.
//!
//! A motion is carried out at once and as a whole: this is no simulation of bodies.

use msgs::ids::{AgentId, Tick};
use msgs::maes_msgs::Wake as Events;
use nalgebra::Point3;
use voxels::{Cell, Grid, Terrain, line_of_sight};

use super::{Controller, Ctx};
use crate::command::{Command, Motion};
use crate::exploration_map::ExplorationMap;
use crate::observation::{Briefing, Cells, Collision, Observation, Surface};
use crate::travel::Travel;

/// Radius of the body, metres.
pub(crate) const RADIUS_M: f64 = 0.4;

/// A map of which is known what is drawn: `.` free, `#` wall, `?` unexplored.
pub(crate) fn drawn(text: &str) -> ExplorationMap {
    let free = Grid::from_text(&text.replace('?', "#")).unwrap();
    let unexplored = Grid::from_text(&text.replace('#', ".").replace('?', "#")).unwrap();
    let mut map = ExplorationMap::new(free.extent());
    for (index, (terrain, mark)) in (0..).zip(free.as_slice().iter().zip(unexplored.as_slice())) {
        match (terrain, mark) {
            (Terrain::Free, _) => map.note_free(&[index]),
            (Terrain::Wall, Terrain::Free) => map.note_wall(&[index]),
            (Terrain::Wall, Terrain::Wall) => {}
        }
    }
    map
}

/// One agent in a world.
pub(crate) struct Scene {
    world: Grid<Terrain>,
    briefing: Briefing,
    pub(crate) map: ExplorationMap,
    travel: Travel,
    /// What it is told next.
    pub(crate) observation: Observation,
}

impl Scene {
    /// At the centre of a cell of a world that is drawn; `?` is wall there, and nothing is known.
    pub(crate) fn new(text: &str, start: Cell) -> Self {
        let world = Grid::from_text(&text.replace('?', "#")).unwrap();
        let extent = world.extent();
        let briefing = Briefing {
            duration: Tick(90_000),
            extent,
            agents: 2,
            agents_seed: 1,
            controller: String::new(),
            settings: Vec::new(),
            body_radius_m: RADIUS_M,
            lidar_range_m: f64::INFINITY,
            lidar_period_ticks: 10,
            communication_range_m: f64::INFINITY,
            share_period_ticks: 251,
        };
        let mut observation = super::tests::idle();
        observation.pose.position = extent.centre(start);
        let travel = Travel::new(RADIUS_M, 1.0);
        Self { world, briefing, map: ExplorationMap::new(extent), travel, observation }
    }

    /// The same, and all that is drawn but `?` is known; no scan has been made.
    pub(crate) fn known(text: &str, start: Cell) -> Self {
        Self { map: drawn(text), ..Self::new(text, start) }
    }

    /// Puts the body somewhere else.
    pub(crate) fn put(&mut self, cell: Cell) {
        self.observation.pose.position = self.map.extent().centre(cell);
        self.observation.events |= Events::NEW_CELL;
    }

    /// A scan: learns all that can be seen from here, and has it in the view.
    pub(crate) fn look(&mut self) {
        let extent = self.world.extent();
        let here = self.observation.pose.position;
        let is_free = |cell: Cell| self.world.get(cell) == Some(&Terrain::Free);
        let is_seen = |cell: Cell| is_free(cell) && line_of_sight(&self.world, &here, &extent.centre(cell));
        let free: Vec<Cell> = extent.cells().filter(|&cell| is_seen(cell)).collect();
        let mut wall: Vec<Cell> = free.iter().flat_map(|cell| cell.neighbours6()).collect();
        wall.retain(|&cell| extent.contains(cell) && !is_free(cell));
        wall.sort_unstable();
        wall.dedup();
        let indices = |cells: Vec<Cell>| cells.into_iter().map(|cell| extent.index(cell).unwrap() as u32).collect();
        let view = Cells { free: indices(free), wall: indices(wall) };
        self.map.note_free(&view.free);
        self.map.note_wall(&view.wall);
        self.map.note_covered(extent.cell_of(&here));
        self.observation.view = Some(view);
        self.observation.scan_tick = Some(self.observation.tick);
    }

    /// Shows these cells as the last scan, and nothing else.
    pub(crate) fn show(&mut self, cells: &[Cell]) {
        let mut free: Vec<u32> = cells.iter().map(|&cell| self.map.extent().index(cell).unwrap() as u32).collect();
        free.sort_unstable();
        self.observation.view = Some(Cells { free, wall: Vec::new() });
        self.observation.scan_tick = Some(self.observation.tick);
    }

    /// A motion was refused because another agent is in the way.
    pub(crate) fn collide(&mut self) {
        self.observation.collision = Some(Collision { surface: Surface::Wall, with_agent: true });
        self.observation.events |= Events::COLLISION;
        self.observation.is_active = false;
    }

    /// Asks a controller now; the task it sets is under way then.
    pub(crate) fn ask(&mut self, controller: &mut dyn Controller) -> Command {
        let Self { briefing, map, travel, observation, .. } = self;
        map.note_covered(map.extent().cell_of(&observation.pose.position));
        let command = controller.decide(observation, &mut Ctx::new(AgentId(0), briefing, observation, map, travel));
        observation.events = 0;
        match command.motion {
            Motion::Keep => {}
            Motion::Stop => observation.is_active = false,
            _ => observation.is_active = true,
        }
        command
    }

    /// Lets ticks go by.
    pub(crate) fn wait(&mut self, ticks: u64) {
        self.observation.tick = self.observation.tick.after(ticks);
    }

    /// The end of a task; a path ends at its last way-point.
    pub(crate) fn arrive(&mut self, motion: &Motion) {
        if let Motion::Path(way_points) = motion {
            self.observation.pose.position = *way_points.last().unwrap();
            self.observation.events |= Events::NEW_CELL;
        }
        self.observation.collision = None;
        self.observation.events |= Events::TASK_DONE;
        self.observation.is_active = false;
    }
}

/// Cell of a flat world.
pub(crate) fn flat(x: i32, y: i32) -> Cell {
    Cell::new(x, y, 0)
}

/// Whether a body of [`RADIUS_M`] that goes through these points, in a map with cells of 1 m, comes near to nothing but cells that
/// are known to be free. Looked up point by point along the way, unlike what it is to check.
pub(crate) fn is_through_free_cells(map: &ExplorationMap, from: &Point3<f64>, way_points: &[Point3<f64>]) -> bool {
    use crate::exploration_map::CellState;
    let mut from = *from;
    way_points.iter().all(|to| {
        let steps = ((to - from).norm() / 0.02).ceil().max(1.0);
        let is_clear_at = |step: usize| {
            let centre = from + (to - from) * (step as f64 / steps);
            let here = map.extent().cell_of(&centre);
            here.neighbours26().into_iter().chain([here]).all(|cell| {
                let low = Point3::new(f64::from(cell.x), f64::from(cell.y), f64::from(cell.z));
                let nearest = centre.coords.sup(&low.coords).inf(&low.coords.add_scalar(1.0));
                let is_touched = (nearest - centre.coords).norm() < RADIUS_M - 1e-9;
                !is_touched || matches!(map.state(cell), CellState::Free | CellState::Covered)
            })
        };
        let is_clear = (0..=steps as usize).all(is_clear_at);
        from = *to;
        is_clear
    })
}
