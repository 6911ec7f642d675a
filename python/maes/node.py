"""A Python controller as a ROS 2 node, by the ROS client of `agent_node`; no rclpy is needed.

    python -m maes.node my_file:MyController --id 0

The first argument names a module or a file, and a class in it; the others are those of `agent_node`
(`agent_node --help`). It runs the agents with that class unless the scenario names it itself.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
from pathlib import Path

from . import _maes
from .controllers import Controller, registered


def load(place: str) -> type[Controller]:
    """The class of `module:Class` or `folder/file.py:Class`."""
    module_name, colon, class_name = place.rpartition(":")
    if not (module_name and colon and class_name):
        raise _maes.BadInput(f"{place}: expected MODULE:CLASS or FILE.py:CLASS")
    path = Path(module_name if module_name.endswith(".py") else f"{module_name}.py")
    if path.is_file():
        spec = importlib.util.spec_from_file_location(path.stem, path)
        if spec is None or spec.loader is None:
            raise _maes.BadInput(f"{path}: no Python file")
        module = importlib.util.module_from_spec(spec)
        sys.modules[path.stem] = module
        spec.loader.exec_module(module)
    else:
        module = importlib.import_module(module_name)
    found = getattr(module, class_name, None)
    if not (isinstance(found, type) and issubclass(found, Controller)):
        raise _maes.BadInput(f"{place}: expected a subclass of maes.Controller")
    return found


def main(arguments: list[str]) -> int:
    """Run the node; return its exit code."""
    if not arguments or arguments[0] in ("-h", "--help"):
        print(__doc__)
        return 0 if arguments else 2
    try:
        found = load(arguments[0])
        known = registered([found])
    except (_maes.BadInput, ImportError, OSError, SyntaxError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    rest = arguments[1:]
    if not any(one == "--controller" or one.startswith("--controller=") for one in rest):
        rest = ["--controller", found.name, *rest]
    return _maes.run_node(known, rest)


if __name__ == "__main__":
    code = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    # Threads of the ROS client may still be at work, which must not meet an interpreter that ends.
    os._exit(code)
