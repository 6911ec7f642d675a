use super::*;

const BASE: &str =
    "[scenario]\nduration_s = 10.0\n[scenario.map]\nkind = \"spheres\"\nsize = 24\n[scenario.agents]\ncount = 2\n";

fn parse(head: &str) -> Result<Plan, PlanError> {
    Plan::parse("p.toml", &format!("{head}\n{BASE}"), Path::new("."))
}

fn refused(head: &str) -> String {
    parse(head).unwrap_err().to_string()
}

#[test]
fn every_combination_is_run_with_every_seed() {
    let plan = parse("seeds = \"3..4\"\n[axes]\n\"agents.controller\" = [\"rbw\", \"lvd\"]\n\"agents.count\" = [1, 3]")
        .unwrap();
    let what: Vec<(u64, &str, u32)> = plan
        .runs
        .iter()
        .map(|run| (run.scenario.seed, run.scenario.agents.controller.as_str(), run.scenario.agents.count))
        .collect();
    let of_seed = |seed| [(seed, "rbw", 3), (seed, "lvd", 3), (seed, "rbw", 1), (seed, "lvd", 1)];
    assert_eq!(what, [of_seed(3), of_seed(4)].concat(), "by seed, and the most expensive first");
    assert_eq!(plan.runs[0].axes["agents.count"], "3");
    assert_eq!(plan.runs.iter().map(|run| &run.id).collect::<BTreeSet<_>>().len(), 8);
    assert_eq!(
        plan.axes.iter().map(|axis| axis.key.as_str()).collect::<Vec<_>>(),
        ["agents.controller", "agents.count"]
    );
}

#[test]
fn run_id_depends_neither_on_the_plan_nor_on_execution() {
    let one = parse("seeds = [7]").unwrap();
    let other = parse("seeds = \"6..8\"\naxes.\"agents.count\" = [1, 2]").unwrap();
    assert!(other.runs.iter().any(|run| run.id == one.runs[0].id));
    let text = format!("seeds = [7]\n{BASE}[scenario.execution]\nthreads = 3\n");
    assert_eq!(Plan::parse("p.toml", &text, Path::new(".")).unwrap().runs[0].id, one.runs[0].id);
}

#[test]
fn text_of_a_plan_is_self_contained() {
    let folder = tempfile::tempdir().unwrap();
    let base = "seed = 9\nduration_s = 10.0\n[map]\nkind = \"noise\"\nsize = 20\n[agents]\ncount = 2\n";
    std::fs::write(folder.path().join("base.toml"), base).unwrap();
    let text = "# why\nscenario = \"base.toml\" # here\nseeds = [1]\n[axes]\n\"agents.count\" = [1, 2]\n";
    let plan = Plan::parse("p.toml", text, folder.path()).unwrap();
    assert!(plan.text.starts_with("# why\n# scenario"), "{}", plan.text);
    let copy = Plan::parse("copy.toml", &plan.text, Path::new("/nowhere")).unwrap();
    assert_eq!(copy.runs, plan.runs);
}

#[test]
fn errors_name_line_key_and_allowed_values() {
    for (head, expected) in [
        (
            "seeds = [1]\nsed = 2",
            "p.toml:2: unknown field `sed`, expected one of `scenario`, `seeds`, `folder`, `axes`",
        ),
        ("", "missing field `seeds`"),
        ("seeds = \"2..1\"", "p.toml:1: seeds: the range \"2..1\" has no seeds"),
        ("seeds = []", "p.toml:1: seeds: no seeds; expected seeds from 0"),
        ("seeds = [1, 2, 1]", "p.toml:1: seeds: 1 is listed twice"),
        ("seeds = [-1]", "p.toml:1: seeds: expected seeds from 0"),
        (
            "seeds = [1]\naxes.\"agents.count\" = []",
            "p.toml:2: axes.\"agents.count\" = []: expected at least one value",
        ),
        ("seeds = [1]\naxes.\"agents.count\" = [1,\n1]", "p.toml:3: axes.\"agents.count\": 1 is listed twice"),
        ("seeds = [1]\naxes.\"agents.count\" = [1,\n0]", "p.toml:3: agents.count = 0: expected 1 to 1000"),
        (
            "seeds = [1]\naxes.\"agents.cuont\" = [1]",
            "p.toml:2: axes.\"agents.cuont\" = 1: unknown key `agents.cuont`; did you mean `agents.count`?",
        ),
        ("seeds = [1]\naxes.seed = [1]", "p.toml:2: axes.\"seed\": `seed` is given by `seeds`"),
        (
            "seeds = [1]\naxes.\"execution.threads\" = [1]",
            "p.toml:2: axes.\"execution.threads\": `execution` cannot change",
        ),
        (
            "seeds = [1]\naxes.\"agents.controller\" = [\"rwb\"]",
            "p.toml:2: agents.controller: controller rwb: unknown; known are rbw",
        ),
        (
            "seeds = [1]\naxes.\"agents.c\\nunt\" = [1]",
            "p.toml:2: axes.\"agents.c; unt\" = 1: unknown key `agents.c; unt`; did you mean `agents.count`?",
        ),
        ("seeds = \"0..999999\"\naxes.\"agents.count\" = [1, 2]", "more runs than the 1000000"),
    ] {
        let error = refused(head);
        assert!(error.contains(expected), "{head:?}: {error}");
    }
    let with_base = |base: &str| Plan::parse("p.toml", base, Path::new("/nowhere")).unwrap_err().to_string();
    let error = with_base(&format!("seeds = [1]\n{BASE}colour = 3\n"));
    assert!(error.contains("p.toml:9: unknown field `colour`"), "{error}");
    let error = with_base("seeds = [1]\nscenario = \"no.toml\"\n");
    assert!(error.contains("p.toml:2: scenario = \"no.toml\": /nowhere/no.toml: "), "{error}");
}

#[test]
fn plans_of_the_repository_are_valid() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("plans");
    let runs = |name: &str| Plan::load(&folder.join(name)).unwrap_or_else(|error| panic!("{error}")).runs.len();
    let plans =
        ["quick.toml", "paper-figures.toml", "paper-figures-maes3d.toml", "paper-table-1.toml", "report-2022.toml"];
    assert_eq!(plans.map(runs), [48, 270, 270, 12, 40]);
}
