"""Prints what a file of the viewer Rerun has, as JSON, for tests/rerun.rs.

    read_rerun.py FILE.rrd

`columns` has the rows of each entity and component, `[nanoseconds, values]`, for all but the mesh,
of which `faces` has the rows: `[nanoseconds, [[free cell, wall], ...]]`, cells of 1 m as [x, y, z],
and by the order of the corners, which decides from where a face is visible. `blueprint` has the
entities whose display the layout changes, and `origins` those that its views show.
"""

import json
import sys

import numpy as np
from rerun.chunk import RrdReader


def rows(batch, component):
    times = batch.column("sim_time").cast("int64").to_pylist()
    return [[time, values] for time, values in zip(times, batch.column(component).to_pylist())]


def faces(batch):
    corners = rows(batch, "Mesh3D:vertex_positions")
    triangles = rows(batch, "Mesh3D:triangle_indices")
    for (time, vertices), (_, indices) in zip(corners, triangles):
        pairs = []
        vertices = np.array(vertices).reshape(-1, 4, 3)
        for face, (first, second) in enumerate(np.array(indices).reshape(-1, 2, 3)):
            a, b, c = vertices.reshape(-1, 3)[first]
            towards_viewer = np.cross(b - a, c - a)
            other = vertices.reshape(-1, 3)[second]
            same = np.cross(other[1] - other[0], other[2] - other[0])
            assert (towards_viewer == same).all() and np.abs(towards_viewer).sum() == 1, "a square"
            assert {*first, *second} == set(range(4 * face, 4 * face + 4)), "of its own corners"
            middle = vertices[face].mean(axis=0)
            cells = [np.floor(middle + side * towards_viewer / 2) for side in (1, -1)]
            pairs.append([cell.astype(int).tolist() for cell in cells])
        yield [time, pairs]


reader = RrdReader(sys.argv[1])
(recording,), (layout,) = reader.recordings(), reader.blueprints()
content = {"columns": {}, "faces": [], "blueprint": [], "origins": []}
for chunk in reader.stream(store=recording):
    if chunk.is_static:
        continue
    assert chunk.timeline_names == ["sim_time"], chunk.entity_path
    batch = chunk.to_record_batch()
    for name in batch.schema.names:
        if name.startswith("Mesh3D:"):
            continue
        if ":" in name:
            column = content["columns"].setdefault(f"{chunk.entity_path} {name}", [])
            if name == "Scalars:scalars":
                # As texts, because readers of JSON differ in the last bit.
                texts = [[time, [repr(one) for one in of]] for time, of in rows(batch, name)]
                column.extend(texts)
            else:
                column.extend(rows(batch, name))
    if "Mesh3D:vertex_positions" in batch.schema.names:
        content["faces"].extend(faces(batch))
for chunk in reader.stream(store=layout):
    _, is_override, entity = chunk.entity_path.partition("/ViewContents/overrides")
    if is_override:
        content["blueprint"].append(entity.removesuffix("/visualizers"))
    batch = chunk.to_record_batch()
    if "ViewBlueprint:space_origin" in batch.schema.names:
        content["origins"].extend(batch.column("ViewBlueprint:space_origin").to_pylist()[0])
print(json.dumps(content))
