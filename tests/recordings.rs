//! Recordings open with `rosbags`, `mcap` and `mcap-ros2-support` from PyPI, which the test
//! installs.
//!
//! `check_recording.py` checks their content, independently of this project's code.

use std::path::Path;

use sim_server::setup;
use voxels::Terrain;

use crate::look_ahead;
use crate::support::processes::Process;
use crate::support::python;
use crate::support::runs::{Site, scenario, text};

/// Fails unless `check_recording.py` accepts `file` as the recording of a run in a map with so many
/// free cells.
#[track_caller]
fn assert_opens(site: &Site, file: &Path, free_cells: u64) {
    let info = Process::start(site.binary("maes").arg("info").arg(file)).ended().with_code(0);
    let info_file = site.file("info.txt", &info.stdout);
    let metadata = Process::start(site.binary("maes").arg("info").arg(file).arg("--metadata")).ended().with_code(0);
    let metadata_file = site.file("metadata.yaml", &metadata.stdout);
    let mut check = site.command(python::for_recordings());
    check.arg(crate::support::root().join("tests/check_recording.py"));
    check.arg(file).arg(info_file).arg(metadata_file).arg(free_cells.to_string());
    let checked = Process::start(&mut check).ended();
    assert_eq!(checked.code, Some(0), "{checked}");
    assert!(checked.stdout.ends_with("all right"), "{checked}");
}

#[test]
fn ros_run_opens_in_python() {
    let site = Site::new();
    let file = site.path("run.mcap");
    let flags =
        ["--agents", "5", "--controller", "rbw", "--size", "50", "--seed", "7", "--duration", "300", "--record"];
    let run = site.start(&mut site.run_sh(&[&flags[..], &[text(&file)]].concat())).ended().with_code(0);
    let counted = run.stderr.lines().find_map(|line| line.strip_prefix("map seed 7: ")?.split_once(" free cells"));
    let (free_cells, _) = counted.expect("the server says what the map is like");
    assert_opens(&site, &file, free_cells.parse().expect("a number of cells"));
}

#[test]
fn communicating_run_opens_in_python() {
    let site = Site::new();
    let file = site.path("run.mcap");
    let scenario = look_ahead::record(file.clone());
    let (world, report) = setup::build(&scenario).expect("there is such a world");
    let free_cells = world.terrain().as_slice().iter().filter(|&&cell| cell == Terrain::Free).count();
    assert_eq!(report.free_cells, free_cells as u64, "the report counts the cells of the map");
    assert_opens(&site, &file, report.free_cells);
}

#[test]
fn reference_settings() {
    let site = Site::new();
    let file = site.path("run.mcap");
    let path = scenario("maes3d.toml");
    let flags = [text(&path), "--transport", "memory", "--duration", "60", "--record", text(&file)];
    let run = site.start(&mut site.run_sh(&flags)).ended().with_code(0);
    run.digest();
    let loaded = setup::load(&path, &[]).expect("the scenario is legal");
    let (_, report) = setup::build(&loaded).expect("there is such a world");
    assert_opens(&site, &file, report.free_cells);
}

#[test]
fn rosbag2_folder_is_taken_for_its_recording() {
    let site = Site::new();
    let (bag, file) = (site.path("night"), site.path("night/night_0.mcap"));
    let maes = |words: &[&str]| Process::start(site.binary("maes").args(words)).ended();
    let record = format!("{}/", text(&bag));
    let flags = ["--transport", "memory", "--agents", "2", "--size", "20", "--duration", "30"];
    let whole = ["--set", "stop_when_explored=false", "--record", &record];
    let run = maes(&[&["run"], &flags[..], &whole].concat()).with_code(0);
    for words in [&["info"][..], &["verify"], &["info", "--metadata"], &["scenario"]] {
        let of_folder = maes(&[words, &[text(&bag)]].concat()).with_code(0);
        let of_file = maes(&[words, &[text(&file)]].concat()).with_code(0);
        assert_eq!(of_folder.stdout, of_file.stdout, "{words:?}");
    }
    maes(&["diff", &record, text(&file)]).with_code(0);
    let again = maes(&["run", text(&bag), "--transport", "memory"]).with_code(0);
    assert_eq!(again.digest(), run.digest());
    maes(&["run", "--transport", "memory", "--fork", &record, "--at", "10"]).with_code(0);
    let recovered = site.path("whole.mcap");
    maes(&["recover", text(&bag), "-o", text(&recovered)]).with_code(0);
    maes(&["diff", text(&recovered), text(&bag)]).with_code(0);

    std::fs::copy(&file, site.path("night/night_1.mcap")).expect("the folder can be written to");
    let refused = maes(&["info", text(&bag)]).with_code(2);
    assert!(refused.stderr.contains("a folder with 2 recordings (night_0.mcap, night_1.mcap)"), "{refused}");
}
