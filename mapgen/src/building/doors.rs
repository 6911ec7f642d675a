//! Doors: every room gets one towards a hallway.
//!
//! Rooms at a hallway get doors to it; then, round by round, those beside a room that has been
//! reached get a door to it. A door keeps the padding of the spec to the corners of both rooms.
//! Where no wall is long enough for that, it is as wide as it can be.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use voxels::Extent;

use super::BuildingSpec;
use super::rect::{Rect, Side};

/// The most doors from a room to one neighbour: one wall each, if the neighbour, a hallway, is on
/// several sides (MAES).
const DOORS_TO_NEIGHBOUR_MAX: usize = 3;

/// The owner of a cell of the plan: none, the hallways, or a room by its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Owner {
    Free,
    Halls,
    Room(usize),
}

/// A piece of wall between a room and one neighbour, one cell thick.
#[derive(Debug, Clone, Copy)]
struct SharedWall {
    neighbour: Owner,
    wall: Rect,
    /// The axis along which the wall runs.
    along: usize,
}

impl SharedWall {
    fn length(&self) -> i32 {
        self.wall.along(self.along)
    }
}

/// The rooms that can be reached from the hallways, and the doors that are needed for it.
pub(super) struct Connected {
    pub(super) rooms: Vec<Rect>,
    pub(super) doors: Vec<Rect>,
}

/// Draws the doors of one floor.
pub(super) fn connect(
    spec: &BuildingSpec,
    extent: Extent,
    halls: &[Rect],
    rooms: &[Rect],
    rng: &mut ChaCha8Rng,
) -> Connected {
    let shared = shared_walls(extent, halls, rooms);
    let width = spec.door_width as i32;
    let padded = width + 2 * spec.door_padding as i32;
    let mut doors = Vec::new();
    let mut is_reached = vec![false; rooms.len()];
    let mut left: Vec<usize> = (0..rooms.len()).collect();
    loop {
        let before = is_reached.clone();
        let leads_on = |wall: &&SharedWall| match wall.neighbour {
            Owner::Room(neighbour) => before[neighbour],
            Owner::Halls => true,
            Owner::Free => false,
        };
        for &room in &left {
            let mut walls: Vec<&SharedWall> =
                shared[room].iter().filter(|wall| wall.length() >= padded).filter(leads_on).collect();
            walls.sort_by_key(|wall| wall.neighbour);
            for of_one in walls.chunk_by(|one, other| one.neighbour == other.neighbour) {
                let count = rng.random_range(1..=DOORS_TO_NEIGHBOUR_MAX);
                doors.extend(of_one.iter().take(count).map(|wall| door(wall, width, spec.door_padding as i32, rng)));
            }
            is_reached[room] = !walls.is_empty();
        }
        if is_reached == before {
            for &room in &left {
                let longest = shared[room].iter().filter(leads_on).max_by_key(|wall| wall.length());
                doors.extend(longest.map(|wall| door(wall, width.min(wall.length()), 0, rng)));
                is_reached[room] = longest.is_some();
            }
        }
        if is_reached == before {
            let rooms = rooms.iter().zip(is_reached).filter_map(|(&room, is_reached)| is_reached.then_some(room));
            return Connected { rooms: rooms.collect(), doors };
        }
        left.retain(|&room| !is_reached[room]);
    }
}

/// A door somewhere in a wall.
fn door(SharedWall { wall, along, .. }: &SharedWall, width: i32, padding: i32, rng: &mut ChaCha8Rng) -> Rect {
    let low = rng.random_range(wall.low[*along] + padding..=wall.high[*along] - padding - width);
    wall.between(*along, low, low + width)
}

/// For each room, the pieces of wall that it shares with one neighbour each, side by side.
fn shared_walls(extent: Extent, halls: &[Rect], rooms: &[Rect]) -> Vec<Vec<SharedWall>> {
    let [size_x, size_y, _] = extent.size().map(|cells| cells as usize);
    let mut owners = vec![Owner::Free; size_x * size_y];
    let numbered = rooms.iter().enumerate().map(|(number, rect)| (rect, Owner::Room(number)));
    for (rect, owner) in halls.iter().map(|rect| (rect, Owner::Halls)).chain(numbered) {
        for y in rect.low[1]..rect.high[1] {
            owners[y as usize * size_x..][rect.low[0] as usize..rect.high[0] as usize].fill(owner);
        }
    }
    let owner_at = |[x, y]: [i32; 2]| owners[y as usize * size_x + x as usize];
    let of_room = |room: &Rect| Side::ALL.into_iter().flat_map(|side| pieces(*room, side, owner_at)).collect();
    rooms.iter().map(of_room).collect()
}

/// The pieces of the wall at one side of a room behind which is one neighbour.
fn pieces(room: Rect, side: Side, owner_at: impl Fn([i32; 2]) -> Owner) -> Vec<SharedWall> {
    let wall = room.beyond(side);
    let along = 1 - side.axis;
    let behind = |at: i32| {
        let mut place = wall.low;
        place[along] = at;
        let [step_x, step_y] = side.outward();
        owner_at([place[0] + step_x, place[1] + step_y])
    };
    let places: Vec<i32> = (wall.low[along]..wall.high[along]).collect();
    let runs = places.chunk_by(|&one, &other| behind(one) == behind(other));
    let piece = |run: &[i32]| SharedWall {
        neighbour: behind(run[0]),
        wall: wall.between(along, run[0], run[run.len() - 1] + 1),
        along,
    };
    runs.map(piece).filter(|piece| piece.neighbour != Owner::Free).collect()
}
