//! Meetings on purpose: whether it pays to go to an agent out of contact before the rest of the own
//! tour, to learn which of its tasks that agent has seen.
//!
//! The other agent is expected along its tour of the division, or at its last known goal if it has
//! none, and is met at the first place where this one can be no later than it. What it has seen of
//! the own tour is known by probabilities ([`super::sightings`]). These are taken to depend on one
//! unknown, how far it has come: if it has seen a task, it has seen all more probable ones as well.
//! So a few cases stand for all. A detour pays if the expected end of the own tour, after the
//! meeting and without what the other one has seen, is before its end without the meeting.
//!
//! Invariant: agents in contact are never met on purpose; the result depends on the numbers alone.
//! What the other agent gains by the meeting is not counted.

use msgs::ids::AgentId;
use voxels::Cell;

use super::division::timed;
use super::{Team, TeamParams, Tours, Valued, World, arrivals_s, seconds};

/// The cases: in each the other agent has seen the tasks that it has seen with a higher probability
/// than this.
const SEEN_FROM: [f64; 4] = [0.125, 0.375, 0.625, 0.875];

/// The own tour.
#[derive(Debug, Clone, Copy)]
struct OwnTour<'t> {
    /// The tasks in their order.
    tasks: &'t [usize],
    /// By task, the time from where this agent is, seconds.
    first_s: &'t [f64],
    /// Duration from task to task, seconds.
    between_s: &'t [Vec<f64>],
}

/// A place to meet another agent.
#[derive(Debug, Clone, Copy)]
struct Meeting<'m> {
    /// When both are there, seconds from now.
    time_s: f64,
    /// By task, the time from there, seconds.
    after_s: &'m [f64],
    /// By task, the probability that the other agent has seen it without the knowledge of this one.
    seen: &'m [f64],
    /// The probability that the other agent is there.
    chance: f64,
}

impl OwnTour<'_> {
    /// How much sooner the own tour is expected to end with a meeting, seconds; negative if later.
    fn saved_s(&self, meeting: &Meeting<'_>) -> f64 {
        let after = |seen_from: f64| {
            let left = self.tasks.iter().copied().filter(|&task| meeting.seen[task] <= seen_from);
            meeting.time_s + self.duration_s(meeting.after_s, left)
        };
        let met_s = SEEN_FROM.map(after).iter().sum::<f64>() / SEEN_FROM.len() as f64;
        let end_s = meeting.chance * met_s + (1.0 - meeting.chance) * after(1.0);
        self.duration_s(self.first_s, self.tasks.iter().copied()) - end_s
    }

    fn duration_s(&self, first_s: &[f64], tasks: impl Iterator<Item = usize>) -> f64 {
        timed(tasks, first_s, self.between_s).last().map_or(0.0, |(_, time_s)| time_s)
    }
}

impl Team {
    /// Which of the agents sought it pays most to meet before the rest of the own tour, and where.
    pub(super) fn meeting(
        &mut self,
        valued: &[Valued],
        tours: &Tours,
        is_sought: &dyn Fn(AgentId) -> bool,
        world: &World<'_>,
    ) -> Option<(AgentId, Cell)> {
        let TeamParams { leg_s, meeting_chance, meeting_decay_s, .. } = self.params;
        let own_tour = OwnTour { tasks: &tours.of_own, first_s: &tours.own_s, between_s: &tours.between_s };
        let mut best: Option<(f64, AgentId, Cell)> = None;
        for (number, (agent, sighting)) in self.sightings.iter().enumerate().filter(|(_, (agent, _))| is_sought(*agent))
        {
            let chance_seen =
                |valued: &Valued| sighting.chance_seen(valued.prospect(), valued.arrivals_s[number], world.now);
            let seen: Vec<f64> = valued.iter().map(chance_seen).collect();
            let out_s = seconds(world.now) - sighting.known_s;
            let chance = meeting_chance * libm::exp(-out_s / meeting_decay_s);
            let arrivals_s = arrivals_s(valued, number);
            let (cell, saved_s) = match soonest(tours.of(number), &arrivals_s, &tours.between_s, &tours.own_s) {
                Some((task, time_s)) => {
                    let meeting = Meeting { time_s, after_s: &tours.between_s[task], seen: &seen, chance };
                    (valued[task].task.cell, own_tour.saved_s(&meeting))
                }
                None => {
                    let Some(here) = world.graph.region_of(world.here) else { continue };
                    let regions = valued.iter().map(|valued| valued.task.region);
                    self.lengths.begin(world.graph, sighting.cell, regions.chain([here]));
                    let leg = |to| world.leg_s(self.lengths.to(world.graph, to), world.speed_m_s, leg_s);
                    let time_s = leg(here).max(sighting.free_s - seconds(world.now));
                    let after_s: Vec<f64> = valued.iter().map(|valued| leg(valued.task.region)).collect();
                    let meeting = Meeting { time_s, after_s: &after_s, seen: &seen, chance };
                    (sighting.cell, own_tour.saved_s(&meeting))
                }
            };
            if cell != world.here && saved_s > best.map_or(0.0, |(most_s, ..)| most_s) {
                best = Some((saved_s, agent, cell));
            }
        }
        best.map(|(_, agent, cell)| (agent, cell))
    }
}

/// Where on its tour another agent can be met soonest: the task, and when. By task, it can be there
/// at `arrivals_s` from where it is, and this agent at `own_s`; all in seconds from now.
fn soonest(tour: &[usize], arrivals_s: &[f64], between_s: &[Vec<f64>], own_s: &[f64]) -> Option<(usize, f64)> {
    let timed = timed(tour.iter().copied(), arrivals_s, between_s);
    timed.filter(|&(task, time_s)| own_s[task] <= time_s).min_by(|a, b| a.1.total_cmp(&b.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places on a line, at 1 m/s.
    fn from(place: f64, to: &[f64]) -> Vec<f64> {
        to.iter().map(|other| (other - place).abs()).collect()
    }

    /// What a meeting at 10 m and 10 s saves an agent at 0 m with tasks at 20 and 100 m.
    fn saved_s(seen: [f64; 2], chance: f64) -> f64 {
        let tasks = [20.0, 100.0];
        let (first_s, after_s) = (from(0.0, &tasks), from(10.0, &tasks));
        let between_s = tasks.map(|task| from(task, &tasks));
        let own_tour = OwnTour { tasks: &[0, 1], first_s: &first_s, between_s: &between_s };
        own_tour.saved_s(&Meeting { time_s: 10.0, after_s: &after_s, seen: &seen, chance })
    }

    #[test]
    fn a_meeting_saves_the_ways_to_what_the_other_one_has_seen() {
        assert_eq!(saved_s([0.0, 0.0], 1.0), 0.0, "on the way, and without news");
        assert_eq!(saved_s([0.0, 1.0], 1.0), 80.0, "nothing is left beyond the first task");
        assert_eq!(saved_s([0.0, 1.0], 0.5), 40.0, "it may not be there");
        assert_eq!(saved_s([0.0, 0.5], 1.0), 40.0, "in two of four cases");
        assert_eq!(saved_s([1.0, 0.0], 1.0), 0.0, "the first task is on the way to the second");
    }

    #[test]
    fn an_agent_is_met_where_it_will_be_and_not_where_it_was() {
        let tasks = [30.0, 20.0, 10.0];
        let between_s: Vec<Vec<f64>> = tasks.iter().map(|&task| from(task, &tasks)).collect();
        let soonest = |own: f64| soonest(&[0, 1, 2], &from(40.0, &tasks), &between_s, &from(own, &tasks));
        assert_eq!(soonest(25.0), Some((0, 10.0)), "it gets there first, and waits");
        assert_eq!(soonest(5.0), Some((1, 20.0)));
        assert_eq!(soonest(-100.0), None, "it comes too late everywhere");
    }
}
