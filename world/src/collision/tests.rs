use proptest::prelude::*;
use voxels::Extent;

use super::*;

const RADIUS_M: f64 = 0.4;

/// Free but for the cell (2, 2, 2).
fn one_block() -> Grid<Terrain> {
    let mut terrain = Grid::new(Extent::new([5, 5, 5], 1.0).unwrap(), Terrain::Free);
    terrain.set(Cell::new(2, 2, 2), Terrain::Wall);
    terrain
}

fn contact(terrain: &Grid<Terrain>, from: [f64; 3], by: [f64; 3]) -> Option<Contact> {
    Obstacles::new(terrain, &[], 0).first_contact(&Point3::from(from), &Vector3::from(by), RADIUS_M)
}

#[test]
fn faces_are_met_at_the_radius() {
    let terrain = one_block();
    let cases = [
        ([1.0, 2.5, 2.5], [1.0, 0.0, 0.0], Surface::Wall, [-1.0, 0.0, 0.0]),
        ([2.5, 4.0, 2.5], [0.0, -1.0, 0.0], Surface::Wall, [0.0, 1.0, 0.0]),
        ([2.5, 2.5, 4.0], [0.0, 0.0, -1.0], Surface::Floor, [0.0, 0.0, 1.0]),
        ([2.5, 2.5, 1.0], [0.0, 0.0, 1.0], Surface::Ceiling, [0.0, 0.0, -1.0]),
    ];
    for (from, by, surface, normal) in cases {
        let contact = contact(&terrain, from, by).unwrap();
        assert!((contact.time - 0.6).abs() < 1e-11, "{contact:?}");
        assert!((contact.normal - Vector3::from(normal)).norm() < 1e-12, "{contact:?}");
        assert_eq!(surface_of(&contact.normal), surface);
        assert!(!contact.with_agent);
    }
}

#[test]
fn edges_and_corners_are_round() {
    let terrain = one_block();
    // Past the edge at x = y = 2: clear by a hair's breadth, then not.
    let beside = 2.0 - RADIUS_M;
    assert!(contact(&terrain, [beside - 1e-6, 1.0, 2.5], [0.0, 1.0, 0.0]).is_none());
    assert!(contact(&terrain, [beside + 1e-6, 1.0, 2.5], [0.0, 1.0, 0.0]).is_some());
    let diagonal = RADIUS_M / 2.0_f64.sqrt();
    assert!(contact(&terrain, [1.0, 2.0 - diagonal - 1e-6, 2.0 - diagonal - 1e-6], [3.0, 0.0, 0.0]).is_none());
    assert!(contact(&terrain, [1.0, 2.0 - diagonal + 1e-6, 2.0 - diagonal + 1e-6], [3.0, 0.0, 0.0]).is_some());
}

#[test]
fn edge_at_exactly_45_degrees_is_a_wall() {
    let terrain = one_block();
    // Bodies move along one diagonal towards the lower and the upper edges of the block.
    for (from_m, by) in [(0.5, 1.0), (0.7, 1.0), (4.3, -1.0), (4.5, -1.0)] {
        for along in 0..2 {
            let mut from = [2.5; 3];
            from[along] = from_m;
            from[2] = from_m;
            let mut towards = [0.0; 3];
            towards[along] = 2.0 * by;
            towards[2] = 2.0 * by;
            let contact = contact(&terrain, from, towards).unwrap();
            let slope = contact.normal.z.abs();
            assert!((slope - std::f64::consts::FRAC_1_SQRT_2).abs() < 1e-9, "{contact:?}");
            assert_eq!(surface_of(&contact.normal), Surface::Wall, "{contact:?}");
        }
    }
    let steeper = |by: f64| Vector3::new(libm::cos(by), 0.0, libm::sin(by));
    let limit = std::f64::consts::FRAC_PI_4;
    assert_eq!(surface_of(&steeper(limit + 1e-5)), Surface::Floor);
    assert_eq!(surface_of(&steeper(-limit - 1e-5)), Surface::Ceiling);
}

#[test]
fn body_that_fits_exactly_slides_along_walls() {
    // A corridor of three cells of 0.2 m, and a body of 0.6 m: its centre is where rounding takes
    // it.
    for first in 1..40 {
        let mut terrain = Grid::new(Extent::new([12, 44, 5], 0.2).unwrap(), Terrain::Wall);
        for (x, y, z) in (1..11).flat_map(|x| (0..3).flat_map(move |y| (1..4).map(move |z| (x, y, z)))) {
            terrain.set(Cell::new(x, first + y, z), Terrain::Free);
        }
        let (near, far) = (f64::from(first) * 0.2 + 0.3, (f64::from(first) + 1.5) * 0.2);
        for (from_y, to_y) in [(near, far), (far, near)] {
            let from = Point3::new(0.9, from_y, 0.5);
            let contact =
                Obstacles::new(&terrain, &[], 0).first_contact(&from, &Vector3::new(0.3, to_y - from_y, 0.0), 0.3);
            assert_eq!(contact, None, "{first}");
        }
    }
}

#[test]
fn leaving_and_sliding_are_free_even_when_touching() {
    let terrain = one_block();
    let touching = [2.0 - RADIUS_M, 2.5, 2.5];
    assert!(contact(&terrain, touching, [-0.5, 0.0, 0.0]).is_none());
    assert!(contact(&terrain, touching, [0.0, 0.5, 0.0]).is_none());
    assert!(contact(&terrain, touching, [1e-9, 0.0, 0.0]).is_some());
    let inside_by_rounding = [2.0 - RADIUS_M + 1e-12, 2.5, 2.5];
    assert!(contact(&terrain, inside_by_rounding, [-0.5, 0.0, 0.0]).is_none());
}

#[test]
fn beyond_the_map_is_wall() {
    let terrain = one_block();
    assert!(contact(&terrain, [0.5, 0.5, 0.5], [-0.2, 0.0, 0.0]).is_some());
    assert!(contact(&terrain, [4.5, 4.5, 4.5], [0.0, 0.0, 0.2]).is_some());
}

#[test]
fn other_bodies_are_in_the_way_and_itself_is_not() {
    let terrain = Grid::new(Extent::new([9, 3, 3], 1.0).unwrap(), Terrain::Free);
    let sphere = |x| Sphere { centre: Point3::new(x, 1.5, 1.5), radius_m: RADIUS_M };
    let spheres = [sphere(1.0), sphere(4.0)];
    let obstacles = Obstacles::new(&terrain, &spheres, 0);
    let go = |by: f64| obstacles.first_contact(&spheres[0].centre, &Vector3::new(by, 0.0, 0.0), RADIUS_M);
    assert!(go(2.1).is_none());
    let contact = go(4.4).unwrap();
    assert!(contact.with_agent);
    assert!((contact.time - 0.5).abs() < 1e-12);
    assert_eq!(contact.normal, Vector3::new(-1.0, 0.0, 0.0));
}

/// The least distance between a cube and points along a motion, by brute force.
fn sampled_distance(from: &Point3<f64>, by: &Vector3<f64>) -> f64 {
    let (low, high) = (Point3::new(2.0, 2.0, 2.0), Point3::new(3.0, 3.0, 3.0));
    (0..=2000)
        .map(|step| {
            let point = from + by * (f64::from(step) / 2000.0);
            (point - point.sup(&low).inf(&high)).norm()
        })
        .fold(f64::INFINITY, f64::min)
}

proptest! {
    #[test]
    fn agrees_with_brute_force(
        from in prop::array::uniform3(0.45..4.55_f64),
        by in prop::array::uniform3(-0.5..0.5_f64),
    ) {
        let (from_point, by_vector) = (Point3::from(from), Vector3::from(by));
        let to = from_point + by_vector;
        prop_assume!(to.iter().all(|&at| at > 0.45 && at < 4.55));
        let start_m = sampled_distance(&from_point, &Vector3::zeros());
        prop_assume!(start_m > RADIUS_M);
        let least_m = sampled_distance(&from_point, &by_vector);
        let met = contact(&one_block(), from, by);
        if least_m < RADIUS_M - 1e-6 {
            let met = met.expect("brute force finds a contact");
            let there = from_point + by_vector * met.time;
            let distance_m = sampled_distance(&there, &Vector3::zeros());
            prop_assert!((distance_m - RADIUS_M).abs() < 1e-9, "contact at distance {distance_m}");
            prop_assert!((met.normal.norm() - 1.0).abs() < 1e-9);
            prop_assert!(met.normal.dot(&by_vector) < 0.0);
        } else if least_m > RADIUS_M + 1e-6 {
            prop_assert!(met.is_none(), "{met:?} at a distance of {least_m}");
        }
    }

    #[test]
    fn bodies_far_away_are_skipped_and_no_others(
        places in prop::collection::vec((prop::array::uniform3(0.0..9.0_f64), 0.0..1.5_f64), 1..20),
        by in prop::array::uniform3(-2.0..2.0_f64),
    ) {
        let terrain = Grid::new(Extent::new([9, 9, 9], 1.0).unwrap(), Terrain::Free);
        let sphere = |(centre, radius_m): ([f64; 3], f64)| Sphere { centre: centre.into(), radius_m };
        let spheres: Vec<Sphere> = places.into_iter().map(sphere).collect();
        let (from, by) = (spheres[0].centre, Vector3::from(by));
        let walls = Obstacles::new(&terrain, &[], 0).first_contact(&from, &by, RADIUS_M);
        let others = spheres[1..].iter().filter(|other| other.is_solid());
        let first = others.filter_map(|other| other.first_contact(&from, &by, RADIUS_M)).chain(walls);
        let time = first.map(|contact| contact.time).reduce(f64::min);
        let found = Obstacles::new(&terrain, &spheres, 0).first_contact(&from, &by, RADIUS_M);
        prop_assert_eq!(found.map(|contact| contact.time), time);
    }
}
