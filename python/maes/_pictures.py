"""Pictures of worlds that are stepped: a layer of cells from above, with the agents."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from .controllers import CellState

PIXELS = 480
# The colours of Okabe and Ito, which readers with any vision tell apart.
AGENTS = np.array(
    [(230, 159, 0), (86, 180, 233), (0, 158, 115), (240, 228, 66), (0, 114, 178), (213, 94, 0), (204, 121, 167)],
    np.uint8,
)
COLOURS = np.zeros((len(CellState), 3), np.uint8)
COLOURS[CellState.UNEXPLORED] = (120, 120, 130)
COLOURS[CellState.FREE] = COLOURS[CellState.COVERED] = (236, 236, 236)
COLOURS[CellState.WALL] = (40, 40, 48)


def of_layer(
    states: npt.NDArray[np.uint8], layer: int, poses: npt.NDArray[np.float64]
) -> npt.NDArray[np.uint8]:
    """A picture, uint8 (height, width, 3), with x to the right and y up.

    `states` are the `CellState`s of a layer, (y, x); `poses` the positions in cells and headings in
    rad of the agents, (agents, 4).
    """
    scale = max(1, round(PIXELS / max(states.shape)))
    picture = COLOURS[states].repeat(scale, 0).repeat(scale, 1)
    rows, columns = np.ogrid[: picture.shape[0], : picture.shape[1]]
    radius = max(0.5 * scale, 3.0)
    for agent, (x, y, z, yaw) in enumerate(poses):
        ahead, up = columns + 0.5 - x * scale, rows + 0.5 - y * scale
        distance = np.hypot(ahead, up)
        is_disc = distance <= radius
        if int(z) != layer:
            is_disc &= distance > radius - 2.0
        # The front half of the middle line.
        along = ahead * np.cos(yaw) + up * np.sin(yaw)
        is_front = is_disc & (along > 0) & (np.abs(up * np.cos(yaw) - ahead * np.sin(yaw)) <= 1.0)
        picture[is_disc] = AGENTS[agent % len(AGENTS)]
        picture[is_front] = 0
    return np.ascontiguousarray(picture[::-1])


class Window:
    """A window of matplotlib with the newest picture."""

    def __init__(self) -> None:
        try:
            import matplotlib.pyplot as plt
        except ImportError as error:
            raise ImportError('render_mode="human" needs matplotlib: pip install "maes[plot]"') from error
        self._plt = plt
        self._figure, self._axes = plt.subplots(num="maes", clear=True)
        self._axes.set_axis_off()
        self._image: Any = None

    def show(self, picture: npt.NDArray[np.uint8]) -> None:
        """Replace the picture, and let the window handle its events."""
        if self._image is None:
            self._image = self._axes.imshow(picture)
            self._plt.show(block=False)
        self._image.set_data(picture)
        self._figure.canvas.draw_idle()
        self._figure.canvas.flush_events()

    def close(self) -> None:
        """Close the window."""
        self._plt.close(self._figure)
