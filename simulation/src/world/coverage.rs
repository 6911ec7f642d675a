//! How much of the free space has been seen (explored) and visited (covered), by each agent and by the team.
//!
//! A free cell is explored once a scan has crossed it, and covered once the centre of a body has been in it. Fractions are of
//! all free cells of the true map (reference: after pocket removal), as real numbers.

use msgs::ids::{AgentId, Tick};

/// A set of cell indices.
#[derive(Debug, Clone)]
struct CellSet {
    words: Vec<u64>,
    len: usize,
}

impl CellSet {
    fn new(volume: usize) -> Self {
        Self { words: vec![0; volume.div_ceil(64)], len: 0 }
    }

    fn insert(&mut self, index: u32) {
        let word = &mut self.words[index as usize / 64];
        let bit = 1 << (index % 64);
        if *word & bit == 0 {
            *word |= bit;
            self.len += 1;
        }
    }
}

/// Shares of the free cells, in thousandths, of which it is noted when the team has seen so much.
pub const MILESTONES_PERMILLE: [u64; 5] = [500, 900, 990, 999, 1000];

/// The score of a run.
#[derive(Debug, Clone)]
pub struct Coverage {
    free_cells: usize,
    explored: CellSet,
    covered: CellSet,
    explored_by: Vec<usize>,
    covered_by: Vec<CellSet>,
    /// Free cells that are on each agent's map, as it says.
    believed_by: Vec<usize>,
    /// When the milestones were reached, as far as they have been.
    milestones: Vec<Tick>,
}

impl Coverage {
    /// Nothing seen yet.
    ///
    /// # Panics
    /// If there are no free cells: a share of nothing is no number.
    #[must_use]
    pub fn new(volume: usize, free_cells: usize, agents: usize) -> Self {
        assert!(free_cells > 0, "a world has free cells");
        Self {
            free_cells,
            explored: CellSet::new(volume),
            covered: CellSet::new(volume),
            explored_by: vec![0; agents],
            covered_by: vec![CellSet::new(volume); agents],
            believed_by: vec![0; agents],
            milestones: Vec::new(),
        }
    }

    /// Notes free cells that `agent` has seen for the first time.
    pub fn explore(&mut self, agent: AgentId, new_free: &[u32]) {
        self.explored_by[agent.index()] += new_free.len();
        for &cell in new_free {
            self.explored.insert(cell);
        }
    }

    /// Notes that the centre of `agent` is in a cell.
    pub fn cover(&mut self, agent: AgentId, cell: u32) {
        self.covered.insert(cell);
        self.covered_by[agent.index()].insert(cell);
    }

    /// Notes how many free cells `agent` says are on its map; more than there are count as all.
    pub fn believe(&mut self, agent: AgentId, known_free: u32) {
        self.believed_by[agent.index()] = self.free_cells.min(known_free as usize);
    }

    /// Notes which milestones have been reached by now.
    pub fn note_milestones(&mut self, now: Tick) {
        let (explored, free) = (self.explored.len as u64, self.free_cells as u64);
        while MILESTONES_PERMILLE.get(self.milestones.len()).is_some_and(|&permille| explored * 1000 >= free * permille)
        {
            self.milestones.push(now);
        }
    }

    /// The milestones that have been reached, in thousandths, and when.
    pub fn milestones(&self) -> impl Iterator<Item = (u64, Tick)> {
        MILESTONES_PERMILLE.into_iter().zip(self.milestones.iter().copied())
    }

    /// Share of the free cells that at least one agent has seen, 0 ..= 1.
    #[must_use]
    pub fn explored(&self) -> f64 {
        self.share(self.explored.len)
    }

    /// Whether every free cell has been seen.
    #[must_use]
    pub fn is_explored(&self) -> bool {
        self.explored.len == self.free_cells
    }

    /// Whether every free cell has been visited.
    #[must_use]
    pub fn is_covered(&self) -> bool {
        self.covered.len == self.free_cells
    }

    /// Share of the free cells that at least one agent has visited, 0 ..= 1.
    #[must_use]
    pub fn covered(&self) -> f64 {
        self.share(self.covered.len)
    }

    /// Share of the free cells that each agent has seen, by agent.
    #[must_use]
    pub fn explored_by(&self) -> Vec<f64> {
        self.explored_by.iter().map(|&cells| self.share(cells)).collect()
    }

    /// Share of the free cells that each agent has visited, by agent.
    #[must_use]
    pub fn covered_by(&self) -> Vec<f64> {
        self.covered_by.iter().map(|set| self.share(set.len)).collect()
    }

    /// Share of the free cells that is on each agent's map, by agent, as they said last.
    #[must_use]
    pub fn believed_by(&self) -> Vec<f64> {
        self.believed_by.iter().map(|&cells| self.share(cells)).collect()
    }

    /// The free cells that at least one agent has seen: a bit for each cell of the map, by index, 64 to a word.
    #[must_use]
    pub fn explored_cells(&self) -> &[u64] {
        &self.explored.words
    }

    /// Free cells of the map.
    #[must_use]
    pub fn free_cells(&self) -> usize {
        self.free_cells
    }

    fn share(&self, cells: usize) -> f64 {
        cells as f64 / self.free_cells as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn milestones_are_noted_in_the_tick_in_which_they_are_reached() {
        let mut coverage = Coverage::new(1000, 1000, 2);
        let cells: Vec<u32> = (0..1000).collect();
        for (tick, seen) in [(3, 499), (4, 500), (5, 950), (6, 1000), (7, 1000)] {
            coverage.explore(AgentId((tick % 2) as u32), &cells[..seen]);
            coverage.note_milestones(Tick(tick));
        }
        let reached: Vec<(u64, u64)> = coverage.milestones().map(|(permille, tick)| (permille, tick.0)).collect();
        assert_eq!(reached, [(500, 4), (900, 5), (990, 6), (999, 6), (1000, 6)]);
    }
}
