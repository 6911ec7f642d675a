//! Exploration and coverage: the free cells that have been seen and visited, by each agent and by
//! the team.
//!
//! A free cell is explored once a scan has crossed it, and covered once the centre of a body has
//! been in it. Shares are of all free cells of the true map after its repair (MAES3D: after pocket
//! removal). If the map changes during a run, all of this holds for the cells that are free at
//! present, and counts what has been seen and visited since they have been so.

use std::collections::BTreeSet;

use fixedbitset::FixedBitSet;
use msgs::ids::{AgentId, Tick};
use voxels::{CellSet, FACES, Grid, Terrain, is_wall_at};

/// Explored shares, in thousandths of the free cells, whose ticks are recorded.
pub const MILESTONES_PERMILLE: [u64; 5] = [500, 900, 990, 999, 1000];

/// Known share, in thousandths of the free cells, from which on a base station has the map.
const KNOWN_AT_BASE_PERMILLE: u64 = 990;

/// Explored and covered cells of a run.
#[derive(Debug, Clone)]
pub struct Coverage {
    free_cells: usize,
    explored: FixedBitSet,
    /// Number of explored cells, because shares are read in every tick.
    explored_count: usize,
    covered: CellSet,
    explored_by: Vec<usize>,
    covered_by: Vec<CellSet>,
    /// Free cells on each agent's own map, as last reported.
    believed_by: Vec<usize>,
    /// Ticks of the milestones reached so far.
    milestones: Vec<Tick>,
    base_stations: BTreeSet<AgentId>,
    /// Since when a base station has [`KNOWN_AT_BASE_PERMILLE`] on its map.
    known_at_base_since: Option<Tick>,
}

impl Coverage {
    /// Nothing explored or covered yet, in a map of `volume` cells.
    ///
    /// # Panics
    /// If there are no free cells, because shares are undefined then.
    #[must_use]
    pub fn new(volume: usize, free_cells: usize, agents: usize) -> Self {
        assert!(free_cells > 0, "a world has free cells");
        Self {
            free_cells,
            explored: FixedBitSet::with_capacity(volume),
            explored_count: 0,
            covered: CellSet::new(volume),
            explored_by: vec![0; agents],
            // None is a copy, which would use its memory.
            covered_by: (0..agents).map(|_| CellSet::new(volume)).collect(),
            believed_by: vec![0; agents],
            milestones: Vec::new(),
            base_stations: BTreeSet::new(),
            known_at_base_since: None,
        }
    }

    /// This coverage with these agents as base stations.
    #[must_use]
    pub fn with_base_stations(self, base_stations: BTreeSet<AgentId>) -> Self {
        Self { base_stations, ..self }
    }

    /// Records free cells that `agent` has seen for the first time.
    pub fn explore(&mut self, agent: AgentId, new_free: &[u32]) {
        self.explored_by[agent.index()] += new_free.len();
        for &cell in new_free {
            self.explored_count += usize::from(!self.explored.put(cell as usize));
        }
    }

    /// Records that the centre of the body of `agent` is in a cell.
    pub fn cover(&mut self, agent: AgentId, cell: u32) {
        self.covered.insert(cell as usize);
        self.covered_by[agent.index()].insert(cell as usize);
    }

    /// Records how many free cells `agent` reports to be on its map, clamped to the number there
    /// are.
    pub fn believe(&mut self, agent: AgentId, known_free: u32, now: Tick) {
        self.believed_by[agent.index()] = self.free_cells.min(known_free as usize);
        if self.base_stations.contains(&agent) {
            self.note_known_at_base(now);
        }
    }

    fn note_known_at_base(&mut self, now: Tick) {
        let has_map = |cells: usize| cells as u64 * 1000 >= self.free_cells as u64 * KNOWN_AT_BASE_PERMILLE;
        let is_known = self.known_at_base_count().is_some_and(has_map);
        self.known_at_base_since = is_known.then(|| self.known_at_base_since.unwrap_or(now));
    }

    /// Free cells on the map of the base station with most of them; `None` without base stations.
    #[must_use]
    pub fn known_at_base_count(&self) -> Option<usize> {
        let of = |agent: &AgentId| self.believed_by[agent.index()].min(self.free_cells);
        self.base_stations.iter().map(of).max()
    }

    /// Share of the free cells that a base station knows, 0 ..= 1; `None` without base stations.
    #[must_use]
    pub fn known_at_base(&self) -> Option<f64> {
        self.known_at_base_count().map(|cells| self.share(cells))
    }

    /// Since when a base station knows 99 % of the free cells; `None` if none does.
    #[must_use]
    pub fn known_at_base_since(&self) -> Option<Tick> {
        self.known_at_base_since
    }

    /// Records that cells (by index) have become wall, or free. Of `explored_by`, by agent, so many
    /// of them counted as explored by it.
    pub fn revise(&mut self, changed: &[u32], terrain: Terrain, explored_by: &[usize], now: Tick) {
        for (cells, forgotten) in self.explored_by.iter_mut().zip(explored_by) {
            *cells -= forgotten;
        }
        match terrain {
            Terrain::Free => self.free_cells += changed.len(),
            Terrain::Wall => self.free_cells -= changed.len(),
        }
        for cell in changed.iter().map(|&cell| cell as usize) {
            self.explored_count -= usize::from(self.explored.contains(cell));
            self.explored.set(cell, false);
            self.covered.remove(cell);
            self.covered_by.iter_mut().for_each(|cells| cells.remove(cell));
        }
        let (explored, free) = (self.explored_count as u64, self.free_cells as u64);
        let is_reached = |permille: &&u64| explored * 1000 >= free * **permille;
        self.milestones.truncate(MILESTONES_PERMILLE.iter().take_while(is_reached).count());
        self.note_milestones(now);
        self.note_known_at_base(now);
    }

    /// Records the milestones reached by now.
    pub fn note_milestones(&mut self, now: Tick) {
        let (explored, free) = (self.explored_count as u64, self.free_cells as u64);
        while MILESTONES_PERMILLE.get(self.milestones.len()).is_some_and(|&permille| explored * 1000 >= free * permille)
        {
            self.milestones.push(now);
        }
    }

    /// The milestones reached so far, in thousandths, with their ticks.
    pub fn milestones(&self) -> impl Iterator<Item = (u64, Tick)> {
        MILESTONES_PERMILLE.into_iter().zip(self.milestones.iter().copied())
    }

    /// Share of the free cells that at least one agent has seen, 0 ..= 1.
    #[must_use]
    pub fn explored(&self) -> f64 {
        self.share(self.explored_count)
    }

    /// Number of free cells that at least one agent has seen.
    #[must_use]
    pub fn explored_count(&self) -> usize {
        self.explored_count
    }

    /// Whether every free cell has been seen.
    #[must_use]
    pub fn is_explored(&self) -> bool {
        self.explored_count == self.free_cells
    }

    /// Whether every free cell has been visited.
    #[must_use]
    pub fn is_covered(&self) -> bool {
        self.covered.len() == self.free_cells
    }

    /// Share of the free cells that at least one agent has visited, 0 ..= 1.
    #[must_use]
    pub fn covered(&self) -> f64 {
        self.share(self.covered.len())
    }

    /// Share of the free cells that each agent has seen, by agent, 0 ..= 1.
    #[must_use]
    pub fn explored_by(&self) -> Vec<f64> {
        self.explored_by.iter().map(|&cells| self.share(cells)).collect()
    }

    /// Share of the free cells that each agent has visited, by agent, 0 ..= 1.
    #[must_use]
    pub fn covered_by(&self) -> Vec<f64> {
        self.covered_by.iter().map(|set| self.share(set.len())).collect()
    }

    /// Share of the free cells on each agent's own map, as last reported, by agent, 0 ..= 1.
    #[must_use]
    pub fn believed_by(&self) -> Vec<f64> {
        self.believed_by.iter().map(|&cells| self.share(cells.min(self.free_cells))).collect()
    }

    /// The free cells that at least one agent has seen, by cell index.
    #[must_use]
    pub fn explored_cells(&self) -> &FixedBitSet {
        &self.explored
    }

    /// Area of the walls around what the team has seen, m^2: of the faces between free cells that
    /// it has seen and cells of wall. `terrain` is the map at present.
    #[must_use]
    pub fn explored_surface_m2(&self, terrain: &Grid<Terrain>) -> f64 {
        let extent = terrain.extent();
        let faces = |index: usize| {
            let cell = extent.cell_at(index);
            FACES.iter().filter(|face| is_wall_at(terrain, cell + **face)).count()
        };
        let faces: usize = self.explored.ones().map(faces).sum();
        faces as f64 * extent.cell_m() * extent.cell_m()
    }

    /// Number of free cells of the map.
    #[must_use]
    pub fn free_cells(&self) -> usize {
        self.free_cells
    }

    fn share(&self, cells: usize) -> f64 {
        cells as f64 / self.free_cells.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use voxels::{Cell, Extent};

    use super::*;

    #[test]
    fn base_has_the_map_as_long_as_it_knows_99_percent() {
        let (base, other) = (AgentId(1), AgentId(0));
        let mut coverage = Coverage::new(2000, 1000, 2).with_base_stations([base].into());
        coverage.believe(other, 1000, Tick(1));
        assert_eq!((coverage.known_at_base(), coverage.known_at_base_since()), (Some(0.0), None));
        coverage.believe(base, 989, Tick(2));
        assert_eq!((coverage.known_at_base(), coverage.known_at_base_since()), (Some(0.989), None));
        coverage.believe(base, 995, Tick(3));
        coverage.believe(base, 1000, Tick(4));
        assert_eq!(coverage.known_at_base_since(), Some(Tick(3)));
        // More becomes free than it knows.
        let opened: Vec<u32> = (1000..1100).collect();
        coverage.revise(&opened, Terrain::Free, &[0, 0], Tick(5));
        assert_eq!(coverage.known_at_base_since(), None);
        coverage.believe(base, 1100, Tick(6));
        assert_eq!((coverage.known_at_base(), coverage.known_at_base_since()), (Some(1.0), Some(Tick(6))));
        assert_eq!(Coverage::new(9, 9, 1).known_at_base(), None);
    }

    #[test]
    fn milestones_have_the_tick_they_are_reached_in() {
        let mut coverage = Coverage::new(1000, 1000, 2);
        let cells: Vec<u32> = (0..1000).collect();
        for (tick, seen) in [(3, 499), (4, 500), (5, 950), (6, 1000), (7, 1000)] {
            coverage.explore(AgentId((tick % 2) as u32), &cells[..seen]);
            coverage.note_milestones(Tick(tick));
        }
        let reached: Vec<(u64, u64)> = coverage.milestones().map(|(permille, tick)| (permille, tick.0)).collect();
        assert_eq!(reached, [(500, 4), (900, 5), (990, 6), (999, 6), (1000, 6)]);
    }

    #[test]
    fn surface_is_that_of_the_walls_around_what_was_seen() {
        // A lane of three cells of half a metre.
        let solid = "#####\n#####\n#####\n";
        let text = format!("{solid}\n#####\n#...#\n#####\n\n{solid}");
        let walls = Grid::from_text(&text).unwrap().into_vec();
        let terrain = Grid::from_vec(Extent::new([5, 3, 3], 0.5).unwrap(), walls).unwrap();
        let extent = terrain.extent();
        let cell = |x| extent.index(Cell::new(x, 1, 1)).unwrap() as u32;
        let mut coverage = Coverage::new(extent.volume(), 3, 1);
        assert_eq!(coverage.explored_surface_m2(&terrain), 0.0);
        coverage.explore(AgentId(0), &[cell(1)]);
        // Five of its faces are wall; the sixth one is open, whether what is behind was seen.
        assert_eq!(coverage.explored_surface_m2(&terrain), 5.0 * 0.25);
        coverage.explore(AgentId(0), &[cell(2), cell(3)]);
        assert_eq!(coverage.explored_surface_m2(&terrain), 14.0 * 0.25);
    }
}
