use std::f64::consts::TAU;

use super::*;

const TEXT: &str = "seed = 1\nduration_s = 1.0\nmap = { kind = \"spheres\", size = 20 }\nagents = { count = 3 }\n";

fn parse(lidars: &str) -> Result<Scenario, String> {
    Scenario::parse("s.toml", &format!("{TEXT}{lidars}\n"), &[]).map_err(|error| error.to_string())
}

fn refused(lidars: &str) -> String {
    parse(lidars).unwrap_err()
}

/// Entries, each with these keys beside its name.
fn entries(keys: &[&str]) -> String {
    let entry = |(number, keys): (usize, &&str)| format!("{{ name = \"s{number}\", {keys} }}");
    format!("lidars = [{}]", keys.iter().enumerate().map(entry).collect::<Vec<_>>().join(", "))
}

#[test]
fn identity_is_read_as_the_same_scenario() {
    let text =
        entries(&["preset = \"vlp-16\", mount_height_m = 0.1", "pattern = \"frustum\", agents = [0, 2]", "rays = 100"]);
    let scenario = parse(&text).unwrap();
    let identity = scenario.identity();
    assert!(!identity.contains("[lidar]") && identity.contains("[[lidars]]") && !identity.contains("preset"));
    assert_eq!(Scenario::parse("identity", &identity, &[]).unwrap(), scenario, "{identity}");
    assert!(!parse("").unwrap().identity().contains("lidars"));
}

#[test]
fn agents_have_their_entries_in_order() {
    let scenario = parse(&entries(&["preset = \"vlp-16\"", "pattern = \"frustum\", agents = [0, 2]"])).unwrap();
    let names = |agent| {
        let names = scenario.lidars_of(AgentId(agent)).map(|(name, _)| name.unwrap().to_string());
        names.collect::<Vec<_>>()
    };
    assert_eq!((names(0), names(1), names(2)), (vec!["s0".into(), "s1".into()], vec!["s0".into()], names(0)));
    let (first, others) = scenario.sensors();
    assert_eq!((first.rays(), others.len(), others[&AgentId(1)].rays()), (28800 + 4800, 1, 28800));
    let only = parse("lidar = { rays = 9 }").unwrap();
    assert_eq!(only.lidars_of(AgentId(2)).map(|(name, lidar)| (name, lidar.rays)).collect::<Vec<_>>(), [(None, 9)]);
    assert!(only.sensors().1.is_empty());
}

#[test]
fn one_name_may_stand_for_lidars_of_different_agents() {
    let both = "lidars = [{ name = \"eye\", agents = [0] }, { name = \"eye\", agents = [1, 2], rays = 9 }]";
    let (first, others) = parse(both).unwrap().sensors();
    assert_eq!((first.rays(), others.len()), (5124, 2));
    assert_eq!(others[&AgentId(1)], others[&AgentId(2)]);
    let twice = refused("lidars = [{ name = \"eye\" }, { name = \"eye\", agents = [1, 2] }]");
    assert_eq!(
        twice,
        "s.toml:5: lidars[1].name = \"eye\": expected another name, as agent 1 has that of lidars[0] already"
    );
}

#[test]
fn lidars_scan_together() {
    let scenario = parse(&entries(&["period_ticks = 5", "fov_rad = 2.0, period_ticks = 5"])).unwrap();
    assert_eq!(scenario.scan_timing(), ScanTiming { schedule: LidarSchedule::OnRequest, period_ticks: 5 });
    assert_eq!(scenario.lidars().map(|(_, lidar)| lidar.fov_rad).collect::<Vec<_>>(), [TAU, 2.0]);
    let periods = refused(&entries(&["period_ticks = 5", "rays = 9"]));
    assert!(periods.ends_with("lidars[1].period_ticks = 10: expected 5, as lidars[0] has: LiDARs scan together"));
    let schedules = refused(&entries(&["rays = 9", "schedule = \"maes3d\""]));
    assert!(schedules.contains("lidars[1].schedule = \"maes3d\": expected that of lidars[0]"), "{schedules}");
}

#[test]
fn mistakes_are_named_with_their_entry() {
    let cases = [
        ("lidars = []".to_owned(), "s.toml:5: lidars = 0 entries: expected 1 to 64 entries, or [lidar] instead"),
        (
            "lidar = { rays = 9 }\nlidars = [{ name = \"a\" }]".to_owned(),
            "s.toml:6: lidars = 1 entries: expected [lidar] or [[lidars]], not both",
        ),
        ("[[lidars]]\nrays = 9".to_owned(), "s.toml:5:1: missing key `lidars[0].name`: expected a text in quotes"),
        ("[[lidars]]\nname = 3".to_owned(), "s.toml:6:8: lidars[0].name = 3: expected a text in quotes"),
        (
            "[[lidars]]\nname = \"Front\"".to_owned(),
            "an entry of `lidars`: name = \"Front\": expected a to z first, then a to z, 0 to 9 and single \"_\" not at \
             the end, up to 32 characters; not base_link, map, odom or ..._optical_frame",
        ),
        (
            "[[lidars]]\nname = \"a\"\nrayz = 9".to_owned(),
            "s.toml:7:1: unknown key `lidars[0].rayz`; did you mean `lidars.rays`?",
        ),
        (
            entries(&["rays = 9", "preset = \"vlp16\""]),
            "lidars[1].preset = \"vlp16\": expected \"vlp-16\", \"os1-64\", \"mid-360\" or \"depth-camera\"; did you mean \"vlp-16\"?",
        ),
        (
            entries(&["preset = \"vlp-16\", pattern = \"frustum\""]),
            "an entry of `lidars`: that of the name \"s0\" has the preset \"vlp-16\" and another pattern; expected no \
             pattern beside a preset",
        ),
        (entries(&["rays = 9", "rays = 0"]), "s.toml:5: lidars[1].rays = 0: expected 1 to 1e6"),
        (entries(&["agents = [3]"]), "s.toml:5: lidars[0].agents = 3: expected ids of agents, 0 to 2"),
        (entries(&["agents = [1, 1]"]), "s.toml:5: lidars[0].agents = 1: expected each agent once"),
        (
            entries(&["agents = [0, 2]"]),
            "s.toml:5: lidars = none of agent 1: expected at least one LiDAR of each agent: an entry without `agents` is \
             one of all",
        ),
        (
            entries(&["rays = 9", "rows = 9"]),
            "s.toml:5: lidars[1].rows = 9: expected only with lidars[1].pattern = \"ring\" or \"frustum\"",
        ),
        (
            entries(&["rays = 1000000", "rays = 100000"]),
            "s.toml:5: lidars = 1100000 rays: expected at most 1048576 rays of all entries together",
        ),
    ];
    for (text, expected) in cases {
        let refused = refused(&text);
        assert!(refused.contains(expected), "{text}\n{refused}\n{expected}");
    }
    let many: Vec<&str> = vec!["rays = 9"; 65];
    assert!(refused(&entries(&many)).contains("lidars = 65 entries: expected 1 to 64"));
    let team = format!("{}\n", entries(&many[..2])).replace('\n', "");
    let crowd = Scenario::parse("s.toml", &format!("{}{team}\n", TEXT.replace("count = 3", "count = 600")), &[]);
    assert!(crowd.unwrap_err().to_string().contains("lidars = 1200 LiDARs: expected at most 1024 LiDARs of all"));
}

#[test]
fn mounts_are_inside_of_the_bodies_that_have_them() {
    let small = "bodies = [{ agents = [2], radius_m = 0.2 }]";
    let entries = |agents: &str| {
        format!(
            "{small}\nlidars = [{{ name = \"a\" }}, {{ name = \"b\", preset = \"vlp-16\", mount_height_m = 0.3, agents = {agents} }}]"
        )
    };
    assert!(parse(&entries("[0, 1]")).is_ok());
    let high = refused(&entries("[1, 2]"));
    assert!(high.contains("lidars[1].mount_height_m = 0.3: expected less than the radius of the smallest body, 0.2 m"));
}
