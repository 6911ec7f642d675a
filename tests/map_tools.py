"""Opens files and topics of this project with the tools that other people have: trimesh, Open3D, pyoctomap, PCL.

    map_tools.py FOLDER

FOLDER has cave.txt with the same map as cave.obj, .stl, .glb, .pcd and .bt, and run.mcap with the topics of trees
(tests/map_tools.rs makes them). Prints a line for each check; ends with an error at the first that fails.
"""

import pathlib
import shutil
import struct
import subprocess
import sys

import numpy
import open3d
import pyoctomap
import trimesh
from mcap.reader import make_reader


def check(holds, words):
    if not holds:
        raise SystemExit(f"failed: {words}")
    print(f"ok: {words}")


def cave(path):
    """Walls by x, y, z, and the length of a cell."""
    first, rest = path.read_text().split("\n", 1)
    layers = [layer.split("\n") for layer in rest.strip("\n").split("\n\n")]
    walls = numpy.array([[[cell == "#" for cell in row] for row in layer[::-1]] for layer in layers])
    return walls.transpose(2, 1, 0), float(first.split("=")[1])


def check_meshes(folder, walls, cell_m):
    volume = (~walls).sum() * cell_m**3
    low, high = [edge(numpy.argwhere(~walls), axis=0) for edge in (numpy.min, numpy.max)]
    bounds = numpy.array([low, high + 1]) * cell_m
    for name in ("cave.obj", "cave.stl", "cave.glb"):
        file = folder / name
        mesh = trimesh.load(file, force="mesh")
        mesh.merge_vertices()
        check(mesh.is_watertight, f"{name} is watertight for trimesh {trimesh.__version__}")
        # Triangles face the wall: outwards of the free space.
        check(numpy.isclose(mesh.volume, volume), f"{name}: volume {mesh.volume:.6g}, expected {volume:.6g}")
        shown = bounds if name != "cave.glb" else numpy.array(
            [[bounds[0, 0], bounds[0, 2], -bounds[1, 1]], [bounds[1, 0], bounds[1, 2], -bounds[0, 1]]]
        )
        check(numpy.allclose(mesh.bounds, shown), f"{name}: bounds {mesh.bounds.tolist()}")
        opened = open3d.io.read_triangle_mesh(str(file))
        opened.merge_close_vertices(cell_m * 1e-3)
        check(len(opened.triangles) == len(mesh.faces), f"{name}: {len(opened.triangles)} triangles in Open3D")


def check_cloud(folder, walls, cell_m):
    cloud = open3d.io.read_point_cloud(str(folder / "cave.pcd"))
    found = {tuple(cell) for cell in numpy.floor(numpy.asarray(cloud.points) / cell_m).astype(int)}
    # Also those that touch a free cell at an edge or a corner.
    free = numpy.pad(~walls, 1)
    near = numpy.zeros_like(walls)
    x, y, z = walls.shape
    for i, j, k in numpy.ndindex(3, 3, 3):
        near |= free[i : i + x, j : j + y, k : k + z]
    expected = {tuple(cell) for cell in numpy.argwhere(walls & near)}
    check(found == expected, f"cave.pcd: {len(found)} walls in Open3D {open3d.__version__}")
    if shutil.which("pcl_pcd2ply"):
        subprocess.run(["pcl_pcd2ply", "cave.pcd", "cave_pcl.ply"], cwd=folder, check=True, capture_output=True)
        points = len(open3d.io.read_point_cloud(str(folder / "cave_pcl.ply")).points)
        check(points == len(cloud.points), f"cave.pcd: {points} points in PCL")


def states(tree, shape, cell_m, corner=(0, 0, 0)):
    """1 where a tree is occupied, 0 where it is free, -1 where it knows nothing."""
    found = numpy.full(shape, -1)
    for cell in numpy.ndindex(*shape):
        at = [(along + first + 0.5) * cell_m for along, first in zip(cell, corner)]
        node = tree.search(numpy.array(at))
        if node is not None:
            found[cell] = tree.isNodeOccupied(node)
    return found


def check_tree(folder, walls, cell_m):
    tree = pyoctomap.OcTree(cell_m)
    check(tree.readBinary(str(folder / "cave.bt")), "cave.bt is a tree")
    check(numpy.array_equal(states(tree, walls.shape, cell_m), walls), "cave.bt: the same cells in pyoctomap")


def octomap(message):
    """Frame, whether it is binary, type, length of a cell and data of an octomap_msgs/Octomap in CDR."""
    body, at = message[4:], 8

    def word():
        nonlocal at
        at = (at + 3) & ~3
        (length,) = struct.unpack_from("<I", body, at)
        at += 4 + length
        return body[at - length : at]

    frame = word()[:-1].decode()
    binary, at = bool(body[at]), at + 1
    kind = word()[:-1].decode()
    at = (at + 7) & ~7
    (cell_m,) = struct.unpack_from("<d", body, at)
    at += 8
    return frame, binary, kind, cell_m, word()


def nodes_in(data):
    """Nodes and leaves of a binary tree."""
    count, inner, at = 1, 1, 0
    while inner:
        (bits,) = struct.unpack_from("<H", data, at)
        children = [bits >> 2 * child & 3 for child in range(8)]
        count += sum(child != 0 for child in children)
        inner += children.count(3) - 1
        at += 2
    check(at == len(data), f"{len(data)} bytes are {count} nodes")
    return count


def tree_of(folder, message):
    frame, binary, kind, cell_m, data = octomap(message)
    check((frame, binary, kind) == ("map", True, "OcTree"), f"a binary tree in the frame {frame}")
    file = folder / "topic.bt"
    # The header that octomap_msgs leaves out.
    header = f"# Octomap OcTree binary file\nid OcTree\nsize {nodes_in(data)}\nres {cell_m}\ndata\n"
    file.write_bytes(header.encode() + data)
    tree = pyoctomap.OcTree(cell_m)
    check(tree.readBinary(str(file)), "pyoctomap reads the tree")
    return tree, cell_m


def check_topics(folder, walls, cell_m):
    with (folder / "run.mcap").open("rb") as recording:
        messages = {}
        for _, channel, message in make_reader(recording).iter_messages():
            messages.setdefault(channel.topic, []).append(message.data)
    tree, length_m = tree_of(folder, messages["/sim/octomap"][-1])
    check(length_m == cell_m, f"/sim/octomap has cells of {length_m} m")
    check(numpy.array_equal(states(tree, walls.shape, cell_m), walls), "/sim/octomap: the same cells in pyoctomap")
    counts = []
    # Before the first scan nothing is known: no node.
    known = [message for message in messages["/sim/explored_octomap"] if octomap(message)[-1]]
    for message in (known[0], known[-1]):
        seen = states(tree_of(folder, message)[0], walls.shape, cell_m)
        check(numpy.array_equal(seen == 1, walls & (seen != -1)), "/sim/explored_octomap: what is seen is right")
        counts.append((seen == 0).sum())
    check(0 < counts[0] < counts[1], f"/sim/explored_octomap grows from {counts[0]} to {counts[1]} free cells")
    for topic in ("/sim/explored_map", "/sim/explored_points"):
        check(len(messages[topic]) > 1, f"{topic}: {len(messages[topic])} messages")


def main():
    folder = pathlib.Path(sys.argv[1])
    walls, cell_m = cave(folder / "cave.txt")
    check_meshes(folder, walls, cell_m)
    check_cloud(folder, walls, cell_m)
    check_tree(folder, walls, cell_m)
    check_topics(folder, walls, cell_m)


if __name__ == "__main__":
    main()
