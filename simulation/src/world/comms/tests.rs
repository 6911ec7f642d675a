use proptest::prelude::*;
use voxels::Extent;

use super::*;

const LINE_OF_SIGHT: ContactModel = ContactModel::LineOfSightAndRange { range_m: f64::INFINITY };

fn models() -> impl Strategy<Value = ContactModel> {
    prop_oneof![
        (0.0..8.0_f64).prop_map(|range_m| ContactModel::LineOfSightAndRange { range_m }),
        (0.0..8.0_f64).prop_map(|range_m| ContactModel::Range { range_m }),
        Just(ContactModel::Global),
        (0.0..60.0_f64, 0.1..5.0_f64, 0.0..9.0_f64).prop_map(|(reference_loss_db, free_exponent, wall_exponent)| {
            let loss =
                PathLoss { reference_loss_db, reference_m: 2.0, free_exponent, wall_exponent, ..PathLoss::default() };
            ContactModel::Attenuated(loss)
        }),
    ]
}

/// A cube of 6 cells along each edge, and two places in it.
fn places() -> impl Strategy<Value = (Grid<Terrain>, Point3<f64>, Point3<f64>)> {
    let place = || prop::array::uniform3(0.0..5.99_f64).prop_map(Point3::from);
    (prop::collection::vec(prop::bool::weighted(0.2), 216), place(), place()).prop_map(|(walls, one, other)| {
        let cells = walls.into_iter().map(|wall| if wall { Terrain::Wall } else { Terrain::Free }).collect();
        (Grid::from_vec(Extent::new([6, 6, 6], 1.0).unwrap(), cells).unwrap(), one, other)
    })
}

#[test]
fn power_falls_as_the_formula_says() {
    let loss = PathLoss::default();
    let is = |distance_m, in_walls_m, dbm: f64| {
        let received = loss.received_dbm(distance_m, in_walls_m);
        assert!((received - dbm).abs() < 1e-9, "{distance_m} {in_walls_m}: {received}");
    };
    is(35.0, 0.0, -51.0);
    is(350.0, 0.0, -71.0);
    is(3.5, 0.0, -31.0);
    // 40 dB for each tenfold of (1 + length).
    is(35.0, 9.0, -91.0);
    is(35.0, 1.0, -51.0 - 40.0 * libm::log10(2.0));
    // Nothing is amplified, however near.
    is(0.0, 0.0, -20.0);
    is(1e-300, 0.0, -20.0);
    assert!((loss.reach_m() - 35.0 * libm::pow(10.0, 0.95)).abs() < 1e-9);
    assert!(PathLoss { threshold_dbm: -19.0, ..loss }.reach_m() < 0.0);
}

#[test]
fn models_differ_where_walls_are() {
    let world = Grid::from_text("..#.......\n").unwrap();
    let at = |x: f64| Point3::new(x, 0.5, 0.5);
    let joins = |model: ContactModel, other| model.joins(&world, &at(0.5), &at(other));
    let range = ContactModel::Range { range_m: 4.0 };
    let both = ContactModel::LineOfSightAndRange { range_m: 4.0 };
    // One metre of wall costs 12 dB; the open reaches 4 m at 35 dB.
    let weak = PathLoss {
        tx_dbm: 0.0,
        threshold_dbm: -40.0,
        reference_loss_db: 40.0,
        reference_m: 8.0,
        ..PathLoss::default()
    };
    let weak = ContactModel::Attenuated(weak);
    let contacts =
        [LINE_OF_SIGHT, range, both, ContactModel::Global, weak].map(|model| [1.5, 3.0, 9.5].map(|x| joins(model, x)));
    assert_eq!(contacts[0], [true, false, false]);
    assert_eq!(contacts[1], [true, true, false]);
    assert_eq!(contacts[2], [true, false, false]);
    assert_eq!(contacts[3], [true, true, true]);
    assert_eq!(contacts[4], [true, false, false]);
    let strong = ContactModel::Attenuated(PathLoss::default());
    assert_eq!([1.5, 3.0, 9.5].map(|x| joins(strong, x)), [true; 3]);
}

proptest! {
    #[test]
    fn contact_is_symmetric(model in models(), (world, one, other) in places()) {
        prop_assert_eq!(model.joins(&world, &one, &other), model.joins(&world, &other, &one));
    }

    #[test]
    fn without_walls_power_is_a_range_and_a_line_of_sight(
        reference_loss_db in 0.0..60.0_f64,
        free_exponent in 0.5..6.0_f64,
        wall_exponent in 0.0..9.0_f64,
        (_, one, other) in places(),
    ) {
        let world = Grid::new(Extent::new([6, 6, 6], 1.0).unwrap(), Terrain::Free);
        let loss = PathLoss { reference_loss_db, reference_m: 2.0, free_exponent, wall_exponent, ..PathLoss::default() };
        let range_m = loss.reach_m();
        prop_assume!(((other - one).norm() / range_m - 1.0).abs() > 1e-9);
        let expected = ContactModel::LineOfSightAndRange { range_m }.joins(&world, &one, &other);
        prop_assert_eq!(ContactModel::Attenuated(loss).joins(&world, &one, &other), expected);
    }

    /// Whatever the walls cost, no more are in contact than in the open, and no fewer than in line
    /// of sight within the reach.
    #[test]
    fn walls_only_take_away(wall_exponent in 0.0..1000.0_f64, (world, one, other) in places()) {
        let loss = PathLoss { reference_loss_db: 50.0, reference_m: 4.0, wall_exponent, ..PathLoss::default() };
        let joins = |model: ContactModel| model.joins(&world, &one, &other);
        let is_heard = joins(ContactModel::Attenuated(loss));
        let range_m = loss.reach_m();
        prop_assume!(((other - one).norm() / range_m - 1.0).abs() > 1e-9);
        let is_in_range = joins(ContactModel::Range { range_m });
        let is_in_sight = joins(ContactModel::LineOfSightAndRange { range_m });
        prop_assert!(is_in_range || !is_heard);
        prop_assert!(is_heard || !is_in_sight);
    }
}

proptest! {
    #[test]
    fn table_of_moving_radios_agrees_with_the_model(
        walls in prop::collection::vec(prop::bool::weighted(0.15), 6 * 6 * 6),
        moves in prop::collection::vec((0usize..4, prop::array::uniform3(0.0..6.0f64), prop::bool::weighted(0.9)), 1..30),
        range_m in prop::sample::select(vec![2.5, f64::INFINITY]),
    ) {
        let kinds = walls.into_iter().map(|is_wall| if is_wall { Terrain::Wall } else { Terrain::Free }).collect();
        let terrain = Grid::from_vec(Extent::new([6; 3], 1.0).unwrap(), kinds).unwrap();
        let model = ContactModel::LineOfSightAndRange { range_m };
        let mut radios = [Radio { position: Point3::new(3.0, 3.0, 3.0), is_on_air: true }; 4];
        let mut table = ContactTable::new(radios.to_vec(), Vec::new());
        for (moved, [x, y, z], is_on_air) in moves {
            // Short moves as well, so that the same wall stays between two radios.
            let position = radios[moved].position + (Point3::new(x, y, z) - radios[moved].position) * (x / 6.0);
            radios[moved] = Radio { position, is_on_air };
            table.update(radios.into_iter(), Vec::new());
            for (one, other) in (0..4).flat_map(|one| (0..4).map(move |other| (one, other))) {
                let expected = one != other
                    && radios[one].is_on_air
                    && radios[other].is_on_air
                    && model.joins(&terrain, &radios[one].position, &radios[other].position);
                let contacts = table.of(AgentId::from_index(one), &model, &terrain);
                prop_assert_eq!(contacts.contains(&AgentId::from_index(other)), expected);
            }
        }
    }
}
