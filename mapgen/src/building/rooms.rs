//! Rooms: a region is split at random, recursively, by walls one cell thick.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::BuildingSpec;
use super::rect::Rect;

/// The axis of the first split, which is always made if there is room (along y, as in MAES).
const FIRST_AXIS: usize = 1;

/// The rooms of a region. Each of them has no side shorter than `room_side_min`, which the region
/// must not have either.
pub(super) fn split(spec: &BuildingSpec, region: Rect, rng: &mut ChaCha8Rng) -> Vec<Rect> {
    let mut rooms = Vec::new();
    let mut open = vec![(region, FIRST_AXIS, true)];
    while let Some((rect, axis, is_first)) = open.pop() {
        let is_split = is_first || rng.random::<f64>() < spec.split_chance;
        // A wall with a room of the shortest length on either side.
        let has_room = |axis: &usize| rect.along(*axis) > 2 * spec.room_side_min as i32;
        match [axis, 1 - axis].into_iter().find(has_room).filter(|_| is_split) {
            Some(axis) => {
                let side_min = spec.room_side_min as i32;
                let wall = rng.random_range(rect.low[axis] + side_min..rect.high[axis] - side_min);
                open.push((rect.between(axis, wall + 1, rect.high[axis]), 1 - axis, false));
                open.push((rect.between(axis, rect.low[axis], wall), 1 - axis, false));
            }
            None => rooms.push(rect),
        }
    }
    rooms
}
