use super::*;
use proptest::prelude::*;
use voxels::{close_shell, free_components};

fn extent(size: [u32; 3]) -> Extent {
    Extent::new(size, 1.0).unwrap()
}

fn repaired(file: &str, text: &str) -> Result<GeneratedMap, MapError> {
    repair(file, Grid::from_text(text).unwrap(), 9)
}

/// Everything that is promised of every map.
pub(super) fn assert_sound(map: &GeneratedMap, layers: u32) {
    let GeneratedMap { terrain, report, .. } = map;
    assert_eq!(close_shell(&mut terrain.clone(), layers), 0, "the shell is solid");
    assert_eq!(free_components(terrain).sizes, [report.free_cells as usize]);
    assert_eq!(free_cells(terrain), report.free_cells);
    assert!(report.free_cells > 0);
    assert_eq!(report.free_fraction, report.free_cells as f64 / terrain.extent().volume() as f64);
}

fn any_spheres() -> impl Strategy<Value = (SpheresSpec, Extent)> {
    let sizes = prop::array::uniform3(5u32..26);
    let others = (0.0f64..1.0, 0.0f64..1.0, 0.0f64..1.0, 0u32..6, 0u32..4);
    (sizes, others).prop_map(|(size, (fill, low, high, connections, smoothing))| {
        let limit = (size.into_iter().min().unwrap() - 4) / 2;
        let radius_min = (low * f64::from(limit + 1)) as u32;
        let radius_max = radius_min + (high * f64::from(limit + 1 - radius_min)) as u32;
        let reach: f64 = size.into_iter().map(|s| f64::from(s - 3) / f64::from(s)).product();
        let fill_ratio = (fill * reach).max(1e-9);
        let spec = SpheresSpec { fill_ratio, radius_min, radius_max, connections, smoothing, ..SpheresSpec::default() };
        (spec, extent(size))
    })
}

proptest! {
    #[test]
    fn spheres_give_a_sound_map_or_an_error((spec, extent) in any_spheres(), seed: u64) {
        let spec = MapSpec::Spheres(spec);
        prop_assert_eq!(spec.check(extent), Ok(()));
        match generate(&spec, extent, seed) {
            Ok(map) => {
                assert_sound(&map, 2);
                prop_assert!(map.report.carved.unwrap().spheres > 0);
                prop_assert_eq!(generate(&spec, extent, seed), Ok(map));
            }
            Err(MapError::FillUnreachable { asked, reached, spheres, .. }) => {
                prop_assert!(reached < asked && spheres > 0);
            }
            Err(error) => prop_assert_eq!(error, MapError::Empty),
        }
    }

    #[test]
    fn noise_gives_a_sound_map_or_an_error(
        size in prop::array::uniform3(5u32..20), fill in 0.0f64..=1.0, smoothing in 0u32..8, seed: u64,
    ) {
        let (spec, extent) = (MapSpec::Noise(NoiseSpec { fill, smoothing }), extent(size));
        match generate(&spec, extent, seed) {
            Ok(map) => {
                assert_sound(&map, 1);
                prop_assert_eq!(map.report.shell_cells_closed, 0);
                prop_assert_eq!(generate(&spec, extent, seed), Ok(map));
            }
            Err(error) => prop_assert_eq!(error, MapError::Empty),
        }
    }
}

/// A change here changes what every reported seed stands for.
#[test]
fn a_seed_stands_for_the_same_map_for_ever() {
    let small = SpheresSpec { fill_ratio: 0.5, radius_min: 0, radius_max: 4, smoothing: 1, ..SpheresSpec::default() };
    for (spec, size, seed, expected) in [
        (MapSpec::Spheres(SpheresSpec::default()), [50, 50, 50], 7, "b75b16b5619b51c7c3d82354dc490533"),
        (MapSpec::Spheres(small), [24, 13, 17], u64::MAX, "4e596ebf54ea4fd34e23d19120ddb6a9"),
        (MapSpec::Noise(NoiseSpec::default()), [40, 30, 20], 7, "dad8e59fc680c1fe4b5ee51cb23749bc"),
    ] {
        let map = generate(&spec, extent(size), seed).unwrap();
        assert_eq!(terrain_hash(&map.terrain).to_hex()[..32], *expected, "{spec:?}");
    }
}

/// The seeds of the experiments of the paper on MAES3D.
const PAPER_SEEDS: [u64; 10] = [688446, 881082, 715672, 360565, 402211, 781547, 234175, 510916, 902487, 103226];

/// The maps of the reference's own code, run from its seeds: free cells and hash.
#[test]
fn seeds_of_the_paper_make_its_maps() {
    // As the branch that ran the experiments: radii 3 to 6, two smoothings.
    let branch = SpheresSpec { radius_max: 6, smoothing: 2, random: SphereRandom::Unity, ..SpheresSpec::default() };
    // As the text of the paper and the user interface: 3 to 8, five.
    let text = SpheresSpec { random: SphereRandom::Unity, ..SpheresSpec::default() };
    let of_branch = [
        (243865, "80b3499bef6f92ec"),
        (242175, "469ab12b2b1ffb33"),
        (244840, "2310e071d48bbc3f"),
        (240956, "d44e335d696c7062"),
        (236087, "6d52345939950a09"),
        (241391, "4fec5cd8b2b75881"),
        (241455, "355642c70d721bbd"),
        (240418, "e9beeb519e44ec03"),
        (243395, "4312ceb121f3f276"),
        (240459, "07cf25b9e51864a8"),
    ];
    let of_text = [
        (235858, "393de87bb218524c"),
        (233414, "8d28ae218593eb38"),
        (235744, "51e247bcacdcbf16"),
        (230720, "3ab7c4bc424bd51d"),
        (230171, "654ec518b105b5fb"),
        (229322, "969dcad2ee61c69c"),
        (234188, "aa06a76c7cf266be"),
        (235285, "e87d4b98a5748038"),
        (239485, "ee66a53778b4c5b3"),
        (231211, "7c539286cc91a118"),
    ];
    let of_branch_50 = [(29264, "05a1e7677e5ff361"), (28299, "c2ac80566ccc7e42")];
    /// Spec, cells along an axis, free cells and hash of the map of each seed.
    type Golden<'a> = (&'a SpheresSpec, u32, &'a [(u64, &'a str)]);
    let tables: [Golden<'_>; 3] = [(&branch, 100, &of_branch), (&text, 100, &of_text), (&branch, 50, &of_branch_50)];
    for (spec, side, table) in tables {
        for (seed, &(free_cells, hash)) in PAPER_SEEDS.into_iter().zip(table) {
            let map = generate(&MapSpec::Spheres(spec.clone()), extent([side; 3]), seed).unwrap();
            let found = (map.report.free_cells, terrain_hash(&map.terrain).to_hex());
            assert_eq!((found.0, &found.1[..16]), (free_cells, hash), "{side}^3, seed {seed}, {spec:?}");
        }
    }
}

#[test]
fn different_seeds_give_different_maps() {
    for spec in [MapSpec::Spheres(SpheresSpec::default()), MapSpec::Noise(NoiseSpec::default())] {
        let hash = |seed| terrain_hash(&generate(&spec, extent([30; 3]), seed).unwrap().terrain);
        let mut hashes: Vec<[u8; 32]> = (0..20).map(|seed| *hash(seed).as_bytes()).collect();
        hashes.sort_unstable();
        hashes.dedup();
        assert_eq!(hashes.len(), 20, "{spec:?}");
    }
}

/// The measurements of docs/reference-model.md, "Measurements of maps".
#[test]
fn default_maps_are_as_open_as_those_of_maes3d() {
    let mean = |spec: &MapSpec, side: u32| {
        let fractions = (0..8).map(|seed| generate(spec, extent([side; 3]), seed).unwrap().report.free_fraction);
        fractions.sum::<f64>() / 8.0
    };
    let spheres = MapSpec::Spheres(SpheresSpec::default());
    let noise = MapSpec::Noise(NoiseSpec::default());
    for (spec, side, expected) in [
        (&spheres, 50, 0.22..0.24),
        (&spheres, 100, 0.22..0.24),
        (&noise, 30, 4_500.0 / 27_000.0..6_500.0 / 27_000.0),
        (&noise, 50, 0.27..0.32),
        (&noise, 100, 0.35..0.38),
    ] {
        let mean = mean(spec, side);
        assert!(expected.contains(&mean), "{side}^3: {mean}, expected {expected:?}, {spec:?}");
    }
    let report = generate(&spheres, extent([100; 3]), 7).unwrap().report;
    let carved = report.carved.unwrap();
    assert!((150..240).contains(&carved.spheres) && (280..460).contains(&carved.tunnels), "{carved:?}");
}

#[test]
fn an_impossible_fill_says_what_was_reached_and_why() {
    let spec = SpheresSpec { fill_ratio: 0.3, radius_min: 11, radius_max: 11, ..SpheresSpec::default() };
    let error = generate(&MapSpec::Spheres(spec), extent([30; 3]), 1).unwrap_err();
    assert_eq!(
        error.to_string(),
        "fill_ratio 0.3 is out of reach on a map of 30x30x30 cells with radii from 11 to 11: 1 sphere(s) freed \
         0.2371 of the volume, and no wall cell is left in which another one could be centred"
    );
}

#[test]
fn parameters_outside_their_range_are_named() {
    let default = SpheresSpec::default();
    let spheres = |spec: SpheresSpec| MapSpec::Spheres(spec).check(extent([30; 3])).unwrap_err().to_string();
    assert_eq!(spheres(SpheresSpec { radius_max: 14, ..default }), "radius_max is 14, allowed is 3 to 13");
    assert_eq!(spheres(SpheresSpec { radius_min: 9, ..default }), "radius_max is 8, allowed is 9 to 13");
    assert_eq!(spheres(SpheresSpec { radius_min: 99, ..default }), "radius_min is 99, allowed is 0 to 13");
    assert_eq!(spheres(SpheresSpec { connections: 65, ..default }), "connections is 65, allowed is 0 to 64");
    assert_eq!(
        spheres(SpheresSpec { fill_ratio: 0.0, ..default }),
        "fill_ratio is 0, allowed is more than 0 and at most 0.7290 on a map of 30x30x30 cells"
    );
    for fill_ratio in [-0.1, 0.73, f64::NAN, f64::INFINITY] {
        assert!(spheres(SpheresSpec { fill_ratio, ..default }).starts_with("fill_ratio is "));
    }

    let noise = |fill, smoothing, size| {
        MapSpec::Noise(NoiseSpec { fill, smoothing }).check(extent(size)).map_err(|error| error.to_string())
    };
    assert_eq!(noise(f64::NAN, 5, [9; 3]), Err("fill is NaN, allowed is 0 to 1".to_owned()));
    assert_eq!(noise(0.5, 1001, [9; 3]), Err("smoothing is 1001, allowed is 0 to 1000".to_owned()));
    let short = "map size along y is 4 cells, generators need at least 5";
    assert_eq!(noise(0.5, 5, [5, 4, 5]), Err(short.to_owned()));
    assert_eq!(noise(0.5, 5, [5, 5, 5]), Ok(()));
}

#[test]
fn a_map_without_free_cells_is_an_error() {
    let solid = MapSpec::Noise(NoiseSpec { fill: 1.0, smoothing: 0 });
    assert_eq!(generate(&solid, extent([9; 3]), 1), Err(MapError::Empty));
    let empty = MapError::ImportEmpty { file: "open.txt".to_owned() };
    assert_eq!(repaired("open.txt", "...\n.#.\n...\n"), Err(empty));
}

#[test]
fn an_imported_map_is_closed_and_connected() {
    let walls = "#####\n#####\n#####\n#####\n";
    let map = repaired("cave.txt", &format!("{walls}\n##.##\n#.#.#\n..#.#\n#####\n\n{walls}")).unwrap();
    assert_sound(&map, 1);
    // Two caves of two cells within the shell: the right one and the left one, which comes first in
    // index order.
    assert_eq!(map.terrain.to_text(), format!("{walls}\n#####\n#.###\n#.###\n#####\n\n{walls}"));
    let MapReport { shell_cells_closed, pockets_removed, pocket_cells_removed, .. } = map.report;
    assert_eq!((shell_cells_closed, pockets_removed, pocket_cells_removed), (2, 1, 2));
}

#[test]
fn text_form_has_the_defaults_of_maes3d_and_no_other_keys() {
    let random = SphereRandom::Chacha;
    let spheres = SpheresSpec { fill_ratio: 0.2, radius_min: 3, radius_max: 8, connections: 3, smoothing: 5, random };
    let noise = NoiseSpec { fill: 0.53, smoothing: 5 };
    assert_eq!(toml::from_str(""), Ok(spheres.clone()));
    assert_eq!(toml::from_str(""), Ok(noise.clone()));
    assert_eq!(toml::from_str(&toml::to_string(&spheres).unwrap()), Ok(spheres));
    assert_eq!(toml::from_str("smoothing = 2"), Ok(NoiseSpec { smoothing: 2, ..noise }));
    assert!(toml::from_str::<SpheresSpec>("fill = 0.2").unwrap_err().message().contains("unknown field `fill`"));
    assert!(toml::from_str::<NoiseSpec>("radius_min = 3").unwrap_err().message().contains("`radius_min`"));
}
