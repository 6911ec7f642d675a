use super::*;

#[test]
fn every_part_of_a_plan_has_a_job() {
    let site = tempfile::tempdir().unwrap();
    let text = "seeds = \"1..3\"\n[scenario]\nduration_s = 1.0\n[scenario.map]\nkind = \"spheres\"\nsize = 24\n\
                [scenario.agents]\ncount = 1\n";
    let plan = Plan::parse("p.toml", text, Path::new(".")).unwrap();
    let job = |scheduler| {
        std::fs::read_to_string(emit(&plan, site.path(), scheduler, NonZero::new(16).unwrap()).unwrap()).unwrap()
    };
    let slurm = job(Scheduler::Slurm);
    assert!(slurm.contains("--array=0-2\n") && slurm.contains("--part \"$SLURM_ARRAY_TASK_ID/3\""), "{slurm}");
    assert!(slurm.contains(&format!("folder='{}'", site.path().canonicalize().unwrap().display())), "{slurm}");
    let k8s = job(Scheduler::K8s);
    assert!(k8s.contains("completions: 3\n") && k8s.contains("$JOB_COMPLETION_INDEX/3"), "{k8s}");
    let copy = std::fs::read_to_string(site.path().join(PLAN)).unwrap();
    assert_eq!(Plan::parse("copy", &copy, Path::new("/nowhere")).unwrap().runs, plan.runs);
}
