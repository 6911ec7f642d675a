//! The lattice on which the corners of a mesh lie: whole units of 2^-18 cells.
//!
//! Predicates on such corners are exact in integers. Corners that almost lie on a centre or a
//! boundary of cells are put there, so that files with numbers of 32 and of 64 bits, and cells of
//! lengths that no binary number has, get the same map: a face through centres that is meant as one
//! is one.

use super::super::frame::Bounds;
use super::Triangle;

/// Units of a cell along an axis. A map has less than 2^11 cells along an axis: twice the area of a
/// triangle in a map is below 2^59 square units.
pub(super) const UNIT: i64 = 1 << 18;

/// Largest coordinate that is put on the lattice, in lengths of cells; beyond it, numbers of 64
/// bits are coarser than the lattice.
const LARGEST: f64 = (1u64 << 34) as f64;

/// Distance from a multiple of half a cell within which a coordinate is that multiple, as a share
/// of the largest coordinate: some rounding errors of numbers of 32 bits.
const SHARE: f64 = 1.0 / (1u64 << 20) as f64;

/// Bounds of this distance, in lengths of cells.
const NEAR: [f64; 2] = [1.0 / (1 << 17) as f64, 1e-3];

/// Puts places, in lengths of cells, on the lattice. `bounds` are those of the places that count.
pub(super) fn put_on(places: &mut [[f64; 3]], bounds: Bounds) {
    let largest = [bounds.low, bounds.high].iter().flatten().fold(0.0f64, |largest, along| largest.max(along.abs()));
    let near = (largest * SHARE).clamp(NEAR[0], NEAR[1]);
    for along in places.iter_mut().flatten().filter(|along| along.abs() < LARGEST) {
        let half = libm::round(*along * 2.0) / 2.0;
        let is_near = (*along - half).abs() < near;
        // Adding 0 leaves one zero.
        *along = if is_near { half } else { libm::round(*along * UNIT as f64) / UNIT as f64 } + 0.0;
    }
}

/// The corners of a triangle of a map, units.
pub(super) fn units(triangle: &Triangle) -> [[i64; 3]; 3] {
    triangle.map(|corner| corner.map(|along| (along * UNIT as f64) as i64))
}

/// The normal of a triangle, with twice its area in square units as length.
pub(super) fn normal([a, b, c]: &[[i64; 3]; 3]) -> [i64; 3] {
    let to = |corner: &[i64; 3]| [0, 1, 2].map(|along| corner[along] - a[along]);
    let (b, c) = (to(b), to(c));
    [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]]
}
