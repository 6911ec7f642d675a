//! Viewpoints for confined bodies: where such a body can be to see what it cannot reach.
//!
//! A frontier has an unexplored cell beside it, and a body of several cells may not touch one,
//! while one on the ground stands below most of them: the frontier itself is no goal. A goal is a
//! *viewpoint*, a cell in which the body has room, that it can reach, and from which an unexplored
//! cell is seen within the range of the LiDAR. Viewpoints beside frontiers come first, by path
//! length; once there are none, those from which a ray meets an unexplored cell, however far away:
//! rays pass where the body does not.
//!
//! Invariants: a known cell stays known, so a cell from which no ray meets an unexplored one is not
//! examined again (only a wall that turns out to be free could change that); a viewpoint at which
//! the body has been is not chosen again; rays of at most [`RAY_CELLS_MAX`] cells are cast for a
//! decision. The result depends on the map and on earlier calls alone.
//!
//! Bodies that touch one cell have no use for this: they go to the frontier, unless their LiDAR has
//! a band of elevations and sees from there neither what is above nor what is below.

mod beside;

use std::cell::{Cell as Slot, RefCell};
use std::task::Poll;

use msgs::ids::Tick;
use voxels::{BodyLattice, Cell, CellSet, Extent};

use super::Ctx;
use super::dsvp::gain::{GainEstimator, Likelihood};
use agent::exploration_map::{CellState, ExplorationMap};
use agent::observation::{FieldOfView, RunInfo};
use agent::path::{Goal, Graph, Neighbours, Reachable, Search};
use beside::BesideFrontiers;

/// Rays of a viewpoint: as many as those of the LiDAR of MAES3D, in the same directions. So many
/// are in a band of elevations as well, unless it is less than this share of the sphere.
const RAYS: u32 = 5124;
const OF_SPHERE_MIN: f64 = 0.125;

/// Longest ray, cells; it bounds the memory of the rays.
const RANGE_CELLS_MAX: f64 = 100.0;

/// Most cells on the rays of the scans that a decision casts on the map, some tens of milliseconds.
const RAY_CELLS_MAX: usize = 1 << 24;

/// Number of viewpoints among which the gain decides, the nearest ones.
const OFFERS: usize = 8;

/// Least number of cells that a search for viewpoints looks for; each further one looks for four
/// times as many.
const NEAREST_MIN: usize = 16;

/// Added to the length of a path where gains are compared by length, metres.
const NEAR_M: f64 = 2.0;

/// The spacing of the viewpoints examined, cells; a finer one follows if a coarser one has none.
const SPACINGS: [i32; 3] = [4, 2, 1];

/// Edge of the blocks by which cells far from every frontier are left out, cells.
const BLOCK_CELLS: i32 = 8;

/// Which cells are meant, for example those through which paths may lead.
pub(crate) type CellFilter<'o> = &'o dyn Fn(Cell) -> bool;

/// What an agent says that rests because nothing unexplored can be seen from where its body can be.
pub(crate) const NOTHING_TO_SEE: &str = "sees nothing more from where it can be";

/// Time without a new cell on its map after which a body that needs viewpoints goes to one before
/// anything else: 30 s. Controllers that visit cells have many more of those than there are places
/// to look from.
const STALLED_TICKS: u64 = 1500;

/// How the map of an agent has grown.
#[derive(Debug, Default)]
pub(crate) struct Growth {
    /// Cells known at the last look, and since when.
    known_cells: usize,
    since: Tick,
    /// Whether no viewpoint would show more.
    has_seen_all: bool,
}

impl Growth {
    /// Whether the map has not grown for long, and a viewpoint may show more.
    pub(crate) fn has_stalled(&mut self, map: &ExplorationMap, now: Tick) -> bool {
        let known_cells = map.free() + map.wall();
        if self.known_cells != known_cells {
            *self = Self { known_cells, since: now, has_seen_all: false };
        }
        !self.has_seen_all && now >= self.since.after(STALLED_TICKS)
    }

    /// Notes that no viewpoint would show more on this map.
    pub(crate) fn note_all_seen(&mut self) {
        self.has_seen_all = true;
    }
}

/// A viewpoint and what it is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Viewpoint {
    /// Where the body goes.
    pub(crate) cell: Cell,
    /// An unexplored cell that is seen from there.
    pub(crate) target: Cell,
}

/// The viewpoints of one agent.
#[derive(Debug)]
pub(crate) struct Viewpoints {
    rays: GainEstimator,
    /// Where the body is in a cell.
    lattice: BodyLattice,
    range_m: f64,
    /// What the LiDAR sees with some heading; `None`: everything.
    field_of_view: Option<FieldOfView>,
    /// Cells within this distance of a frontier along each axis are beside it.
    beside: i32,
    /// Cells from which nothing new is seen: those examined, and those at which the body has been.
    exhausted: CellSet,
    reachable: Reachable,
    /// The cells with an unexplored one in sight beside a frontier nearby.
    near: Option<BesideFrontiers>,
    /// From where and with how many changes of the map none of those was found.
    none_beside: Option<(Cell, usize)>,
    /// The nearest cells that were examined last.
    nearest: Option<Nearest>,
}

impl Viewpoints {
    /// For a body of `radius_m` metres; nothing has been examined yet.
    pub(crate) fn new(run_info: &RunInfo, radius_m: f64) -> Self {
        let extent = run_info.extent;
        let lattice = BodyLattice::of(radius_m, extent.cell_m());
        let range_cells = (run_info.lidar_range_m / extent.cell_m()).min(RANGE_CELLS_MAX);
        let of_sphere =
            run_info.field_of_view.map_or(1.0, |view| (libm::sin(view.highest_rad) - libm::sin(view.lowest_rad)) / 2.0);
        let count = (f64::from(RAYS) / of_sphere.max(OF_SPHERE_MIN)) as u32;
        let mut rays = GainEstimator::new(count, range_cells, 1, Likelihood::new(1.0)).from(lattice);
        rays.limit_to(run_info.field_of_view.as_ref());
        let beside = (radius_m / extent.cell_m() + 0.5).ceil() as i32 + 1;
        Self {
            rays,
            lattice,
            range_m: range_cells * extent.cell_m(),
            field_of_view: run_info.field_of_view,
            beside,
            exhausted: CellSet::new(extent.volume()),
            reachable: Reachable::default(),
            near: None,
            none_beside: None,
            nearest: None,
        }
    }

    /// Notes that the body is at rest in a cell and has scanned there: it need not look from there
    /// again.
    pub(crate) fn visit(&mut self, extent: Extent, cell: Cell) {
        if let Some(index) = extent.index(cell) {
            self.exhausted.insert(index);
        }
    }

    /// The viewpoint to go to next. `None`: nothing unexplored can be seen from anywhere that the
    /// body can reach. Pending: more are left to examine in the next tick, with the body at rest.
    pub(crate) fn next(&mut self, ctx: &Ctx<'_>) -> Poll<Option<Viewpoint>> {
        self.next_among(ctx, None)
    }

    /// [`Viewpoints::next`] with a path through open cells alone; `None` says nothing about others.
    pub(crate) fn next_within(&mut self, ctx: &Ctx<'_>, is_open: CellFilter<'_>) -> Poll<Option<Viewpoint>> {
        self.next_among(ctx, Some(is_open))
    }

    fn next_among(&mut self, ctx: &Ctx<'_>, is_open: Option<CellFilter<'_>>) -> Poll<Option<Viewpoint>> {
        let map = ctx.map();
        if map.frontier_count() == 0 {
            return Poll::Ready(None);
        }
        let now = (ctx.cell(), map.journal_len());
        self.reachable.update(ctx.graph(Neighbours::TwentySix), ctx.cell());
        if self.none_beside != Some(now) {
            if let Some(viewpoint) = self.beside_frontier(ctx, is_open) {
                self.none_beside = None;
                return Poll::Ready(Some(viewpoint));
            }
            self.none_beside = is_open.is_none().then_some(now);
        }
        self.by_rays(ctx, is_open)
    }

    /// The nearest viewpoint beside a frontier.
    fn beside_frontier(&mut self, ctx: &Ctx<'_>, is_open: Option<CellFilter<'_>>) -> Option<Viewpoint> {
        let (map, from, graph) = (ctx.map(), ctx.cell(), ctx.graph(Neighbours::TwentySix));
        let near = self.near.take();
        let mut near = near.unwrap_or_else(|| BesideFrontiers::new(map.extent(), self.beside));
        near.update(map);
        let is_one = |cell: Cell| graph.is_usable(cell) && self.target_beside(map, cell).is_some();
        // The body is there, whether it has room or not.
        let is_here = !self.is_exhausted(map, from) && self.target_beside(map, from).is_some();
        let is_any = |near: &BesideFrontiers| self.reachable.reaches_any(near.cells(), &self.exhausted);
        if !is_here && !is_any(&near) {
            near.settle(map, is_one);
            if !is_any(&near) {
                self.near = Some(near);
                return None;
            }
        }
        let near = RefCell::new(near);
        let is_goal = |cell: Cell| match cell == from {
            true => is_here,
            false => !self.is_exhausted(map, cell) && near.borrow_mut().holds(map, cell, is_one),
        };
        let path = search(graph, from, &is_goal, is_open).run();
        self.near = Some(near.into_inner());
        let &cell = path?.cells.last()?;
        Some(Viewpoint { cell, target: self.target_beside(map, cell)? })
    }

    fn is_exhausted(&self, map: &ExplorationMap, cell: Cell) -> bool {
        map.extent().index(cell).is_none_or(|index| self.exhausted.contains(index))
    }

    /// An unexplored cell beside a frontier nearby that is in sight.
    fn target_beside(&self, map: &ExplorationMap, cell: Cell) -> Option<Cell> {
        let unexplored = map
            .frontiers_near(cell, self.beside)
            .flat_map(Cell::neighbours6)
            .filter(|&beside| map.extent().contains(beside) && map.state(beside) == CellState::Unexplored);
        unexplored.into_iter().find(|&target| self.is_seen(map, cell, target))
    }

    /// Whether the centre of an unexplored cell is in sight and in range of the place of another.
    fn is_seen(&self, map: &ExplorationMap, from: Cell, target: Cell) -> bool {
        let (here, there) = (self.lattice.place(map.extent(), from), map.extent().centre(target));
        self.field_of_view.is_none_or(|view| view.holds(&(there - here)))
            && (there - here).norm() <= self.range_m
            && map.is_seen_from(&here, target)
    }

    /// Of the nearest viewpoints from which a ray meets an unexplored cell, the one with the most
    /// such cells for its path.
    fn by_rays(&mut self, ctx: &Ctx<'_>, is_open: Option<CellFilter<'_>>) -> Poll<Option<Viewpoint>> {
        let (map, extent) = (ctx.map(), ctx.map().extent());
        let near = NearFrontiers::of(map, (self.range_m / extent.cell_m()).ceil() as i32 + 1);
        let mut casts_left = (RAY_CELLS_MAX / self.rays.ray_cells(map)).max(1);
        for spacing in SPACINGS {
            if near.count(extent, spacing, &self.reachable, &self.exhausted) == 0 {
                continue;
            }
            let key = (ctx.cell(), map.journal_len(), spacing);
            let known = self.nearest.take().filter(|nearest| nearest.key == key && is_open.is_none());
            let mut nearest = known.unwrap_or_else(|| Nearest { key, cells: Vec::new(), is_all: false });
            let mut offers: Vec<(f64, Viewpoint)> = Vec::new();
            let mut is_out_of_casts = false;
            let mut number = 0;
            loop {
                if number == nearest.cells.len() && !nearest.is_all {
                    let left = near.count(extent, spacing, &self.reachable, &self.exhausted);
                    let left = left.saturating_sub(offers.len());
                    let is_offered = |cell| offers.iter().any(|(_, offer)| offer.cell == cell);
                    let is_left = |cell| !self.is_exhausted(map, cell) && !is_offered(cell);
                    let count = (4 * nearest.cells.len()).max(NEAREST_MIN);
                    nearest = Nearest::found(ctx, key, count, &near, (left, &is_left), is_open);
                    number = 0;
                }
                let Some(&(cell, length_cells)) = nearest.cells.get(number) else { break };
                number += 1;
                let Some(index) = extent.index(cell).filter(|&index| !self.exhausted.contains(index)) else { continue };
                if casts_left == 0 {
                    is_out_of_casts = true;
                    break;
                }
                casts_left -= 1;
                let Some(target) = self.rays.first_unexplored(map, cell) else {
                    self.exhausted.insert(index);
                    continue;
                };
                let gain = f64::from(self.rays.gain(map, cell));
                offers.push((gain / (length_cells * extent.cell_m() + NEAR_M), Viewpoint { cell, target }));
                if offers.len() == OFFERS {
                    break;
                }
            }
            // Later lists leave out what is on offer.
            self.nearest = (offers.is_empty() && is_open.is_none()).then_some(nearest);
            if is_out_of_casts && offers.is_empty() {
                return Poll::Pending;
            }
            // Of equal ones the nearest.
            let best = offers.into_iter().reduce(|best, offer| if offer.0 > best.0 { offer } else { best });
            if let Some((_, viewpoint)) = best {
                return Poll::Ready(Some(viewpoint));
            }
        }
        Poll::Ready(None)
    }
}

/// The first cells of a search from where the body is that may be viewpoints, nearest first.
#[derive(Debug)]
struct Nearest {
    /// From where, with how many changes of the map, and of which spacing.
    key: (Cell, usize, i32),
    /// With the lengths of the paths to them, cells.
    cells: Vec<(Cell, f64)>,
    /// Whether there are no others.
    is_all: bool,
}

impl Nearest {
    /// The first `count` of the cells near frontiers that are left to examine, or all up to the
    /// last of them: their number, and which they are. Paths lead through open cells alone.
    fn found(
        ctx: &Ctx<'_>,
        key: (Cell, usize, i32),
        count: usize,
        near: &NearFrontiers,
        (left, is_left): (usize, &dyn Fn(Cell) -> bool),
        is_open: Option<CellFilter<'_>>,
    ) -> Self {
        let (_, _, spacing) = key;
        let cells = RefCell::new(Vec::new());
        let left = Slot::new(left);
        let is_last = |cell: Cell| {
            let is_on_lattice = [cell.x, cell.y, cell.z].iter().all(|along| along % spacing == 0);
            if is_on_lattice && near.holds(cell) && is_left(cell) {
                cells.borrow_mut().push(cell);
                left.set(left.get().saturating_sub(1));
            }
            left.get() == 0 || cells.borrow().len() == count
        };
        let mut search = search(ctx.graph(Neighbours::TwentySix), ctx.cell(), &is_last, is_open);
        let is_all = search.run().is_none() || left.get() == 0;
        let cells = cells.borrow().iter().map(|&cell| (cell, search.length_cells(cell))).collect();
        Self { key, cells, is_all }
    }
}

/// The search for the nearest of the goals, through open cells if there is a choice of them.
fn search<'a>(graph: Graph<'a>, from: Cell, is_goal: CellFilter<'a>, is_open: Option<CellFilter<'a>>) -> Search<'a> {
    let search = Search::new(graph, from, Goal::Where(is_goal));
    match is_open {
        Some(is_open) => search.within(is_open),
        None => search,
    }
}

/// The blocks of cells within a distance of a frontier.
struct NearFrontiers {
    size: [i32; 3],
    is_near: Vec<bool>,
}

impl NearFrontiers {
    fn of(map: &ExplorationMap, reach_cells: i32) -> Self {
        let size = map.extent().size().map(|cells| (cells.cast_signed() + BLOCK_CELLS - 1) / BLOCK_CELLS);
        let volume = size.iter().map(|&blocks| blocks as usize).product();
        let mut near = Self { size, is_near: vec![false; volume] };
        let mut last = None;
        for index in map.frontiers() {
            let block = block_of(map.extent().cell_at(index as usize));
            if last.replace(block) != Some(block) {
                let place = near.place(block);
                near.is_near[place] = true;
            }
        }
        for axis in 0..3 {
            near.dilate(axis, reach_cells.div_euclid(BLOCK_CELLS) + 1);
        }
        near
    }

    /// Extends the blocks along an axis.
    fn dilate(&mut self, axis: usize, by: i32) {
        let before = self.is_near.clone();
        for z in 0..self.size[2] {
            for y in 0..self.size[1] {
                for x in 0..self.size[0] {
                    let here = [x, y, z];
                    let range = (here[axis] - by).max(0)..=(here[axis] + by).min(self.size[axis] - 1);
                    let is_near = range.into_iter().any(|along| {
                        let mut other = here;
                        other[axis] = along;
                        before[self.place(other)]
                    });
                    let place = self.place(here);
                    self.is_near[place] = is_near;
                }
            }
        }
    }

    fn place(&self, [x, y, z]: [i32; 3]) -> usize {
        ((z * self.size[1] + y) * self.size[0] + x) as usize
    }

    fn holds(&self, cell: Cell) -> bool {
        self.is_near[self.place(block_of(cell))]
    }

    /// How many cells of a spacing there are in the blocks that can be reached and are not
    /// exhausted.
    fn count(&self, extent: Extent, spacing: i32, reachable: &Reachable, exhausted: &CellSet) -> usize {
        let [size_x, size_y, size_z] = extent.size().map(u32::cast_signed);
        let of_spacing = (0..BLOCK_CELLS).step_by(spacing as usize).fold(0, |bits, x| bits | 1_u64 << x);
        let mut count = 0;
        for (block, _) in self.is_near.iter().enumerate().filter(|(_, is_near)| **is_near) {
            let block = block as i32;
            let [x, y, z] =
                [block % self.size[0], block / self.size[0] % self.size[1], block / self.size[0] / self.size[1]]
                    .map(|along| along * BLOCK_CELLS);
            let along = |low: i32, size: i32| (low..(low + BLOCK_CELLS).min(size)).step_by(spacing as usize);
            let cells = (size_x - x).min(BLOCK_CELLS).cast_unsigned();
            for (z, y) in along(z, size_z).flat_map(|z| along(y, size_y).map(move |y| (z, y))) {
                let first = ((z * size_y + y) * size_x + x) as usize;
                let left = reachable.run(first, cells) & !exhausted.run(first, cells) & of_spacing;
                count += left.count_ones() as usize;
            }
        }
        count
    }
}

/// The block of a cell of the map.
fn block_of(cell: Cell) -> [i32; 3] {
    [cell.x, cell.y, cell.z].map(|along| along / BLOCK_CELLS)
}
