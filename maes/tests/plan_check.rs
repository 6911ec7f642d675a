//! The steps of the GitHub Action: a plan against a stored result.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const PLAN: &str = "seeds = \"1..6\"\n[axes]\n\"agents.controller\" = [\"rbw\", \"dsvp\"]\n[scenario]\nduration_s = 200.0\n\
                    map = { kind = \"spheres\", size = 40 }\nagents = { count = 2 }\n";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn check(folder: &Path, more: &[&str]) -> Output {
    let mut script = Command::new(root().join("launch_scripts/plan_check.sh"));
    script.args(["plan.toml", "base.csv", "out"]).args(more).current_dir(folder);
    script.env("MAES", env!("CARGO_BIN_EXE_maes")).env("GITHUB_STEP_SUMMARY", folder.join("summary.md"));
    script.output().expect("bash starts")
}

fn printed(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr].concat()).into_owned()
}

#[test]
fn a_variant_that_has_become_worse_fails_the_check() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("plan.toml"), PLAN).expect("a new file");
    let base = folder.path().join("base.csv");

    let first = check(folder.path(), &[]);
    assert_eq!(first.status.code(), Some(2), "{}", printed(&first));
    assert!(printed(&first).contains("base.csv: there was no stored result; this one is written now"));

    let same = check(folder.path(), &[]);
    assert!(same.status.success(), "{}", printed(&same));
    assert!(printed(&same).contains("n = 6, 6 of them the same run"), "{}", printed(&same));
    assert!(
        printed(&same).contains("0 of 2 variants are worse by more than 5 %, or fail more often"),
        "{}",
        printed(&same)
    );
    assert!(folder.path().join("out/report/report.html").is_file());

    // As if the runs of dsvp had been better: a cell was seen after half the time.
    let stored = fs::read_to_string(&base).expect("the stored result");
    let mut lines = stored.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let column = |name: &str| header.iter().position(|column| *column == name).expect("a column");
    let [area, digest] = [column("area_under_explored"), column("digest")];
    let mut better = vec![header.join(",")];
    for line in lines {
        let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
        if line.contains(",dsvp,") {
            let explored: f64 = fields[area].parse().expect("a number");
            fields[area] = (1.0 - (1.0 - explored) / 2.0).to_string();
            fields[digest] = "another".to_owned();
        }
        better.push(fields.join(","));
    }
    fs::write(&base, better.join("\n") + "\n").expect("the file is ours");
    let worse = check(folder.path(), &[]);
    assert_eq!(worse.status.code(), Some(1), "{}", printed(&worse));
    let said = printed(&worse);
    assert!(said.contains("regression: dsvp: mean time until a cell is seen"), "{said}");
    assert!(said.contains(" %), n = 6, 0 of them the same run; p = 0.031"), "{said}");
    assert!(said.contains("1 of 2 variants are worse"), "{said}");
    let summary = fs::read_to_string(folder.path().join("summary.md")).expect("a summary");
    assert!(summary.contains("regression: dsvp"), "{summary}");

    let tolerant = check(folder.path(), &["--tolerance", "150"]);
    assert!(tolerant.status.success(), "{}", printed(&tolerant));
}

#[test]
fn action_gives_the_script_all_its_inputs() {
    let action = fs::read_to_string(root().join("action.yml")).expect("the action");
    let (inputs, steps) = action.split_once("runs:\n").expect("steps");
    let names: Vec<&str> = inputs
        .lines()
        .filter_map(|line| line.strip_prefix("  ")?.strip_suffix(':'))
        .filter(|name| !name.starts_with(' '))
        .collect();
    assert_eq!(names, ["plan", "base", "out", "measure", "tolerance", "maes"]);
    for name in names {
        let variable = format!("{}: ${{{{ inputs.{name} }}}}", name.to_uppercase());
        assert!(steps.contains(&variable), "{variable}");
    }
    let call = "\"$PLAN\" \"$BASE\" \"$OUT\" --measure \"$MEASURE\" --tolerance \"$TOLERANCE\"";
    assert!(steps.contains("$GITHUB_ACTION_PATH/launch_scripts/plan_check.sh") && steps.contains(call), "{steps}");
}

#[test]
fn development_container_does_the_steps_of_contributing() {
    let file = fs::read_to_string(root().join(".devcontainer/devcontainer.json")).expect("the container");
    let container: serde_json::Value = serde_json::from_str(&file).expect("JSON");
    let steps = container["postCreateCommand"].as_str().expect("steps");
    assert_eq!(
        steps,
        ".ci/needed && npm --prefix viewer ci && npm --prefix viewer run build && launch_scripts/build.sh"
    );
    let checks = fs::read_to_string(root().join(".ci/run")).expect("the checks");
    assert!(checks.contains("\n.ci/needed\n"), "the checks install the same");
}
