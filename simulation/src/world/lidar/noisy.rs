//! Scans that err: returns that are missed, and distances that are noisy ([`crate::world::errors`]).
//!
//! A ray that meets a wall has its return from the middle of its way through that cell. Noise moves the return along the ray: the
//! cells before the place where it then lies are taken for free, and that cell for wall. A return that is missed, or that seems
//! to come from the body's own cell, tells nothing. A ray that meets no wall errs in nothing.
//!
//! What an agent is told of a cell is told once, as with exact scans; so each ray has a vote, and a cell is told of once the votes of
//! all scans of the agent differ by [`VOTES`]. Noise of less than a cell is outvoted nearly always; what it gets wrong stays so.
//!
//! This way of casting knows no bundles: it follows one ray after the other with [`voxels::walk`].

use std::ops::ControlFlow;

use msgs::ids::{AgentId, Tick};
use nalgebra::Point3;
use voxels::{Cell, walk};

use super::cast::{self, Field, Found};
use super::{Pattern, ScanView, Scanner, SensorMemory};
use crate::world::body::Pose;
use crate::world::noise::SensorNoise;

/// Votes by which what is told of a cell has to lead.
const VOTES: i8 = 3;

/// The scan that errs: whose and when.
#[derive(Debug, Clone, Copy)]
pub struct NoisyScan<'a> {
    /// How much.
    pub noise: &'a SensorNoise,
    /// Whose scan.
    pub agent: AgentId,
    /// When it was cast.
    pub tick: Tick,
}

/// What one ray tells.
struct Told<'a> {
    /// Cells that it seems to cross, the body's own first.
    free: &'a [(Cell, f64)],
    /// The cell that its return seems to come from, and the place.
    wall: Option<(Cell, Point3<f64>)>,
}

impl Scanner {
    /// As [`Scanner::scan`], with errors: cells that have got their votes are marked as seen and appended.
    pub fn scan_noisy(
        &self,
        memory: &mut SensorMemory,
        pose: &Pose,
        blur: NoisyScan<'_>,
        new_free: &mut Vec<u32>,
        new_wall: &mut Vec<u32>,
    ) {
        let extent = memory.extent;
        let Some(own) = extent.index(extent.cell_of(&pose.position)) else { return };
        let mut votes = std::mem::take(&mut memory.votes);
        votes.resize(extent.volume(), 0);
        votes[own] = VOTES;
        let mut touched = vec![own];
        self.follow(memory, pose, blur, |told| {
            let mut vote = |cell: Cell, vote: i8| {
                if let Some(index) = extent.index(cell)
                    && memory.seen[memory.slot_of(cell)] == 0
                {
                    votes[index] = votes[index].saturating_add(vote);
                    touched.push(index);
                }
            };
            told.free.iter().for_each(|&(cell, _)| vote(cell, 1));
            told.wall.iter().for_each(|&(cell, _)| vote(cell, -1));
        });
        memory.votes = votes;
        let mut unseen = Vec::new();
        for index in touched {
            let slot = memory.slot_of(extent.cell_at(index));
            let leads = memory.votes[index];
            if leads.unsigned_abs() < VOTES.unsigned_abs() || memory.seen[slot] != 0 {
                continue;
            }
            // What is truly there is not what is told.
            let mut field = Field { kinds: &memory.kinds, seen: &mut memory.seen };
            Found { free: &mut unseen, wall: &mut Vec::new() }.mark(&mut field, slot);
            if leads > 0 { new_free.push(index as u32) } else { new_wall.push(index as u32) }
        }
    }

    /// As [`Scanner::view`], with errors: of each cell what most rays of the scan tell.
    pub fn view_noisy(&self, memory: &SensorMemory, pose: &Pose, blur: NoisyScan<'_>) -> ScanView {
        let extent = memory.extent;
        let mut votes = vec![0_i32; extent.volume()];
        let mut view = ScanView::default();
        self.follow(memory, pose, blur, |told| {
            let mut vote = |cell: Cell, vote: i32| {
                if let Some(index) = extent.index(cell) {
                    votes[index] += vote;
                }
            };
            told.free.iter().for_each(|&(cell, _)| vote(cell, 1));
            told.wall.iter().for_each(|&(cell, _)| vote(cell, -1));
            view.hits.extend(told.wall.map(|(_, hit)| hit));
        });
        for (index, votes) in (0..).zip(votes) {
            match votes {
                1.. => view.free.push(index),
                0 => {}
                _ => view.wall.push(index),
            }
        }
        view
    }

    /// As [`Scanner::hits`], with errors.
    pub fn hits_noisy(&self, memory: &SensorMemory, pose: &Pose, blur: NoisyScan<'_>) -> Vec<Point3<f64>> {
        let mut hits = Vec::new();
        self.follow(memory, pose, blur, |told| hits.extend(told.wall.map(|(_, hit)| hit)));
        hits
    }

    fn follow(&self, memory: &SensorMemory, pose: &Pose, blur: NoisyScan<'_>, mut tell: impl FnMut(Told<'_>)) {
        let Some(start) = self.start(memory, pose) else { return };
        let extent = memory.extent;
        let is_wall = |cell: Cell| cast::is_wall(memory.kinds[memory.slot_of(cell)]);
        // In lengths of a ray's direction, which for a shell is as long as the ray.
        let reach = match self.pattern {
            Pattern::Lattice { .. } => self.range_m,
            Pattern::Shell { .. } => extent.cell_m(),
        };
        let mut rng = blur.noise.scan_stream(blur.agent, blur.tick);
        let mut crossed: Vec<(Cell, f64)> = Vec::new();
        for bundle in &self.bundles {
            for lane in bundle.lanes(start.cone()) {
                let direction = bundle.direction(lane);
                let length = direction.norm();
                let noise = blur.noise.sample_return(&mut rng).map(|noise_m| noise_m / length);
                crossed.clear();
                let mut entered_wall = None;
                let mut seems = None;
                let _where_it_ended = walk(extent, &pose.position, &direction, reach, |cell, entry| {
                    if let (Some(wall), None) = (entered_wall, seems) {
                        seems = Some((wall + entry) / 2.0 + noise.unwrap_or(0.0));
                    }
                    if seems.is_some_and(|seems| entry > seems) {
                        return ControlFlow::Break(());
                    }
                    crossed.push((cell, entry));
                    if entered_wall.is_none() && is_wall(cell) {
                        entered_wall = Some(entry);
                    }
                    ControlFlow::Continue(())
                });
                let Some(wall) = entered_wall else {
                    tell(Told { free: &crossed, wall: None });
                    continue;
                };
                let Some(noise) = noise else { continue };
                // At the edge of the map or of the range the ray has not left the wall.
                let seems = seems.unwrap_or(wall + noise);
                let free = crossed.partition_point(|&(_, entry)| entry <= seems).saturating_sub(1);
                if free > 0 {
                    let hit = pose.position + direction * seems;
                    tell(Told { free: &crossed[..free], wall: Some((crossed[free].0, hit)) });
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use voxels::{Grid, Terrain};

    use super::*;

    /// A hall of 8 x 5 x 5 cells, inside.
    fn hall() -> Grid<Terrain> {
        let mut terrain = Grid::new(voxels::Extent::new([10, 7, 7], 1.0).unwrap(), Terrain::Free);
        voxels::close_shell(&mut terrain, 1);
        terrain
    }

    const POSE: Pose = Pose { position: Point3::new(2.3, 3.4, 3.6), yaw_rad: 0.0 };

    fn scanner() -> Scanner {
        Scanner::new(Pattern::Lattice { rays: 5124 }, f64::INFINITY, TAU)
    }

    /// What is told of so many scans.
    fn told(noise: &SensorNoise, scans: u64) -> [Vec<u32>; 2] {
        let mut memory = SensorMemory::new(&hall());
        let (mut free, mut wall) = (Vec::new(), Vec::new());
        for tick in (0..scans).map(Tick) {
            let blur = NoisyScan { noise, agent: AgentId(0), tick };
            scanner().scan_noisy(&mut memory, &POSE, blur, &mut free, &mut wall);
        }
        free.sort_unstable();
        wall.sort_unstable();
        [free, wall]
    }

    #[test]
    fn without_errors_it_is_an_exact_scan() {
        let mut memory = SensorMemory::new(&hall());
        let (mut free, mut wall) = (Vec::new(), Vec::new());
        scanner().scan(&mut memory, &POSE, &mut free, &mut wall);
        free.sort_unstable();
        wall.sort_unstable();
        let exact = SensorNoise::default();
        // Cells that few rays meet have got their votes after some scans.
        assert_eq!(told(&exact, 3), [free, wall]);
        let blur = NoisyScan { noise: &exact, agent: AgentId(0), tick: Tick(0) };
        let view = scanner().view(&memory, &POSE);
        let blurred = scanner().view_noisy(&memory, &POSE, blur);
        assert_eq!((&view.free, &view.wall), (&blurred.free, &blurred.wall));
        assert_eq!(view.hits.len(), blurred.hits.len());
        assert_eq!(scanner().hits_noisy(&memory, &POSE, blur), blurred.hits);
    }

    #[test]
    fn noise_of_less_than_a_cell_is_outvoted() {
        let hall = hall();
        let noise = SensorNoise { range_sigma_m: 0.2, missed_returns: 0.3, ..SensorNoise::default() };
        let [free, wall] = told(&noise, 5);
        let is_free = |cell: u32| hall.as_slice()[cell as usize] == Terrain::Free;
        let wrong =
            free.iter().filter(|&&cell| !is_free(cell)).count() + wall.iter().filter(|&&cell| is_free(cell)).count();
        assert!(free.len() > 195 && wrong < 10, "{} {wrong}", free.len());
    }

    #[test]
    fn noise_of_more_than_a_cell_is_not() {
        let hall = hall();
        let [free, _] = told(&SensorNoise { range_sigma_m: 3.0, ..SensorNoise::default() }, 5);
        assert!(free.iter().any(|&cell| hall.as_slice()[cell as usize] == Terrain::Wall));
    }

    #[test]
    fn who_misses_all_returns_sees_nothing_but_its_own_cell() {
        let [free, wall] = told(&SensorNoise { missed_returns: 1.0, ..SensorNoise::default() }, 5);
        assert_eq!((free.len(), wall.len()), (1, 0));
    }

    #[test]
    fn a_scan_hangs_on_its_agent_and_tick_alone() {
        let noise = SensorNoise { range_sigma_m: 0.5, ..SensorNoise::default() };
        let memory = SensorMemory::new(&hall());
        let hits = |agent, tick| {
            let blur = NoisyScan { noise: &noise, agent: AgentId(agent), tick: Tick(tick) };
            scanner().hits_noisy(&memory, &POSE, blur)
        };
        assert_eq!(hits(0, 1), hits(0, 1));
        assert_ne!(hits(0, 1), hits(0, 2));
        assert_ne!(hits(0, 1), hits(1, 1));
    }
}
