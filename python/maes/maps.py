"""Maps: generated, loaded, saved, and as NumPy arrays."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _maes


def _unpacked(bits: npt.NDArray[np.uint8], size: tuple[int, int, int], cell_m: float) -> Map:
    """A map from a bit for each cell, as a pickle has it."""
    walls = np.unpackbits(bits, count=int(np.prod(size)))
    return Map(walls.reshape(size), cell_m, as_is=True)


class Map:
    """A true map of cells, each wall or free. Outside the map all is wall."""

    __slots__ = ("_native",)
    _native: _maes.NativeMap

    def __init__(
        self, walls: npt.ArrayLike, cell_m: float = 1.0, *, as_is: bool = False
    ) -> None:
        """From an array of shape (x, y, z), true for wall.

        Its outermost layer becomes wall and all but the largest free component are filled, so that
        agents can run in it, unless `as_is`.
        """
        array = np.asarray(walls)
        if array.ndim != 3:
            raise _maes.BadInput(f"walls has shape {array.shape}: expected three axes, x, y and z")
        self._native = _maes.NativeMap.from_walls(array.astype(bool), cell_m, as_is)

    @classmethod
    def _of(cls, native: _maes.NativeMap) -> Map:
        made = cls.__new__(cls)
        made._native = native
        return made

    @classmethod
    def generate(
        cls,
        kind: str = "spheres",
        size: int | tuple[int, int, int] = 50,
        *,
        seed: int = 1,
        cell_m: float = 1.0,
        **parameters: Any,
    ) -> Map:
        """A map of a generator ("spheres", "noise", "building", "mine" or "scene", docs/maps.md).

        `size` is in cells, `cell_m` the edge of a cell; `parameters` are the keys of the table
        `map.<kind>`.
        """
        from .scenarios import Scenario

        edge: Any = list(size) if isinstance(size, tuple) else size
        keys: dict[str, Any] = {"kind": kind, "size": edge, "seed": seed, "cell_m": cell_m}
        return Scenario(map={**keys, kind: parameters}).map()

    @classmethod
    def load(
        cls, file: str | os.PathLike[str], *, cell_m: float | None = None, as_is: bool = False
    ) -> Map:
        """Read a map file of any format of docs/maps.md."""
        return cls._of(_maes.NativeMap.load(os.fspath(file), cell_m, as_is))

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write a map file; the ending chooses the format: .m3dm, .txt, .bt, .obj or .stl."""
        path = Path(file)
        path.write_bytes(self._native.encode(path.suffix.lstrip(".")))

    @property
    def size(self) -> tuple[int, int, int]:
        """Cells along x, y and z."""
        x, y, z = self._native.size
        return x, y, z

    @property
    def cell_m(self) -> float:
        """Edge of a cell, metres."""
        return self._native.cell_m

    @property
    def free_cells(self) -> int:
        """Number of free cells."""
        return self._native.free_cells

    def walls(self) -> npt.NDArray[np.bool_]:
        """Whether each cell is wall: bool, shape `size`, indexed [x, y, z]. One copy."""
        return self._native.walls()

    def to_mesh(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
        """The surface of the walls: vertices (N, 3) in metres, and triangles (M, 3) of their indices."""
        triangle = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("flags", "<u2")])
        corners = np.frombuffer(self._native.encode("stl"), triangle, offset=84)["corners"]
        vertices, indices = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
        return vertices.astype(np.float64), np.asarray(indices).reshape(-1, 3).astype(np.int64)

    def plot(self, ax: Any = None, *, z: int | None = None) -> Any:
        """Draw one layer of cells from above with matplotlib; the middle one by default."""
        import matplotlib.pyplot as plt

        if ax is None:
            _, ax = plt.subplots()
        x_m, y_m, _ = (cells * self.cell_m for cells in self.size)
        layer = self.walls()[:, :, self.size[2] // 2 if z is None else z]
        ax.imshow(layer.T, origin="lower", extent=(0, x_m, 0, y_m), cmap="gray_r")
        ax.set_xlabel("x (m)")
        ax.set_ylabel("y (m)")
        return ax

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpacked, (np.packbits(self.walls()), self.size, self.cell_m)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Map) and self._native == other._native

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        x, y, z = self.size
        return f"Map({x} x {y} x {z} cells of {self.cell_m} m, {self.free_cells} free)"
