//! Noisy scans: missed returns and Gaussian range noise ([`crate::noise`]).
//!
//! The exact return of a ray lies halfway through the wall cell it hits. Noise moves the return
//! along the ray: the cells before it are taken as free, the cell at it as wall. A missed return,
//! or one from the body's own cell, yields nothing. A ray that hits no wall has no noise.
//!
//! A cell is reported to its agent once, as with exact scans. Each ray therefore votes, and a cell
//! is reported once the votes of all scans of the agent lead by [`VOTES`]. Noise of less than a
//! cell is nearly always outvoted; a wrong report is final.
//!
//! Rays are not bundled: each is followed with [`voxels::walk`].

use std::ops::ControlFlow;

use msgs::ids::{AgentId, Tick};
use voxels::{Cell, walk};

use super::bodies::{Bodies, BodyHit};
use super::engine::{CastCount, Engine, NewCells, NotCast};
use super::returns::{Measured, RayReturn, incidence_cos};
use super::{Pattern, ScanView, Scanner, SensorMemory};
use crate::body::Pose;
use crate::noise::SensorNoise;

/// The lead in votes with which a cell is reported.
const VOTES: i8 = 3;

/// The engine of one noisy scan: noise parameters, agent, LiDAR and tick, which name its random
/// stream.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NoisyScan<'a> {
    /// The bodies of others.
    pub(crate) bodies: &'a Bodies,
    /// Noise parameters.
    pub(crate) noise: &'a SensorNoise,
    /// The scanning agent.
    pub(crate) agent: AgentId,
    /// Which of its LiDARs scans.
    pub(crate) lidar: usize,
    /// Tick of the scan.
    pub(crate) tick: Tick,
}

/// The cells that one ray votes for.
struct RayVote<'a> {
    /// Cells that it seems to cross, the body's own first, with the distances at which it enters
    /// them.
    free: &'a [(Cell, f64)],
    /// The cell of its measured return.
    wall: Option<Cell>,
    /// What it measures.
    ray: RayReturn,
}

/// Marks cells as seen and adds them once they have the votes; the kind that is reported may differ
/// from the true one.
impl Engine for NoisyScan<'_> {
    fn cast(&mut self, scanner: &Scanner, memory: &mut SensorMemory, pose: &Pose, new: NewCells<'_>) -> CastCount {
        let extent = memory.extent();
        let due = u64::from(scanner.rays());
        let Some(own) = extent.index(extent.cell_of(&pose.position)) else {
            return CastCount::without(due, NotCast::OutsideMap);
        };
        let mut votes = memory.take_votes();
        let mut touched: Vec<usize> = extent.index(extent.cell_of(&scanner.origin(pose))).into_iter().collect();
        touched.push(own);
        touched.extend(memory.body_cells(&pose.position).into_iter().filter_map(|cell| extent.index(cell)));
        touched.iter().for_each(|&index| votes[index] = VOTES);
        let in_view = scanner.follow(memory, pose, *self, |ray| {
            let mut vote = |cell: Cell, vote: i8| {
                if let Some(index) = extent.index(cell)
                    && !memory.has_seen(cell)
                {
                    votes[index] = votes[index].saturating_add(vote);
                    touched.push(index);
                }
            };
            ray.free.iter().for_each(|&(cell, _)| vote(cell, 1));
            ray.wall.into_iter().for_each(|cell| vote(cell, -1));
        });
        let mut of_true_kinds = (Vec::new(), Vec::new());
        for index in touched {
            let cell = extent.cell_at(index);
            let leads = votes[index];
            if leads.unsigned_abs() < VOTES.unsigned_abs() || memory.has_seen(cell) {
                continue;
            }
            memory.see(cell, &mut NewCells { free: &mut of_true_kinds.0, wall: &mut of_true_kinds.1 });
            if leads > 0 { new.free.push(index as u32) } else { new.wall.push(index as u32) }
        }
        memory.put_votes(votes);
        let mut count = CastCount::of(due);
        count.leave_out(due - in_view, NotCast::OutsideView);
        count
    }
}

impl Scanner {
    /// As [`Scanner::view`], with noise: the kind of each cell is that of most rays of the scan.
    pub(crate) fn view_noisy(&self, memory: &SensorMemory, pose: &Pose, scan: NoisyScan<'_>) -> ScanView {
        let extent = memory.extent();
        let mut votes = vec![0_i32; extent.volume()];
        let mut view = ScanView::default();
        self.follow(memory, pose, scan, |ray| {
            let mut vote = |cell: Cell, vote: i32| {
                if let Some(index) = extent.index(cell) {
                    votes[index] += vote;
                }
            };
            ray.free.iter().for_each(|&(cell, _)| vote(cell, 1));
            ray.wall.into_iter().for_each(|cell| vote(cell, -1));
            view.hits.extend(ray.ray.point());
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

    /// As [`Scanner::returns`], with noise.
    pub(crate) fn returns_noisy(&self, memory: &SensorMemory, pose: &Pose, scan: NoisyScan<'_>) -> Vec<RayReturn> {
        let mut returns = Vec::new();
        self.follow(memory, pose, scan, |vote| returns.push(vote.ray));
        returns
    }

    /// Follows all rays in the field of view; returns how many.
    fn follow(
        &self,
        memory: &SensorMemory,
        pose: &Pose,
        scan: NoisyScan<'_>,
        mut vote: impl FnMut(RayVote<'_>),
    ) -> u64 {
        let mut rays = 0;
        let Some(start) = self.start(memory, pose) else { return rays };
        let extent = memory.extent();
        let is_wall = |cell: Cell| memory.is_wall(cell);
        // In lengths of a ray's direction; that of a shell's ray is as long as the ray.
        let reach = match self.rays.pattern {
            Pattern::Lattice { .. } | Pattern::Grid(_) => self.range_m,
            Pattern::Shell { .. } => extent.cell_m(),
        };
        let (origin, blind_m) = (self.origin(pose), self.mount.min_range_m);
        let mut rng = scan.noise.scan_stream(scan.agent, scan.lidar, scan.tick);
        let mut crossed: Vec<(Cell, f64)> = Vec::new();
        for bundle in &*self.bundles(pose.yaw_rad) {
            for lane in bundle.lanes(start.cone()) {
                rays += 1;
                let direction = bundle.direction(lane);
                let length = direction.norm();
                let noise = scan.noise.sample_return(&mut rng).map(|noise_m| noise_m / length);
                crossed.clear();
                let mut entered_wall = None;
                let mut measured = None;
                let body = scan.bodies.first_on(&origin, &direction).filter(|hit| hit.distance <= reach);
                let reach = body.map_or(reach, |hit| hit.distance);
                let _where_it_ended = walk(extent, &origin, &direction, reach, |cell, entry| {
                    if let (Some((_, wall)), None) = (entered_wall, measured) {
                        measured = Some((wall + entry) / 2.0 + noise.unwrap_or(0.0));
                    }
                    if measured.is_some_and(|measured| entry > measured) {
                        return ControlFlow::Break(());
                    }
                    crossed.push((cell, entry));
                    if entered_wall.is_none() && is_wall(cell) {
                        entered_wall = Some((cell, entry));
                    }
                    ControlFlow::Continue(())
                });
                let mut without = |free: &[(Cell, f64)], measured: Measured| {
                    vote(RayVote { free, wall: None, ray: RayReturn { direction, measured } });
                };
                let (wall, incidence_cos) = match (entered_wall, body) {
                    (Some((cell, wall)), _) => (wall, incidence_cos(memory, &origin, &direction, cell)),
                    (None, Some(BodyHit { distance, incidence_cos })) => (distance, incidence_cos),
                    (None, None) => {
                        without(&crossed, Measured::OutOfRange);
                        continue;
                    }
                };
                let Some(noise) = noise else {
                    without(&[], Measured::Missed);
                    continue;
                };
                if blind_m > 0.0 && wall <= blind_m {
                    without(&[], Measured::TooNear);
                    continue;
                }
                if entered_wall.is_none() {
                    // Cells behind the body are not crossed, however far it seems to be.
                    let measured = wall + noise;
                    let free = crossed.partition_point(|&(_, entry)| entry <= measured);
                    let point = origin + direction * measured;
                    without(&crossed[..free], Measured::Surface { point, incidence_cos });
                    continue;
                }
                // At the edge of the map or of the range the ray has not left the wall cell.
                let measured = measured.unwrap_or(wall + noise);
                let free = crossed.partition_point(|&(_, entry)| entry <= measured).saturating_sub(1);
                if free == 0 {
                    without(&[], Measured::Missed);
                    continue;
                }
                let measured = Measured::Surface { point: origin + direction * measured, incidence_cos };
                let ray = RayReturn { direction, measured };
                vote(RayVote { free: &crossed[..free], wall: Some(crossed[free].0), ray });
            }
        }
        rays
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use nalgebra::Point3;
    use voxels::{Grid, Terrain};

    use super::*;

    /// A hall with an interior of 8 x 5 x 5 cells.
    fn hall() -> Grid<Terrain> {
        let mut terrain = Grid::new(voxels::Extent::new([10, 7, 7], 1.0).unwrap(), Terrain::Free);
        voxels::close_shell(&mut terrain, 1);
        terrain
    }

    const POSE: Pose = Pose { position: Point3::new(2.3, 3.4, 3.6), yaw_rad: 0.0 };

    fn scanner() -> Scanner {
        Scanner::new(Pattern::Lattice { rays: 5124 }, f64::INFINITY, TAU)
    }

    /// The cells that are reported after a number of scans.
    fn reported(noise: &SensorNoise, scans: u64) -> [Vec<u32>; 2] {
        let mut memory = SensorMemory::new(&hall());
        let (mut free, mut wall) = (Vec::new(), Vec::new());
        for tick in (0..scans).map(Tick) {
            let new = NewCells { free: &mut free, wall: &mut wall };
            NoisyScan { noise, agent: AgentId(0), lidar: 0, tick, bodies: &Bodies::default() }.cast(
                &scanner(),
                &mut memory,
                &POSE,
                new,
            );
        }
        free.sort_unstable();
        wall.sort_unstable();
        [free, wall]
    }

    #[test]
    fn scan_without_noise_is_exact() {
        let mut memory = SensorMemory::new(&hall());
        let (mut free, mut wall) = (Vec::new(), Vec::new());
        scanner().scan(&mut memory, &POSE, &mut free, &mut wall);
        free.sort_unstable();
        wall.sort_unstable();
        let exact = SensorNoise::default();
        // Cells that few rays hit have enough votes after some scans.
        assert_eq!(reported(&exact, 3), [free, wall]);
        let scan = NoisyScan { noise: &exact, agent: AgentId(0), lidar: 0, tick: Tick(0), bodies: &Bodies::default() };
        let view = scanner().view(&memory, &POSE);
        let noisy = scanner().view_noisy(&memory, &POSE, scan);
        assert_eq!((&view.free, &view.wall), (&noisy.free, &noisy.wall));
        assert_eq!(view.hits.len(), noisy.hits.len());
        let returns = scanner().returns_noisy(&memory, &POSE, scan);
        assert_eq!(returns.iter().filter_map(RayReturn::point).collect::<Vec<_>>(), noisy.hits);
    }

    #[test]
    fn noise_of_less_than_a_cell_is_outvoted() {
        let hall = hall();
        let noise = SensorNoise { range_sigma_m: 0.2, missed_returns: 0.3, ..SensorNoise::default() };
        let [free, wall] = reported(&noise, 5);
        let is_free = |cell: u32| hall.as_slice()[cell as usize] == Terrain::Free;
        let wrong =
            free.iter().filter(|&&cell| !is_free(cell)).count() + wall.iter().filter(|&&cell| is_free(cell)).count();
        assert!(free.len() > 195 && wrong < 10, "{} {wrong}", free.len());
    }

    #[test]
    fn noise_of_more_than_a_cell_is_not_outvoted() {
        let hall = hall();
        let [free, _] = reported(&SensorNoise { range_sigma_m: 3.0, ..SensorNoise::default() }, 5);
        assert!(free.iter().any(|&cell| hall.as_slice()[cell as usize] == Terrain::Wall));
    }

    #[test]
    fn all_returns_missed_sees_only_own_cell() {
        let [free, wall] = reported(&SensorNoise { missed_returns: 1.0, ..SensorNoise::default() }, 5);
        assert_eq!((free.len(), wall.len()), (1, 0));
    }

    #[test]
    fn noise_depends_on_agent_and_tick_alone() {
        let noise = SensorNoise { range_sigma_m: 0.5, ..SensorNoise::default() };
        let memory = SensorMemory::new(&hall());
        let hits = |agent, tick| {
            let (agent, tick) = (AgentId(agent), Tick(tick));
            let scan = NoisyScan { noise: &noise, agent, lidar: 0, tick, bodies: &Bodies::default() };
            scanner().returns_noisy(&memory, &POSE, scan)
        };
        assert_eq!(hits(0, 1), hits(0, 1));
        assert_ne!(hits(0, 1), hits(0, 2));
        assert_ne!(hits(0, 1), hits(1, 1));
    }
}
