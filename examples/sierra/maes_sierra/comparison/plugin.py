"""The comparison of controllers of SIERRA's `compare.graphs`, without two of its errors.

SIERRA 1.5.16 passes the absolute path of the first controller's scenario where the name of the
scenario belongs. Joined to a path it replaces what is before it, so all controllers are compared
with the results of the first. And without `legend` in graphs.yaml it labels the lines with the
letters of `--things`.
"""

import argparse
from pathlib import Path

from sierra.core import batchroot, types, utils
from sierra.core.graphs import gconfig
from sierra.plugins.compare.graphs import inter_controller, outputroot


class Comparator(inter_controller.UnivarInterControllerComparator):
    def exp_select(self) -> list[batchroot.ExpRoot]:
        """The batch experiment of the command line, with each controller."""
        args = self.cli_args
        # As SIERRA names the folder in the stages before.
        stem = Path(args.expdef_template).stem.replace("-", "")
        leaf = batchroot.ExpRootLeaf(args.batch_criteria, stem)
        root, project = args.sierra_root, args.project
        return [
            batchroot.ExpRoot(root, project, controller, args.scenario, leaf)
            for controller in self.things
        ]

    def compare(self, cmdopts: types.Cmdopts, graph: types.YAMLDict, roots) -> None:
        super().compare(cmdopts, {**graph, "legend": self.things}, roots)


def proc_exps(
    main_config: types.YAMLDict, cmdopts: types.Cmdopts, cli_args: argparse.Namespace
) -> None:
    """Stage 5. Other comparisons than those of controllers are left to `compare.graphs`."""
    controllers = cmdopts["things"].split(",")
    roots = outputroot.PathSet(cmdopts, controllers, None)
    for folder in [roots.graph_root, roots.csv_root, roots.model_root]:
        utils.dir_create_checked(folder, True)
    graphs = gconfig.section(gconfig.load(cmdopts), "inter-controller")
    Comparator(controllers, roots, cmdopts, cli_args, main_config)(target_graphs=graphs)
