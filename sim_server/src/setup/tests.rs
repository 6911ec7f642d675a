use tempfile::TempDir;
use voxels::{Grid, Terrain};

use super::*;

/// A recording holds the cells of a building, but not where its entrances are.
#[test]
fn a_recorded_team_starts_at_the_entrances_again() {
    const TEXT: &str = "seed = 7\nduration_s = 60.0\nmap = { kind = \"building\", size = [40, 30, 13] }\n\
                        agents = { count = 6 }\nspawn = { kind = \"entrances\" }\n";
    let scenario = Scenario::parse("s.toml", TEXT, &[]).unwrap();
    let (world, report) = build(&scenario).unwrap();
    assert_eq!(report.built.unwrap().entrances, 2);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    record(&file, &scenario, &world).unwrap().finish().unwrap();

    let (again, _) = rebuild(&Recording::open(&file).unwrap(), &scenario).unwrap();
    assert_eq!(again.terrain(), world.terrain());
    for agent in world.agents() {
        assert_eq!(again.body(agent).pose(), world.body(agent).pose(), "{agent:?}");
    }
}

#[test]
fn a_start_that_cannot_be_had_says_what_can() {
    let refused = |spawn: &str| {
        let text = format!(
            "seed = 7\nduration_s = 60.0\nmap = {{ kind = \"spheres\", size = 30 }}\nagents = {{ count = 3 }}\nspawn = {spawn}\n"
        );
        build(&Scenario::parse("s.toml", &text, &[]).unwrap()).err().unwrap().to_string()
    };
    assert!(refused("{ kind = \"entrances\" }").contains("this map has no entrances"));
    let scattered = refused("{ kind = \"scattered\", min_distance_m = 100.0 }");
    assert!(
        scattered.contains("spawn: 1 of 3 bodies find room in this map, at random and at least 100 m apart"),
        "{scattered}"
    );
    let boxed = refused("{ kind = \"box\", low = [0.0, 0.0, 0.0], high = [1.0, 1.0, 1.0] }");
    assert!(
        boxed.contains("spawn: 0 of 3 bodies find room in the box from [0.0, 0.0, 0.0] to [1.0, 1.0, 1.0] m"),
        "{boxed}"
    );
}

#[test]
fn a_building_that_cannot_be_had_is_told_with_its_table() {
    let text = "seed = 7\nduration_s = 60.0\nagents = { count = 3 }\n\
                map = { kind = \"building\", size = 30, building = { floors = 8 } }\n";
    let refused = build(&Scenario::parse("s.toml", text, &[]).unwrap()).err().unwrap().to_string();
    assert!(refused.contains("map.building: floors is 8, allowed is 1 to 7"), "{refused}");
}

/// A scenario on the map file `map` in `folder`, with more keys of its map and of its bodies.
fn scenario(folder: &TempDir, map: &str, keys: &str, body: &str) -> Result<Scenario, SetupError> {
    let file = folder.path().join("s.toml");
    let map = folder.path().join(map);
    let text = format!(
        "seed = 1\nduration_s = 1.0\n[map]\nkind = \"file\"\nfile = {:?}\n{keys}\n[agents]\ncount = 1\n[body]\n{body}\n",
        map.display()
    );
    std::fs::write(&file, text).unwrap();
    load(&file, &[])
}

/// A folder with a hall of 3 x 3 x 3 free cells of half a metre as a packed map, as a plain one and
/// in parts that are no map.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    let mut hall = Grid::new(Extent::new([5; 3], 0.5).unwrap(), Terrain::Free);
    voxels::close_shell(&mut hall, 1);
    std::fs::write(folder.path().join("packed.m3dm"), packed::write(&hall)).unwrap();
    std::fs::write(folder.path().join("plain.m3dm"), m3dm::write(&hall).unwrap()).unwrap();
    folder
}

const SMALL_BODY: &str = "radius_m = 0.2";

#[test]
fn the_cells_of_a_map_are_as_long_as_its_file_says() {
    let folder = folder();
    let of_file = scenario(&folder, "packed.m3dm", "", SMALL_BODY).unwrap();
    assert_eq!(of_file.map.cell_m, Some(0.5));
    assert!(of_file.identity().contains("cell_m = 0.5\n"), "a recording names the length");
    let (world, _) = build(&of_file).unwrap();
    assert_eq!(world.terrain().extent().cell_m(), 0.5);
    assert_eq!(scenario(&folder, "packed.m3dm", "cell_m = 0.5", SMALL_BODY).unwrap(), of_file);

    let of_scenario = |keys| build(&scenario(&folder, "plain.m3dm", keys, SMALL_BODY).unwrap()).unwrap().0;
    assert_eq!(of_scenario("cell_m = 0.8").terrain().extent().cell_m(), 0.8);
    assert_eq!(of_scenario("").terrain().extent().cell_m(), 1.0);
}

#[test]
fn what_does_not_fit_the_cells_of_the_file_is_refused() {
    let folder = folder();
    let other = scenario(&folder, "packed.m3dm", "cell_m = 0.8", SMALL_BODY).unwrap();
    let error = build(&other).unwrap_err().to_string();
    assert!(
        error.starts_with("map.file: ") && error.contains("cells of 0.5 m, asked for are cells of 0.8 m"),
        "{error}"
    );
    let fast = scenario(&folder, "packed.m3dm", "", "speed_max_m_s = 30.0").unwrap_err().to_string();
    assert!(fast.contains("body.speed_max_m_s = 30"), "{fast}");
    assert!(scenario(&folder, "plain.m3dm", "", "speed_max_m_s = 30.0").is_ok());
    let import = scenario(&folder, "plain.m3dm", "import = { threshold = 2.0 }", "").unwrap_err().to_string();
    assert!(import.contains("s.toml:6: map.import.threshold = 2: expected 0 to 1"), "{import}");
    // A file that is not there is said when the world is made.
    let missing = scenario(&folder, "nowhere.m3dm", "", "").unwrap();
    assert!(build(&missing).unwrap_err().to_string().contains("nowhere.m3dm: No such file"));
}

#[test]
fn paths_start_from_the_folder_of_the_scenario_or_of_the_flag() {
    let folder = folder();
    let file = folder.path().join("s.toml");
    let import = "import = { trajectory = \"poses.txt\", model_path = [\"models\"] }";
    let text = format!(
        "seed = 1\nduration_s = 1.0\n[map]\nkind = \"file\"\nfile = \"packed.m3dm\"\n{import}\n[agents]\ncount = 1\n"
    );
    std::fs::write(&file, text).unwrap();
    let of_flag = |key: &str, value: &str| Override {
        origin: format!("--set {key}={value}"),
        key: key.to_owned(),
        value: Some(value.into()),
    };
    let paths = |overrides: &[Override]| {
        let map = load(&file, overrides).unwrap().map;
        let import = map.import.clone().from_folder(&map.folder);
        (map.path().unwrap(), import.trajectory.unwrap(), import.model_path.unwrap().remove(0))
    };
    let at = |name: &str| folder.path().join(name);
    assert_eq!(paths(&[]), (at("packed.m3dm"), at("poses.txt"), at("models")));
    let other_map = of_flag("map.file", "other.pcd");
    assert_eq!(paths(std::slice::from_ref(&other_map)), ("other.pcd".into(), at("poses.txt"), at("models")));
    let other_poses = of_flag("map.import.trajectory", "other.txt");
    let here = std::path::absolute("other.txt").unwrap();
    assert_eq!(paths(std::slice::from_ref(&other_poses)), (at("packed.m3dm"), here, at("models")));
    assert_eq!(paths(&[other_map, other_poses]), ("other.pcd".into(), "other.txt".into(), at("models")));

    let moved = load_with_paths_from(Path::new("/elsewhere"), &file, &[]).unwrap();
    assert_eq!(moved.map.path().unwrap(), Path::new("/elsewhere/packed.m3dm"));
    // The recorded name is the one of the file.
    assert!(moved.identity().contains("file = \"packed.m3dm\""), "{}", moved.identity());
}

/// A recording keeps the name of its map file, and accepts each other file with the same map.
#[test]
fn recorded_map_may_have_another_name() {
    let folder = folder();
    let recorded = scenario(&folder, "packed.m3dm", "", SMALL_BODY).unwrap();
    let (world, _) = build(&recorded).unwrap();
    let file = folder.path().join("run.mcap");
    record(&file, &recorded, &world).unwrap().finish().unwrap();
    let recording = Recording::open(&file).unwrap();

    std::fs::rename(folder.path().join("packed.m3dm"), folder.path().join("moved.m3dm")).unwrap();
    assert_eq!(load_recorded(&recording, None, &[]).unwrap().identity(), recorded.identity());
    rebuild(&recording, &recorded).unwrap();
    let load = |map: &str, keys: &str| {
        scenario(&folder, map, keys, SMALL_BODY).unwrap();
        load_recorded(&recording, Some(&folder.path().join("s.toml")), &[])
    };
    for (map, keys) in
        [("moved.m3dm", ""), ("./moved.m3dm", "import = { cells_max = 999 }"), ("plain.m3dm", "cell_m = 0.5")]
    {
        assert_eq!(load(map, keys).unwrap().identity(), recorded.identity(), "{map}");
    }
    std::fs::write(folder.path().join("other.txt"), "cell_m = 0.5\n###\n###\n###\n\n###\n#.#\n###\n\n###\n###\n###\n")
        .unwrap();
    let other = load("other.txt", "").unwrap_err().to_string();
    assert!(other.contains("the scenario of a recorded run stays as it is") && other.contains("other.txt"), "{other}");
    let missing = load("packed.m3dm", "cell_m = 0.5").unwrap();
    assert_eq!(missing.identity(), recorded.identity(), "the map is in the recording");
}
