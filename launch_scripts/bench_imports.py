#!/usr/bin/env python3
"""Times the import of maps against trimesh and Open3D, which only read the same files.

    python3 launch_scripts/bench_imports.py [FOLDER] [--triangles N] [--points N]

Needs Python with trimesh, Open3D and laspy, and `maes` in target/release. Makes a scene and a cloud in each format in
FOLDER (default: a temporary one), and prints for each file the shortest of three times: of `maes map info` from its
start to its end, with the cells made, and of each library for the reading alone, without its own start. The ratio is
the time of the faster library to ours. Exit code 1 if a ratio is below 1.
"""

import argparse
import pathlib
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


def shortest(call):
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


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


def readers(file):
    name = str(file)
    if file.suffix == ".las":
        return {"laspy": lambda: laspy.read(name).xyz}
    if file.stem == "scene":
        return {"trimesh": lambda: trimesh.load(name, force="mesh"), "Open3D": lambda: open3d.io.read_triangle_mesh(name)}
    return {"Open3D": lambda: open3d.io.read_point_cloud(name)}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("folder", nargs="?", type=pathlib.Path)
    parser.add_argument("--triangles", type=int, default=400_000)
    parser.add_argument("--points", type=int, default=2_000_000)
    parser.add_argument("--cell-m", default="0.5")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.folder or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        write(folder, scene(arguments.triangles), cloud(arguments.points))
        print(f"trimesh {trimesh.__version__}, Open3D {open3d.__version__}, laspy {laspy.__version__}")
        print(f"{'file':<16}{'MB':>8}{'ours, s':>10}  others, s")
        is_slower = False
        for file in sorted(folder.iterdir()):
            command = [MAES, "map", "info", file, "--cell-m", arguments.cell_m]
            ours = shortest(lambda: subprocess.run(command, check=True, capture_output=True))
            others = {name: shortest(read) for name, read in readers(file).items()}
            ratio = min(others.values()) / ours
            is_slower |= ratio < 1
            texts = ", ".join(f"{name} {seconds:.3f}" for name, seconds in others.items())
            print(f"{file.name:<16}{file.stat().st_size / 1e6:>8.1f}{ours:>10.3f}  {texts}; ratio {ratio:.2f}")
    sys.exit(1 if is_slower else 0)


if __name__ == "__main__":
    main()
