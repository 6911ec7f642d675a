//! The code blocks of the documents work.
//!
//! The language of a block says what is done with it:
//!
//! | language | what is done |
//! |---|---|
//! | `sh` | executed by bash |
//! | `sh,long` | executed with `MAES_DOCUMENTED=long`, otherwise as the next one |
//! | `sh,checked,WHY` | its syntax is checked, and the options of its `maes` commands; [`WHY`] |
//! | `python` | executed with the Python package |
//! | `python,recording` | executed with the usual readers of recordings |
//! | `python,part` | its syntax is checked: it is a part of a function |
//! | `toml,scenario` | read as a scenario, with what is required added |
//! | `toml,plan` | read as a plan, from `experiments/plans` |
//! | `toml` | its syntax is checked |
//! | `rust` | a source of the workspace has it, line by line |
//! | `text` | nothing: output, drawings, formulas |
//!
//! All documents are tested in the order of the site, in one folder that has what a reader brings
//! along. The blocks of a language in a document are one session, and what a block has started in
//! the background ends with it. `MAES_DOCUMENT=WORD` tests those documents only whose name has this
//! word. Commands that build or install are not executed, `maes` is
//! `tests/documented_commands/maes`, which knows the commands that do not end by themselves, and
//! `ros2` is `launch_scripts/ros2.py`, because it is in no wheel.

use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;

use ::experiments::plan::Plan;
use regex_lite::Regex;

use crate::support::runs::Site;
use crate::support::{python, root};
use crate::tidy::{CRATES, files, read};

/// Programs that build or install; what they do has tests of its own.
const NOT_EXECUTED: [&str; 2] = ["cargo", "pip"];

/// Why a block is checked only: a word of its language, what it needs, and the files that test
/// it or do the same.
const WHY: [(&str, &str, &[&str]); 13] = [
    ("build", "compiles for minutes", &["tests/installation.rs", "launch_scripts/release.sh", ".ci/run"]),
    ("cluster", "a workload manager", &["tests/clusters.rs"]),
    ("colcon", "ROS 2 with colcon", &["tests/ros_package.rs", "tests/external_agents.rs"]),
    ("controller", "changed sources, compiled", &["tests/own_programs.rs", "controllers/src/lib.rs"]),
    ("docker", "a container runtime", &["launch_scripts/check_image.py"]),
    ("evo", "evo from PyPI", &["tests/drift.rs"]),
    ("hosts", "root, and hosts or network namespaces", &["tests/hosts.rs"]),
    ("hours", "hours, or results of hours", &["tests/experiments.rs", "report/tests/report.rs"]),
    ("long-tests", "is a test of its own that takes long", &["launch_scripts/long_tests.sh"]),
    ("processes", "terminals for several processes", &["tests/recovery.rs", "tests/interruptions.rs"]),
    ("release", "the files of a release, and root", &["launch_scripts/check_release.sh"]),
    ("rerun", "the viewer Rerun with a window", &["tests/rerun.rs"]),
    ("training", "packages for learning, and half an hour", &["python/tests/test_envs.py"]),
];

/// Makes the files that a reader brings along.
const FILES_OF_THE_READER: &str = r#"
short="--transport memory --agents 2 --size 20 --duration 20"
maes run $short --record a.mcap && cp a.mcap run.mcap
maes run $short --seed 2 --record b.mcap
maes map generate --size 30 --seed 7 -o cave.m3dm
maes map convert cave.m3dm mine.obj
cp "$1/examples/python/agent.py" .
"#;

/// What a part of a scenario leaves out.
const REQUIRED: &str = "seed = 1\nduration_s = 600.0\nmap = { kind = \"spheres\", size = 30 }\nagents = { count = 3 }";

/// The least that a plan says.
const A_PLAN: &str = "seeds = \"1..2\"\nscenario = \"../../launch_scripts/scenarios/default.toml\"";

/// A small plan, for what is said of plans in general.
const PLAN: &str = "seeds = \"1..2\"\n\n[axes]\n\"agents.controller\" = [\"rbw\", \"Zigzag\"]\n\n\
    [scenario]\nduration_s = 20.0\nmap = { kind = \"spheres\", size = 20 }\nagents = { count = 2 }\n";

/// A floor plan of a room and a corridor, in the format of ROS maps.
const FLOOR: &str = "image: floor.pgm\nresolution: 0.5\norigin: [0.0, 0.0, 0.0]\nnegate: 0\n\
    occupied_thresh: 0.65\nfree_thresh: 0.196\n";

/// A block of a document.
#[derive(Debug, Clone)]
struct Block {
    /// Number of its first line in the document, from 0.
    first_line: usize,
    language: String,
    /// Without the indentation of the list that it is in.
    lines: Vec<String>,
}

impl Block {
    fn text(&self) -> String {
        self.lines.iter().flat_map(|line| [line, "\n"]).collect()
    }

    /// Its `maes` commands, each in one line.
    fn commands(&self) -> Vec<String> {
        let joined = self.text().replace("\\\n", " ");
        joined.lines().filter(|line| line.starts_with("maes ")).map(str::to_owned).collect()
    }
}

/// A document with its blocks.
#[derive(Debug)]
struct Document {
    /// As the summary of the site names it.
    name: String,
    blocks: Vec<Block>,
}

impl Document {
    fn new(name: &str, text: &str) -> Self {
        let fence = Regex::new(r"^( *)```(.*)$").expect("it is written here");
        let mut blocks: Vec<Block> = Vec::new();
        let mut open: Option<(usize, Block)> = None;
        for (number, line) in text.lines().enumerate() {
            let found = fence.captures(line);
            open = match (open, found) {
                (None, None) => None,
                (None, Some(found)) => {
                    let block = Block { first_line: number + 1, language: found[2].to_owned(), lines: Vec::new() };
                    Some((found[1].len(), block))
                }
                (Some((indent, mut block)), None) => {
                    block.lines.push(line.get(indent..).unwrap_or_default().to_owned());
                    Some((indent, block))
                }
                (Some((_, block)), Some(_)) => {
                    blocks.push(block);
                    None
                }
            };
        }
        assert!(open.is_none(), "{name}: a block has no end");
        Self { name: name.to_owned(), blocks }
    }

    /// The blocks in these languages as one text, in which every line has the number that it has in
    /// the document. `end` goes into the line behind each block.
    fn session(&self, languages: &[&str], end: &str) -> Option<String> {
        let mut lines: Vec<&str> = Vec::new();
        for block in self.blocks.iter().filter(|block| languages.contains(&block.language.as_str())) {
            lines.resize(block.first_line, "");
            lines.extend(block.lines.iter().map(String::as_str));
            lines.push(end);
        }
        (!lines.is_empty()).then(|| lines.join("\n") + "\n")
    }
}

/// The documents that are asked for.
fn documents() -> Vec<Document> {
    documents_of(&std::env::var("MAES_DOCUMENT").unwrap_or_default())
}

/// The documents with a word in their name, in the order of the site.
fn documents_of(wanted: &str) -> Vec<Document> {
    let link = Regex::new(r"\]\(([^)]+\.md)\)").expect("it is written here");
    let summary = read(&root().join("docs/SUMMARY.md"));
    let names = link.captures_iter(&summary).map(|found| found[1].to_owned()).filter(|name| name.contains(wanted));
    names.map(|name| Document::new(&name, &read(&root().join("docs").join(&name)))).collect()
}

/// A folder as a reader has it in front of them, with what the blocks have made so far.
struct Desk {
    site: Site,
    is_long: bool,
}

impl Desk {
    fn new() -> Self {
        let desk =
            Self { site: Site::new(), is_long: std::env::var("MAES_DOCUMENTED").is_ok_and(|mode| mode == "long") };
        for folder in ["examples", "experiments", "msgs", "python"] {
            symlink(root().join(folder), desk.site.path(folder)).expect("a link");
        }
        desk.stand_ins();
        desk.site.file("plan.toml", PLAN);
        desk.site.file("box.txt", "#####\n#####\n#####\n\n#####\n#...#\n#####\n\n#####\n#####\n#####\n");
        desk.site.file("floor.yaml", FLOOR);
        desk.site.file("floor.pgm", floor());
        let python = Document::new("python.md", &read(&root().join("docs/python.md")));
        let class = python.blocks.iter().find(|block| block.text().starts_with("class ")).expect("it has a controller");
        let class: String = class.text().split("\nmaes.run").next().expect("a split has a first part").to_owned();
        desk.site.file("my_file.py", format!("import maes\n\n\n{class}"));
        let made = desk.bash(FILES_OF_THE_READER, "run");
        assert_eq!(made, Ok(()), "the files of the reader");
        desk
    }

    /// The programs, and the scripts that lie where the reader calls them.
    fn stand_ins(&self) {
        let script = |path: PathBuf, text: String| {
            fs::write(&path, format!("#!/bin/sh\n{text}\n")).expect("the folder can be written to");
            fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).expect("it is ours");
        };
        for folder in ["programs", "launch_scripts"] {
            fs::create_dir(self.site.path(folder)).expect("a folder");
        }
        let programs = self.site.path("programs");
        symlink(root().join("tests/documented_commands/maes"), programs.join("maes")).expect("a link");
        let [option, in_ros, name] = python::in_ros();
        let ros2 = root().join("launch_scripts/ros2.py");
        let once = "[ \"$2\" != echo ] || set -- \"$@\" --once";
        let ros2 = format!("{once}\nexec bash {option} '{in_ros}' {name} python {} \"$@\"", ros2.display());
        script(programs.join("ros2"), ros2);
        for name in NOT_EXECUTED {
            script(programs.join(name), "exit 0".to_owned());
        }
        let (package, interpreter) = (crate::python_package::package(), python::for_package());
        let python = format!("PYTHONPATH={} exec {} \"$@\"", package.display(), interpreter.display());
        script(programs.join("python"), python);
        for file in files("launch_scripts", "sh").into_iter().chain(files("launch_scripts", "toml")) {
            let name = file.strip_prefix(root()).expect("it is in the workspace");
            let place = self.site.path(name.to_str().expect("paths of tests are texts"));
            fs::create_dir_all(place.parent().expect("it has a folder")).expect("a folder");
            if file.extension().is_some_and(|extension| extension == "sh") {
                script(place, format!("exec {} \"$@\"", file.display()));
            } else {
                symlink(&file, place).expect("a link");
            }
        }
    }

    /// Executes a script.
    fn bash(&self, script: &str, mode: &str) -> Result<(), String> {
        let script = self.site.file("session.sh", script);
        let mut command = self.site.command("bash");
        let programs = self.site.path("programs");
        let path = format!("{}:{}", programs.display(), std::env::var("PATH").expect("there are programs"));
        // The number of a line is that in the document.
        command.args(["-c", "set -eEuo pipefail; trap 'echo \"line $LINENO fails: $BASH_COMMAND\" >&2' ERR; . \"$0\""]);
        command.arg(&script).arg(root()).env("PATH", path).env("MAES_DOCUMENTED", mode);
        self.passes(&mut command)
    }

    /// Executes a Python script.
    fn python(&self, interpreter: &Path, script: &str) -> Result<(), String> {
        let script = self.site.file("session.py", script);
        let mut command = self.site.command(interpreter);
        command.arg(script).env("PYTHONPATH", crate::python_package::package()).env("PYTHONDONTWRITEBYTECODE", "1");
        self.passes(&mut command)
    }

    fn passes(&self, command: &mut Command) -> Result<(), String> {
        let ended = self.site.start(command).ended();
        if ended.code == Some(0) { Ok(()) } else { Err(ended.to_string()) }
    }

    /// Everything in a document that does not work.
    fn defects(&self, document: &Document) -> Vec<String> {
        let mut results: Vec<Result<(), String>> = Vec::new();
        let shell: &[&str] = if self.is_long { &["sh", "sh,long"] } else { &["sh"] };
        // What was started in the background ends with its block. A node of rclpy may handle the
        // signal and sleep on: the test stood still for ever.
        let end = "for job in $(jobs -p); do kill \"$job\" 2>/dev/null || true; done; \
            for job in $(jobs -p); do \
            timeout 30 tail -s 0.1 -f --pid \"$job\" /dev/null || kill -9 \"$job\"; done; wait";
        if let Some(session) = document.session(shell, end) {
            results.push(self.bash(&session, if self.is_long { "long" } else { "run" }));
        }
        if let Some(session) = document.session(&["python"], "") {
            results.push(self.python(python::for_package(), &session));
        }
        for block in &document.blocks {
            results.push(match block.language.as_str() {
                checked if reason(checked).is_some() => self.checked(block),
                "sh,long" if !self.is_long => self.checked(block),
                "python,recording" => self.python(python::for_recordings(), &block.text()),
                "python,part" => self.part(block),
                "toml,scenario" => self.scenario(block),
                "toml,plan" => plan(block),
                "toml" => block.text().parse::<toml::Table>().map(|_| ()).map_err(|error| error.to_string()),
                "rust" => source(block),
                "sh" | "sh,long" | "python" | "text" => Ok(()),
                other => Err(format!("line {}: {other:?} is none of the languages of {}", block.first_line, file!())),
            });
        }
        results.into_iter().filter_map(Result::err).map(|error| format!("{}: {error}", document.name)).collect()
    }

    fn checked(&self, block: &Block) -> Result<(), String> {
        let script = self.site.file("syntax.sh", block.text());
        self.passes(self.site.command("bash").arg("-n").arg(script))?;
        self.bash(&block.commands().join("\n"), "checked")
    }

    fn part(&self, block: &Block) -> Result<(), String> {
        let indented: String = block.lines.iter().map(|line| format!("    {line}\n")).collect();
        self.python(python::for_package(), &format!("def part(self, ctx, command):\n{indented}"))
    }

    fn scenario(&self, block: &Block) -> Result<(), String> {
        let mut scenario: toml::Table = block.text().parse().map_err(|error: toml::de::Error| error.to_string())?;
        let required: toml::Table = REQUIRED.parse().expect("it is written here");
        for (key, value) in required {
            scenario.entry(key).or_insert(value);
        }
        self.site.file("documented.toml", scenario.to_string());
        self.bash("maes scenario documented.toml", "run")
    }
}

fn plan(block: &Block) -> Result<(), String> {
    let parsed = Plan::parse("documented.toml", &block.text(), &root().join("experiments/plans"));
    parsed.map(|_| ()).map_err(|error| error.to_string())
}

/// The row of [`WHY`] that a language names.
fn reason(language: &str) -> Option<(&str, &str, &[&str])> {
    let word = language.strip_prefix("sh,checked,")?;
    WHY.into_iter().find(|(known, ..)| *known == word)
}

/// Fails unless a source has these lines, wherever they are indented to.
fn source(block: &Block) -> Result<(), String> {
    let trimmed = |text: &str| text.lines().map(|line| format!("{}\n", line.trim())).collect::<String>();
    let wanted = trimmed(&block.text());
    let mut sources = CRATES.iter().flat_map(|folder| files(&format!("{folder}/src"), "rs"));
    if sources.any(|file| trimmed(&read(&file)).contains(wanted.trim())) {
        Ok(())
    } else {
        Err(format!("line {}: no source has these lines:\n{}", block.first_line, block.text()))
    }
}

/// A picture of a free room of 30 x 20 pixels with a wall around it.
fn floor() -> Vec<u8> {
    let (width, height) = (32, 22);
    let is_wall = |x: usize, y: usize| x == 0 || y == 0 || x == width - 1 || y == height - 1;
    let pixels = (0..width * height).map(|at| if is_wall(at % width, at / width) { 0 } else { 254 });
    format!("P5\n{width} {height}\n255\n").into_bytes().into_iter().chain(pixels).collect()
}

#[test]
fn documented_blocks_work() {
    python::prepare_ros();
    let desk = Desk::new();
    let defects: Vec<String> = documents().iter().flat_map(|document| desk.defects(document)).collect();
    assert!(defects.is_empty(), "{} defects:\n{}", defects.len(), defects.join("\n\n"));
}

#[test]
fn defects_of_blocks_are_found() {
    let desk = Desk::new();
    let defects = |language: &str, text: &str| {
        desk.defects(&Document::new("mutant.md", &format!("Text.\n\n```{language}\n{text}\n```\n"))).join("\n")
    };
    for (language, whole, broken, reason) in [
        ("sh", "maes info a.mcap", "maes info\nmaes info c.mcap", "line 4 fails"),
        ("sh", "false & maes info a.mcap", "maes info a.mcap | false", "line 4 fails"),
        (
            "sh",
            "maes run --transport memory --size 40 --duration 30",
            "maes run --transport memory --size 40 --duration 0.1",
            "the team has moved",
        ),
        ("sh", "maes diff a.mcap b.mcap", "maes diff a.mcap c.mcap", "c.mcap"),
        (
            "sh,checked,docker",
            "maes run --agents 5",
            "maes run --agent-count 5",
            "--agent-count is not among the options",
        ),
        ("sh,checked,docker", "maes map info X.m3dm", "maes maps info X.m3dm", "no such command"),
        ("sh,checked,colcon", "colcon build && true", "colcon build && (", "syntax error"),
        ("sh,long", "maes faults --seeds 2", "maes faults --seed-count 2", "--seed-count is not among the options"),
        ("python", "import maes", "import maes\nmaes.runs()", "line 5"),
        ("python,part", "return self", "return self)", "unmatched"),
        ("python,recording", "import mcap", "import mcap.nothing", "mcap.nothing"),
        ("toml,scenario", "lidar.range_m = 5", "lidar.range = 5", "lidar.range"),
        ("toml,plan", A_PLAN, &format!("{A_PLAN}\nrun = 5"), "unknown field `run`"),
        ("toml", "a = 1", "a == 1", "TOML"),
        ("rust", "pub trait Controller", "pub trait Controllers", "no source has these lines"),
        ("text", "a", "a\n```\n\n```bash\ntrue", "\"bash\" is none of"),
        ("text", "a", "a\n```\n\n```sh,checked\ntrue", "\"sh,checked\" is none of"),
    ] {
        assert_eq!(defects(language, whole), "", "{whole}");
        let found = defects(language, broken);
        assert!(found.contains(reason), "{broken}: {found:?} has no {reason:?}");
    }
}

#[test]
fn reasons_of_blocks_that_are_checked_only_hold() {
    let documents: Vec<Document> = documents_of("");
    let languages: Vec<&str> =
        documents.iter().flat_map(|document| &document.blocks).map(|block| block.language.as_str()).collect();
    for (word, needed, covered) in WHY {
        assert!(languages.contains(&format!("sh,checked,{word}").as_str()), "no block needs {needed} ({word})");
        for file in covered {
            assert!(root().join(file).is_file(), "{word}: there is no {file}");
        }
    }
    let executed = languages.iter().filter(|language| **language == "sh").count();
    let checked = languages.iter().filter(|language| language.starts_with("sh,checked")).count();
    assert!(executed > 2 * checked, "{executed} blocks are executed, {checked} are checked only");
}

#[test]
fn sessions_keep_the_numbers_of_lines() {
    let document = Document::new("a.md", "One\n```sh\ntwo\n```\n- three\n\n  ```sh\n  four\n    five\n  ```\n");
    let session = document.session(&["sh"], "end").expect("it has blocks");
    assert_eq!(session, "\n\ntwo\nend\n\n\n\nfour\n  five\nend\n");
    assert!(document.session(&["python"], "").is_none());
}
