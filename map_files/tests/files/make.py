"""Writes the meshes of this folder with trimesh 4.6.8: `python make.py FOLDER`.

A house of ten boxes that overlap, with two rooms joined by a door and no way out, and two boxes
that overlap. tests/solids.rs has the same boxes.
"""

import sys

import trimesh

HOUSE = [
    ((0.0, 0.0, 0.0), (4.0, 3.0, 0.2)),
    ((0.0, 0.0, 2.3), (4.0, 3.0, 2.5)),
    ((0.0, 0.0, 0.0), (0.3, 3.0, 2.5)),
    ((3.7, 0.0, 0.0), (4.0, 3.0, 2.5)),
    ((0.0, 0.0, 0.0), (4.0, 0.3, 2.5)),
    ((0.0, 2.7, 0.0), (4.0, 3.0, 2.5)),
    ((2.0, 0.1, 0.1), (2.2, 1.0, 2.4)),
    ((2.0, 1.8, 0.1), (2.2, 2.9, 2.4)),
    ((2.0, 0.9, 1.9), (2.2, 1.9, 2.4)),
    ((0.2, 0.2, 0.1), (0.8, 0.8, 2.6)),
]
BOXES = [((0.0, 0.0, 0.0), (2.0, 2.0, 2.0)), ((1.0, 1.0, 1.0), (3.0, 3.0, 3.0))]


def main() -> None:
    folder = sys.argv[1]
    for name, boxes in [("house", HOUSE), ("boxes", BOXES)]:
        solid = trimesh.util.concatenate([trimesh.creation.box(bounds=bounds) for bounds in boxes])
        for extension in ["obj", "stl", "ply", "glb"]:
            solid.export(f"{folder}/{name}.{extension}")


main()
