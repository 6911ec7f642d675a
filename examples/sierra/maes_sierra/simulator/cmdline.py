"""Command line of the engine. It adds no flag to those of SIERRA."""

import argparse

from sierra.plugins import PluginCmdline


def build(parents: list[argparse.ArgumentParser], stages: list[int]) -> PluginCmdline:
    return PluginCmdline(parents, stages)


def to_cmdopts(args: argparse.Namespace) -> dict:
    return {}
