"""Writes the rooms of this folder: `python make_rooms.py FOLDER`.

room_trimesh.dae by trimesh 5.2.0 and pycollada 0.9.3, room_assimp.dae from the same STL by assimp 5.2.5 of
Debian (on the path), and room.e57 by pye57 0.4.19: points of a room, seen by two scanners.
"""

import subprocess
import sys

import numpy as np
import pye57
import trimesh

# A room of 12 x 9 x 6 m between walls of 1 m, with a wall, a pillar and a beam in it.
BOXES = [
    ((0, 0, 0), (14, 11, 1)),
    ((0, 0, 7), (14, 11, 8)),
    ((0, 0, 1), (1, 11, 7)),
    ((13, 0, 1), (14, 11, 7)),
    ((1, 0, 1), (13, 1, 7)),
    ((1, 10, 1), (13, 11, 7)),
    ((5, 1, 1), (6, 7, 5)),
    ((9, 6, 1), (11, 7, 7)),
    ((11, 1, 6), (13, 3, 7)),
]

# Places and turns about z of the scanners, and which points they see.
SCANNERS = [((3.25, 2.25, 1.75), 0.0), ((1.75, 2.25, 1.75), np.pi / 2)]


def scans(file: str) -> None:
    steps = np.array(list(np.ndindex(13, 9, 7)))
    points = steps[np.any(steps % (12, 8, 6) == 0, axis=1)] / 2 + 0.25
    e57 = pye57.E57(file, mode="w")
    for place, turn in SCANNERS:
        seen = points[points[:, 0] >= 2.5] if turn == 0.0 else points[points[:, 0] <= 3.5]
        cosine, sine = np.cos(turn), np.sin(turn)
        rotation = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
        # Two points with nothing but a direction, and one at the scanner.
        local = np.vstack([(seen - place) @ rotation, [[1e3, 0, 0], [0, 1e3, 0], [0, 0, 0]]])
        state = np.zeros(len(local), dtype=np.int8)
        state[-3:-1] = 2
        axes = dict(zip(["cartesianX", "cartesianY", "cartesianZ"], local.T))
        quaternion = np.array([np.cos(turn / 2), 0, 0, np.sin(turn / 2)])
        data = {**axes, "cartesianInvalidState": state}
        e57.write_scan_raw(data, rotation=quaternion, translation=np.array(place))
    e57.close()


def main() -> None:
    folder = sys.argv[1]
    room = trimesh.util.concatenate([trimesh.creation.box(bounds=np.array(bounds, float)) for bounds in BOXES])
    with open(f"{folder}/room_trimesh.dae", "wb") as file:
        file.write(trimesh.exchange.dae.export_collada(room))
    room.export(f"{folder}/room.stl")
    subprocess.run(["assimp", "export", f"{folder}/room.stl", f"{folder}/room_assimp.dae"], check=True)
    scans(f"{folder}/room.e57")


main()
