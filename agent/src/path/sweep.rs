//! Swept volume of a sphere: the cells it touches while it moves. All lengths are in cells: the
//! edge of a cell is 1.
//!
//! A cell is touched if the centre comes nearer to its cube than the radius. The distance from a
//! point to a cube, squared, is convex and piecewise quadratic along a leg, which makes the test
//! exact.

use voxels::{BodyLattice, Cell};

/// Added to the radius of a body, cells, so that rounding errors of its motion never cause a
/// collision.
const MARGIN: f64 = 1e-6;

/// Coordinates this near to a multiple of a half are rounded to it, cells.
const SNAP: f64 = 1e-9;

/// Bodies with a larger radius, cells, fit nowhere: the tables of their moves would grow without
/// bound.
const RADIUS_MAX: f64 = 16.0;

/// The clearance in cells for a body with this radius in metres, or `None` for a body that fits
/// nowhere.
///
/// It includes a margin, but not beyond the next radius at which a sphere at the place of a cell
/// ([`BodyLattice`]) touches the faces of further cells: a body that fits between walls exactly
/// still does.
pub(super) fn clearance(radius_m: f64, cell_m: f64) -> Option<f64> {
    let radius = (radius_m / cell_m).max(0.0);
    if !(radius_m >= 0.0 && radius <= RADIUS_MAX) {
        return None;
    }
    let offset = BodyLattice::of(radius_m, cell_m).offset_cells();
    let to_faces = (radius - offset - SNAP).ceil() + offset;
    Some((radius + MARGIN).min(to_faces))
}

/// The place of a cell.
pub(super) fn place(lattice: BodyLattice, cell: Cell) -> [f64; 3] {
    [cell.x, cell.y, cell.z].map(|along| f64::from(along) + lattice.offset_cells())
}

/// A point in metres, converted to cells; coordinates of faces and centres are snapped.
pub(super) fn in_cells(point: [f64; 3], cell_m: f64) -> [f64; 3] {
    point.map(|metres| {
        let cells = metres / cell_m;
        let halves = (2.0 * cells).round() / 2.0;
        if (cells - halves).abs() < SNAP { halves } else { cells }
    })
}

/// Visits the rows of cells along x near a sphere that moves straight between two points, until
/// `visit` returns true: y, z, and the first and the last x. All cells that are touched are among
/// them; returns whether one of the rows ended it.
pub(super) fn rows(
    from: [f64; 3],
    to: [f64; 3],
    radius: f64,
    mut visit: impl FnMut((i32, i32), (i32, i32)) -> bool,
) -> bool {
    let by = [0, 1, 2].map(|axis| to[axis] - from[axis]);
    let reach = radius + SNAP;
    let at = |axis: usize, time: f64| from[axis] + by[axis] * time;
    let near = |axis: usize, layer: i32| {
        within(from[axis], by[axis], f64::from(layer) - reach, f64::from(layer) + 1.0 + reach)
    };
    let (low_z, high_z) = range(from[2], to[2], reach);
    for z in low_z..=high_z {
        let (enter_z, leave_z) = near(2, z);
        let (low_y, high_y) = range(at(1, enter_z), at(1, leave_z), reach);
        for y in low_y..=high_y {
            let (enter_y, leave_y) = near(1, y);
            let (enter, leave) = (enter_z.max(enter_y), leave_z.min(leave_y));
            if enter <= leave && visit((y, z), range(at(0, enter), at(0, leave), reach)) {
                return true;
            }
        }
    }
    false
}

/// A box of cells: the lowest corner of its first one and the highest of its last one.
#[derive(Debug, Clone, Copy)]
struct Box3 {
    low: [f64; 3],
    high: [f64; 3],
}

impl Box3 {
    fn of_cell(cell: Cell) -> Self {
        let low = [cell.x, cell.y, cell.z].map(f64::from);
        Self { low, high: low.map(|along| along + 1.0) }
    }
}

/// Whether a moving sphere touches one of the cells of a row from `low_x` to `high_x`: a box.
pub(super) fn touches_run(
    from: [f64; 3],
    to: [f64; 3],
    radius: f64,
    (y, z): (i32, i32),
    low_x: i32,
    high_x: i32,
) -> bool {
    let by = [0, 1, 2].map(|axis| to[axis] - from[axis]);
    let [low, high] = [Cell::new(low_x, y, z), Cell::new(high_x, y, z)].map(Box3::of_cell);
    is_nearer(from, by, &Box3 { low: low.low, high: high.high }, radius * radius)
}

/// The cells touched by the moving sphere, in cell order.
pub(super) fn touched(from: [f64; 3], to: [f64; 3], radius: f64) -> Vec<Cell> {
    let by = [0, 1, 2].map(|axis| to[axis] - from[axis]);
    let mut cells = Vec::new();
    rows(from, to, radius, |(y, z), (low_x, high_x)| {
        let row = (low_x..=high_x).map(|x| Cell::new(x, y, z));
        cells.extend(row.filter(|&cell| is_nearer(from, by, &Box3::of_cell(cell), radius * radius)));
        false
    });
    cells.sort_unstable();
    cells
}

/// Squared distances that differ by less are told apart by the exact test alone, cells squared.
const CLOSE: f64 = 1e-9;

/// Steps towards the nearest point of a leg before the exact test.
const STEPS_MAX: usize = 6;

/// Whether a point that moves from `from` by `by` comes nearer to a box than this distance,
/// squared.
///
/// The squared distance is convex along the leg: Newton's method bounds it from above and below in
/// two or three steps, which mostly decide.
fn is_nearer(from: [f64; 3], by: [f64; 3], target: &Box3, limit: f64) -> bool {
    let [mut along, mut length] = [0.0, 0.0];
    for axis in 0..3 {
        along += (0.5 * (target.low[axis] + target.high[axis]) - from[axis]) * by[axis];
        length += by[axis] * by[axis];
    }
    let mut time = if length > 0.0 { (along / length).clamp(0.0, 1.0) } else { 0.0 };
    let (mut earliest, mut latest) = (0.0, 1.0);
    for _ in 0..STEPS_MAX {
        let (mut distance, mut slope, mut curvature) = (0.0, 0.0, 0.0);
        for axis in 0..3 {
            let at = from[axis] + by[axis] * time;
            let apart = (at - target.low[axis]).min(0.0) + (at - target.high[axis]).max(0.0);
            distance += apart * apart;
            slope += apart * by[axis];
            curvature += if apart == 0.0 { 0.0 } else { by[axis] * by[axis] };
        }
        if distance < limit - CLOSE {
            return true;
        }
        // How much nearer it can still get, as the distance is above its tangent.
        let left = if slope > 0.0 { time - earliest } else { latest - time };
        if distance - 2.0 * slope.abs() * left > limit + CLOSE {
            return false;
        }
        if slope > 0.0 {
            latest = time;
        } else {
            earliest = time;
        }
        let next = if curvature > 0.0 { time - slope / curvature } else { time };
        time = next.clamp(earliest, latest);
    }
    distance_squared(from, by, target) < limit
}

/// The cells, along one axis, that come within `reach` of an interval.
fn range(a: f64, b: f64, reach: f64) -> (i32, i32) {
    (floor(a.min(b) - reach), floor(a.max(b) + reach))
}

/// The greatest whole number that is not above a coordinate; without a call of a function.
fn floor(along: f64) -> i32 {
    let truncated = along as i32;
    truncated - i32::from(f64::from(truncated) > along)
}

/// The times between 0 and 1 at which a coordinate is between two values.
fn within(from: f64, by: f64, low: f64, high: f64) -> (f64, f64) {
    if by == 0.0 {
        return (0.0, 1.0);
    }
    let (a, b) = ((low - from) / by, (high - from) / by);
    (a.min(b).clamp(0.0, 1.0), a.max(b).clamp(0.0, 1.0))
}

/// The least distance, squared, between a point that moves from `from` by `by` and a box.
fn distance_squared(from: [f64; 3], by: [f64; 3], Box3 { low, high }: &Box3) -> f64 {
    let offset = |axis: usize, time: f64| {
        let at = from[axis] + by[axis] * time;
        (at - low[axis]).min(0.0) + (at - high[axis]).max(0.0)
    };
    let at = |time: f64| (0..3).map(|axis| offset(axis, time)).map(|apart| apart * apart).sum::<f64>();
    // Between the times at which the point passes the plane of a face, the distance is quadratic.
    let mut times = [0.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
    for (slot, time) in times[1..].iter_mut().enumerate().take(6) {
        let axis = slot / 2;
        let plane = if slot % 2 == 0 { low[axis] } else { high[axis] };
        let crossing = (plane - from[axis]) / by[axis];
        if crossing > 0.0 && crossing < 1.0 {
            *time = crossing;
        }
    }
    times.sort_unstable_by(f64::total_cmp);
    let mut least = at(0.0).min(at(1.0));
    for window in times.windows(2) {
        let middle = 0.5 * (window[0] + window[1]);
        let (mut slope, mut curvature) = (0.0, 0.0);
        for (axis, along) in by.into_iter().enumerate() {
            let apart = offset(axis, middle);
            if apart != 0.0 {
                slope += apart * along;
                curvature += along * along;
            }
        }
        let time = if curvature > 0.0 { middle - slope / curvature } else { middle };
        least = least.min(at(time.clamp(window[0], window[1])));
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The centre of a cell.
    fn centre(cell: Cell) -> [f64; 3] {
        place(BodyLattice::Centres, cell)
    }

    #[test]
    fn small_bodies_touch_the_cells_of_a_step() {
        let home = centre(Cell::default());
        let passed = |to: Cell, radius_m: f64| touched(home, centre(to), clearance(radius_m, 1.0).unwrap());
        for radius_m in [0.0, 0.4, 0.5] {
            assert_eq!(passed(Cell::default(), radius_m), [Cell::default()]);
            assert_eq!(passed(Cell::new(0, 1, 0), radius_m), [Cell::default(), Cell::new(0, 1, 0)]);
            let square = [Cell::new(-1, 0, 0), Cell::default(), Cell::new(-1, 0, 1), Cell::new(0, 0, 1)];
            assert_eq!(passed(Cell::new(-1, 0, 1), radius_m), square);
            assert_eq!(passed(Cell::new(1, -1, 1), radius_m).len(), 8);
        }
    }

    #[test]
    fn larger_bodies_touch_more() {
        let home = centre(Cell::default());
        let count = |radius_m: f64| touched(home, home, clearance(radius_m, 1.0).unwrap()).len();
        assert_eq!(count(0.6), 7);
        assert_eq!(count(0.71), 19);
        assert_eq!(count(0.87), 27);
        assert_eq!(count(1.5), 27);
        assert_eq!(count(1.51), 33);
    }

    #[test]
    fn exact_fit_holds_at_any_cell_size() {
        for cell_m in [0.1, 0.3, 0.7, 1.0, 2.3] {
            assert_eq!(clearance(cell_m * 0.5, cell_m), Some(0.5));
            assert_eq!(clearance(cell_m * 1.5, cell_m), Some(1.5));
            assert!(clearance(cell_m * 0.501, cell_m).unwrap() > 0.501);
            for cells in [1.0, 2.0, 3.0] {
                let radius = clearance(cell_m * cells, cell_m).unwrap();
                let corner = place(BodyLattice::Corners, Cell::default());
                let reach = touched(corner, corner, radius).iter().map(|cell| cell.x).min();
                assert_eq!(reach, Some(-(cells as i32)), "{cell_m} m");
            }
        }
    }

    #[test]
    fn oversized_bodies_fit_nowhere() {
        for radius_m in [f64::NAN, f64::INFINITY, -1.0, 17.0] {
            assert_eq!(clearance(radius_m, 1.0), None);
        }
        assert!(clearance(16.0, 1.0).is_some());
    }

    fn sampled(from: [f64; 3], to: [f64; 3], cell: Cell) -> f64 {
        let low = [cell.x, cell.y, cell.z].map(f64::from);
        let at = |time: f64| {
            let apart = |axis: usize| {
                let here = from[axis] + (to[axis] - from[axis]) * time;
                here - here.clamp(low[axis], low[axis] + 1.0)
            };
            (0..3).map(|axis| apart(axis) * apart(axis)).sum::<f64>()
        };
        (0..=1000).map(|i| at(f64::from(i) / 1000.0)).fold(f64::INFINITY, f64::min)
    }

    proptest! {
        #[test]
        fn distance_is_the_minimum_along_the_leg(
            from in prop::array::uniform3(-3.0..3.0), to in prop::array::uniform3(-3.0..3.0),
        ) {
            let by = [0, 1, 2].map(|axis| to[axis] - from[axis]);
            let (exact, sampled) = (distance_squared(from, by, &Box3::of_cell(Cell::default())), sampled(from, to, Cell::default()));
            prop_assert!(exact <= sampled + 1e-12);
            prop_assert!(sampled.sqrt() <= exact.sqrt() + 0.006, "{exact} {sampled}");
        }

        #[test]
        fn swept_cells_are_complete(
            from in prop::array::uniform3(-3.0..3.0), to in prop::array::uniform3(-3.0..3.0), radius in 0.1..2.0,
        ) {
            let by = [0, 1, 2].map(|axis| to[axis] - from[axis]);
            let mut all = Vec::new();
            for z in -6..6 {
                for y in -6..6 {
                    for x in -6..6 {
                        if distance_squared(from, by, &Box3::of_cell(Cell::new(x, y, z))) < radius * radius {
                            all.push(Cell::new(x, y, z));
                        }
                    }
                }
            }
            prop_assert_eq!(touched(from, to, radius), all);
        }
    }
}
