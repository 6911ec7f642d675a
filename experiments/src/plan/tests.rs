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
fn run_id_depends_on_the_versions_of_its_controllers() {
    let runs = |versions: &[(&str, Option<&str>)], head: &str| {
        let versions = versions.iter().map(|&(name, version)| (name.to_owned(), version.map(str::to_owned))).collect();
        let known = KnownControllers { versions: &versions, ..KnownControllers::BUILT_IN };
        let plan = Plan::parse_with("p.toml", &format!("{head}\n{BASE}"), Path::new("."), known).unwrap();
        plan.runs.into_iter().map(|run| (run.id, run.is_versioned)).collect::<Vec<_>>()
    };
    let (one, other, none) = ([("lvd", Some("1"))], [("lvd", Some("2"))], [("lvd", None)]);
    let head = "seeds = [1]\naxes.\"agents.controller\" = [\"rbw\", \"lvd\"]";
    let (plain, first, second) = (runs(&[], head), runs(&one, head), runs(&other, head));
    assert_eq!([&first[0], &second[0]], [&plain[0]; 2], "runs without it keep their ids");
    assert!(plain[1].0 != first[1].0 && first[1].0 != second[1].0);
    assert!([&plain, &first, &second].into_iter().flatten().all(|(_, is_versioned)| *is_versioned));
    assert_eq!(runs(&[("lvd", Some("1")), ("dsvp", None)], head), first);
    let is_versioned = |head| runs(&none, head).into_iter().map(|(_, is_versioned)| is_versioned).collect::<Vec<_>>();
    assert_eq!(is_versioned(head), [true, false]);
    // In a part of the team, and in a part of the run.
    let mixed = "seeds = [1]\naxes.\"agents.mix\" = [[{ ids = [0], controller = \"lvd\" }]]";
    assert_ne!(runs(&[], mixed), runs(&one, mixed));
    assert_eq!(is_versioned(mixed), [false]);
    let forked = (runs(&[], FORKED), runs(&one, FORKED));
    let same: Vec<bool> = forked.0.iter().zip(&forked.1).map(|(one, other)| one == other).collect();
    assert_eq!(same.iter().filter(|same| **same).count(), 2, "{same:?}");
    assert_eq!(is_versioned(FORKED), same);
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
    let plans = [
        "quick.toml",
        "paper-figures.toml",
        "paper-figures-maes3d.toml",
        "paper-figures-branch.toml",
        "paper-table-1.toml",
        "report-2022.toml",
    ];
    assert_eq!(plans.map(runs), [48, 270, 270, 270, 12, 40]);
}

/// The runs of a plan without seed: labels, controller, and settings.
fn what(plan: &Plan) -> Vec<(Vec<String>, String, Vec<String>)> {
    let run = |run: &PlannedRun| {
        let labels = run.axes.iter().map(|(key, value)| format!("{key}={value}")).collect();
        (labels, run.scenario.agents.controller.clone(), wire::settings(&run.scenario.agents.set))
    };
    plan.runs.iter().map(run).collect()
}

#[test]
fn variants_are_named_sets_of_any_keys() {
    let plan = parse(
        "seeds = [1, 2]\ntitle = \"Far and near\"\naxes.\"agents.count\" = [2, 1]\n\
         [[variant]]\nname = \"far\"\n\"lidar.range_m\" = 20\nagents.controller = \"lvd\"\n\
         agents.set.visit_radius_m = 5.0\n[[variant]]\nname = \"near\"\nlidar = { range_m = 5, rays = 100 }\n\
         bodies = [{ agents = [0], kind = \"aerial\" }]\n[variant.spawn]\nkind = \"scattered\"\nmin_distance_m = 2.0",
    )
    .unwrap();
    assert_eq!((plan.compare, plan.runs.len()), (vec![VARIANT.to_owned()], 8));
    let [far, near] = ["far", "near"].map(|name| {
        let is = |run: &&PlannedRun| run.axes[VARIANT] == name && run.axes["agents.count"] == "2";
        plan.runs.iter().find(is).unwrap().scenario.clone()
    });
    assert_eq!((far.lidar.unwrap().range_m, far.agents.controller.as_str(), far.bodies.len()), (20.0, "lvd", 0));
    assert_eq!(wire::settings(&far.agents.set), ["visit_radius_m=5.0"]);
    assert_eq!(
        (near.lidar.as_ref().unwrap().range_m, near.lidar.as_ref().unwrap().rays, near.agents.controller.as_str()),
        (5.0, 100, "rbw")
    );
    assert_eq!(near.bodies.len(), 1);
    // A run has the same id by whatever plan.
    let same = parse("seeds = [1]\naxes.\"lidar.range_m\" = [20]\n[axes]\n\"agents.controller\" = [\"lvd\"]\n");
    assert!(same.is_err(), "a table is not defined twice");
    let same = parse(
        "seeds = [1]\naxes.\"lidar.range_m\" = [20]\naxes.\"agents.controller\" = [\"lvd\"]\n\
         axes.\"agents.set.visit_radius_m\" = [5.0]",
    )
    .unwrap();
    let far = plan.runs.iter().find(|run| run.axes[VARIANT] == "far" && run.axes["agents.count"] == "2").unwrap();
    assert_eq!(same.runs[0].id, far.id);
}

#[test]
fn settings_of_one_controller_vary_beside_other_controllers() {
    let plan = parse(
        "seeds = [1]\ncompare = [\"agents.controller\", \"agents.set.visit_radius_m\"]\n[axes]\n\
         \"agents.set.visit_radius_m\" = [2.0, 4.0]\n\"agents.controller\" = [\"rbw\", \"lvd\"]",
    )
    .unwrap();
    assert_eq!(
        what(&plan),
        [
            (vec!["agents.controller=rbw".to_owned()], "rbw".to_owned(), vec![]),
            (
                vec!["agents.controller=lvd".to_owned(), "agents.set.visit_radius_m=2.0".to_owned()],
                "lvd".to_owned(),
                vec!["visit_radius_m=2.0".to_owned()]
            ),
            (
                vec!["agents.controller=lvd".to_owned(), "agents.set.visit_radius_m=4.0".to_owned()],
                "lvd".to_owned(),
                vec!["visit_radius_m=4.0".to_owned()]
            ),
        ]
    );
    let error = refused("seeds = [1]\naxes.\"agents.set.visit_radus_m\" = [2.0, 4.0]");
    assert!(error.contains("visit_radus_m"), "{error}");
}

#[test]
fn settings_of_the_base_apply_to_controllers_that_have_them() {
    let text = format!(
        "seeds = [1]\naxes.\"agents.controller\" = [\"lvd\", \"rbw\", \"nearest-frontier\"]\n{BASE}controller = \
         \"lvd\"\nset = {{ visit_radius_m = 2.0, search_time = \"budgeted\" }}\n"
    );
    let plan = Plan::parse("p.toml", &text, Path::new(".")).unwrap();
    let settings: Vec<_> = what(&plan).into_iter().map(|(_, controller, settings)| (controller, settings)).collect();
    let both = vec!["search_time=budgeted".to_owned(), "visit_radius_m=2.0".to_owned()];
    assert_eq!(
        settings,
        [
            ("lvd".to_owned(), both),
            ("rbw".to_owned(), vec![]),
            ("nearest-frontier".to_owned(), vec!["search_time=budgeted".to_owned()])
        ]
    );
}

#[test]
fn map_files_are_blocks_like_seeds() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("maps")).unwrap();
    for name in ["one.m3dm", "two.m3dm"] {
        std::fs::write(folder.path().join("maps").join(name), name).unwrap();
    }
    let text = format!(
        "seeds = [1, 2]\nmaps = \"maps/*.m3dm\"\naxes.\"agents.controller\" = [\"rbw\", \"lvd\"]\n{BASE}\
         [scenario.lidar]\nrange_m = 4.0\n"
    );
    let plan = Plan::parse("p.toml", &text, folder.path()).unwrap();
    let blocks: Vec<_> =
        plan.runs.iter().map(|run| (run.scenario.seed, run.axes[MAP_FILE].as_str(), run.map.clone())).collect();
    let names: Vec<_> = blocks.iter().map(|(seed, name, _)| (*seed, *name)).collect();
    let of_seed = |seed| [(seed, "one.m3dm"), (seed, "one.m3dm"), (seed, "two.m3dm"), (seed, "two.m3dm")];
    assert_eq!(names, [of_seed(1), of_seed(2)].concat());
    // The seed does not change a map file.
    assert_eq!((&blocks[0].2, &blocks[2].2), (&blocks[4].2, &blocks[6].2));
    assert_ne!(blocks[0].2, blocks[2].2);
    // The copy of the plan can lie elsewhere, with copies of its maps.
    let elsewhere = folder.path().join("elsewhere");
    plan.inputs.copy_to(&elsewhere).unwrap();
    std::fs::remove_dir_all(folder.path().join("maps")).unwrap();
    let copy = Plan::parse("copy.toml", &plan.text, &elsewhere).unwrap();
    assert_eq!(copy.text, plan.text);
    let ids = |plan: &Plan| plan.runs.iter().map(|run| run.id.clone()).collect::<Vec<_>>();
    assert_eq!(ids(&copy), ids(&plan));
}

#[test]
fn runs_of_one_map_have_one_map_id() {
    let maps = |head: &str| parse(head).unwrap().runs.into_iter().map(|run| run.map).collect::<Vec<_>>();
    let own = maps("seeds = [1, 2]\naxes.\"agents.controller\" = [\"rbw\", \"lvd\"]");
    assert!(own[0] == own[1] && own[2] == own[3] && own[0] != own[2], "{own:?}");
    let fixed = maps("seeds = [1, 2]\naxes.\"map.seed\" = [1]");
    assert!(fixed[0] == fixed[1] && fixed[0] == own[0], "{fixed:?}");
}

#[test]
fn errors_of_variants_name_the_line() {
    for (head, expected) in [
        (
            "seeds = [1]\ncompare = \"count\"\naxes.\"agents.count\" = [1]",
            "p.toml:2: compare: \"count\": expected an axis",
        ),
        ("seeds = [1]\ncompare = \"count\"\naxes.\"agents.count\" = [1]", "did you mean `agents.count`?"),
        ("seeds = [1]\ncompare = []", "p.toml:2: compare: expected an axis"),
        (
            "seeds = [1]\ncompare = [\"agents.count\", \"agents.count\"]\naxes.\"agents.count\" = [1, 2]",
            "p.toml:2: compare: \"agents.count\" is listed twice",
        ),
        ("seeds = [1]\n[[variant]]\n\"agents.count\" = 3", "p.toml:3: variant: expected a name of its own"),
        (
            "seeds = [1]\n[[variant]]\nname = \"a\"\n[[variant]]\nname = \"a\"",
            "p.toml:5: variant: name = \"a\": expected a name of its own",
        ),
        (
            "seeds = [1]\ncompare = \"agents.count\"\naxes.\"agents.count\" = [1]\n[[variant]]\nname = \"a\"",
            "expected either `compare` or `[[variant]]`",
        ),
        (
            "seeds = [1]\n[[variant]]\nname = \"a\"\n\"agents.cuont\" = 2",
            "p.toml:4: variant \"a\": agents.cuont = 2: unknown key `agents.cuont`; did you mean `agents.count`?",
        ),
        ("seeds = [1]\n[[variant]]\nname = \"a\"\n\"agents.count\" = 0", "p.toml:4: agents.count = 0: expected 1 to"),
        ("seeds = [1]\n[[variant]]\nname = \"a\"\nseed = 0", "p.toml:4: variant \"a\": seed: `seed` is given by"),
        (
            "seeds = [1]\naxes.\"agents.count\" = [1]\n[[variant]]\nname = \"a\"\nagents = { count = 2 }",
            "p.toml:2: axes.\"agents.count\": variant \"a\" sets agents.count; leave one of them out",
        ),
        ("seeds = [1]\nmaps = \"*.nothing\"", "p.toml:2: maps: \"*.nothing\": no file in"),
        ("seeds = [1]\nmaps = \"a.m3dm\"\naxes.\"map.size\" = [20]", "p.toml:3: axes.\"map.size\": `maps` gives the"),
    ] {
        let error = refused(head);
        assert!(error.contains(expected), "{head:?}: {error}");
    }
}

const FORKED: &str = "seeds = [1, 2]\ncompare = \"agents.controller\"\n\
                      axes.\"agents.controller\" = [\"rbw\", \"lvd\"]\n[fork]\nat_s = [4.0, 6.0]";

#[test]
fn forks_are_the_same_run_up_to_their_time() {
    let plan = parse(FORKED).unwrap();
    let of_first: Vec<&PlannedRun> = plan.runs.iter().filter(|run| run.scenario.seed == 1).collect();
    let labels: Vec<_> = of_first
        .iter()
        .map(|run| (run.axes["agents.controller"].as_str(), run.axes.get(FORK).map(String::as_str)))
        .collect();
    // What changes nothing is one run for both times.
    assert_eq!(labels, [("rbw", None), ("lvd", Some("4")), ("lvd", Some("6"))]);
    let parent = &of_first[0].scenario;
    assert!(parent.event.is_empty());
    for (run, at_s) in of_first[1..].iter().zip([4.0, 6.0]) {
        assert_eq!(run.scenario.initial_identity(), parent.initial_identity());
        let [event] = &run.scenario.event[..] else { panic!("{:?}", run.scenario.event) };
        assert_eq!((event.at_s, event.parent.as_ref(), &event.set["agents.controller"]), (at_s, None, &"lvd".into()));
        assert_eq!(run.scenario.controllers_label(), "rbw, then lvd");
    }
    assert_eq!(parent.controllers_label(), "rbw");
    let at_start = parse(&FORKED.replace("4.0, 6.0", "0.0")).unwrap();
    assert!(at_start.runs.iter().all(|run| run.scenario.controllers_label() == run.axes["agents.controller"]));
    let copy = Plan::parse("p.toml", &plan.text, Path::new(".")).unwrap();
    assert_eq!(copy.runs, plan.runs);
}

#[test]
fn axes_are_bounded_and_their_values_different() {
    let axes: String = (0..101).map(|number| format!("\"agents.set.k{number}\" = [1]\n")).collect();
    let error = refused(&format!("seeds = [1]\n[axes]\n{axes}"));
    assert!(error.contains("p.toml:103: axes: 101: expected at most 100"), "{error}");
    let values: String = (1..=20_000).map(|number| format!("{number},\n")).collect();
    let error = refused(&format!("seeds = [1]\n[axes]\n\"lidar.range_m\" = [\n{values}7,\n1.0]\n"));
    assert!(error.contains("p.toml:20004: axes.\"lidar.range_m\": 7 is listed twice"), "{error}");
}

#[test]
fn forks_that_cannot_be_are_refused() {
    for (head, expected) in [
        (FORKED.replace("[4.0, 6.0]", "[4.01]"), "p.toml:5: fork.at_s = 4.01: expected a multiple of 0.02 s"),
        (FORKED.replace("[4.0, 6.0]", "[]"), "p.toml:5: fork.at_s = []: expected at least one time"),
        (FORKED.replace("[4.0, 6.0]", "[4.0, 4.0]"), "p.toml:5: fork.at_s: 4 is listed twice"),
        (
            FORKED.replace("compare = \"agents.controller\"\n", ""),
            "p.toml:4: fork: expected `compare` or `[[variant]]`",
        ),
        (
            FORKED.replace("agents.controller", "agents.count").replace("[\"rbw\", \"lvd\"]", "[2, 3]"),
            "agents.count cannot change during a run: the team is the one of the past",
        ),
    ] {
        let error = refused(&head);
        assert!(error.contains(expected), "{head}: {error}");
    }
}

#[test]
fn primary_measure_is_named_before_the_data() {
    assert_eq!(parse("seeds = [1]").unwrap().primary, Measure::Area);
    assert_eq!(parse("seeds = [1]\nprimary = \"time-99\"").unwrap().primary, Measure::Time99);
    for wrong in ["\"time\"", "99", "[\"area\", \"time-99\"]"] {
        let error = refused(&format!("seeds = [1]\nprimary = {wrong}"));
        assert!(error.starts_with(&format!("p.toml:2: primary = {wrong}: expected one of \"area\", ")), "{error}");
    }
}

#[test]
fn plan_says_how_many_seeds_its_variants_need() {
    let said = |seeds: usize, variants: usize| {
        let names: String =
            (0..variants).map(|i| format!("[[variant]]\nname = \"{i}\"\nlidar.range_m = {}.0\n", i + 2)).collect();
        parse(&format!("seeds = \"1..{seeds}\"\n{names}")).unwrap().too_few_blocks()
    };
    for (variants, needed) in [(2, 6), (3, 7), (5, 9), (8, 11)] {
        let words = said(needed - 1, variants).expect("too few");
        assert!(words.starts_with(&format!("{variants} variants need at least {needed} seeds")), "{words}");
        assert_eq!(said(needed, variants), None);
    }
    assert_eq!(said(1, 1), None);
    // Axes beside what is compared make panels, not comparisons.
    let plan = |seeds: usize| {
        let head = format!(
            "seeds = \"1..{seeds}\"\n[axes]\n\"agents.controller\" = [\"rbw\", \"lvd\"]\n\"agents.count\" = [1, 2, 5]"
        );
        parse(&head).unwrap().too_few_blocks()
    };
    assert!(plan(5).is_some_and(|words| words.contains("2 variants need at least 6 seeds, and the plan has 5")));
    assert_eq!(plan(6), None);
}

#[test]
fn keys_that_an_axis_varies_need_no_value_in_the_base() {
    let runs = |text: &str| {
        let plan = Plan::parse("p.toml", text, Path::new(".")).unwrap_or_else(|error| panic!("{error}"));
        let of = |run: &PlannedRun| (run.scenario.agents.count, run.scenario.map.size.unwrap().cells()[0]);
        plan.runs.iter().map(of).collect::<BTreeSet<_>>()
    };
    let base = "[scenario]\nduration_s = 10.0\nagents = { controller = \"rbw\" }\nmap = { kind = \"spheres\" }\n";
    let both = format!("seeds = [1]\n[axes]\n\"agents.count\" = [1, 2]\n\"map.size\" = [24, 30]\n{base}");
    assert_eq!(runs(&both), BTreeSet::from([(1, 24), (1, 30), (2, 24), (2, 30)]));
    let tables = "seeds = [1]\n[axes]\nagents = [{ count = 1 }, { count = 3 }]\n[scenario]\nduration_s = 10.0\n\
                  map = { kind = \"spheres\", size = 24 }\n";
    assert_eq!(runs(tables), BTreeSet::from([(1, 24), (3, 24)]));
    let variant = |name: &str, keys: &str| format!("[[variant]]\nname = \"{name}\"\n{keys}\n");
    let base = "[scenario]\nduration_s = 10.0\nmap = { kind = \"spheres\", size = 24 }\n";
    let variants = variant("one", "agents.count = 1") + &variant("two", "agents.count = 2");
    assert_eq!(runs(&format!("seeds = [1]\n{variants}{base}")), BTreeSet::from([(1, 24), (2, 24)]));
    // A variant without it would get that of another one.
    let lacking = variant("one", "agents.count = 1") + &variant("two", "lidar.range_m = 2.0");
    let error =
        Plan::parse("p.toml", &format!("seeds = [1]\n{lacking}{base}"), Path::new(".")).unwrap_err().to_string();
    assert!(error.contains("missing field `agents`"), "{error}");
}
