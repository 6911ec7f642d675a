"""Runs of an experiment: they differ in their seeds."""

from pathlib import Path

from sierra.core.experiment import definition


def for_single_exp_run(
    exp_def: definition.BaseExpDef,
    run_num: int,
    run_output_path: Path,
    launch_stem_path: Path,
    random_seed: int,
    cmdopts,
) -> definition.BaseExpDef:
    """Counts the seeds up from that of the template.

    SIERRA's random seeds differ between controllers. With these, all controllers and team sizes are
    compared on the same maps, and a repetition gives the same results.
    """
    exp_def.attr_change("/", "seed", exp_def.attr_get("/", "seed") + run_num)
    return exp_def
