"""Stage 5: controllers are compared, each with its own results."""


def sierra_plugin_type() -> str:
    return "pipeline"
