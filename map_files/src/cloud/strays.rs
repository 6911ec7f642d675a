//! Stray points: a few that lie farther from all others than these from each other.

/// Most points, as a share of all, that can be strays.
const STRAYS_SHARE: f64 = 0.005;

/// Most strays of a small cloud, in which they are a larger share, and how many points it has for
/// each of them at least.
const SMALL_CLOUD_STRAYS_MAX: usize = 3;
const SMALL_CLOUD_POINTS_PER_STRAY: usize = 16;

/// How many times farther such a larger share lies from the others than these from each other.
const SMALL_CLOUD_GAP_FACTOR: f64 = 8.0;

/// A few points that lie farther from the others than these from each other, along some axis.
pub(super) struct Strays {
    /// What the others span, in lengths of cells.
    low: [f64; 3],
    high: [f64; 3],
    /// The first of them.
    pub(super) first: [f64; 3],
    pub(super) count: usize,
}

impl Strays {
    /// The strays among at most `total_max` finite points in lengths of cells; `None` if there are
    /// none. `points` makes a pass over them.
    pub(super) fn of<P: Iterator<Item = [f64; 3]>>(total_max: usize, points: impl Fn() -> P) -> Option<Self> {
        let kept = most_of(total_max) + 1;
        if kept == 1 {
            return None;
        }
        let mut ends: [Ends; 3] = std::array::from_fn(|_| Ends::new(kept));
        let mut total = 0;
        points().for_each(|point| {
            total += 1;
            for (ends, along) in ends.iter_mut().zip(point) {
                ends.add(along);
            }
        });
        let most = most_of(total);
        if most == 0 {
            return None;
        }
        let gap = |outside: usize| if outside > share(total) { SMALL_CLOUD_GAP_FACTOR } else { 1.0 };
        let (mut low, mut high) = ([f64::NEG_INFINITY; 3], [f64::INFINITY; 3]);
        for (axis, ends) in ends.into_iter().enumerate() {
            // The lowest coordinates, and the highest ones from the last one on.
            let (lowest, highest) = ends.sorted(most + 1);
            // Most points lie between these; from there outwards, a gap longer than all of that,
            // or several times as long, has strays behind it.
            let (mut first, mut last) = (most, most);
            let span = (highest[last] - lowest[first]).max(1.0);
            while first > 0 && lowest[first] - lowest[first - 1] <= gap(first) * span {
                first -= 1;
            }
            while last > 0 && highest[last - 1] - highest[last] <= gap(last) * span {
                last -= 1;
            }
            if first > 0 {
                low[axis] = lowest[first];
            }
            if last > 0 {
                high[axis] = highest[last];
            }
        }
        if low == [f64::NEG_INFINITY; 3] && high == [f64::INFINITY; 3] {
            return None;
        }
        let mut strays = Self { low, high, first: [0.0; 3], count: 0 };
        let (mut first, mut count) = (None, 0);
        points().for_each(|point| {
            if !strays.holds(point) {
                first.get_or_insert(point);
                count += 1;
            }
        });
        (strays.first, strays.count) = (first?, count);
        (count <= most).then_some(strays)
    }

    /// Whether a point is none of them.
    pub(super) fn holds(&self, point: [f64; 3]) -> bool {
        (0..3).all(|axis| (self.low[axis]..=self.high[axis]).contains(&point[axis]))
    }
}

/// Most strays among so many points.
fn most_of(total: usize) -> usize {
    share(total).max(SMALL_CLOUD_STRAYS_MAX.min(total / SMALL_CLOUD_POINTS_PER_STRAY))
}

/// Most strays among so many points that need not lie [`SMALL_CLOUD_GAP_FACTOR`] away.
fn share(total: usize) -> usize {
    (total as f64 * STRAYS_SHARE) as usize
}

/// The lowest and the highest of many numbers.
struct Ends {
    lowest: Least,
    /// With the other sign.
    highest: Least,
}

impl Ends {
    fn new(kept: usize) -> Self {
        Self { lowest: Least::new(kept), highest: Least::new(kept) }
    }

    fn add(&mut self, along: f64) {
        self.lowest.add(along);
        self.highest.add(-along);
    }

    /// The `count` lowest numbers from the lowest on, and the highest ones from the highest on.
    fn sorted(self, count: usize) -> (Vec<f64>, Vec<f64>) {
        let highest = self.highest.sorted(count);
        (self.lowest.sorted(count), highest.into_iter().map(|along| -along).collect())
    }
}

/// The least of many numbers.
struct Least {
    kept: usize,
    /// The least so far, and some more.
    numbers: Vec<f64>,
    /// Greater ones are none of the least.
    bound: f64,
}

impl Least {
    fn new(kept: usize) -> Self {
        Self { kept, numbers: Vec::new(), bound: f64::INFINITY }
    }

    fn add(&mut self, number: f64) {
        if number >= self.bound {
            return;
        }
        self.numbers.push(number);
        if self.numbers.len() >= 2 * self.kept {
            let (_, bound, _) = self.numbers.select_nth_unstable_by(self.kept - 1, f64::total_cmp);
            self.bound = *bound;
            self.numbers.truncate(self.kept);
        }
    }

    fn sorted(mut self, count: usize) -> Vec<f64> {
        self.numbers.sort_unstable_by(f64::total_cmp);
        self.numbers.truncate(count);
        self.numbers
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_are_kept() {
        let numbers = || (0..1000).map(|number| f64::from(number * 7919 % 1000));
        let mut least = Least::new(5);
        numbers().for_each(|number| least.add(number));
        assert_eq!(least.sorted(5), [0.0, 1.0, 2.0, 3.0, 4.0]);
        let mut ends = Ends::new(3);
        numbers().for_each(|number| ends.add(number));
        assert_eq!(ends.sorted(2), (vec![0.0, 1.0], vec![999.0, 998.0]));
    }

    #[test]
    fn a_few_points_far_away_are_strays() {
        let points = |strays: usize| {
            move || {
                let inside = (0..1000).map(|number| [f64::from(number % 10), f64::from(number / 10 % 10), 0.5]);
                inside.chain((0..strays).map(|number| [500.0 + number as f64, 5.0, 0.5]))
            }
        };
        let strays = Strays::of(1005, points(5)).unwrap();
        assert_eq!((strays.first, strays.count), ([500.0, 5.0, 0.5], 5));
        assert!(strays.holds([9.0, 9.0, 0.5]) && !strays.holds([500.0, 5.0, 0.5]));
        // Of some points nothing is known before they are counted.
        assert_eq!(Strays::of(4000, points(5)).unwrap().count, 5);
        assert!(Strays::of(1020, points(20)).is_none(), "too many for strays");
        assert!(Strays::of(1000, points(0)).is_none());
    }

    #[test]
    fn a_point_very_far_from_a_small_cloud_is_a_stray() {
        let points = |count: usize, strays: &'static [f64]| {
            move || {
                let inside = (0..count).map(|number| [(number % 10) as f64, (number / 10) as f64, 0.5]);
                inside.chain(strays.iter().map(|&along| [4.0, 3.0, along]))
            }
        };
        let count = |inside: usize, strays: &'static [f64]| {
            Strays::of(inside + strays.len(), points(inside, strays)).map_or(0, |strays| strays.count)
        };
        assert_eq!(count(40, &[-900.0]), 1);
        assert_eq!(count(40, &[-900.0, 5000.0]), 2);
        assert_eq!(count(620, &[100.0; 3]), 3);
        assert_eq!(count(40, &[5.0]), 0, "some cells above the others");
        assert_eq!(count(40, &[100.0; 3]), 0, "more than one in sixteen");
        assert_eq!(count(12, &[-900.0]), 0, "too few to tell");
    }
}
