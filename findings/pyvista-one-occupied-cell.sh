#!/usr/bin/env bash
# pyvista 0.49.1: one occupied cell of an occupancy grid is 8, 1/6 or 0 cubic metres.
#
# Expected: `pyvista.wrap` of an array of 5 x 5 x 5 is a grid of 125 cells, and of one that is
# occupied `threshold(0.5)` leaves one cell of 1 cubic metre.
# Seen: the values become those of *points*: 64 cells between 125 of them, from 0 to 4 m.
# `threshold` keeps each cell with any corner above: 8 cells, a cube of 2 m; a wall of one cell is
# two cells thick, and a gap of one cell between walls is closed. With `all_scalars=True` nothing is
# left of it, and a surface by `contour` has a sixth of its volume. Only as cell data of an
# ImageData of 6 x 6 x 6 *points* it is one cell.
# So: `ImageData(dimensions=np.array(map.shape) + 1)` and `cell_data[...] = map.ravel(order="F")`.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check pyvista==0.49.1
"$dir/venv/bin/python" - <<'PY'
import sys
import numpy as np
import pyvista

def room(walls):
    cells = np.zeros((5, 5, 5))
    cells[walls] = 1
    return cells

one = room((2, 2, 2))
points = pyvista.wrap(one)
cells = pyvista.ImageData(dimensions=np.array(one.shape) + 1)
cells.cell_data["occupied"] = one.ravel(order="F")
any_corner, all_corners, right = points.threshold(0.5), points.threshold(0.5, all_scalars=True), cells.threshold(0.5)
surface = points.contour([0.5])
gap = pyvista.wrap(room((slice(1, 4, 2),))).threshold(0.5)
print("wrapped:", points.n_cells, "cells, up to", points.bounds[1], "m")
print("threshold: %d cells, %.2f m^3; all_scalars: %d cells; contour: %.3f m^3"
      % (any_corner.n_cells, any_corner.volume, all_corners.n_cells, surface.volume))
print("as cell data: %d cell, %.2f m^3" % (right.n_cells, right.volume))
print("two walls of one cell with a gap of one cell: %d of %d cells occupied" % (gap.n_cells, points.n_cells))
if (points.n_cells, any_corner.n_cells, all_corners.n_cells, right.n_cells, gap.n_cells) != (64, 8, 0, 1, 64):
    sys.exit("changed: cells are %s" % [points.n_cells, any_corner.n_cells, all_corners.n_cells, right.n_cells, gap.n_cells])
if abs(surface.volume - 1 / 6) > 0.001:
    sys.exit("changed: the surface has %s" % surface.volume)
PY
