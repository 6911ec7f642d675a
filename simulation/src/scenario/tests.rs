use super::*;

const SMALL: &str = "seed = 7\nduration_s = 60.0\n[map]\nkind = \"spheres\"\nsize = 50\n[agents]\ncount = 3\n";

fn set(key: &str, value: impl Into<toml::Value>) -> Override {
    Override { origin: format!("--set {key}"), key: key.to_owned(), value: Some(value.into()) }
}

#[test]
fn what_is_left_out_is_the_reference() {
    let scenario = Scenario::parse("s.toml", SMALL, &[]).unwrap();
    assert_eq!(scenario.lidar.as_ref().unwrap().rays, 5124);
    assert_eq!(scenario.body.radius_m, 0.4);
    assert_eq!(scenario.duration_ticks(), Tick(3000));
    assert_eq!(scenario.map_seed(), 7);
}

#[test]
fn the_identity_reads_back_and_leaves_the_execution_out() {
    let text = format!("{SMALL}[execution]\nthreads = 3\n[views]\nmax_hz = 1.0\nrecord = [\"odom\"]\n");
    let one = Scenario::parse("s.toml", SMALL, &[]).unwrap();
    let other = Scenario::parse("s.toml", &text, &[]).unwrap();
    assert_ne!(one, other);
    assert_eq!(one.identity(), other.identity());
    assert_eq!(Scenario::parse("identity", &one.identity(), &[]).unwrap(), one);
    assert!(!other.identity().contains("views"));
    assert_eq!(Scenario::parse("all", &other.to_toml(), &[]).unwrap(), other);
}

#[test]
fn a_building_has_its_parameters_in_the_identity_and_other_maps_have_none() {
    assert!(!Scenario::parse("s.toml", SMALL, &[]).unwrap().identity().contains("building"));
    let building = Scenario::parse("s.toml", SMALL, &[set("map.kind", "building")]).unwrap();
    assert!(building.identity().contains("[map.building]\ndoor_height = 2\n"), "{}", building.identity());
    assert_eq!(Scenario::parse("identity", &building.identity(), &[]).unwrap(), building);
}

#[test]
fn every_kind_of_start_is_part_of_the_identity() {
    for text in [
        "{ kind = \"nearest_origin\", yaw_rad = 1.0 }",
        "{ kind = \"list\", poses = [[1.5, 2.5, 3.5, 0.5]] }",
        "{ kind = \"scattered\" }",
        "{ kind = \"scattered\", min_distance_m = 4.0, seed = 9, yaw_rad = -1.0 }",
        "{ kind = \"box\", low = [1.0, 2.0, 3.0], high = [4.0, 5.0, 6.0] }",
        "{ kind = \"entrances\" }",
    ] {
        let scenario = Scenario::parse("s.toml", &format!("spawn = {text}\n{SMALL}"), &[]).unwrap();
        assert_eq!(Scenario::parse("identity", &scenario.identity(), &[]).unwrap(), scenario, "{text}");
    }
}

#[test]
fn starts_out_of_range_are_named() {
    let spawn = |text: &str| format!("spawn = {text}\n{SMALL}");
    let distance = "s.toml:1: spawn.min_distance_m = -1: expected 0 to 1e6";
    refuses(&spawn("{ kind = \"scattered\", min_distance_m = -1.0 }"), &[], distance);
    refuses(
        &spawn("{ kind = \"scattered\", yaw_rad = 7.0 }"),
        &[],
        "s.toml:1: spawn.yaw_rad = 7: expected -2 pi to 2 pi",
    );
    let seed = "s.toml:1:38: spawn.seed = -1: expected a seed from 0 to 9223372036854775807";
    refuses(&spawn("{ kind = \"scattered\", seed = -1 }"), &[], seed);
    let corner = "s.toml:1: spawn.high = [4.0, 1.0, 6.0]: expected finite numbers, none of them below spawn.low = [1.0, 2.0, 3.0]";
    refuses(&spawn("{ kind = \"box\", low = [1.0, 2.0, 3.0], high = [4.0, 1.0, 6.0] }"), &[], corner);
    refuses(&spawn("{ kind = \"box\", low = [1.0, 2.0, nan], high = [4.0, 1.0, 6.0] }"), &[], "spawn.high");
    refuses(
        &spawn("{ kind = \"box\", low = [1.0, 2.0, 3.0] }"),
        &[],
        "s.toml:1:1: missing key `spawn.high`: expected [x, y, z] (m)",
    );
    let yaw = "s.toml:1:31: key `spawn.yaw_rad` does not go with kind = \"entrances\", only with \"nearest_origin\", \
               \"scattered\", \"box\"";
    refuses(&spawn("{ kind = \"entrances\", yaw_rad = 1.0 }"), &[], yaw);
}

#[test]
fn overrides_set_keys() {
    let overrides =
        [set("agents.count", 5), set("map.size", 30), set("execution.rtf", 2.0), set("lidar.range_m", f64::INFINITY)];
    let scenario = Scenario::parse("s.toml", SMALL, &overrides).unwrap();
    assert_eq!(scenario.agents.count, 5);
    assert_eq!(scenario.map.size, Some(Size::Cube(30)));
    assert_eq!(scenario.execution.rtf, Rtf::Limit(2.0));
}

#[track_caller]
fn refuses(text: &str, overrides: &[Override], expected: &str) {
    let error = Scenario::parse("s.toml", text, overrides).unwrap_err().to_string();
    assert!(error.contains(expected), "{error}");
    assert!(!error.contains('\n'), "{error}");
}

#[test]
fn mistakes_are_named_with_their_place() {
    refuses("seed = ", &[], "s.toml:1:");
    refuses(
        &SMALL.replace("count", "cuont"),
        &[],
        "s.toml:7:1: unknown key `agents.cuont`; did you mean `agents.count`?",
    );
    refuses(&SMALL.replace("seed = 7\n", ""), &[], "s.toml:1:1: missing key `seed`: expected a seed");
    refuses(&SMALL.replace("60.0", "0.03"), &[], "s.toml:2: duration_s = 0.03: expected a multiple of 0.02 s");
    refuses(&SMALL.replace("size = 50", ""), &[], "s.toml:4: map.size = nothing: a generated map needs a size");
    refuses(SMALL, &[set("agents.count", 0)], "--set agents.count: agents.count = 0: expected 1 to 1000");
    let cuont = "--set agents.cuont: unknown key `agents.cuont`; did you mean `agents.count`?";
    refuses(SMALL, &[set("agents.cuont", 1)], cuont);
    refuses(SMALL, &[set("seed.x", 1)], "--set seed.x: `seed` in `seed.x` is not a table");
    let pace = "execution.rtf = \"fast\": expected a number, 0.001 to 1e6, or \"max\"";
    refuses(SMALL, &[set("execution.rtf", "fast")], &format!("--set execution.rtf: {pace}"));
    let rtf = format!("{SMALL}[execution]\nrtf = \"fast\"\n");
    refuses(&rtf, &[], &format!("s.toml:9:7: {pace}"));
    let size = "expected a number of cells from 1 to 1024, or three such as [100, 80, 30]";
    refuses(&SMALL.replace("50", "-3"), &[], &format!("s.toml:5:8: map.size = -3: {size}"));
    refuses(SMALL, &[set("map.size", "big")], &format!("--set map.size: map.size = \"big\": {size}"));
    refuses(&format!("spawn = \"foo\"\n{SMALL}"), &[], "s.toml:1:9: spawn = \"foo\": expected a table");
    refuses(
        &format!("spawn = \"foo\"\n{SMALL}"),
        &[],
        "{ kind = \"nearest_origin\" } or { kind = \"list\", poses = [...] }",
    );
    let kinds =
        "--set spawn.kind: spawn.kind = \"foo\": expected \"nearest_origin\", \"list\", \"scattered\", \"box\" or";
    refuses(SMALL, &[set("spawn.kind", "foo")], kinds);
    for seed in ["9223372036854775808", "-1", "1.5"] {
        refuses(&SMALL.replace("seed = 7", &format!("seed = {seed}")), &[], "0 to 9223372036854775807");
        refuses(SMALL, &[set("seed", seed)], "0 to 9223372036854775807");
        refuses(SMALL, &[set("map.seed", seed)], "0 to 9223372036854775807");
    }
    refuses(
        SMALL,
        &[set("body.radius_m", 20.0)],
        "body.radius_m = 20: expected at least a thousandth of a cell and at most the length of 16 cells",
    );
    refuses(SMALL, &[set("body.speed_max_m_s", 60.0)], "body.speed_max_m_s = 60: expected at most one cell in a tick");
    refuses(SMALL, &[set("body.radius_m", 1e-9)], "body.radius_m = 0.000000001");
    refuses(SMALL, &[set("execution.rtf", 1e-300)], "execution.rtf");
    refuses(SMALL, &[set("spawn.kind", "nearest_origin"), set("spawn.yaw_rad", f64::NAN)], "spawn.yaw_rad = NaN");
    refuses(SMALL, &[set("lidar.fov_rad", 7.0)], "lidar.fov_rad = 7");
    refuses(SMALL, &[set("views.max_hz", 0.0)], "views.max_hz = 0: expected 0.1 to 1000");
    refuses(SMALL, &[set("views.odom_period_ticks", 0)], "views.odom_period_ticks = 0: expected at least 1");
    refuses(
        SMALL,
        &[set("views.record", vec!["tf"])],
        "views.record = [\"tf\"]: expected a list of the words \"tf_static\", \"odom\"",
    );
    refuses(SMALL, &[set("lidar.range_m", f64::NAN)], "lidar.range_m = NaN");
    refuses(
        SMALL,
        &[set("map.file", "x.m3dm")],
        "--set map.file: map.file = x.m3dm: only a map of kind \"file\" has a file",
    );
    let of_file = SMALL.replace("\"spheres\"", "\"file\"\nfile = \"x.m3dm\"");
    refuses(&of_file, &[], "s.toml:6: map.size = [50, 50, 50]: a map from a file has the size of the file");
    let with_size = [set("map.kind", "file"), set("map.file", "x.m3dm"), set("map.size", 50)];
    refuses(SMALL, &with_size, "--set map.size: map.size = [50, 50, 50]: a map from a file has the size of the file");
}

#[test]
fn texts_and_their_tables_are_bounded() {
    let long = format!("{SMALL}#{}", " ".repeat(SCENARIO_BYTES_MAX));
    let bytes = format!("s.toml:1:1: {} bytes: expected a scenario of at most 1048576 bytes", long.len());
    refuses(&long, &[], &bytes);
    for part in ["{}, ", "[0], ", "{ a.b.c = 1 }, "] {
        let many =
            format!("{SMALL}[agents.set]\nx = [{}]\n", part.repeat(TABLES_MAX / part.matches(['{', '[', '.']).count()));
        refuses(&many, &[], "of the characters { [ and . that begin them: expected a scenario with at most 131072");
    }
    let some = format!("{SMALL}[agents.set]\nx = [{}]\n", "[0], ".repeat(10_000));
    Scenario::parse("s.toml", &some, &[]).unwrap();
}

#[test]
fn flags_may_be_legal_only_together() {
    let poses = toml::Value::from(vec![vec![1.0, 2.0, 3.0]]);
    let together = [set("spawn.kind", "list"), set("spawn.poses", poses), set("agents.count", 1)];
    Scenario::parse("s.toml", SMALL, &together).unwrap();
    let two = [set("seed", 1), set("agents.cuont", 1), set("map.size", 30), set("lidar.rang_m", 1)];
    refuses(SMALL, &two, "--set agents.cuont: unknown key `agents.cuont`");
}

#[test]
fn errors_name_the_origin_of_a_value() {
    let text = format!("{SMALL}[lidar]\nrange_m = -1.0\n");
    refuses(&text, &[], "s.toml:9: lidar.range_m = -1: expected a number above 0, or inf");
    refuses(&text, &[set("lidar.range_m", -3)], "--set lidar.range_m: lidar.range_m = -3: expected a number above 0");
    let table: toml::Table = toml::from_str("range_m = -2").unwrap();
    refuses(&text, &[set("lidar", table), set("agents.count", 2)], "--set lidar: lidar.range_m = -2");
    assert_eq!(Scenario::parse("s.toml", &text, &[set("lidar.range_m", 3)]).unwrap().lidar.unwrap().range_m, 3.0);
    let inline = SMALL.replace("[agents]\ncount = 3\n", "") + "[agents]\nset = { x = 1 }\n\ncount = 0";
    refuses(&inline, &[], "s.toml:9: agents.count = 0");
    refuses(
        SMALL,
        &[set("map.kind", "file"), Override { value: None, ..set("map.size", 0) }],
        "--set map.kind: map.file",
    );
}

#[test]
fn misspelt_names_get_a_suggestion() {
    let did_you_mean = |key: &str, value: toml::Value, meant: &str| {
        refuses(SMALL, &[set(key, value)], &format!("did you mean {meant}?"));
    };
    did_you_mean("lidar.rang_m", 3.into(), "`lidar.range_m`");
    did_you_mean("lidra.range_m", 3.into(), "`lidar`");
    did_you_mean("max_hz", 3.into(), "`views.max_hz`");
    did_you_mean("map.kind", "noize".into(), "\"noise\"");
    did_you_mean("views.record", vec!["odom", "pointss"].into(), "\"points\"");
    let all = "unknown key `faults.x`; expected one of `on_agent_loss`";
    refuses(SMALL, &[set("faults.x", 1)], all);
}

#[test]
fn a_body_that_is_not_described_is_that_of_its_kind() {
    assert_eq!(Scenario::parse("s.toml", SMALL, &[]).unwrap().body, BodyModel::SUBMARINE);
    let aerial =
        Scenario::parse("s.toml", &format!("{SMALL}[body]\nkind = \"aerial\"\nradius_m = 0.3\n"), &[]).unwrap();
    assert_eq!(aerial.body, BodyModel { radius_m: 0.3, ..BodyModel::AERIAL });
}

const MIXED: &str = "[body]\nradius_m = 0.3\nspeed_max_m_s = 1.0\n\
                     [[bodies]]\nagents = [2]\nspeed_max_m_s = 2.0\n[[bodies]]\nagents = [0]\nkind = \"aerial\"\n";

#[test]
fn a_team_can_be_mixed() {
    let scenario = Scenario::parse("s.toml", &format!("{SMALL}{MIXED}"), &[]).unwrap();
    let faster = BodyModel { radius_m: 0.3, speed_max_m_s: 2.0, ..BodyModel::SUBMARINE };
    let others = [(AgentId(0), BodyModel::AERIAL), (AgentId(2), faster)];
    assert_eq!(scenario.other_bodies(), others.into());
    let radii_m: Vec<f64> = scenario.bodies_by_agent().iter().map(|body| body.radius_m).collect();
    assert_eq!(radii_m, [0.4, 0.3, 0.3]);
    assert_eq!(Scenario::parse("identity", &scenario.identity(), &[]).unwrap(), scenario);
    let submarines = format!("{SMALL}[body]\nkind = \"aerial\"\n[[bodies]]\nagents = [1]\nkind = \"submarine\"\n");
    let scenario = Scenario::parse("s.toml", &submarines, &[]).unwrap();
    assert_eq!(scenario.other_bodies(), [(AgentId(1), BodyModel::SUBMARINE)].into());
    assert_eq!(Scenario::parse("identity", &scenario.identity(), &[]).unwrap(), scenario);
}

#[test]
fn the_identity_of_a_team_of_submarines_does_not_speak_of_kinds() {
    let identity = Scenario::parse("s.toml", SMALL, &[]).unwrap().identity();
    assert!(!identity.contains("bodies"), "{identity}");
    assert_eq!(identity.matches("kind").count(), 2, "of the map and of the starts: {identity}");
}

#[test]
fn mistakes_in_bodies_are_named_with_their_entry() {
    let with = |entries: &str| format!("{SMALL}{entries}");
    let entry = |keys: &str| with(&format!("[[bodies]]\nagents = [0]\n[[bodies]]\n{keys}\n"));
    refuses(&entry("radius_m = 0.3"), &[], "s.toml:10:1: missing key `bodies[1].agents`: expected a list of ids");
    refuses(
        &entry("agents = [1]\nsize = 3"),
        &[],
        "s.toml:12:1: unknown key `bodies[1].size`; did you mean `map.size`?",
    );
    let boat = "s.toml:12:8: bodies[1].kind = \"boat\": expected \"submarine\", \"aerial\" or \"ground\"";
    refuses(&entry("agents = [1]\nkind = \"boat\""), &[], boat);
    refuses(&entry("agents = [-1]"), &[], "s.toml:11:10: bodies[1].agents = [-1]: expected a list of ids of agents");
    refuses(&entry("agents = []"), &[], "s.toml:11: bodies[1].agents = []: expected at least one id of an agent");
    refuses(&entry("agents = [3]"), &[], "bodies[1].agents = 3: expected ids of agents, 0 to 2");
    refuses(&entry("agents = [1, 0]"), &[], "bodies[1].agents = 0: expected each agent once, and it is in bodies[0]");
    refuses(&entry("agents = [1]\nradius_m = 20"), &[], "bodies[1].radius_m = 20: expected at least a thousandth");
    refuses(
        &entry("agents = [1]\nacceleration_m_s2 = 0"),
        &[],
        "s.toml:12: bodies[1].acceleration_m_s2 = 0: expected a number above 0",
    );
    refuses(
        &with("[body]\nagents = [0]\n"),
        &[],
        "s.toml:9:1: unknown key `body.agents`; did you mean `bodies.agents`?",
    );
    refuses(
        &with(&"[[bodies]]\nagents = [0]\n".repeat(256)),
        &[],
        "s.toml:8: bodies = 256 entries: expected at most 255",
    );
}

#[test]
fn communication_and_sensors_are_checked_and_stand_in_the_identity_only_if_they_are_given() {
    let plain = Scenario::parse("s.toml", SMALL, &[]).unwrap();
    let identity = plain.identity();
    assert!(identity.contains("[communication]\nrange_m = inf\n\n"), "{identity}");
    assert!(!identity.contains("sensor") && !identity.contains("relays"), "{identity}");
    let keys = [
        set("communication.model", "attenuated"),
        set("communication.loss", 0.5),
        set("communication.bytes_per_s", 1e4),
        set("communication.attenuation.tx_dbm", -10.0),
        set("communication.relays.per_agent", 3),
        set("sensor.pose_bound_m", 0.5),
    ];
    let radios = Scenario::parse("s.toml", SMALL, &keys).unwrap();
    assert_eq!(Scenario::parse("identity", &radios.identity(), &[]).unwrap(), radios);
    assert_eq!(radios.sensor.errors(7).pose_step_m, 0.05);
    assert_eq!(radios.communication.message().relays_per_agent, 3);
    let refused = [
        (vec![set("communication.loss", 1.5)], "communication.loss = 1.5: expected 0 to 1"),
        (vec![set("communication.loss", f64::NAN)], "communication.loss = NaN"),
        (vec![set("communication.bytes_per_s", 0.0)], "communication.bytes_per_s = 0: expected at least 1, or inf"),
        (vec![set("communication.queue_bytes", 100)], "communication.queue_bytes = 100: expected 114688"),
        (
            vec![set("communication.relays.per_agent", 1025)],
            "communication.relays.per_agent = 1025: expected 0 to 1024",
        ),
        (vec![set("communication.relays.read_range_m", -1.0)], "communication.relays.read_range_m = -1"),
        (vec![set("communication.attenuation.free_exponent", 0.0)], "communication.attenuation.free_exponent = 0"),
        (vec![set("communication.attenuation.reference_m", 0.0)], "communication.attenuation.reference_m = 0"),
        (
            vec![set("communication.model", "radio")],
            "communication.model = \"radio\": expected \"line_of_sight\", \"range\"",
        ),
        (
            vec![set("communication.model", "global"), set("communication.range_m", 5.0)],
            "communication.range_m = 5: the models",
        ),
        (vec![set("sensor.missed_returns", -0.1)], "sensor.missed_returns = -0.1: expected 0 to 1"),
        (vec![set("sensor.range_sigma_m", f64::INFINITY)], "sensor.range_sigma_m = inf: expected 0 to 1e6"),
    ];
    for (keys, reason) in refused {
        refuses(SMALL, &keys, reason);
    }
}
