//! Wrong input, and what the command answers: one line that says what is wrong, where, and what to
//! do, in the words of the user. Each row is executed by the built program.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const PLAN: &str = "seeds = \"1..2\"\n[axes]\n\"agents.controller\" = [\"rbw\", \"lvd\"]\n[scenario]\nduration_s = 5.0\n\
                    map = { kind = \"spheres\", size = 24 }\nagents = { count = 1 }\n";

const SCENARIO: &str = "seed = 1\nduration_s = 5.0\n[map]\nkind = \"spheres\"\nsize = 24\n[agents]\ncount = 1\n";

/// Command line, exit code, and what the answer has in it.
const ANSWERS: &[(&str, u8, &[&str])] = &[
    // Numbers and times.
    ("run --agents five", 2, &["--agents five: expected an integer, 1 to 1000"]),
    ("run --agents 2.5", 2, &["--agents 2.5: expected an integer, 1 to 1000"]),
    ("run --agents -1", 2, &["--agents -1: expected an integer, 1 to 1000"]),
    ("run --agents 99999999999", 2, &["--agents 99999999999: expected an integer, 1 to 1000"]),
    ("run --agents 0", 2, &["--agents 0", "expected 1 to 1000"]),
    ("run --agents 1001", 2, &["--agents 1001", "expected 1 to 1000"]),
    ("run --agents", 2, &["--agents needs a value"]),
    ("run --seed x", 2, &["--seed x: expected a seed from 0 to 9223372036854775807"]),
    ("run --seed -1", 2, &["--seed -1: expected a seed from 0 to 9223372036854775807"]),
    ("run --duration soon", 2, &["--duration soon: expected a time", "30min", "1:30"]),
    ("run --duration 1:5", 2, &["--duration 1:5: expected a time"]),
    ("run --duration 3days", 2, &["--duration 3days: expected a time"]),
    ("run --duration -5", 2, &["--duration -5", "duration_s", "expected"]),
    ("run --threads many", 2, &["--threads many: expected an integer, 0 to 1024"]),
    ("run --rtf fast", 2, &["--rtf fast: expected a number or max"]),
    ("run --look-ahead maybe", 2, &["--look-ahead maybe: expected true or false"]),
    ("snapshot a.mcap --at noon --out a.png", 2, &["--at noon: expected a time"]),
    ("batch plan.toml --out o --jobs 0", 2, &["--jobs 0: expected a whole number from 1"]),
    ("batch plan.toml --out o --jobs two", 2, &["--jobs two: expected a whole number"]),
    ("batch plan.toml --out o --first-domain 200", 2, &["--first-domain 200: expected a whole number from 0 to 101"]),
    ("batch plan.toml --out o --part 2/2", 2, &["--part 2/2: expected K/N"]),
    ("replay a.mcap --rate -1", 2, &["--rate -1: expected max (as fast as possible), or a number"]),
    ("map check small.txt --radius-m -1", 2, &["--radius-m -1: allowed is above 0 to 16 m"]),
    ("faults --seeds -1", 2, &["--seeds -1: expected a whole number"]),
    ("faults --seeds 0", 2, &["--seeds 0: expected a whole number from 1"]),
    // Names.
    ("rnu", 2, &["no command \"rnu\"; did you mean `run`?"]),
    ("batsh plan.toml", 2, &["no command \"batsh\"; did you mean `batch`?"]),
    ("map chek a.m3dm", 2, &["no command \"chek\"; did you mean `check`? (`maes map --help` lists all)"]),
    ("run --controller dspv", 2, &["controller dspv: unknown", "did you mean `dsvp`?"]),
    ("run --set lidar.rang_m=3", 2, &["--set lidar.rang_m=3: unknown key `lidar.rang_m`"]),
    ("run --set lidar.range_m=far", 2, &["--set lidar.range_m=far", "lidar.range_m"]),
    ("run --set lidar", 2, &["--set lidar: expected KEY=VALUE"]),
    ("run --set =20", 2, &["--set =20: expected KEY=VALUE"]),
    ("run --agent-set speed", 2, &["--agent-set speed: expected KEY=VALUE"]),
    ("run --transport tcp", 2, &["--transport tcp: expected ros2 or memory"]),
    ("run --order reversed", 2, &["--order reversed: expected forward, reverse or shuffle; did you mean reverse?"]),
    ("completions tcsh", 2, &["tcsh", "expected bash"]),
    // Maps.
    ("run --map nofile.m3dm", 2, &["nofile.m3dm", "expected spheres, noise, building, mine, scene, or a map file"]),
    (
        "run --transport memory --map .",
        2,
        &["error: --map .: a folder without .png files; expected one for each layer"],
    ),
    ("run --map=", 2, &["--map is empty; expected spheres, noise, building, mine, scene, or a map file"]),
    ("run --map cave", 2, &["cave", "expected spheres, noise, building, mine, scene, or a map file"]),
    (
        "run --size 12",
        2,
        &["--size 12: map.spheres: radius_max is 8, allowed is 3 to 4", "--set map.spheres.radius_max=VALUE"],
    ),
    ("run --map sphere --size 20", 2, &["--map sphere: map.kind = \"sphere\"", "did you mean \"spheres\"?"]),
    (
        "bench schedule nofolder",
        2,
        &["nofolder: no folder; expected that of `maes bench exploration-1 --out` or `maes bench exploration-2 --out`"],
    ),
    ("run --size 3x4", 2, &["--size 3x4: expected a number of cells, or three joined by x"]),
    ("run --size 5000", 2, &["--size 5000", "map.size"]),
    ("run --size -3", 2, &["--size -3: expected a number of cells"]),
    ("info bag", 2, &["bag", "SQLite (bag_0.db3)", "rosbags-convert"]),
    ("verify bag/bag_0.db3", 2, &["bag_0.db3", "SQLite", "rosbags-convert"]),
    ("batch tight.toml --out o", 2, &["tight.toml:3: map.spheres: radius_max is 8, allowed is 3 to "]),
    ("map info nofile.m3dm", 2, &["nofile.m3dm: cannot be read: No such file or directory"]),
    ("map check small.txt --agents 50", 1, &["small.txt: 50 agents of radius 0.4 m find no starts"]),
    ("map check small.txt --radius-m 0", 2, &["--radius-m 0: allowed is above 0"]),
    // Files of another kind.
    ("run plan.toml", 2, &["plan.toml: a plan of many runs", "maes batch plan.toml --out DIR"]),
    ("batch scenario.toml --out o", 2, &["scenario.toml: a scenario of one run", "maes run scenario.toml"]),
    ("run nofile.toml", 2, &["nofile.toml: No such file or directory"]),
    ("run --record run.bag", 2, &["--record run.bag: expected a name that ends in .mcap"]),
    ("run --profile trace.txt", 2, &["--profile trace.txt: expected a name that ends in .json"]),
    ("view nofile.mcap", 2, &["nofile.mcap: no such file; expected a recording (.mcap), a map or a scenario (.toml)"]),
    ("verify scenario.toml", 2, &["scenario.toml"]),
    ("info nofile.mcap", 2, &["nofile.mcap: No such file or directory"]),
    ("report nofolder", 2, &["nofolder: no folder of a plan", "maes batch"]),
    ("report .", 2, &["no folder of a plan", "maes batch"]),
    ("merge nofolder --out o", 2, &["nofolder"]),
    ("snapshot a.mcap --at 1 --out a.jpg", 2, &["--out a.jpg: expected a name that ends in .png"]),
    // Flags that do not fit.
    ("run a.toml b.toml", 2, &["unexpected argument: b.toml"]),
    ("run --together", 2, &["--together: only with --transport memory"]),
    ("run --transport memory --view", 2, &["--view: runs over memory cannot be observed"]),
    ("run --external two", 2, &["--external two: expected ids of agents, such as 0,3"]),
    ("batch late.toml --out o", 2, &["late.toml:2: primary = \"time\": expected one of \"area\", \"time-90\""]),
];

/// Words of a compiler's library, which say nothing to a user.
const NOT_HUMAN: [&str; 6] =
    ["invalid digit", "invalid float", "os error", "panicked", "RUST_BACKTRACE", "called `Option"];

fn answer(folder: &Path, line: &str) -> Output {
    let mut maes = Command::new(env!("CARGO_BIN_EXE_maes"));
    maes.args(line.split(' ')).current_dir(folder).env("ROS_DOMAIN_ID", "231");
    maes.output().expect("the program starts")
}

/// The files that the command lines name.
fn site() -> tempfile::TempDir {
    let site = tempfile::tempdir().expect("a temporary folder");
    let solid = "######\n".repeat(6);
    let layer = format!("######\n{}######\n", "#....#\n".repeat(4));
    let late = format!("seeds = [1]\nprimary = \"time\"\n{}", &PLAN[PLAN.find("[axes]").expect("axes")..]);
    fs::create_dir(site.path().join("bag")).expect("a new folder");
    let tight = PLAN.replace("[axes]\n", "[axes]\n\"map.size\" = [24, 14]\n");
    for (name, text) in [
        ("bag/bag_0.db3", String::new()),
        ("tight.toml", tight),
        ("plan.toml", PLAN.to_owned()),
        ("late.toml", late),
        ("scenario.toml", SCENARIO.to_owned()),
        ("small.txt", format!("{solid}\n{layer}\n{layer}\n{solid}")),
    ] {
        fs::write(site.path().join(name), text).expect("a new file");
    }
    site
}

#[test]
fn wrong_input_gets_one_line_in_human_words() {
    let site = site();
    let mut wrong = Vec::new();
    for (line, code, expected) in ANSWERS {
        let Output { status, stderr, .. } = answer(site.path(), line);
        let said = String::from_utf8_lossy(&stderr);
        let errors: Vec<&str> = said.lines().filter(|line| line.starts_with("error: ")).collect();
        let is_human = !NOT_HUMAN.iter().any(|word| said.contains(word));
        let is_said = errors.len() == 1 && expected.iter().all(|part| errors[0].contains(part));
        if status.code() != Some(i32::from(*code)) || !is_said || !is_human {
            wrong.push(format!("maes {line}\n  {:?}, expected {code} and {expected:?}\n  {said}", status.code()));
        }
    }
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), ANSWERS.len(), wrong.join("\n"));
}

#[test]
fn reader_that_has_enough_is_no_failure() {
    let script = format!("{:?} completions bash | head -n 1", env!("CARGO_BIN_EXE_maes"));
    let output =
        Command::new("bash").args(["-c", &format!("set -o pipefail; {script}")]).output().expect("bash starts");
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
}

#[test]
fn a_controller_that_cannot_be_written_leaves_nothing() {
    let site = site();
    let limited = "trap '' XFSZ; ulimit -f 0; exec \"$@\"";
    let mut command = Command::new("bash");
    command
        .args(["-c", limited, "bash", env!("CARGO_BIN_EXE_maes"), "new", "own", "--python"])
        .current_dir(site.path());
    let refused = command.output().unwrap();
    let words = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!((refused.status.code(), words.starts_with("error: own: ")), (Some(1), true), "{words}");
    assert!(!site.path().join("own").exists());
}
