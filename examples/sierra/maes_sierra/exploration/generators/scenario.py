"""Scenarios of the project, KIND.SIZE: a map of one of the generators, in cells along each axis."""

from pathlib import Path

import sierra.core.plugin as pm
from sierra.core.experiment import definition, spec


def for_map(
    spec: spec.ExperimentSpec, controller: str, cmdopts, expdef_template_fpath: Path
) -> definition.BaseExpDef:
    """The template with the map of the scenario, to be written as one YAML file for each run."""
    expdef = pm.pipeline.get_plugin_module(cmdopts["expdef"])
    whole = {"src_parent": None, "src_tag": expdef.root_querypath(), "opath_leaf": ".yaml"}
    exp_def = expdef.ExpDef(expdef_template_fpath, definition.WriterConfig([whole]))
    for attr, value in to_dict(spec.scenario_name).items():
        exp_def.attr_change("/map", attr, value)
    return exp_def


def to_generator_name(scenario: str) -> str:
    """The function above that makes a scenario."""
    return "for_map"


def to_dict(scenario: str) -> dict[str, str | int]:
    """What a scenario says about the map."""
    kind, size = scenario.split(".")
    return {"kind": kind, "size": int(size)}
