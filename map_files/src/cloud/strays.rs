//! Stray points: a few that lie farther from all others than these from each other.

/// Most points, as a share of all, that can be strays.
const STRAYS_SHARE: f64 = 0.005;

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
    /// The strays among finite points in lengths of cells; `None` if there are none.
    pub(super) fn of(points: impl Iterator<Item = [f64; 3]> + Clone) -> Option<Self> {
        let total = points.clone().count();
        let most = (total as f64 * STRAYS_SHARE) as usize;
        if most == 0 {
            return None;
        }
        let (mut low, mut high) = ([f64::NEG_INFINITY; 3], [f64::INFINITY; 3]);
        for axis in 0..3 {
            let mut along: Vec<f64> = points.clone().map(|point| point[axis]).collect();
            along.sort_unstable_by(f64::total_cmp);
            // Most points lie between these; from there outwards, a gap longer than all of that
            // has strays behind it.
            let (mut first, mut last) = (most, total - 1 - most);
            let span = (along[last] - along[first]).max(1.0);
            while first > 0 && along[first] - along[first - 1] <= span {
                first -= 1;
            }
            while last + 1 < total && along[last + 1] - along[last] <= span {
                last += 1;
            }
            if first > 0 {
                low[axis] = along[first];
            }
            if last + 1 < total {
                high[axis] = along[last];
            }
        }
        let mut strays = Self { low, high, first: [0.0; 3], count: 0 };
        let mut outside = points.filter(|&point| !strays.holds(point));
        let first = outside.next()?;
        let count = 1 + outside.count();
        (strays.first, strays.count) = (first, count);
        (count <= most).then_some(strays)
    }

    /// Whether a point is none of them.
    pub(super) fn holds(&self, point: [f64; 3]) -> bool {
        (0..3).all(|axis| (self.low[axis]..=self.high[axis]).contains(&point[axis]))
    }
}
