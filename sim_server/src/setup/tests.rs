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
