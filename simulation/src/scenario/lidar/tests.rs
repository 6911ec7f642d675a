use std::f64::consts::PI;

use super::*;

const TEXT: &str = "seed = 1\nduration_s = 1.0\nmap = { kind = \"spheres\", size = 20 }\nagents = { count = 2 }\n";

fn parse(lidar: &str) -> Result<Scenario, String> {
    Scenario::parse("s.toml", &format!("{TEXT}lidar = {{ {lidar} }}\n"), &[]).map_err(|error| error.to_string())
}

#[test]
fn identity_has_the_keys_of_the_pattern_alone() {
    let lattice = parse("range_m = 5.0").unwrap().identity();
    assert!(!lattice.contains("horizontal_rad") && !lattice.contains("mount") && !lattice.contains("min_range_m"));
    assert!(!lattice.contains("sees_agents"));
    assert!(parse("sees_agents = true").unwrap().identity().contains("sees_agents = true"));
    for lidar in ["preset = \"vlp-16\"", "pattern = \"frustum\"", "preset = \"mid-360\", mount_height_m = 0.1"] {
        let scenario = parse(lidar).unwrap();
        let identity = scenario.identity();
        assert!(!identity.contains("preset") && identity.contains("horizontal_rad"), "{identity}");
        assert_eq!(Scenario::parse("identity", &identity, &[]).unwrap(), scenario, "{lidar}");
    }
}

#[test]
fn presets_stand_for_their_keys() {
    let preset = parse("preset = \"vlp-16\", columns = 900").unwrap().lidar.unwrap();
    assert_eq!((preset.pattern, preset.range_m), (LidarPattern::Ring, 100.0));
    assert_eq!((preset.grid.rows, preset.grid.columns), (Some(16), Some(900)));
    assert!((preset.grid.lowest_rad.unwrap() + PI / 12.0).abs() < 1e-12);
    let camera = parse("preset = \"depth-camera\"").unwrap();
    assert_eq!(camera, parse("pattern = \"frustum\"").unwrap());
    let camera = camera.lidar.unwrap();
    assert_eq!((camera.range_m, camera.scanner().rays()), (4.5, 4800));
    assert_eq!(parse("preset = \"os1-64\"").unwrap().lidar.unwrap().scanner().rays(), 65536);
}

#[test]
fn lines_may_have_elevations_of_their_own() {
    let scenario = parse("pattern = \"ring\", columns = 360, elevations_rad = [0.1, -0.4, 0.0]").unwrap();
    let lidar = scenario.lidar.as_ref().unwrap();
    assert_eq!((lidar.rays(), lidar.scanner().rays()), (3 * 360, 3 * 360));
    let view = lidar.scanner().field_of_view().unwrap();
    assert_eq!((view.lowest_rad, view.highest_rad, view.spacing_rad), (-0.4, 0.1, 0.4));
    let identity = scenario.identity();
    assert!(identity.contains("elevations_rad") && !identity.contains("rows"), "{identity}");
    assert_eq!(Scenario::parse("identity", &identity, &[]).unwrap(), scenario);
    // The order makes no difference, and those of a preset are replaced.
    assert_eq!(parse("pattern = \"ring\", columns = 360, elevations_rad = [-0.4, 0.0, 0.1]").unwrap(), scenario);
    let changed = parse("preset = \"os1-64\", elevations_rad = [-0.1, 0.1]").unwrap().lidar.unwrap();
    assert_eq!((changed.rays(), changed.range_m, changed.grid.lowest_rad), (2048, 120.0, None));
}

#[test]
fn impossible_values_are_named() {
    let refused = |lidar: &str| parse(lidar).unwrap_err();
    let other = refused("preset = \"vlp-16\", pattern = \"frustum\"");
    assert!(other.contains("lidar.preset = \"vlp-16\": not with the lidar.pattern"), "{other}");
    assert!(refused("preset = \"vlp16\"").contains("did you mean \"vlp-16\"?"));
    assert!(
        refused("rows = 9").ends_with("lidar.rows = 9: expected only with lidar.pattern = \"ring\" or \"frustum\"")
    );
    assert!(refused("pattern = \"ring\", vertical_rad = 1.0").contains("lidar.vertical_rad = 1: expected only with"));
    assert!(refused("pattern = \"frustum\", lowest_rad = 0.0").contains("lidar.lowest_rad = 0: expected only with"));
    assert!(
        refused("pattern = \"frustum\", fov_rad = 1.0").contains("lidar.fov_rad = 1: expected lidar.horizontal_rad")
    );
    assert!(refused("pattern = \"ring\", rays = 9").contains("lidar.rays = 9: expected only with"));
    assert!(refused("pattern = \"ring\", lowest_rad = 0.5").contains("lidar.highest_rad = 0.26"));
    assert!(refused("pattern = \"frustum\", horizontal_rad = 3.1").contains("lidar.horizontal_rad = 3.1: expected up"));
    assert!(refused("pattern = \"frustum\", min_range_m = 5.0").contains("less than lidar.range_m = 4.5"));
    let high = refused("pattern = \"frustum\", mount_height_m = -0.4");
    assert!(high.ends_with("the radius of the smallest body, 0.4 m, up or down"), "{high}");
    let lines = |lines: &str| refused(&format!("pattern = \"ring\", elevations_rad = [{lines}]"));
    let beside = refused("pattern = \"ring\", rows = 2, elevations_rad = [0.0, 0.1]");
    assert!(beside.contains("lidar.rows = 2: expected only without lidar.elevations_rad"), "{beside}");
    assert!(lines("").contains("lidar.elevations_rad = 0 elevations: expected 1 to 1024"));
    assert!(lines("0.0, 1.6").contains("lidar.elevations_rad = 1.6: expected elevations from -pi/2 to pi/2"));
    assert!(lines("nan").contains("lidar.elevations_rad = NaN: expected elevations from"));
    assert!(lines("0.1, 0.0, 0.1").contains("lidar.elevations_rad = 0.1: expected each elevation once"));
    assert!(lines("\"0\"").contains("expected a list of numbers (rad) such as [-0.1, 0.0]"));
    let camera = refused("pattern = \"frustum\", elevations_rad = [0.0]");
    assert!(
        camera.contains("lidar.elevations_rad = 1 elevations: expected only with lidar.pattern = \"ring\""),
        "{camera}"
    );
    let lines: Vec<String> = (0..300).map(|line| format!("{}", f64::from(line) * 0.005 - 0.7)).collect();
    let many = refused(&format!("pattern = \"ring\", columns = 8192, elevations_rad = [{}]", lines.join(", ")));
    assert!(many.contains("lidar.elevations_rad = 300 elevations: expected at most 1048576 rays"), "{many}");
    let many = refused("pattern = \"ring\", rows = 1024, columns = 2048");
    assert!(many.contains("lidar.rows = 1024: expected at most 1048576 rays"), "{many}");
}
