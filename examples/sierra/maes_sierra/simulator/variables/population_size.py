"""Batch criterion: the number of agents, such as population_size.Linear4.C2 (2 and 4 agents)."""

from pathlib import Path

from sierra.core.experiment import definition
from sierra.core.variables import batch_criteria, population_size


class PopulationSize(population_size.PopulationSize, batch_criteria.IQueryableBatchCriteria):
    def __init__(self, cli_arg: str, main_config, batch_input_root: Path, sizes: list[int]) -> None:
        super().__init__(cli_arg, main_config, batch_input_root)
        self.sizes = sizes

    def gen_attr_changelist(self) -> list[definition.AttrChangeSet]:
        changes = (definition.AttrChange("/agents", "count", size) for size in self.sizes)
        return [definition.AttrChangeSet(change) for change in changes]

    def n_agents(self, exp_num: int) -> int:
        return self.sizes[exp_num]

    def graph_xlabel(self, cmdopts) -> str:
        return "Agents"


def factory(cli_arg: str, main_config, cmdopts, batch_input_root: Path, **kwargs) -> PopulationSize:
    return PopulationSize(cli_arg, main_config, batch_input_root, population_size.parse(cli_arg))
