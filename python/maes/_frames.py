"""Tables as data frames of polars or pandas."""

from __future__ import annotations

import importlib
from typing import Any


def frame(columns: dict[str, list[Any]], library: str | None = None) -> Any:
    """A data frame of polars or pandas; of the first one that is installed by default."""
    if library not in (None, "polars", "pandas"):
        raise ValueError(f'library = {library!r}: expected "polars" or "pandas"')
    for name in [library] if library else ["polars", "pandas"]:
        try:
            return importlib.import_module(name).DataFrame(columns)
        except ModuleNotFoundError as error:
            if error.name != name:
                raise
    raise ModuleNotFoundError(f"a frame needs {library or 'polars or pandas'}: pip install maes[frames]")
