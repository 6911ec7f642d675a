use crate::scenario::{Override, Scenario};

const TEXT: &str = "seed = 7\nduration_s = 60.0\n[map]\nkind = \"spheres\"\nsize = 50\n[agents]\ncount = 3\n";

/// Overrides of `KEY=VALUE`, separated by semicolons; a value is TOML, and nothing removes the key.
fn overrides(keys: &str) -> Vec<Override> {
    let change = |text: &str| {
        let (key, value) = text.trim().split_once('=').unwrap();
        let table: Option<toml::Table> = toml::from_str(&format!("value = {value}")).ok();
        Override {
            origin: text.to_owned(),
            key: key.to_owned(),
            value: table.and_then(|table| table.get("value").cloned()),
        }
    };
    keys.split(';').filter(|text| !text.trim().is_empty()).map(change).collect()
}

fn after(text: &str, keys: &str) -> Result<Scenario, String> {
    Scenario::parse("s.toml", text, &overrides(keys)).map_err(|error| error.to_string())
}

/// The scenario of all keys at once is that of the second ones on the text that names all keys.
#[track_caller]
fn is_the_same(given: &str, changes: &str) {
    let at_once = after(TEXT, &format!("{given};{changes}")).unwrap();
    let resolved = after(TEXT, given).unwrap();
    for text in [resolved.to_toml(), resolved.identity()] {
        let later = after(&text, changes).unwrap();
        assert_eq!(later.identity(), at_once.identity(), "{given} and then {changes}");
        assert_eq!(later, at_once);
    }
    let keys = Scenario::given("s.toml", TEXT, &overrides(given)).unwrap();
    assert_eq!(after(&toml::to_string(&keys).unwrap(), changes).unwrap(), at_once);
}

#[test]
fn kind_of_body_brings_its_limits() {
    for kind in ["submarine", "aerial", "ground"] {
        for other in ["submarine", "aerial", "ground"] {
            let change = format!("body.kind=\"{other}\"");
            is_the_same(&format!("body.kind=\"{kind}\""), &change);
            is_the_same(&format!("body.kind=\"{kind}\"; body.radius_m=0.3; body.speed_max_m_s=0.7"), &change);
            is_the_same(&format!("body.kind=\"{kind}\""), &format!("body.speed_max_m_s=1.5; {change}"));
        }
    }
    is_the_same("", "body.kind=\"ground\"; body.step_max_m=0.2");
}

#[test]
fn other_bodies_follow_the_body() {
    is_the_same("bodies=[{ agents = [0], radius_m = 0.2 }]", "body.kind=\"aerial\"");
    is_the_same("bodies=[{ agents = [0], radius_m = 0.2 }]", "body.speed_max_m_s=0.5");
    is_the_same("bodies=[{ agents = [1], kind = \"ground\" }]", "body.kind=\"ground\"; body.step_max_m=0.2");
    is_the_same("bodies=[{ agents = [1], kind = \"ground\" }]", "body={ kind = \"aerial\" }");
}

#[test]
fn preset_and_pattern_of_a_lidar_bring_their_keys() {
    let presets = ["vlp-16", "os1-64", "mid-360", "depth-camera"];
    for preset in presets {
        is_the_same("", &format!("lidar.preset=\"{preset}\""));
        is_the_same("lidar.range_m=20.0; lidar.period_ticks=5", &format!("lidar.preset=\"{preset}\""));
        for other in presets {
            // A preset that is given is one key, which the other replaces.
            is_the_same(&format!("lidar.preset=\"{preset}\"; lidar.columns=90"), &format!("lidar.preset=\"{other}\""));
        }
        let resolved = after(TEXT, &format!("lidar.preset=\"{preset}\"; lidar.mount_height_m=0.1")).unwrap().to_toml();
        let refused = after(&resolved, "lidar.pattern=\"lattice\"").unwrap_err();
        assert!(refused.contains("lidar.mount_height_m = 0.1: expected only with"), "{refused}");
        let resolved = after(TEXT, &format!("lidar.preset=\"{preset}\"")).unwrap().to_toml();
        assert_eq!(after(&resolved, "lidar.pattern=\"lattice\"").unwrap(), after(TEXT, "").unwrap());
    }
    is_the_same("", "lidar.pattern=\"ring\"; lidar.rows=9");
    is_the_same("lidar.pattern=\"ring\"; lidar.rows=9", "lidar.pattern=\"frustum\"");
}

#[test]
fn kinds_of_starts_and_of_maps_replace_each_other() {
    let list = "spawn.kind=\"list\"; spawn.poses=[[5.5, 5.5, 5.5], [6.5, 5.5, 5.5], [7.5, 5.5, 5.5]]";
    for changes in [list, "spawn.kind=\"entrances\"; map.kind=\"building\"", "spawn.kind=\"scattered\"; spawn.seed=4"] {
        is_the_same("", changes);
        is_the_same("spawn.kind=\"scattered\"", changes);
    }
    is_the_same("", "spawn.kind=\"box\"; spawn.low=[1.0, 1.0, 1.0]; spawn.high=[9.0, 9.0, 9.0]");
    let generators = ["spheres", "noise", "building", "mine", "scene"];
    for (kind, other) in generators.iter().flat_map(|kind| generators.map(|other| (kind, other))) {
        is_the_same(&format!("map.kind=\"{kind}\""), &format!("map.kind=\"{other}\""));
    }
    let file = "map.kind=\"file\"; map.file=\"a.m3dm\"";
    for kind in generators {
        is_the_same(&format!("map.kind=\"{kind}\""), file);
        // What a hand-written text gives of a generator goes as well.
        let from_file = after(TEXT, file).unwrap();
        assert_eq!((from_file.map.size, from_file.map.cell_m), (None, None));
        let generated = format!("map.kind=\"{kind}\"; map.size=30");
        assert_eq!(after(&from_file.to_toml(), &generated).unwrap(), after(TEXT, &generated).unwrap());
    }
}

#[test]
fn battery_has_one_measure() {
    is_the_same("energy.charge_w=5.0; energy.capacity_j=9.0", "energy.idle_w=2.0");
    let lasts = after(TEXT, "energy.endurance_s=60.0").unwrap().to_toml();
    assert_eq!(after(&lasts, "energy.capacity_j=60.0").unwrap(), after(TEXT, "energy.capacity_j=60.0").unwrap());
    let both = after(TEXT, "energy.capacity_j=60.0; energy.endurance_s=60.0").unwrap_err();
    assert!(both.contains("expected either energy.capacity_j or energy.endurance_s"), "{both}");
}

#[test]
fn values_of_a_table_without_some_keys_are_given() {
    let text = format!("{TEXT}[body]\nkind = \"submarine\"\nspeed_max_m_s = 1.5\n[lidar]\nrange_m = inf\n");
    let changed = after(&text, "body.kind=\"aerial\"; lidar.preset=\"vlp-16\"").unwrap();
    assert_eq!(changed.body.speed_max_m_s, 1.5);
    assert_eq!(changed.lidar.unwrap().range_m, f64::INFINITY);
    let ring = after(&format!("{TEXT}[lidar]\npattern = \"ring\"\n"), "lidar.preset=\"depth-camera\"").unwrap_err();
    assert!(ring.contains("not with the lidar.pattern that is given"), "{ring}");
}
