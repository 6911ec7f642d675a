use proptest::prelude::*;
use protocol::event_mask::EventMask;

use super::*;
use crate::testing::{RADIUS_M, drawn, flat, is_through_free_cells};

const FIVE: NonZeroU64 = NonZeroU64::new(5).unwrap();

/// Two rooms and a detour between them.
const ROUND: &str = "\
    .......\n\
    .#####.\n\
    ..#.##.\n\
    #.#....\n";

fn body(radius_m: f64) -> BodyModel {
    BodyModel { radius_m, ..BodyModel::SUBMARINE }
}

fn navigation() -> NavigationTask {
    NavigationTask::new(&body(RADIUS_M), 1.0)
}

/// Requests the path from the left to the right of [`ROUND`].
fn ask(
    navigation: &mut NavigationTask,
    map: &ExplorationMap,
    goal: Cell,
    time: SearchTime,
    now: u64,
) -> NavigationStatus {
    let from = map.extent().centre(flat(1, 0));
    navigation.to_cell(map, &from, goal, Neighbours::Six, time, Tick(now))
}

/// The tick of the result, and the result.
fn ask_until_answered(
    navigation: &mut NavigationTask,
    map: &ExplorationMap,
    time: SearchTime,
    now: u64,
) -> (u64, NavigationStatus) {
    match ask(navigation, map, flat(3, 0), time, now) {
        NavigationStatus::Searching(wake) => {
            assert_eq!(wake.events, EventMask::empty());
            let at = wake.at.0;
            assert!(at > now);
            // Polling earlier changes nothing.
            for early in now..at {
                assert_eq!(ask(navigation, map, flat(3, 0), time, early), NavigationStatus::Searching(wake));
            }
            (at, ask(navigation, map, flat(3, 0), time, at))
        }
        answer => (now, answer),
    }
}

#[test]
fn search_time_changes_only_the_tick_of_the_result() {
    let map = drawn(ROUND);
    let mut navigation = navigation();
    let (at, instant) = ask_until_answered(&mut navigation, &map, SearchTime::Instant, 40);
    assert_eq!(at, 40);
    let NavigationStatus::Go(Motion::Path(waypoints)) = &instant else { panic!("{instant:?}") };
    assert_eq!(waypoints.last(), Some(&map.extent().centre(flat(3, 0))));

    let expansions = {
        let moves = navigation.moves(Neighbours::Six);
        let mut search = Search::new(Graph::new(&map, moves), flat(1, 0), Goal::Cell(flat(3, 0)));
        assert!(search.run().is_some());
        search.expansions()
    };
    let (at, budgeted) = ask_until_answered(&mut navigation, &map, SearchTime::Budgeted(FIVE), 40);
    assert_eq!(at, 40 + expansions.div_ceil(5));
    assert_eq!(budgeted, instant);

    let (at, background) = ask_until_answered(&mut navigation, &map, SearchTime::Background(25), 40);
    assert_eq!(at, 65);
    assert_eq!(background, instant);
}

#[test]
fn late_poll_returns_the_result() {
    let map = drawn(ROUND);
    let mut navigation = navigation();
    let instant = ask(&mut navigation, &map, flat(3, 0), SearchTime::Instant, 0);
    for time in [SearchTime::BUDGETED, SearchTime::Background(25)] {
        assert!(matches!(ask(&mut navigation, &map, flat(3, 0), time, 0), NavigationStatus::Searching(_)));
        assert_eq!(ask(&mut navigation, &map, flat(3, 0), time, 1000), instant);
        // The result was handed out: the next request is a new one.
        assert!(matches!(ask(&mut navigation, &map, flat(3, 0), time, 1000), NavigationStatus::Searching(_)));
    }
}

#[test]
fn another_request_restarts_the_first_one() {
    let map = drawn(ROUND);
    for time in [SearchTime::Budgeted(FIVE), SearchTime::Background(25)] {
        let mut navigation = navigation();
        let instant = ask(&mut navigation, &map, flat(3, 0), SearchTime::Instant, 0);
        let NavigationStatus::Searching(first) = ask(&mut navigation, &map, flat(3, 0), time, 0) else { panic!() };
        assert!(matches!(ask(&mut navigation, &map, flat(6, 3), time, 1), NavigationStatus::Searching(_)));
        let NavigationStatus::Searching(again) = ask(&mut navigation, &map, flat(3, 0), time, 2) else { panic!() };
        assert_eq!(again.at, first.at.after(2));
        assert_eq!(ask(&mut navigation, &map, flat(3, 0), time, again.at.0), instant);
    }
}

#[test]
fn result_is_that_of_the_map_at_the_request() {
    let before = drawn(&ROUND.replace("..#.##.", "..?.##."));
    let mut after = before.clone();
    after.note_free(&[7 + 2]);
    for time in [SearchTime::Budgeted(FIVE), SearchTime::Background(25)] {
        let mut navigation = navigation();
        let NavigationStatus::Searching(wake) = ask(&mut navigation, &before, flat(3, 0), time, 0) else { panic!() };
        let NavigationStatus::Go(Motion::Path(asked_before)) =
            ask(&mut navigation, &after, flat(3, 0), time, wake.at.0)
        else {
            panic!()
        };
        let instant = ask(&mut navigation, &after, flat(3, 0), SearchTime::Instant, 0);
        let NavigationStatus::Go(Motion::Path(asked_after)) = instant else { panic!() };
        assert!(asked_before.len() > asked_after.len(), "{asked_before:?} {asked_after:?}");
    }
}

#[test]
fn straight_path_needs_no_search() {
    let map = drawn(ROUND);
    for time in [SearchTime::Instant, SearchTime::BUDGETED, SearchTime::Background(25)] {
        let straight = NavigationStatus::Go(Motion::Path(vec![map.extent().centre(flat(1, 1))]));
        assert_eq!(ask(&mut navigation(), &map, flat(1, 1), time, 0), straight);
    }
}

#[test]
fn absence_of_a_path_is_a_result() {
    let map = drawn(&ROUND.replacen(".......", "...?...", 1));
    for time in [SearchTime::Instant, SearchTime::Budgeted(FIVE), SearchTime::Background(25)] {
        let (_, answer) = ask_until_answered(&mut navigation(), &map, time, 0);
        assert_eq!(answer, NavigationStatus::NoPath);
    }
    // Walls, unexplored cells and cells outside the map are no goals.
    for goal in [flat(1, 2), flat(3, 3), flat(7, 0), flat(-1, 0)] {
        assert_eq!(ask(&mut navigation(), &map, goal, SearchTime::Instant, 0), NavigationStatus::NoPath, "{goal:?}");
    }
    // A body that is wider than the passage.
    let mut wide = NavigationTask::new(&body(0.6), 1.0);
    assert_eq!(ask(&mut wide, &drawn(ROUND), flat(3, 0), SearchTime::Instant, 0), NavigationStatus::NoPath);
}

fn worlds() -> impl Strategy<Value = String> {
    let cell = prop_oneof![6 => Just('.'), 1 => Just('#'), 1 => Just('?')];
    let row = proptest::collection::vec(cell, 8).prop_map(String::from_iter);
    let layer = proptest::collection::vec(row, 6).prop_map(|rows| rows.join("\n"));
    proptest::collection::vec(layer, 3).prop_map(|layers| layers.join("\n\n"))
}

proptest! {
    #[test]
    fn motions_lead_through_free_cells_only(
        world in worlds(),
        start in (0..8, 0..6, 0..3),
        goal in (0..8, 0..6, 0..3),
        within in [0.4..0.6, 0.4..0.6, 0.4..0.6],
        is_by_faces: bool,
    ) {
        let map = drawn(&world);
        let [start, goal] = [start, goal].map(|(x, y, z)| Cell::new(x, y, z));
        let state = map.state(start);
        prop_assume!(state == crate::exploration_map::CellState::Free);
        let from = Point3::from(map.extent().centre(start).coords.add_scalar(-0.5) + nalgebra::Vector3::from(within));
        // Cells touched at the start are exempt, so there must be none.
        prop_assume!(is_through_free_cells(&map, &from, &[from]));
        let neighbours = if is_by_faces { Neighbours::Six } else { Neighbours::TwentySix };
        let mut answers = Vec::new();
        for time in [SearchTime::Instant, SearchTime::BUDGETED, SearchTime::Background(25)] {
            let mut navigation = navigation();
            let mut status = navigation.to_cell(&map, &from, goal, neighbours, time, Tick(7));
            if let NavigationStatus::Searching(wake) = status {
                status = navigation.to_cell(&map, &from, goal, neighbours, time, wake.at);
            }
            if let NavigationStatus::Go(Motion::Path(waypoints)) = &status {
                prop_assert!(is_through_free_cells(&map, &from, waypoints), "{waypoints:?}\n{world}");
                prop_assert_eq!(waypoints.last(), Some(&map.extent().centre(goal)));
            }
            answers.push(status);
        }
        prop_assert_eq!(&answers[0], &answers[1]);
        prop_assert_eq!(&answers[0], &answers[2]);
    }
}
