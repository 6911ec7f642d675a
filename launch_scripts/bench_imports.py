#!/usr/bin/env python3
"""Compares the import of maps with trimesh, Open3D and laspy on the same files, by processor time.

    python3 launch_scripts/bench_imports.py [FOLDER] [--triangles N] [--points N] [--maes PROGRAM]

Needs Python with trimesh, Open3D, laspy, scipy and networkx. Makes a scene and a cloud in each format in FOLDER
(default: a temporary one), and prints for each file the least processor time of three: of `maes map info` from its
start to its end, which makes the cells; of each library for reading alone, without its own start; and of each library
for reading and making the cells that it can make: those with a point, or those that the surface touches. The two
ratios are the times of the faster library to ours. Exit code 1 if one is below 1.
"""

import argparse
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

import laspy
import numpy
import open3d
import trimesh

MAES = pathlib.Path(__file__).resolve().parents[1] / "target/release/maes"
REPEATS = 3


def shortest(call, clock=time.process_time):
    times = []
    for _ in range(REPEATS):
        start = clock()
        call()
        times.append(clock() - start)
    return min(times)


def children_s():
    """Processor time of all programs that have ended, seconds."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def scene(triangles):
    """A closed surface of about so many triangles, 40 m long."""
    steps = 0
    while 20 * 4 ** (steps + 1) <= triangles:
        steps += 1
    mesh = trimesh.creation.icosphere(subdivisions=steps)
    mesh.apply_scale([20, 15, 6])
    return mesh


def cloud(points):
    """Points of the walls of a hall of 80 m x 60 m x 12 m."""
    size = numpy.array([80.0, 60.0, 12.0])
    random = numpy.random.default_rng(1)
    places = random.random((points, 3)) * size
    side = random.integers(0, 6, points)
    for wall in range(6):
        places[side == wall, wall // 2] = 0.05 if wall % 2 == 0 else size[wall // 2] - 0.05
    return places


def write(folder, mesh, places):
    for name in ("scene.obj", "scene.stl", "scene.ply", "scene.glb"):
        mesh.export(folder / name)
    points = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(places))
    for name in ("cloud.pcd", "cloud.ply", "cloud.xyz"):
        open3d.io.write_point_cloud(str(folder / name), points)
    open3d.io.write_point_cloud(str(folder / "compressed.pcd"), points, compressed=True)
    las = laspy.create(point_format=0, file_version="1.2")
    las.header.scales = [0.001] * 3
    las.x, las.y, las.z = places.T
    las.write(folder / "cloud.las")


def readers(file, cell_m):
    """What reads a file, and what then makes the cells, by library."""
    name = str(file)
    if file.suffix == ".las":
        return {"laspy": (lambda: laspy.read(name).xyz, lambda xyz: numpy.unique((xyz // cell_m).astype(int), axis=0))}
    grid = open3d.geometry.VoxelGrid
    if file.stem == "scene":
        return {
            "trimesh": (lambda: trimesh.load(name, force="mesh"), lambda mesh: mesh.voxelized(cell_m)),
            "Open3D": (
                lambda: open3d.io.read_triangle_mesh(name),
                lambda mesh: grid.create_from_triangle_mesh(mesh, cell_m),
            ),
        }
    points = lambda: open3d.io.read_point_cloud(name)
    return {"Open3D": (points, lambda cloud: grid.create_from_point_cloud(cloud, cell_m))}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("folder", nargs="?", type=pathlib.Path)
    parser.add_argument("--triangles", type=int, default=400_000)
    parser.add_argument("--points", type=int, default=2_000_000)
    parser.add_argument("--cell-m", type=float, default=0.5)
    parser.add_argument("--maes", type=pathlib.Path, default=MAES)
    arguments = parser.parse_args()
    cell_m = arguments.cell_m
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.folder or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        write(folder, scene(arguments.triangles), cloud(arguments.points))
        print(f"trimesh {trimesh.__version__}, Open3D {open3d.__version__}, laspy {laspy.__version__}")
        print(f"{'file':<16}{'MB':>8}{'ours, s':>10}  others, s: reading, and with cells")
        is_slower = False
        for file in sorted(folder.iterdir()):
            command = [arguments.maes, "map", "info", file, "--cell-m", str(cell_m)]
            ours = shortest(lambda: subprocess.run(command, check=True, capture_output=True), children_s)
            others = {}
            for name, (read, cells) in readers(file, cell_m).items():
                others[name] = (shortest(read), shortest(lambda: cells(read())))
            ratios = [min(times) / ours for times in zip(*others.values())]
            is_slower |= min(ratios) < 1
            texts = ", ".join(f"{name} {reading:.3f} {both:.3f}" for name, (reading, both) in others.items())
            size = file.stat().st_size / 1e6
            shown = " ".join(f"{ratio:.2f}" for ratio in ratios)
            print(f"{file.name:<16}{size:>8.1f}{ours:>10.3f}  {texts}; ratios {shown}", flush=True)
    sys.exit(1 if is_slower else 0)


if __name__ == "__main__":
    main()
