//! The plan that all floors share: hallways, the cores beside the first of them, and the regions
//! for rooms.
//!
//! The first hallway, the spine, crosses the whole floor. Cores are cut off the ends of the two
//! regions beside it; then further hallways cross the largest region that is left. A hallway always
//! ends at an older one on at least one side, so that all of them are connected. Between two
//! rectangles there is one layer of wall.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use voxels::Extent;

use super::rect::{Rect, Side};
use super::{BuildingSpec, OUTER_WALL, inside};

/// The part of the plan that all floors have in common.
#[derive(Debug, Clone)]
pub(super) struct Skeleton {
    /// Hallways; those that meet share no cell and no wall stands between them.
    pub(super) halls: Vec<Rect>,
    /// Staircases and lift shafts.
    pub(super) cores: Vec<Core>,
    /// The regions for rooms.
    pub(super) regions: Vec<Rect>,
    /// Ends of hallways at the outer wall: the last layer of the hallway and its side.
    pub(super) mouths: Vec<(Rect, Side)>,
}

/// A shaft through all floors, with doors to the spine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Core {
    pub(super) kind: CoreKind,
    /// Its free cells, seen from above.
    pub(super) rect: Rect,
    /// The side at which the hallway is, behind a layer of wall.
    pub(super) hall: Side,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum CoreKind {
    /// Its flights go up towards the high end of the axis along the hallway, or the low one.
    Stairs {
        up_to: usize,
    },
    Lift,
}

/// A rectangle that is neither hallway nor core, so far.
#[derive(Debug, Clone, Copy)]
struct Region {
    rect: Rect,
    /// By axis and end: whether a hallway goes along that whole side, behind a layer of wall.
    at_hall: [[bool; 2]; 2],
    /// The axis along which it is cut in two by preference.
    cut: usize,
}

/// The axis that the first hallway cuts in two, if the map has room for one with rooms on both
/// sides: x rather than y.
pub(super) fn spine_axis(spec: &BuildingSpec, extent: Extent) -> Option<usize> {
    let inside = inside(extent);
    let has_room =
        |axis: &usize| inside[*axis] >= cut_length_min(spec) && inside[1 - axis] >= spec.room_side_min as i32;
    [0, 1].into_iter().find(has_room)
}

/// The length of a region along the axis that a hallway cuts in two, at the least.
fn cut_length_min(spec: &BuildingSpec) -> i32 {
    2 * spec.room_side_min as i32 + spec.hall_width as i32 + 2
}

/// How many of the staircases and of the lift shafts find room beside the spine.
pub(super) fn cores_that_fit(spec: &BuildingSpec, extent: Extent) -> (u32, u32) {
    let length = spine_axis(spec, extent).map_or(0, |axis| inside(extent)[1 - axis]);
    let mut left = [length; 2];
    let mut fit = |asked: u32, cells: i32| {
        let place = || {
            let roomier = usize::from(left[1] > left[0]);
            let has_room = left[roomier] >= cells;
            left[roomier] -= cells + 1;
            has_room.then_some(())
        };
        std::iter::from_fn(place).take(asked as usize).count() as u32
    };
    let stairs = fit(spec.staircases_built(), slab_length(spec, stairs_length(spec)));
    (stairs, fit(spec.lift_shafts, slab_length(spec, spec.lift_width as i32)))
}

/// Cells of a staircase along the hallway: a landing, a step for each layer between two floors, and
/// a landing.
fn stairs_length(spec: &BuildingSpec) -> i32 {
    2 * spec.stair_width as i32 + spec.rise() - 1
}

/// Cells along the hallway that are cut off a region for a core: what is behind it can be a room.
fn slab_length(spec: &BuildingSpec, core: i32) -> i32 {
    core.max(spec.room_side_min as i32)
}

impl Skeleton {
    /// Draws the hallways and cores of a checked spec.
    pub(super) fn draw(spec: &BuildingSpec, extent: Extent, rng: &mut ChaCha8Rng) -> Self {
        let high = inside(extent).map(|cells| cells + OUTER_WALL);
        let floor = Rect { low: [OUTER_WALL; 2], high };
        let axis = spine_axis(spec, extent).expect("a checked spec has room for a hallway");
        let mut skeleton = Self { halls: Vec::new(), cores: Vec::new(), regions: Vec::new(), mouths: Vec::new() };
        let whole = Region { rect: floor, at_hall: [[false; 2]; 2], cut: axis };
        let mut beside = skeleton.cut(spec, floor, whole, axis, rng).map(Some);
        let mut regions = skeleton.place_cores(spec, &mut beside, axis, rng);
        regions.extend(beside.into_iter().flatten());

        let enough = spec.hall_share * floor.area() as f64;
        while (skeleton.halls.iter().map(Rect::area).sum::<i64>() as f64) < enough {
            let cuts = regions.iter().enumerate().filter_map(|(at, region)| Some((at, region.cut_axis(spec)?)));
            // Of equally large ones the first.
            let Some((at, axis)) = cuts.rev().max_by_key(|&(at, _)| regions[at].rect.area()) else {
                break;
            };
            let region = regions.remove(at);
            regions.extend(skeleton.cut(spec, floor, region, axis, rng));
        }
        skeleton.regions = regions.into_iter().map(|region| region.rect).collect();
        skeleton
    }

    /// Lays a hallway across a region; what is left on its low and its high side.
    fn cut(
        &mut self,
        spec: &BuildingSpec,
        floor: Rect,
        region: Region,
        axis: usize,
        rng: &mut ChaCha8Rng,
    ) -> [Region; 2] {
        let Region { rect, at_hall, .. } = region;
        let (side_min, width) = (spec.room_side_min as i32, spec.hall_width as i32);
        let low = rng.random_range(rect.low[axis] + side_min + 1..=rect.high[axis] - side_min - 1 - width);
        let mut hall = rect.between(axis, low, low + width);
        let across = 1 - axis;
        for end in [0, 1] {
            let side = Side { axis: across, end };
            if at_hall[across][end] {
                let through_wall = hall.beyond(side);
                hall.low[across] = hall.low[across].min(through_wall.low[across]);
                hall.high[across] = hall.high[across].max(through_wall.high[across]);
            } else if [rect.low, rect.high][end][across] == [floor.low, floor.high][end][across] {
                self.mouths.push((hall.nearest(side, 1), side));
            }
        }
        self.halls.push(hall);
        let beside = |low: i32, high: i32, hall_end: usize| {
            let mut at_hall = at_hall;
            at_hall[axis][hall_end] = true;
            Region { rect: rect.between(axis, low, high), at_hall, cut: across }
        };
        [beside(rect.low[axis], low - 1, 1), beside(low + width + 1, rect.high[axis], 0)]
    }

    /// Cuts the cores off the ends of the two regions beside the spine; the regions that are behind
    /// them.
    fn place_cores(
        &mut self,
        spec: &BuildingSpec,
        beside: &mut [Option<Region>; 2],
        axis: usize,
        rng: &mut ChaCha8Rng,
    ) -> Vec<Region> {
        let along = 1 - axis;
        let mut behind = Vec::new();
        let stairs = (0..spec.staircases_built()).map(|_| (stairs_length(spec), spec.stair_width as i32));
        let lifts = (0..spec.lift_shafts).map(|_| (spec.lift_width as i32, spec.lift_width as i32));
        for (number, (length, depth)) in stairs.chain(lifts).enumerate() {
            let left = beside.map(|region| region.map_or(0, |region| region.rect.along(along)));
            let is_high_side = if left[0] == left[1] { rng.random_bool(0.5) } else { left[1] > left[0] };
            let place = &mut beside[usize::from(is_high_side)];
            let region = place.expect("a checked spec has room for its cores");
            let hall = Side { axis, end: usize::from(!is_high_side) };
            let far = Side { axis: along, end: usize::from(rng.random_bool(0.5)) };

            let slab = region.rect.nearest(far, slab_length(spec, length));
            let kind = if number < spec.staircases_built() as usize {
                CoreKind::Stairs { up_to: usize::from(rng.random_bool(0.5)) }
            } else {
                CoreKind::Lift
            };
            self.cores.push(Core { kind, rect: slab.nearest(hall, depth).nearest(far, length), hall });
            let is_room = |rect: &Rect| rect.shortest_side() >= spec.room_side_min as i32;
            let room = slab.without(hall, depth + 1).filter(is_room);
            behind.extend(room.map(|rect| Region { rect, at_hall: [[false; 2]; 2], cut: along }));
            let rest = region.rect.without(far, slab.along(along) + 1);
            let mut at_hall = region.at_hall;
            at_hall[far.axis][far.end] = false;
            *place = rest.map(|rect| Region { rect, at_hall, ..region });
        }
        // A rest too narrow for a room stays solid.
        for place in beside.iter_mut() {
            *place = place.filter(|region| region.rect.shortest_side() >= spec.room_side_min as i32);
        }
        behind
    }
}

impl Region {
    /// The axis along which a hallway can cut it in two and meet an older hallway.
    fn cut_axis(&self, spec: &BuildingSpec) -> Option<usize> {
        let can_be_cut =
            |axis: &usize| self.rect.along(*axis) >= cut_length_min(spec) && self.at_hall[1 - axis].contains(&true);
        [self.cut, 1 - self.cut].into_iter().find(can_be_cut)
    }
}
