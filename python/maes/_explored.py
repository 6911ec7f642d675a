"""What a team has seen of a map, and the faces between its free cells and walls."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from .maps import Map
from .recordings import Scan

_Floats = npt.NDArray[np.float64]
_Cells = npt.NDArray[np.uint32]
_SeenCells = tuple[_Cells, _Floats]


class Explored:
    """What the team has seen, by the time at which it did.

    Cells are numbered as in recordings: index = (z * size_y + y) * size_x + x.
    """

    def __init__(self, cave: Map) -> None:
        self.size, self.cell_m = cave.size, cave.cell_m
        # Infinite: not seen.
        self._free = np.full(math.prod(self.size), np.inf)
        self._wall = self._free.copy()

    def add(self, scans: Sequence[Scan]) -> tuple[_SeenCells, _SeenCells]:
        """The cells that are new to the team and when they were seen, free and wall, by time."""
        scans = sorted(scans, key=lambda scan: scan.time_s)
        times = np.array([scan.time_s for scan in scans])
        return (
            self._new(self._free, times, [scan.free for scan in scans]),
            self._new(self._wall, times, [scan.wall for scan in scans]),
        )

    @staticmethod
    def _new(seen_at: _Floats, times: _Floats, found: list[_Cells]) -> _SeenCells:
        cells = np.concatenate([*found, np.empty(0, np.uint32)])
        times = np.repeat(times, [len(of_scan) for of_scan in found])
        # Of each cell the first time; `unique` finds that because times ascend.
        cells, first = np.unique(cells, return_index=True)
        is_new = np.isinf(seen_at[cells])
        cells, times = cells[is_new], times[first[is_new]]
        seen_at[cells] = times
        order = np.argsort(times, kind="stable")
        return cells[order], times[order]

    def coordinates(self, cells: _Cells) -> npt.NDArray[np.intp]:
        """Of cells, as shape (N, 3)."""
        return np.stack(np.unravel_index(cells, self.size[::-1])[::-1], axis=1)

    def faces(self, new_free: _Cells, new_walls: _Cells) -> tuple[_Floats, _Floats, _Floats]:
        """The new faces between free cells and walls, of cells that `add` has returned: times,
        corners (N, 4, 3) in cells, and normals (N, 3), by time.

        Corners go around counter-clockwise for an observer in the free cell.
        """
        all_times, all_corners, all_normals = [], [], []
        for axis in range(3):
            along, across, up = (np.roll(np.eye(3), axis, axis=1)[number] for number in range(3))
            square = np.array([0 * along, across, across + up, up])
            for step in (1, -1):
                # Of each new face the free cell; the wall is the next one along the step.
                beside_walls = self._neighbours(new_walls, axis, -step)
                is_known = np.isfinite(self._free[beside_walls])
                known = beside_walls[is_known & ~np.isin(beside_walls, new_free)]
                free = np.concatenate([self._with_neighbour(new_free, axis, step), known])
                wall = self._neighbours(free, axis, step)
                times = np.maximum(self._free[free], self._wall[wall])
                is_face = np.isfinite(times)
                cells = self.coordinates(free[is_face])
                lower = cells + along if step > 0 else cells
                all_times.append(times[is_face])
                all_corners.append(lower[:, None, :] + square[::-step])
                all_normals.append(np.broadcast_to(-step * along, (len(cells), 3)))
        times = np.concatenate(all_times)
        order = np.argsort(times, kind="stable")
        return times[order], np.concatenate(all_corners)[order], np.concatenate(all_normals)[order]

    def _with_neighbour(self, cells: _Cells, axis: int, step: int) -> npt.NDArray[np.int64]:
        """Those with a neighbour in the map along an axis."""
        wide = cells.astype(np.int64)
        along = wide // math.prod(self.size[:axis]) % self.size[axis] + step
        return wide[(0 <= along) & (along < self.size[axis])]

    def _neighbours(self, cells: _Cells, axis: int, step: int) -> npt.NDArray[np.int64]:
        """The neighbours in the map along an axis."""
        return self._with_neighbour(cells, axis, step) + step * math.prod(self.size[:axis])
