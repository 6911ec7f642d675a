use std::collections::BTreeSet;
use std::process::Command;

use super::*;

const TEXT: &str = "seeds = \"1..3\"\n[scenario]\nduration_s = 1.0\n[scenario.map]\nkind = \"spheres\"\nsize = 24\n\
                    [scenario.agents]\ncount = 1\n";

const ALL: [Scheduler; 5] =
    [Scheduler::Slurm, Scheduler::Pbs, Scheduler::HtCondor, Scheduler::K8s, Scheduler::Parallel];

fn job(scheduler: Scheduler) -> Job {
    Job {
        scheduler,
        parts: None,
        limit: NonZero::new(2),
        time_s: NonZero::new(90_061),
        memory_mib: NonZero::new(1500).unwrap(),
        partition: None,
        account: None,
        is_requeued: true,
    }
}

fn written(job: &Job) -> String {
    let site = tempfile::tempdir().unwrap();
    let plan = Plan::parse("p.toml", TEXT, Path::new(".")).unwrap();
    let file = emit(&plan, site.path(), job, &Transport::Memory).unwrap();
    let copy = std::fs::read_to_string(site.path().join(PLAN)).unwrap();
    assert_eq!(Plan::parse("copy", &copy, Path::new("/nowhere")).unwrap().runs, plan.runs);
    let part = std::fs::read_to_string(site.path().join(PART)).unwrap();
    assert!(part.contains(" --part \"$1/3\"\n"), "{part}");
    let name = site.path().file_name().unwrap().to_str().unwrap();
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(!text.contains(name) && !part.contains(name), "the folder may be moved");
    for script in [&file, &site.path().join(PART)].into_iter().filter(|file| file.extension().unwrap() == "sh") {
        assert!(Command::new("bash").arg("-n").arg(script).status().unwrap().success(), "{}", script.display());
    }
    text
}

#[test]
fn every_request_reaches_the_workload_manager() {
    let asked = |scheduler, expected: &[&str]| {
        let named = Job { partition: Some("short".to_owned()), account: Some("ours".to_owned()), ..job(scheduler) };
        let text = written(&named);
        expected.iter().for_each(|line| assert!(text.lines().any(|is| is == *line), "{line} is not in\n{text}"));
    };
    asked(
        Scheduler::Slurm,
        &[
            "#SBATCH --array=0-2%2",
            "#SBATCH --mem=1500M",
            "#SBATCH --time=25:01:01",
            "#SBATCH --partition=short",
            "#SBATCH --account=ours",
            "#SBATCH --requeue",
        ],
    );
    asked(
        Scheduler::Pbs,
        &[
            "#PBS -J 0-2%2",
            "#PBS -l select=1:ncpus=1:mem=1500mb",
            "#PBS -l walltime=25:01:01",
            "#PBS -q short",
            "#PBS -A ours",
            "#PBS -r y",
        ],
    );
    let condor = written(&Job { account: Some("ours".to_owned()), ..job(Scheduler::HtCondor) });
    for line in ["request_memory = 1500", "allowed_execute_duration = 90061", "max_materialize = 2", "queue 3"] {
        assert!(condor.lines().any(|is| is == line), "{condor}");
    }
    assert!(condor.contains("accounting_group = ours\n") && condor.contains("max_retries = 3\n"), "{condor}");
    let k8s = written(&job(Scheduler::K8s));
    for line in ["completions: 3", "parallelism: 2", "backoffLimitPerIndex: 3", "activeDeadlineSeconds: 90061"] {
        assert!(k8s.lines().any(|is| is.trim() == line), "{k8s}");
    }
    let parallel = written(&job(Scheduler::Parallel));
    assert!(
        parallel.contains("seq 0 2 | parallel --jobs 2 --timeout 90061 --retries 3 --memfree 1500M "),
        "{parallel}"
    );
}

#[test]
fn parallel_keeps_a_log_for_each_division_of_a_plan() {
    let log = |text: &str, parts| {
        let plan = Plan::parse("p.toml", text, Path::new(".")).unwrap();
        let site = tempfile::tempdir().unwrap();
        let job = Job { parts: NonZero::new(parts), ..job(Scheduler::Parallel) };
        let script = std::fs::read_to_string(emit(&plan, site.path(), &job, &Transport::Memory).unwrap()).unwrap();
        let (_, rest) = script.split_once("--joblog logs/").unwrap();
        rest.split_once(' ').unwrap().0.to_owned()
    };
    let of_three = log(TEXT, 3);
    assert_eq!(of_three, log(TEXT, 3));
    assert_ne!(of_three, log(TEXT, 2), "other parts");
    assert_ne!(of_three, log(&TEXT.replace("1..3", "2..4"), 3), "other runs");
}

#[test]
fn requests_that_are_left_out_leave_no_line() {
    for scheduler in ALL {
        let bare = Job { limit: None, time_s: None, is_requeued: false, ..job(scheduler) };
        let text = written(&bare);
        for word in ["walltime", "--time", "duration", "Deadline", "%2", "max_materialize", "retries", "--requeue"] {
            assert!(!text.contains(word), "{word} is in\n{text}");
        }
        assert!(!text.contains("\n\n"), "{text}");
    }
}

#[test]
fn what_a_workload_manager_lacks_is_refused() {
    let plan = Plan::parse("p.toml", TEXT, Path::new(".")).unwrap();
    let site = tempfile::tempdir().unwrap();
    let refused = |job: &Job| emit(&plan, site.path(), job, &Transport::Memory).unwrap_err().to_string();
    let partition = Some("short".to_owned());
    let texts: BTreeSet<String> = [Scheduler::HtCondor, Scheduler::K8s, Scheduler::Parallel]
        .map(|scheduler| refused(&Job { partition: partition.clone(), ..job(scheduler) }))
        .into();
    assert_eq!(texts.len(), 3);
    assert!(texts.iter().all(|text| text.starts_with("--partition short: ") && text.ends_with("; leave it out")));
    assert!(refused(&Job { account: partition.clone(), ..job(Scheduler::K8s) }).starts_with("--account short: "));
    assert_eq!(std::fs::read_dir(site.path()).unwrap().count(), 0, "nothing is written");
}

#[test]
fn plans_that_do_not_travel_are_refused() {
    let site = tempfile::tempdir().unwrap();
    let map = site.path().join("a.txt");
    std::fs::write(&map, "#####\n#...#\n#####\n").unwrap();
    let text = format!(
        "seeds = [1]\n[scenario]\nduration_s = 1.0\nmap = {{ kind = \"file\", file = {map:?}, cell_m = 1.0 }}\n\
         agents = {{ count = 1 }}\n"
    );
    let emitted = |text: &str| {
        let plan = Plan::parse("p.toml", text, site.path()).unwrap();
        emit(&plan, &site.path().join("out"), &job(Scheduler::Slurm), &Transport::Memory)
    };
    assert!(matches!(emitted(&text), Err(EmitError::Absolute(_))));
    emitted(&text.replace(&format!("{map:?}"), "\"a.txt\"")).unwrap();
    assert!(site.path().join("out/files/a.txt").is_file());
    let outside = text.replace("count = 1", "count = 1, command = [\"python3\", \"{id}\"]");
    let refused = emitted(&outside).unwrap_err().to_string();
    assert!(refused.starts_with("agents.command = [\"python3\", \"{id}\"]: ") && refused.contains("--transport ros2"));
}
