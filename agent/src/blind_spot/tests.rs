use msgs::ids::AgentId;
use protocol::body_model::BodyModel;
use protocol::event_mask::EventMask;
use protocol::field_of_view::FieldOfView;
use protocol::observation::{Collision, Surface};
use voxels::Extent;

use super::*;
use crate::path::Neighbours;
use crate::testing::idle_at;

/// A ring that sees 15 degrees up and down.
const RING: FieldOfView =
    FieldOfView { horizontal_rad: 6.3, lowest_rad: -0.26, highest_rad: 0.26, spacing_rad: 0.01, min_range_m: 0.0 };

/// A ground body of 0.3 m in a hall of 4 x 4 x 1.5 m, whose floor is a cell of 0.1 m thick.
const BODY: BodyModel = BodyModel { radius_m: 0.3, step_max_m: 0.0, slope_max_rad: 0.0, ..BodyModel::GROUND };

const EXTENT: [u32; 3] = [42, 42, 16];

fn moves(body: BodyModel) -> Moves {
    Moves::of(&body, 0.1, Neighbours::TwentySix)
}

/// At rest at the place of a cell, heading along x.
fn at_rest(moves: &Moves, cell: Cell) -> Observation {
    let place = moves.lattice().place(Extent::new(EXTENT, 0.1).unwrap(), cell);
    Observation { field_of_view: Some(RING), ..idle_at(AgentId(0), place) }
}

/// What a ring shows at the start in the middle of the hall, where the floor has no cells at some
/// columns.
fn seen(moves: &Moves, start: Cell, is_pit: impl Fn(Cell) -> bool) -> ExplorationMap {
    let extent = Extent::new(EXTENT, 0.1).unwrap();
    let mut map = ExplorationMap::new(extent);
    let from = moves.lattice().place(extent, start);
    for (index, cell) in (0..).zip(extent.cells()) {
        let by = (extent.centre(cell) - from) / 0.1;
        let across = libm::hypot(by.x, by.y);
        let is_seen = by.z.abs() <= 0.27 * across || moves.touched().contains(&(cell - start));
        let is_border = [(cell.x, 41), (cell.y, 41), (cell.z, 15)].iter().any(|&(at, last)| at == 0 || at == last);
        match (is_seen, is_border && !(cell.z == 0 && is_pit(cell))) {
            (false, _) => {}
            (true, true) => map.note_wall(&[index]),
            (true, false) => map.note_free(&[index]),
        }
    }
    map
}

const START: Cell = Cell::new(21, 21, 4);

#[test]
fn body_in_a_ring_of_seen_floor_can_leave() {
    let on_slopes = BodyModel { slope_max_rad: 0.35, ..BODY };
    for body in [BODY, on_slopes, BodyModel { radius_m: 0.3, ..BodyModel::AERIAL }] {
        let moves = moves(body);
        let mut map = seen(&moves, START, |_| false);
        assert!(is_shut_in(Graph::new(&map, &moves), START), "{:?}", body.kind);
        let known = map.free() + map.wall();
        assert!(BlindSpot::default().fill(&mut map, &moves, &at_rest(&moves, START)));
        assert!(!is_shut_in(Graph::new(&map, &moves), START) && map.free() + map.wall() > known, "{:?}", body.kind);
    }
}

#[test]
fn body_that_sees_all_around_or_is_not_shut_in_assumes_nothing() {
    let moves = moves(BODY);
    let observation = at_rest(&moves, START);
    let mut map = seen(&moves, START, |_| false);
    let all_around = Observation { field_of_view: None, ..observation.clone() };
    assert!(!BlindSpot::default().fill(&mut map, &moves, &all_around));
    let mut blind_spot = BlindSpot::default();
    assert!(blind_spot.fill(&mut map, &moves, &observation) && !blind_spot.fill(&mut map, &moves, &observation));
    let known = map.journal_len();
    assert!(!BlindSpot::default().fill(&mut map, &moves, &observation));
    assert_eq!(map.journal_len(), known);
}

#[test]
fn nothing_is_assumed_towards_an_edge() {
    let moves = moves(BODY);
    // A trench from 0.8 m ahead of the body on, which it sees beyond its blind spot.
    let mut map = seen(&moves, START, |cell| cell.x >= 29);
    assert!(BlindSpot::default().fill(&mut map, &moves, &at_rest(&moves, START)));
    let state = |x: i32, y: i32| map.state(Cell::new(x, y, 0));
    assert_eq!([state(27, 21), state(15, 21)], [CellState::Unexplored, CellState::Wall]);
}

#[test]
fn sensor_overrules_what_is_assumed() {
    let moves = moves(BODY);
    let mut map = seen(&moves, START, |_| false);
    BlindSpot::default().fill(&mut map, &moves, &at_rest(&moves, START));
    let (floor, room) = (Cell::new(26, 21, 0), Cell::new(26, 21, 1));
    assert_eq!([map.state(floor), map.state(room)], [CellState::Wall, CellState::Free]);
    let index = |cell| map.extent().index(cell).unwrap() as u32;
    let (floor_index, room_index) = (index(floor), index(room));
    map.note_free(&[floor_index]);
    map.note_wall(&[room_index]);
    assert_eq!([map.state(floor), map.state(room),], [CellState::Free, CellState::Wall]);
}

#[test]
fn collision_takes_back_what_is_ahead() {
    let moves = moves(BODY);
    let mut map = seen(&moves, START, |_| false);
    let observation = at_rest(&moves, START);
    let mut blind_spot = BlindSpot::default();
    blind_spot.fill(&mut map, &moves, &observation);
    let ahead = START + Cell::new(1, 0, 0);
    assert!(Graph::new(&map, &moves).is_usable(ahead));
    let hit = |with_agent| Observation {
        collision: Some(Collision { surface: Surface::Wall, with_agent }),
        events: EventMask::COLLISION,
        ..observation.clone()
    };
    blind_spot.note_collision(&mut map, &moves, &hit(true));
    assert!(Graph::new(&map, &moves).is_usable(ahead));
    blind_spot.note_collision(&mut map, &moves, &hit(false));
    assert!(
        !Graph::new(&map, &moves).is_usable(ahead) && Graph::new(&map, &moves).is_usable(START - Cell::new(1, 0, 0))
    );
}
