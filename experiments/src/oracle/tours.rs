//! Tours: places shared out over a team so that the last agent is ready as soon as possible.
//!
//! This is the min-max open vehicle routing problem with several depots, which is NP-hard. The
//! heuristic inserts each place where it costs least, farthest places first, and then improves
//! while it can: 2-opt within tours, and moves of single places and of tails between tours. Every
//! step lowers the pair (longest tour, sum of all tours), so it ends.
//!
//! Pure: costs in, tours out. Ties go to the lower index, so the result is a function of the costs.

/// Costs between places, in any unit; symmetric. The first `agents` places are the starts.
#[derive(Debug, Clone)]
pub(super) struct Costs {
    pub(super) agents: usize,
    /// By place and place.
    pub(super) between: Vec<Vec<u64>>,
}

/// Rounds of improvement; most instances need fewer.
const ROUNDS_MAX: usize = 200;

impl Costs {
    /// The length of a tour that begins at a place.
    pub(super) fn length(&self, agent: usize, tour: &[usize]) -> u64 {
        let mut at = agent;
        let mut length = 0;
        for &place in tour {
            length += self.between[at][place];
            at = place;
        }
        length
    }

    /// What a place adds to a tour, at each position the least, with that position.
    fn insertion(&self, agent: usize, tour: &[usize], place: usize) -> (u64, usize) {
        let mut best = (u64::MAX, 0);
        for position in 0..=tour.len() {
            let before = if position == 0 { agent } else { tour[position - 1] };
            let direct = tour.get(position).map_or(0, |&next| self.between[before][next]);
            let onwards = tour.get(position).map_or(0, |&next| self.between[place][next]);
            let added = (self.between[before][place] + onwards).saturating_sub(direct);
            best = best.min((added, position));
        }
        best
    }
}

/// The tours by agent, without their starts.
pub(super) fn share(costs: &Costs) -> Vec<Vec<usize>> {
    let agents = costs.agents;
    let mut tours = vec![Vec::new(); agents];
    let mut lengths = vec![0_u64; agents];
    let nearest_start = |place: usize| (0..agents).map(|agent| costs.between[agent][place]).min().unwrap_or(0);
    let mut places: Vec<usize> = (agents..costs.between.len()).collect();
    places.sort_by_key(|&place| (std::cmp::Reverse(nearest_start(place)), place));
    for place in places {
        let options = (0..agents).map(|agent| {
            let (added, position) = costs.insertion(agent, &tours[agent], place);
            (lengths[agent] + added, added, agent, position)
        });
        if let Some((length, _, agent, position)) = options.min() {
            tours[agent].insert(position, place);
            lengths[agent] = length;
        }
    }
    improve(costs, &mut tours);
    tours
}

fn improve(costs: &Costs, tours: &mut [Vec<usize>]) {
    let mut lengths: Vec<u64> = (0..).zip(&*tours).map(|(agent, tour)| costs.length(agent, tour)).collect();
    for _ in 0..ROUNDS_MAX {
        let mut is_better = false;
        for agent in 0..tours.len() {
            is_better |= shorten(costs, agent, &mut tours[agent], &mut lengths[agent]);
        }
        is_better |= relieve(costs, tours, &mut lengths);
        if !is_better {
            break;
        }
    }
}

/// 2-opt and Or-opt of single places within a tour, until neither helps.
fn shorten(costs: &Costs, agent: usize, tour: &mut Vec<usize>, length: &mut u64) -> bool {
    let before_all = *length;
    loop {
        let before = *length;
        for first in 0..tour.len() {
            for last in first + 1..tour.len() {
                let from = if first == 0 { agent } else { tour[first - 1] };
                let onwards = |end: usize| tour.get(last + 1).map_or(0, |&next| costs.between[end][next]);
                let old = costs.between[from][tour[first]] + onwards(tour[last]);
                let new = costs.between[from][tour[last]] + onwards(tour[first]);
                if new < old {
                    tour[first..=last].reverse();
                    *length -= old - new;
                }
            }
        }
        for position in 0..tour.len() {
            let place = tour.remove(position);
            let without = costs.length(agent, tour);
            let (added, best) = costs.insertion(agent, tour, place);
            let is_shorter = without + added < *length;
            tour.insert(if is_shorter { best } else { position }, place);
            *length = (*length).min(without + added);
        }
        if *length == before {
            return before < before_all;
        }
    }
}

/// Moves one place, or the tail, of the longest tour to another one, if the longer of the two gets
/// shorter.
fn relieve(costs: &Costs, tours: &mut [Vec<usize>], lengths: &mut [u64]) -> bool {
    let Some(longest) = (0..tours.len()).max_by_key(|&agent| (lengths[agent], std::cmp::Reverse(agent))) else {
        return false;
    };
    // (longer of the two, sum of the two, other, what is moved, where to)
    let mut best: Option<(u64, u64, usize, std::ops::Range<usize>, usize)> = None;
    for other in (0..tours.len()).filter(|&other| other != longest) {
        let mut consider = |moved: std::ops::Range<usize>, rest: u64, theirs: u64, position: usize| {
            let option = (rest.max(theirs), rest + theirs, other, moved, position);
            let is_improvement = option.0 < lengths[longest];
            if is_improvement && best.as_ref().is_none_or(|known| (option.0, option.1) < (known.0, known.1)) {
                best = Some(option);
            }
        };
        for position in 0..tours[longest].len() {
            let place = tours[longest][position];
            let mut rest = tours[longest].clone();
            rest.remove(position);
            let (added, at) = costs.insertion(other, &tours[other], place);
            consider(position..position + 1, costs.length(longest, &rest), lengths[other] + added, at);
            let tail = [&tours[other][..], &tours[longest][position..]].concat();
            let rest = costs.length(longest, &tours[longest][..position]);
            consider(position..tours[longest].len(), rest, costs.length(other, &tail), tours[other].len());
        }
    }
    let Some((.., other, moved, position)) = best else { return false };
    let places: Vec<usize> = tours[longest].drain(moved).collect();
    tours[other].splice(position..position, places);
    for agent in [longest, other] {
        lengths[agent] = costs.length(agent, &tours[agent]);
    }
    true
}

/// The part of the rest of a tour, from `position` on, that an idle agent takes over so that both
/// are ready sooner; it may visit it backwards. `idle_at` and `busy_at` are places; `head` is what
/// the busy agent still needs to `busy_at`.
pub(super) fn take_over(
    costs: &Costs,
    idle_at: usize,
    (busy_at, head): (usize, u64),
    rest: &[usize],
) -> Option<(usize, bool)> {
    let mut best: Option<(u64, usize, bool)> = None;
    let whole = head + costs.length(busy_at, rest);
    for position in 0..rest.len() {
        let kept = head + costs.length(busy_at, &rest[..position]);
        for is_reversed in [false, true] {
            let mut taken = rest[position..].to_vec();
            if is_reversed {
                taken.reverse();
            }
            let later = kept.max(costs.length(idle_at, &taken));
            if later < whole && best.is_none_or(|known| (later, position, is_reversed) < known) {
                best = Some((later, position, is_reversed));
            }
        }
    }
    best.map(|(_, position, is_reversed)| (position, is_reversed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    /// Costs between points on a line; the first ones are the starts.
    fn on_a_line(agents: usize, points: &[u64]) -> Costs {
        let between = points.iter().map(|&one| points.iter().map(|&other| one.abs_diff(other)).collect()).collect();
        Costs { agents, between }
    }

    fn longest(costs: &Costs, tours: &[Vec<usize>]) -> u64 {
        (0..).zip(tours).map(|(agent, tour)| costs.length(agent, tour)).max().unwrap()
    }

    /// The least longest tour, by trying everything.
    fn optimum(costs: &Costs) -> u64 {
        fn go(costs: &Costs, tours: &mut Vec<Vec<usize>>, left: &mut Vec<usize>) -> u64 {
            let Some(place) = left.pop() else { return longest(costs, tours) };
            let mut best = u64::MAX;
            for agent in 0..costs.agents {
                for position in 0..=tours[agent].len() {
                    tours[agent].insert(position, place);
                    best = best.min(go(costs, tours, left));
                    tours[agent].remove(position);
                }
            }
            left.push(place);
            best
        }
        let mut left = (costs.agents..costs.between.len()).collect();
        go(costs, &mut vec![Vec::new(); costs.agents], &mut left)
    }

    #[test]
    fn two_agents_share_a_line() {
        let costs = on_a_line(2, &[50, 51, 0, 10, 20, 80, 90, 100]);
        let tours = share(&costs);
        assert_eq!(tours, [vec![4, 3, 2], vec![5, 6, 7]]);
    }

    #[test]
    fn idle_agent_takes_the_far_end() {
        let costs = on_a_line(1, &[0, 10, 20, 30, 40]);
        // Busy at 0, idle at 40: it takes the second half, and comes backwards.
        assert_eq!(take_over(&costs, 4, (0, 0), &[1, 2, 3]), Some((1, true)));
        assert_eq!(take_over(&costs, 4, (0, 0), &[1]), None, "too far away to help");
    }

    #[test]
    fn tours_visit_all_places_and_are_near_the_optimum() {
        let (mut found, mut best) = (0, 0);
        for instance in 0..200 {
            let mut random = voxels::random_streams::stream(instance, 0, "tours");
            let mut draw = |range| random.random_range::<u64, std::ops::Range<u64>>(range);
            let agents = draw(1..4) as usize;
            let points: Vec<(u64, u64)> =
                (0..agents as u64 + draw(1..6)).map(|_| (draw(0..100), draw(0..100))).collect();
            let apart = |a: &(u64, u64), b: &(u64, u64)| a.0.abs_diff(b.0) + a.1.abs_diff(b.1);
            let between = points.iter().map(|a| points.iter().map(|b| apart(a, b)).collect()).collect();
            let costs = Costs { agents, between };
            let tours = share(&costs);
            let mut visited: Vec<usize> = tours.concat();
            visited.sort_unstable();
            assert_eq!(visited, (agents..points.len()).collect::<Vec<_>>());
            assert!(longest(&costs, &tours) >= optimum(&costs));
            (found, best) = (found + longest(&costs, &tours), best + optimum(&costs));
        }
        assert!(found * 100 <= best * 110, "{found} in all, against {best}");
    }
}
