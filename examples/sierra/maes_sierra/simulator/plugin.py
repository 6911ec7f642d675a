"""The interface of the engine to SIERRA: commands of runs, team sizes, the time axis.

SIERRA calls the functions and classes of this module by their names.
"""

import argparse
import os
import shlex
import sys
from pathlib import Path

import yaml
from sierra.core import config, types
from sierra.core.experiment import bindings, definition

from maes_sierra.simulator import series


class ExpRunShellCmdsGenerator(bindings.IExpRunShellCmdsGenerator):
    """The command of one run."""

    def __init__(self, cmdopts, criteria, exp_num, n_agents) -> None:
        pass

    def pre_run_cmds(self, host: str, input_fpath: Path, run_num: int) -> list[types.ShellCmdSpec]:
        return []

    def exec_run_cmds(self, host: str, input_fpath: Path, run_num: int) -> list[types.ShellCmdSpec]:
        # SIERRA's tree: exp-inputs/EXPERIMENT/RUN, and exp-outputs/EXPERIMENT/RUN_output.
        experiment = input_fpath.parent
        batch = experiment.parent.parent
        out = batch / "exp-outputs" / experiment.name / f"{input_fpath.name}_output"
        run = Path(__file__).with_name("run.py")
        words = [sys.executable, str(run), f"{input_fpath}.yaml", str(out)]
        # The commands of a run are joined to one line.
        return [types.ShellCmdSpec(cmd=shlex.join(words) + ";", shell=True, wait=True)]

    def post_run_cmds(self, host: str, run_output_root: Path) -> list[types.ShellCmdSpec]:
        return []


class ExpConfigurer(bindings.IExpConfigurer):
    """Adds the duration to the changes that SIERRA keeps of an experiment."""

    def __init__(self, cmdopts) -> None:
        pass

    def for_exp_run(self, exp_input_root: Path, run_output_root: Path) -> None:
        pass

    def for_exp(self, exp_input_root: Path) -> None:
        any_run = next(exp_input_root.glob("*_run0.yaml"))
        duration_s = float(yaml.safe_load(any_run.read_text())["duration_s"])
        changes = definition.AttrChangeSet(definition.AttrChange("/", "duration_s", duration_s))
        changes.pickle(exp_input_root / config.PICKLE_LEAF)

    def parallelism_paradigm(self) -> str:
        return "per-exp"


def cmdline_postparse_configure(execenv: str, args: argparse.Namespace) -> argparse.Namespace:
    """As many runs at a time as there are cores: each has one process."""
    if args.exec_jobs_per_node is None:
        args.exec_jobs_per_node = os.cpu_count()
    return args


def population_size_from_def(exp_def, main_config, cmdopts) -> int:
    return int(exp_def.attr_get("/agents", "count"))


def population_size_from_pickle(exp_def, main_config, cmdopts) -> int:
    return int(_changed(exp_def, "/agents", "count"))


def expsetup_from_def(exp_def: definition.ExpDefPickle) -> dict[str, float]:
    """The time axis of the graphs of an experiment."""
    duration_s = _changed(exp_def, "/", "duration_s")
    # SIERRA truncates the product of the two to the number of rows: the half keeps rounding away.
    return {
        "duration": duration_s,
        "n_ticks_per_sec": (series.row_count(duration_s) + 0.5) / duration_s,
    }


def _changed(exp_def: definition.ExpDefPickle, path: str, attr: str):
    """What the changes of an experiment set a key to."""
    changes = exp_def.attr_chgs
    return next(change.value for change in changes if (change.path, change.attr) == (path, attr))
