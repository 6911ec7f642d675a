//! Rules of the workspace that the compiler does not check.

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use sim_server::setup;
use simulation::scenario::Scenario;

use crate::support::binaries::cargo;
use crate::support::{python, root};

/// The folders of the crates whose code is delivered, each below those that use it.
pub(crate) const CRATES: [&str; 23] = [
    "voxels",
    "msgs",
    "protocol",
    "system",
    "ros_node",
    "mapgen",
    "map_files",
    "world",
    "simulation",
    "transport",
    "recording",
    "foxglove_server",
    "sim_server",
    "agent",
    "controllers",
    "agent_node",
    "in_memory",
    "supervisor",
    "statistics",
    "experiments",
    "report",
    "testing/fault_injection",
    "maes",
];

/// The crates of this workspace that each may name, as the code map in ARCHITECTURE.md draws them.
const USES: [(&str, &[&str]); 23] = [
    ("voxels", &[]),
    ("msgs", &[]),
    ("protocol", &["msgs", "voxels"]),
    ("system", &["msgs"]),
    ("ros_node", &["msgs", "protocol", "system"]),
    ("mapgen", &["voxels"]),
    ("map_files", &["mapgen", "voxels"]),
    ("world", &["mapgen", "msgs", "protocol", "voxels"]),
    ("simulation", &["mapgen", "msgs", "protocol", "voxels", "world"]),
    ("transport", &["msgs", "protocol", "simulation", "system"]),
    ("recording", &["map_files", "msgs", "simulation", "system", "transport", "voxels"]),
    ("foxglove_server", &["msgs", "recording", "simulation", "system", "transport"]),
    (
        "sim_server",
        &[
            "foxglove_server",
            "map_files",
            "mapgen",
            "msgs",
            "protocol",
            "recording",
            "ros_node",
            "simulation",
            "system",
            "transport",
            "voxels",
            "world",
        ],
    ),
    ("agent", &["msgs", "protocol", "voxels"]),
    ("controllers", &["agent", "msgs", "protocol", "voxels"]),
    ("agent_node", &["agent", "controllers", "msgs", "protocol", "ros_node", "system", "voxels"]),
    (
        "in_memory",
        &[
            "agent",
            "agent_node",
            "msgs",
            "protocol",
            "recording",
            "sim_server",
            "simulation",
            "system",
            "transport",
            "world",
        ],
    ),
    ("supervisor", &["protocol", "simulation", "system"]),
    ("statistics", &["voxels"]),
    (
        "experiments",
        &[
            "agent_node",
            "in_memory",
            "map_files",
            "mapgen",
            "msgs",
            "protocol",
            "recording",
            "sim_server",
            "simulation",
            "statistics",
            "supervisor",
            "system",
            "voxels",
            "world",
        ],
    ),
    ("report", &["agent_node", "experiments", "msgs", "recording", "simulation", "statistics", "voxels"]),
    (
        "testing/fault_injection",
        &[
            "agent_node",
            "in_memory",
            "msgs",
            "protocol",
            "recording",
            "ros_node",
            "sim_server",
            "simulation",
            "supervisor",
            "system",
            "transport",
            "voxels",
        ],
    ),
    (
        "maes",
        &[
            "agent_node",
            "experiments",
            "fault_injection",
            "foxglove_server",
            "in_memory",
            "map_files",
            "mapgen",
            "msgs",
            "protocol",
            "recording",
            "report",
            "ros_node",
            "sim_server",
            "simulation",
            "supervisor",
            "system",
            "voxels",
            "world",
        ],
    ),
];

/// Most lines of a file without its tests.
const LINES_MAX: usize = 600;

/// Most columns of a comment and of a line of a document.
const COLUMNS_MAX: usize = 100;

/// All files with this extension below a folder of the workspace, sorted.
pub(crate) fn files(folder: &str, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut open = vec![root().join(folder)];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display())) {
            let path = entry.expect("a folder can be listed").path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|found| found == extension) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

pub(crate) fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The documents: those of docs/, and those at the top of the workspace.
pub(crate) fn documents() -> Vec<PathBuf> {
    let tops = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md"];
    let tops = tops.into_iter().chain(["contrib/rustdds/README.md"]);
    files("docs", "md").into_iter().chain(tops.map(|top| root().join(top))).collect()
}

/// A path relative to the workspace.
pub(crate) fn name(path: &Path) -> String {
    path.strip_prefix(root()).unwrap_or(path).display().to_string()
}

/// Sources of a crate: without files of tests, and up to the first `cfg(test)` of a file.
pub(crate) fn sources(of: &str) -> Vec<(String, String)> {
    let is_code = |path: &PathBuf| path.file_name().is_some_and(|name| name != "tests.rs");
    let without_tests = |path: PathBuf| {
        let text = read(&path);
        let code = text.split("#[cfg(test)]").next().expect("a split has a first part").to_owned();
        (name(&path), code)
    };
    let found: Vec<_> = files(&format!("{of}/src"), "rs").into_iter().filter(is_code).map(without_tests).collect();
    assert!(!found.is_empty(), "{of} has sources");
    found
}

/// Names of the packages that a crate depends on, transitively.
fn dependencies(of: &str, flags: &[&str]) -> BTreeSet<String> {
    let mut tree = cargo();
    tree.args(["tree", "--locked", "-p", of, "-e", "normal,build", "--prefix", "none", "--format", "{p}"]).args(flags);
    let output = tree.output().expect("cargo runs");
    assert!(output.status.success(), "{tree:?}: {}", String::from_utf8_lossy(&output.stderr));
    let lines = String::from_utf8(output.stdout).expect("names of packages are texts");
    let names = lines.lines().filter_map(|line| line.split(' ').next()).filter(|name| *name != of);
    names.map(str::to_owned).collect()
}

#[test]
fn crates_that_say_something_are_shown() {
    let says_something = |of: &&str| {
        let manifest: toml::Table = read(&root().join(of).join("Cargo.toml")).parse().expect("a manifest is TOML");
        manifest.get("dependencies").and_then(|named| named.get("tracing")).is_some()
    };
    let found: BTreeSet<&str> = CRATES.into_iter().filter(says_something).collect();
    assert_eq!(found, system::diagnostics::OWN.into_iter().collect());
}

#[test]
fn dependencies_point_one_way() {
    assert_eq!(USES.map(|(of, _)| of), CRATES);
    for (place, (of, expected)) in USES.into_iter().enumerate() {
        let manifest: toml::Table = read(&root().join(of).join("Cargo.toml")).parse().expect("a manifest is TOML");
        let named = manifest.get("dependencies").and_then(toml::Value::as_table).expect("a table of dependencies");
        let crates = CRATES.map(|folder| folder.rsplit('/').next().unwrap_or(folder));
        let ours: BTreeSet<&str> = named.keys().map(String::as_str).filter(|name| crates.contains(name)).collect();
        assert_eq!(ours, expected.iter().copied().collect(), "{of}");
        assert!(ours.iter().all(|name| crates[..place].contains(name)), "{of} names only crates below it");
    }
}

#[test]
fn pure_core_links_no_decoder() {
    for of in ["mapgen", "protocol", "world", "simulation"] {
        let linked = dependencies(of, &[]);
        for decoder in ["png", "laz", "serde_json", "mcap", "map_files"] {
            assert!(!linked.contains(decoder), "{of} links {decoder}");
        }
    }
    assert!(dependencies("map_files", &[]).contains("png"));
}

/// Runs in memory, tests of controllers and whoever embeds them need neither.
#[test]
fn runs_in_memory_link_no_tables_and_no_pictures() {
    let linked = dependencies("in_memory", &[]);
    assert!(["parquet", "resvg", "experiments"].iter().all(|&heavy| !linked.contains(heavy)), "{linked:?}");
}

#[test]
fn only_binaries_depend_on_the_ros_client() {
    let knows = |of: &str, flags: &[&str]| dependencies(of, flags).contains("ros2-client");
    for binary in ["sim_server", "agent_node"] {
        assert!(knows(binary, &[]), "{binary} talks ROS 2");
        assert!(!knows(binary, &["--no-default-features"]), "the feature `ros` of {binary} can be left out");
    }
    let pure =
        ["voxels", "msgs", "protocol", "mapgen", "map_files", "world", "simulation", "transport", "recording", "agent"];
    for pure in pure.into_iter().chain(["controllers"]) {
        assert!(!knows(pure, &[]), "{pure} has no ROS client");
    }
    assert!(knows("ros_node", &[]));
}

#[test]
#[ignore = "checks all crates again, without ROS 2"]
fn libraries_build_without_the_ros_client() {
    let mut check = cargo();
    // With the foreign crates of the lints before (see `workspace_features`).
    let packages = ["-p", "sim_server", "-p", "agent_node", "-p", "workspace_features"];
    check.args(["check", "--release", "--lib", "--no-default-features"]).args(packages);
    let output = check.output().expect("cargo runs");
    assert!(output.status.success(), "{check:?}:\n{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn only_ros_node_names_the_ros_client() {
    let mut naming = BTreeSet::new();
    for (file, code) in CRATES.into_iter().flat_map(sources) {
        if code.contains("ros2_client") || code.contains("rustdds") {
            naming.insert(file.split_once("/src/").map_or(file.as_str(), |(folder, _)| folder).to_owned());
        }
    }
    assert_eq!(naming.into_iter().collect::<Vec<_>>(), ["ros_node"], "crates that name the ROS client");
}

#[test]
fn pure_modules_use_no_system_interface() {
    let pure = [
        ("voxels", &[""][..]),
        ("protocol", &[""]),
        ("mapgen", &[""]),
        ("map_files", &[""]),
        ("statistics", &[""]),
        ("world", &[""]),
        ("simulation", &[""]),
        ("transport", &["control"]),
        ("recording", &["bag", "comparison", "difference", "map", "playback", "replay"]),
        ("sim_server", &["session/entities"]),
        ("agent", &["abstract_graph", "bodies", "exploration_map", "map_markers", "sharing"]),
        ("controllers", &[""]),
        ("agent_node", &["control_loop"]),
    ];
    for (of, modules) in pure {
        for module in modules {
            let is_of = |file: &str| {
                let path = file.trim_start_matches(of).trim_start_matches("/src/").trim_end_matches(".rs");
                module.is_empty() || path == *module || path.starts_with(&format!("{module}/"))
            };
            // The time of decisions is for information only.
            let is_pure = |file: &str| is_of(file) && file != "controllers/src/stopwatch.rs";
            let files: Vec<_> = sources(of).into_iter().filter(|(file, _)| is_pure(file)).collect();
            assert!(!files.is_empty(), "{of} has a module {module}");
            for (file, code) in files {
                for word in ["std::time", "std::fs", "std::net", "std::thread", "std::process", "std::env", "std::{"] {
                    assert!(!code.contains(word), "{file} names {word}");
                }
            }
        }
    }
}

#[test]
fn wall_clock_is_read_in_one_place() {
    let reads = |code: &str| code.contains("Instant::now") || code.contains("SystemTime::now");
    // The timers of tokio have a clock of their own.
    let is_of_tokio = |code: &str| code.contains("tokio::time::");
    let reading: Vec<String> = CRATES
        .into_iter()
        .flat_map(sources)
        .filter(|(_, code)| reads(code) && !is_of_tokio(code))
        .map(|(file, _)| file)
        .collect();
    assert_eq!(reading, ["system/src/wall_clock.rs"]);
}

#[test]
fn files_are_short() {
    for (file, code) in CRATES.into_iter().flat_map(sources) {
        let lines = code.lines().count();
        assert!(lines <= LINES_MAX, "{file} has {lines} lines, tests left out; {LINES_MAX} are allowed");
    }
}

/// Comments of the code, and the text of documents: links, tables and blocks of code are left out.
#[test]
fn comments_and_documents_wrap() {
    let is_too_long = |line: &str| line.chars().count() > COLUMNS_MAX && !line.contains("](");
    let crates =
        CRATES.into_iter().chain(["python", "testing/fuzz", "testing/link_emulator"]).map(|of| format!("{of}/src"));
    for file in crates.chain(["tests".to_owned()]).flat_map(|folder| files(&folder, "rs")) {
        let mut is_block = false;
        for (number, line) in read(&file).lines().enumerate().filter(|(_, line)| line.trim_start().starts_with("//")) {
            is_block ^= line.contains("```");
            assert!(is_block || !is_too_long(line), "{}:{}: {line}", name(&file), number + 1);
        }
    }
    for file in documents() {
        let mut is_block = false;
        for (number, line) in read(&file).lines().enumerate() {
            is_block ^= line.trim_start().starts_with("```");
            let is_exempt = is_block || line.starts_with('|') || line.starts_with("    ");
            assert!(is_exempt || !is_too_long(line), "{}:{}: {line}", name(&file), number + 1);
        }
    }
}

#[test]
fn scenarios_can_be_run() {
    let scenarios = files("launch_scripts/scenarios", "toml");
    assert!(scenarios.len() >= 3, "{scenarios:?}");
    for file in scenarios {
        let scenario: Scenario = setup::load(&file, &[]).unwrap_or_else(|error| panic!("{error}"));
        setup::build(&scenario).unwrap_or_else(|error| panic!("{}: {error}", name(&file)));
    }
}

#[test]
fn scripts_can_be_parsed() {
    let parse = |program: &str, arguments: &[&str], file: &Path| {
        let parsed = Command::new(program).args(arguments).arg(file).output().expect("the interpreter runs");
        assert!(parsed.status.success(), "{}: {}", name(file), String::from_utf8_lossy(&parsed.stderr));
    };
    let mut shell = files("launch_scripts", "sh");
    shell.extend(files("tests", "sh"));
    shell.push(root().join(".ci/run"));
    assert!(shell.iter().any(|file| file.ends_with("run.sh")));
    for file in shell {
        parse("bash", &["-n"], &file);
    }
    for file in files("tests", "py") {
        parse("python3", &["-c", "import ast, sys; ast.parse(open(sys.argv[1], encoding='utf-8').read())"], &file);
    }
}

#[test]
fn yaml_files_can_be_parsed() {
    let of = |folder: &str| [files(folder, "yml"), files(folder, "yaml"), files(folder, "rviz")].concat();
    let found = [".github", "examples", "launch_scripts"].map(of).concat();
    assert!(found.iter().any(|file| file.ends_with("compose.yaml")), "{found:?}");
    let parse = "import sys; from ruamel.yaml import YAML\n\
                 for file in sys.argv[1:]: assert YAML(typ='safe', pure=True).load(open(file)), file";
    let output = Command::new(python::for_recordings()).args(["-c", parse]).args(&found).output().expect("python");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// A workflow runs on other machines alone: what it names has to be there, and to be executable.
#[test]
fn scripts_of_the_workflow_exist() {
    let mut names = BTreeSet::new();
    for file in files(".github", "yml") {
        let text = read(&file);
        let words = text.split(|c: char| c.is_whitespace() || "\"$();|".contains(c));
        let is_script =
            |word: &&str| ["launch_scripts/", "tests/", ".ci/"].iter().any(|folder| word.starts_with(folder));
        names.extend(words.filter(is_script).map(str::to_owned));
    }
    assert!(names.contains("launch_scripts/check_memory_path.sh"), "{names:?}");
    for name in names {
        let mode = fs::metadata(root().join(&name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        let is_program = [".sh", ".py"].iter().any(|ending| name.ends_with(ending)) || name == ".ci/run";
        assert!(!is_program || mode.permissions().mode() & 0o111 != 0, "{name} is not executable");
    }
}
