use msgs::ids::AgentId;
use proptest::prelude::*;
use voxels::{Extent, OpenSpace};

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

/// How far a radio moves towards a place.
#[derive(Debug, Clone, Copy)]
enum Move {
    /// By this share of the way.
    Share(f64),
    /// To the nearest multiple of a quarter of a cell, where lines of sight often run along faces,
    /// edges and corners.
    Snap,
    /// By the least that there is.
    Nudge,
}

/// A step of a team of 4: who moves, towards where (cells), how far, and whether it is on air.
type Step = (usize, [f64; 3], Move, bool);

fn steps() -> impl Strategy<Value = Vec<Step>> {
    // Mostly short ways, so that decisions hold for a while.
    let share = prop::sample::select(vec![0.0, 0.002, 0.005, 0.02, 0.05, 1.0]).prop_map(Move::Share);
    let moves = prop_oneof![4 => share, 1 => Just(Move::Snap), 1 => Just(Move::Nudge)];
    let step = (0usize..4, prop::array::uniform3(-0.5..6.5f64), moves, prop::bool::weighted(0.95));
    prop::collection::vec(step, 1..150)
}

fn moved(from: Point3<f64>, to: Point3<f64>, how: Move, cell_m: f64) -> Point3<f64> {
    match how {
        Move::Share(share) => from + (to - from) * share,
        Move::Snap => from.map(|at| (at / cell_m * 4.0).round() / 4.0 * cell_m),
        Move::Nudge => {
            let nudge = |from: f64, to: f64| if to > from { from.next_up() } else { from.next_down() };
            from.coords.zip_map(&to.coords, nudge).into()
        }
    }
}

proptest! {
    #[test]
    fn table_of_moving_radios_agrees_with_the_model(
        model in models(),
        endless in any::<bool>(),
        walls in prop::sample::select(vec![0.1, 0.01])
            .prop_flat_map(|walls| prop::collection::vec(prop::bool::weighted(walls), 6 * 6 * 6)),
        steps in steps(),
        cell_m in prop::sample::select(vec![1.0, 0.5]),
        has_networks in prop::bool::weighted(0.2),
    ) {
        let kinds = walls.into_iter().map(|is_wall| if is_wall { Terrain::Wall } else { Terrain::Free }).collect();
        let terrain = Grid::from_vec(Extent::new([6; 3], cell_m).unwrap(), kinds).unwrap();
        let model = if endless { LINE_OF_SIGHT } else { model };
        let open_space = OpenSpace::of(&terrain);
        let rules = ContactRules { model: &model, terrain: &terrain, open_space: &open_space };
        let mut radios = [Radio { position: Point3::new(3.0, 3.0, 3.0) * cell_m, is_on_air: true }; 4];
        let mut table = ContactTable::new(radios.to_vec(), Vec::new());
        for (number, (agent, to, how, is_on_air)) in steps.into_iter().enumerate() {
            let position = moved(radios[agent].position, Point3::from(to) * cell_m, how, cell_m);
            radios[agent] = Radio { position, is_on_air };
            // Agents 0 and 3 meet in a network now and then.
            let is_linked = has_networks && number % 10 == 0;
            let networks = if is_linked { vec![vec![1], vec![], vec![2], vec![0, 1]] } else { vec![] };
            table.update(radios.into_iter(), networks);
            let joins = |one: usize, other: usize| {
                one != other
                    && radios[one].is_on_air
                    && radios[other].is_on_air
                    && (is_linked && [one, other].iter().all(|agent| agent % 3 == 0)
                        || model.joins(&terrain, &radios[one].position, &radios[other].position))
            };
            let next = (agent + 1) % 4;
            let is_in_contact =
                table.in_contact(AgentId::from_index(agent), AgentId::from_index(next), rules);
            prop_assert_eq!(is_in_contact, joins(agent, next));
            let among = (number % 16) as u64;
            let has_other = table.has_contact_not_among(AgentId::from_index(next), &[among], rules);
            prop_assert_eq!(has_other, (0..4).any(|other| among >> other & 1 == 0 && joins(next, other)));
            // Rows are not asked for in the same order in each tick, and not all of them.
            for one in (0..4).map(|place| (place + number) % 4).take(1 + number % 4) {
                let expected: Vec<AgentId> = (0..4).filter(|&other| joins(one, other)).map(AgentId::from_index).collect();
                let contacts: Vec<AgentId> = table.of(AgentId::from_index(one), rules).collect();
                prop_assert_eq!(contacts, expected);
            }
        }
    }
}
