#!/usr/bin/env bash
# Blender 3.4.1 (Debian 12): its PLY exporter leaves mirrored objects inside out, and its COLLADA
# exporter says Z_UP of a scene that it has turned to y upwards.
#
# Expected: an object with a scale of -1 has its faces outside after every export; and up_axis is
# that of the numbers in the file.
# Seen: STL and OBJ reverse the faces of the mirrored box (volume +6), PLY does not (volume -6): a
# reader that goes by orientation takes it for a cavity, and beside another box their volumes
# cancel. `wm.collada_export` with apply_global_orientation, upwards Y, turns the matrices and
# writes Z_UP, so that every reader that heeds it gets the scene on its side.
# So: apply scales (Ctrl-A) before an export to PLY, and leave the axes of COLLADA alone.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
mkdir debs root
apt-get install -qq -y --download-only --no-install-recommends -o Debug::NoLocking=1 -o APT::Sandbox::User=root \
    -o Dir::Cache::archives="$dir/debs" blender=3.4.1+dfsg-2+b1 python3-numpy >/dev/null 2>&1
find debs -name '*.deb' -exec dpkg -x {} root \;
library=$dir/root/usr/lib/x86_64-linux-gnu
export LD_LIBRARY_PATH=$library:$library/blas:$library/lapack:$library/pulseaudio:$dir/root/usr/lib:$dir/root/lib/x86_64-linux-gnu
export BLENDER_SYSTEM_SCRIPTS=$dir/root/usr/share/blender/scripts BLENDER_SYSTEM_DATAFILES=$dir/root/usr/share/blender/datafiles
cat > scene.py <<'PY'
import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.mesh.primitive_cube_add(size=1)
bpy.context.object.scale = (-1, 2, 3)
bpy.ops.export_mesh.stl(filepath="box.stl", ascii=True)
bpy.ops.wm.obj_export(filepath="box.obj", export_triangulated_mesh=True)
bpy.ops.export_mesh.ply(filepath="box.ply", use_ascii=True)
bpy.ops.wm.collada_export(filepath="box.dae", apply_global_orientation=True,
                          export_global_forward_selection="-Z", export_global_up_selection="Y")
PY
"$dir/root/usr/bin/blender" -b --factory-startup --python scene.py >log 2>&1 || { tail -3 log; exit 1; }
python3 - <<'PY'
import re
import sys

def volume(corners, faces):
    total = 0.0
    for face in faces:
        for b, c in zip(face[1:], face[2:]):
            (p, q, r), (s, t, u), (v, w, x) = corners[face[0]], corners[b], corners[c]
            total += p * (t * x - u * w) - q * (s * x - u * v) + r * (s * w - t * v)
    return round(total / 6, 4)

def numbers(line):
    return [float(word) for word in line.split()]

lines = [numbers(line.split("vertex")[1]) for line in open("box.stl") if "vertex" in line]
found = {"stl": volume(lines, [range(at, at + 3) for at in range(0, len(lines), 3)])}
obj = open("box.obj").read().split("\n")
faces = [[int(word.split("/")[0]) - 1 for word in line.split()[1:]] for line in obj if line.startswith("f ")]
found["obj"] = volume([numbers(line[2:]) for line in obj if line.startswith("v ")], faces)
head, body = open("box.ply").read().split("end_header\n")
count = int(re.search("element vertex ([0-9]+)", head)[1])
body = body.strip().split("\n")
faces = [[int(word) for word in line.split()[1:]] for line in body[count:]]
found["ply"] = volume([numbers(line)[:3] for line in body[:count]], faces)
dae = open("box.dae").read()
matrix = [float(word) for word in re.search("<matrix[^>]*>([^<]*)<", dae)[1].split()]
found["up_axis"] = re.search("<up_axis>(.*?)<", dae)[1]
# The longest side of the box is that along z of the scene.
sides = [max(abs(entry) for entry in matrix[4 * row : 4 * row + 3]) for row in range(3)]
found["3 m along"] = "xyz"[sides.index(max(sides))]
for name, result in found.items():
    print(f"{name}: {result}")
if found["stl"] != 6 or found["obj"] != 6 or found["3 m along"] != "y":
    sys.exit("changed: it is %s" % found)
if found["ply"] != -6 or found["up_axis"] != "Z_UP":
    sys.exit("changed: it is %s" % found)
PY
