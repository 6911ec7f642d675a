"""A project of SIERRA: how much of a map teams of agents explore, by controller and team size."""


def sierra_plugin_type() -> str:
    return "project"
