use std::fs;
use std::path::Path;

use sim_server::session::NullObserver;
use sim_server::verify;

use super::*;

/// The digest of a run on a map file, with more keys of the map.
fn digest(map: &str, keys: &str) -> String {
    let text = format!(
        "seed = 3\nduration_s = 3.0\nmap = {{ kind = \"file\", file = {map:?}{keys} }}\nagents = {{ count = 1 }}\n"
    );
    let scenario = Scenario::parse("s.toml", &text, &[]).unwrap();
    let run = run(&scenario, &AgentOptions::default(), &mut NullObserver, &AtomicBool::new(false));
    run.unwrap().outcome.digest.to_string()
}

#[test]
fn digest_depends_on_the_map_and_not_on_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let spec = mapgen::MapSpec::Noise(mapgen::NoiseSpec::default());
    let make = |seed| mapgen::generate(&spec, voxels::Extent::new([16; 3], 1.0).unwrap(), seed).unwrap().terrain;
    let map = make(1);
    fs::create_dir(at("below")).unwrap();
    fs::write(at("plain.m3dm"), voxels::m3dm::write(&map).unwrap()).unwrap();
    fs::write(at("packed.m3dm"), voxels::packed::write(&map)).unwrap();
    fs::write(at("drawn.txt"), map.to_text()).unwrap();
    fs::write(at("other.m3dm"), voxels::m3dm::write(&make(2)).unwrap()).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(at("plain.m3dm"), at("below/link.m3dm")).unwrap();
    #[cfg(not(unix))]
    fs::copy(at("plain.m3dm"), at("below/link.m3dm")).unwrap();
    let path = |name: &str| at(name).display().to_string();
    let here = digest(&path("plain.m3dm"), "");
    for name in ["./plain.m3dm", "below/../plain.m3dm", "below/link.m3dm", "packed.m3dm", "drawn.txt"] {
        assert_eq!(digest(&path(name), ""), here, "{name}");
    }
    let up = "../".repeat(std::env::current_dir().unwrap().components().count());
    let relative = format!("{up}{}", path("plain.m3dm").trim_start_matches('/'));
    assert!(Path::new(&relative).is_relative());
    assert_eq!(digest(&relative, ", import = { cells_max = 99999 }"), here);
    assert_ne!(digest(&path("other.m3dm"), ""), here);
    assert_ne!(digest(&path("plain.m3dm"), ", cell_m = 2.0"), here);
}

#[test]
fn recording_verifies_without_its_map_file() {
    let folder = tempfile::tempdir().unwrap();
    let (map, record) = (folder.path().join("map.txt"), folder.path().join("run.mcap"));
    let [wall, room] =
        [["#####\n"; 5], ["#####\n", "#...#\n", "#...#\n", "#...#\n", "#####\n"]].map(|rows| rows.concat());
    fs::write(&map, [&wall, &room, &room, &room, &wall].map(String::as_str).join("\n")).unwrap();
    let text = format!(
        "seed = 3\nduration_s = 2.0\nmap = {{ kind = \"file\", file = {:?} }}\nagents = {{ count = 1 }}\n\
         execution = {{ record = {:?} }}\n",
        map.display().to_string(),
        record.display().to_string()
    );
    let scenario = Scenario::parse("s.toml", &text, &[]).unwrap();
    run(&scenario, &AgentOptions::default(), &mut NullObserver, &AtomicBool::new(false)).unwrap();
    fs::rename(&map, folder.path().join("elsewhere.txt")).unwrap();
    verify::verify(&Recording::open(&record).unwrap()).unwrap();
}
