"""Command line of the comparison: that of SIERRA's own."""

from sierra.plugins.compare.graphs.cmdline import build, to_cmdopts

__all__ = ["build", "to_cmdopts"]
