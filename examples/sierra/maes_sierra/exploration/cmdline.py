"""Command line of the project: `--scenario KIND.SIZE`, a map, and `--controller explore.NAME`."""

import argparse

from sierra.plugins import PluginCmdline


class Cmdline(PluginCmdline):
    def init_multistage(self) -> None:
        super().init_multistage()
        self.multistage.add_argument("--scenario", help="kind and size of the map: spheres.50")
        self.multistage.add_argument("--controller", help="one of controllers.yaml: explore.rbw")


def build(parents: list[argparse.ArgumentParser], stages: list[int]) -> PluginCmdline:
    return Cmdline(parents, stages)


def to_cmdopts(args: argparse.Namespace) -> dict:
    return {"scenario": args.scenario, "controller": args.controller}
