//! Ray traversal: which cells a ray or a segment crosses, in order, after Amanatides and Woo
//! ("A Fast Voxel Traversal Algorithm for Ray Tracing", 1987).
//!
//! **Rule.** Everything is computed in cell units (`point / cell_m`) with plain `f64` operations,
//! so the cells are the same on every machine. The ray keeps, per axis, the distance at which it
//! meets the next cell boundary, and steps along the axis where that is smallest; the distance then
//! grows by `1 / |direction|` of that axis. **Ties:** when boundaries are reached at the same
//! distance, the lower axis steps first: x before y before z. Consecutive cells always share a
//! face.
//!
//! A ray that only touches an edge or a corner passes through the cells that this rule names, and
//! no others. The simulated LiDAR follows the same rule with its own loop; a test holds the two
//! equal.

use std::ops::ControlFlow;

use nalgebra::{Point3, Vector3};

use crate::extent::floor;
use crate::{Cell, Extent};

/// The distances along a ray, in cell units, at which it crosses its next cell boundaries.
struct Crossings {
    cell: Cell,
    step: [i32; 3],
    next: [f64; 3],
    delta: [f64; 3],
}

impl Crossings {
    /// `origin` and `direction` in cell units. An axis along which the ray does not move (or whose
    /// component is not a usable number) is never crossed.
    fn new(cell: Cell, origin: [f64; 3], direction: [f64; 3]) -> Self {
        let floor = [cell.x, cell.y, cell.z].map(f64::from);
        let mut step = [1; 3];
        let mut next = [f64::INFINITY; 3];
        let mut delta = [f64::INFINITY; 3];
        for axis in 0..3 {
            let inverse = 1.0 / direction[axis].abs();
            if !(inverse.is_finite() && inverse > 0.0) {
                continue;
            }
            let to_boundary = if direction[axis] < 0.0 {
                step[axis] = -1;
                origin[axis] - floor[axis]
            } else {
                floor[axis] + 1.0 - origin[axis]
            };
            next[axis] = to_boundary * inverse;
            delta[axis] = inverse;
        }
        Self { cell, step, next, delta }
    }

    /// Enters the next cell; returns the axis of the step and the distance at which it was made.
    #[inline(always)]
    fn advance(&mut self) -> (usize, f64) {
        // Constant indices keep the state in registers.
        let [x, y, z] = self.next;
        if x <= y && x <= z {
            self.cell.x += self.step[0];
            self.next[0] += self.delta[0];
            (0, x)
        } else if y <= z {
            self.cell.y += self.step[1];
            self.next[1] += self.delta[1];
            (1, y)
        } else {
            self.cell.z += self.step[2];
            self.next[2] += self.delta[2];
            (2, z)
        }
    }
}

/// Visits the cells that a ray crosses, in order, until `visit` breaks, the ray leaves the map or
/// the next cell begins farther away than `t_max_m`.
///
/// `visit` gets the cell and the distance at which the ray enters it, in metres if `direction` has
/// length 1 and otherwise in multiples of its length; `t_max_m` is in the same unit and may be
/// infinite. The first cell is the origin's own, at 0. Nothing is visited if the origin is outside
/// the map; only the first cell is if the direction is zero. `origin` and `direction` are in the
/// map frame.
///
/// ```
/// use nalgebra::{Point3, Vector3};
/// use std::ops::ControlFlow;
/// use voxels::{Cell, Extent, walk};
/// let extent = Extent::new([3, 1, 1], 1.0)?;
/// let mut crossed = Vec::new();
/// let end = walk(extent, &Point3::new(0.25, 0.5, 0.5), &Vector3::x(), f64::INFINITY, |cell, m| {
///     crossed.push((cell.x, m));
///     ControlFlow::<()>::Continue(())
/// });
/// assert_eq!(crossed, [(0, 0.0), (1, 0.75), (2, 1.75)]);
/// assert_eq!(end, ControlFlow::Continue(()));
/// # Ok::<(), voxels::ExtentError>(())
/// ```
#[inline]
pub fn walk<B>(
    extent: Extent,
    origin: &Point3<f64>,
    direction: &Vector3<f64>,
    t_max_m: f64,
    mut visit: impl FnMut(Cell, f64) -> ControlFlow<B>,
) -> ControlFlow<B> {
    let cell_m = extent.cell_m();
    let limit = t_max_m / cell_m;
    let direction = [direction.x, direction.y, direction.z];
    let mut ray = Crossings::new(extent.cell_of(origin), extent.in_cells(origin), direction);
    let mut entry = 0.0;
    while extent.contains(ray.cell) {
        visit(ray.cell, entry * cell_m)?;
        (_, entry) = ray.advance();
        if entry > limit || entry == f64::INFINITY {
            break;
        }
    }
    ControlFlow::Continue(())
}

/// Visits the cells that the segment between two points crosses, from the cell of one end to the
/// cell of the other, until `visit` breaks.
///
/// The segment is always walked from the end that is smaller in (x, y, z) order, so the cells do
/// not depend on the order of the arguments. Cells outside the map are visited as well; points with
/// coordinates that are not finite, or more than 2^29 cells from the origin, visit nothing.
#[inline]
pub fn walk_segment<B>(
    extent: Extent,
    a: &Point3<f64>,
    b: &Point3<f64>,
    mut visit: impl FnMut(Cell) -> ControlFlow<B>,
) -> ControlFlow<B> {
    walk_stretches(extent, a, b, |cell, _| visit(cell))
}

/// As [`walk_segment`]; `visit` also gets the two ends of the stretch of the segment in the cell,
/// in cell units and up to rounding.
#[inline]
pub(crate) fn walk_stretches<B>(
    extent: Extent,
    a: &Point3<f64>,
    b: &Point3<f64>,
    mut visit: impl FnMut(Cell, [[f64; 3]; 2]) -> ControlFlow<B>,
) -> ControlFlow<B> {
    const REACH: f64 = (1 << 29) as f64;
    let far = |point: &[f64; 3]| !point.iter().all(|cells| cells.abs() <= REACH);
    let ends = [a, b].map(|point| extent.in_cells(point));
    if ends.iter().any(far) {
        return ControlFlow::Continue(());
    }
    let [from, to] = if ends[1] < ends[0] { [ends[1], ends[0]] } else { ends };
    let cell_of = |point: [f64; 3]| {
        let [x, y, z] = point.map(floor);
        Cell::new(x, y, z)
    };

    let direction = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
    let at = |time: f64| [from[0] + direction[0] * time, from[1] + direction[1] * time, from[2] + direction[2] * time];
    let mut ray = Crossings::new(cell_of(from), from, direction);
    // Counting the steps instead of comparing distances makes the walk end in the last cell
    // exactly.
    let way = cell_of(to) - cell_of(from);
    let way = [way.x, way.y, way.z];
    let mut steps_left = way.map(i32::unsigned_abs);
    for axis in 0..3 {
        ray.step[axis] = way[axis].signum();
        if steps_left[axis] == 0 {
            ray.next[axis] = f64::INFINITY;
        } else {
            // A boundary may be crossed within a distance too short for its inverse to be a number.
            ray.next[axis] = ray.next[axis].min(f64::MAX);
        }
    }
    let mut entry = 0.0;
    loop {
        let exit = ray.next[0].min(ray.next[1]).min(ray.next[2]).min(1.0);
        visit(ray.cell, [at(entry), at(exit)])?;
        if steps_left == [0; 3] {
            return ControlFlow::Continue(());
        }
        let (axis, _) = ray.advance();
        steps_left[axis] -= 1;
        if steps_left[axis] == 0 {
            ray.next[axis] = f64::INFINITY;
        }
        entry = exit;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn cells_of_ray(extent: Extent, origin: [f64; 3], direction: [f64; 3], t_max_m: f64) -> Vec<(Cell, f64)> {
        let mut crossed = Vec::new();
        let _ = walk(extent, &origin.into(), &direction.into(), t_max_m, |cell, entry_m| {
            crossed.push((cell, entry_m));
            ControlFlow::<()>::Continue(())
        });
        crossed
    }

    fn cells_of_segment(a: [f64; 3], b: [f64; 3]) -> Vec<Cell> {
        let extent = Extent::new([1, 1, 1], 1.0).unwrap();
        let mut crossed = Vec::new();
        let _ = walk_segment(extent, &a.into(), &b.into(), |cell| {
            crossed.push(cell);
            ControlFlow::<()>::Continue(())
        });
        crossed
    }

    fn share_a_face(a: Cell, b: Cell) -> bool {
        let d = a - b;
        d.x.abs() + d.y.abs() + d.z.abs() == 1
    }

    /// A non-negative fraction with a positive denominator, or infinity as 1 / 0.
    #[derive(Clone, Copy, Debug)]
    struct Ratio(i128, i128);

    impl Ratio {
        fn less(self, other: Ratio) -> bool {
            self.0 * other.1 < other.0 * self.1
        }

        fn max(self, other: Ratio) -> Ratio {
            if self.less(other) { other } else { self }
        }

        fn min(self, other: Ratio) -> Ratio {
            if other.less(self) { other } else { self }
        }
    }

    const PARTS: i32 = 16;

    /// The exact interval of the ray's parameter inside a closed cell, or `None` without one.
    /// Origins are given in 16ths of a cell.
    fn exact_interval(cell: Cell, origin: [i32; 3], direction: [i32; 3]) -> Option<(Ratio, Ratio)> {
        let (mut enter, mut leave) = (Ratio(0, 1), Ratio(1, 0));
        for (axis, low) in [cell.x, cell.y, cell.z].into_iter().enumerate() {
            let low = low * PARTS - origin[axis];
            let high = low + PARTS;
            let d = direction[axis];
            if d == 0 {
                // Half-open, like the rounding rule.
                if low > 0 || high <= 0 {
                    return None;
                }
                continue;
            }
            let (near, far) = if d > 0 { (low, high) } else { (-high, -low) };
            if far < 0 {
                return None;
            }
            let at = |parts: i32| Ratio(i128::from(parts.max(0)), i128::from(d.abs() * PARTS));
            (enter, leave) = (enter.max(at(near)), leave.min(at(far)));
        }
        (!leave.less(enter)).then_some((enter, leave))
    }

    #[test]
    fn ties_go_to_the_lower_axis() {
        let extent = Extent::new([2, 2, 2], 1.0).unwrap();
        let up = cells_of_ray(extent, [0.5; 3], [1.0; 3], 9.0);
        let down = cells_of_ray(extent, [1.5; 3], [-1.0; 3], 9.0);
        let cells = |crossed: &[(Cell, f64)]| crossed.iter().map(|&(cell, _)| cell).collect::<Vec<_>>();
        let (c000, c100, c110, c111) = (Cell::new(0, 0, 0), Cell::new(1, 0, 0), Cell::new(1, 1, 0), Cell::new(1, 1, 1));
        let (c011, c001) = (Cell::new(0, 1, 1), Cell::new(0, 0, 1));
        assert_eq!(cells(&up), [c000, c100, c110, c111]);
        assert_eq!(cells(&down), [c111, c011, c001, c000]);
        assert!(up[1..].iter().all(|&(_, entry_m)| entry_m == 0.5));
        assert_eq!(cells_of_segment([1.5; 3], [0.5; 3]), [c000, c100, c110, c111]);
    }

    #[test]
    fn an_origin_on_a_boundary_belongs_to_the_upper_cell() {
        let extent = Extent::new([3, 1, 1], 1.0).unwrap();
        let back = cells_of_ray(extent, [2.0, 0.5, 0.5], [-1.0, 0.0, 0.0], 9.0);
        let expected = [(Cell::new(2, 0, 0), 0.0), (Cell::new(1, 0, 0), 0.0), (Cell::new(0, 0, 0), 1.0)];
        assert_eq!(back, expected);
    }

    #[test]
    fn the_range_is_closed_and_in_metres() {
        let extent = Extent::new([9, 1, 1], 0.5).unwrap();
        let reach = |t_max_m| cells_of_ray(extent, [0.25; 3], [1.0, 0.0, 0.0], t_max_m).len();
        assert_eq!((reach(0.0), reach(0.24), reach(0.25), reach(0.75), reach(f64::INFINITY)), (1, 1, 2, 3, 9));
    }

    #[test]
    fn strange_rays_end_at_once() {
        let extent = Extent::new([3, 3, 3], 1.0).unwrap();
        assert_eq!(cells_of_ray(extent, [1.5; 3], [0.0; 3], f64::INFINITY).len(), 1);
        assert_eq!(cells_of_ray(extent, [1.5; 3], [f64::NAN; 3], f64::INFINITY).len(), 1);
        assert_eq!(cells_of_ray(extent, [1.5, 3.0, 1.5], [0.0, -1.0, 0.0], 9.0), []);
        assert_eq!(cells_of_ray(extent, [f64::NAN; 3], [1.0; 3], 9.0), []);
        assert_eq!(cells_of_segment([0.5; 3], [f64::NAN; 3]), []);
        assert_eq!(cells_of_segment([0.5; 3], [1e300; 3]), []);
    }

    #[test]
    fn a_segment_ends_in_the_cell_of_its_end() {
        let x = |cells: Vec<Cell>| cells.iter().map(|cell| cell.x).collect::<Vec<_>>();
        assert_eq!(x(cells_of_segment([1.5, 0.5, 0.5], [3.0, 0.5, 0.5])), [1, 2, 3]);
        assert_eq!(x(cells_of_segment([3.0, 0.5, 0.5], [4.5, 0.5, 0.5])), [3, 4]);
        let tiny = cells_of_segment([0.5, 0.0, 0.5], [0.5, -1e-320, 0.5]);
        assert_eq!(tiny, [Cell::new(0, -1, 0), Cell::new(0, 0, 0)]);
        let tiny = cells_of_segment([0.5, 0.0, 0.5], [0.7, -1e-320, 0.5]);
        assert_eq!(tiny, [Cell::new(0, 0, 0), Cell::new(0, -1, 0)]);
    }

    proptest! {
        #[test]
        fn ray_matches_exact_arithmetic(
            size in prop::array::uniform3(1u32..12),
            origin in prop::array::uniform3(0i32..PARTS * 12),
            direction in prop::array::uniform3(prop_oneof![-3i32..=3, -60i32..=60]),
            cell_m in prop_oneof![Just(1.0), Just(0.5), Just(4.0)],
        ) {
            let extent = Extent::new(size, cell_m).unwrap();
            let mut inside = origin;
            for axis in 0..3 {
                inside[axis] %= PARTS * size[axis] as i32;
            }
            let point = inside.map(|parts| f64::from(parts) / f64::from(PARTS) * cell_m);
            let crossed = cells_of_ray(extent, point, direction.map(f64::from), f64::INFINITY);

            prop_assert_eq!(crossed[0], (extent.cell_of(&point.into()), 0.0));
            for pair in crossed.windows(2) {
                prop_assert!(share_a_face(pair[0].0, pair[1].0));
                prop_assert!(pair[0].1 <= pair[1].1);
            }
            for &(cell, entry_m) in &crossed {
                let interval = exact_interval(cell, inside, direction);
                prop_assert!(interval.is_some(), "{cell:?} is not touched");
                let Ratio(parts, whole) = interval.unwrap().0;
                let exact_m = parts as f64 / whole as f64 * cell_m;
                prop_assert!((entry_m - exact_m).abs() <= 1e-12 * (1.0 + exact_m));
            }
            for cell in extent.cells() {
                let interval = exact_interval(cell, inside, direction);
                if interval.is_some_and(|(enter, leave)| enter.less(leave)) && direction != [0; 3] {
                    prop_assert!(crossed.iter().any(|&(c, _)| c == cell), "{cell:?} is missed");
                }
            }
        }

        #[test]
        fn segment_matches_its_ray(
            a in prop::array::uniform3(0.0f64..9.0),
            b in prop::array::uniform3(0.0f64..9.0),
        ) {
            let crossed = cells_of_segment(a, b);
            let mut back = cells_of_segment(b, a);
            prop_assert_eq!(&crossed, &back);
            if b < a {
                back.reverse();
            }
            let extent = Extent::new([9, 9, 9], 1.0).unwrap();
            prop_assert_eq!(back[0], extent.cell_of(&a.into()));
            prop_assert_eq!(back[back.len() - 1], extent.cell_of(&b.into()));
            prop_assert!(crossed.windows(2).all(|pair| share_a_face(pair[0], pair[1])));
            let (from, to) = if b < a { (b, a) } else { (a, b) };
            let direction = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
            let ray = cells_of_ray(extent, from, direction, 1.0);
            prop_assert!(ray.iter().map(|&(cell, _)| cell).eq(crossed));
        }
    }
}
