"""A recording in the viewer Rerun (https://rerun.io); needs rerun-sdk.

    python -m maes.rerun run.mcap                    # opens the viewer
    python -m maes.rerun run.mcap --save run.rrd     # writes a file for it instead

Sim time is the timeline `sim_time`. Entities, in metres of the frame `map`:

- `world/explored/surface`: the faces between walls and free cells that the team has seen, in a row
  for each second with those that are new; `.../walls` and `.../free`: the centres of the cells. The
  blueprint shows all rows up to now, and hides the centres.
- `world/agents/agent_<id>`: pose and body, `.../lidar`: the hits of its last scan
- `world/trails/agent_<id>`: where it has been, `world/paths/agent_<id>`: the path of its task
- `world/contacts`: who is in radio contact
- `progress/team/explored` and `.../covered`, `progress/explored_by/agent_<id>`: shares of the free
  cells

Hits and contacts are there if the recording has them (`views.record`: `points`, `contacts`).
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _maes
from .maps import Map
from .recordings import Recording
from .scenarios import Scenario

try:
    import rerun as rr
    import rerun.blueprint as rrb
except ModuleNotFoundError as error:
    if error.name != "rerun":
        raise
    raise ModuleNotFoundError(
        "the viewer Rerun is not installed: pip install rerun-sdk", name=error.name
    ) from None

TIMELINE = "sim_time"

# Those of the agents on the page of `maes view`, see viewer/src/scene/colours.ts.
_COLOURS = [
    *(0xF5A623, 0x56C1F5, 0x1FC795, 0xF6E34C, 0xE98CC4),
    *(0xFF6B3D, 0x5C8DFF, 0xB9F26D, 0xC800FF, 0x4BFAF0),
]
_CONTACTS = 0xC8D2DCFF
_EXPLORED = 0xF0C27AFF
_COVERED = 0x56C8D8FF
_FREE = 0x5A96D2FF
_WALL = 0x8C96A5FF
# Of the surface, from the bottom of the map to its top.
_LOW, _HIGH = np.array([58, 74, 110]), np.array([214, 222, 232])

# Cells and trails have a row for each period in which there is something new, seconds.
_PERIOD_S = 1.0

# Of `maes_msgs/Task` and `visualization_msgs/Marker`.
_KEEP, _PATH = 0, 4
_LINE_LIST, _ADD = 5, 0

_Floats = npt.NDArray[np.float64]
_Cells = npt.NDArray[np.uint32]
_Poses = tuple[_Floats, _Floats, _Floats]


def _colour(agent: int) -> int:
    return _COLOURS[agent % len(_COLOURS)] << 8 | 0xFF


def _times(seconds: npt.ArrayLike) -> Any:
    # Stamps are whole ticks, and seconds in floating point need not be.
    nanoseconds = np.rint(np.asarray(seconds, np.float64) * 1e9).astype("timedelta64[ns]")
    return [rr.TimeColumn(TIMELINE, duration=nanoseconds)]


def _row_ends(times: _Floats) -> npt.NDArray[np.intp]:
    """Where the rows of ascending times end: one for each period, at its last time."""
    return np.flatnonzero(np.diff(np.ceil(times / _PERIOD_S), append=np.inf)) + 1


def _radius_m(scenario: Scenario, agent: int) -> float:
    for entry in scenario.to_dict().get("bodies", []):
        if agent in entry["agents"]:
            return float(entry["radius_m"])
    return float(scenario["body.radius_m"])


def _points(points: Iterable[dict[str, float]]) -> list[tuple[float, float, float]]:
    return [(point["x"], point["y"], point["z"]) for point in points]


def _poses(recording: Recording) -> dict[int, _Poses]:
    """Times, positions and quaternions of each agent that was in the world."""
    rows: dict[int, list[list[float]]] = {}
    for time_s, message in recording.messages("/tf"):
        for stamped in message["transforms"]:
            agent = int(stamped["child_frame_id"].removeprefix("agent_").partition("/")[0])
            parts = stamped["transform"]["translation"], stamped["transform"]["rotation"]
            numbers = [part[axis] for part, axes in zip(parts, ("xyz", "xyzw")) for axis in axes]
            rows.setdefault(agent, []).append([time_s, *numbers])
    arrays = {agent: np.array(of_agent) for agent, of_agent in sorted(rows.items())}
    return {agent: (of[:, 0], of[:, 1:4], of[:, 4:]) for agent, of in arrays.items()}


def _cave(recording: Recording) -> Map:
    cave = recording.map()
    if cave is None:
        raise _maes.BadInput(f"{recording.file}: no map in the recording")
    return cave


def _first_seen(recording: Recording, agents: int, kind: str) -> tuple[_Cells, _Floats]:
    """Indices of the cells that the team has seen, and when, by time."""
    scans = [scan for agent in range(agents) for scan in recording.scans(agent)]
    scans.sort(key=lambda scan: scan.time_s)
    found = [getattr(scan, kind) for scan in scans]
    cells = np.concatenate([*found, np.empty(0, np.uint32)])
    times = np.repeat([scan.time_s for scan in scans], [len(of_scan) for of_scan in found])
    # Of each cell the first time; `unique` finds that because times ascend.
    cells, first = np.unique(cells, return_index=True)
    order = np.argsort(times[first], kind="stable")
    return cells[order], times[first][order]


def _faces(free: _Floats, wall: _Floats) -> tuple[_Floats, _Floats, _Floats]:
    """The faces between free cells and walls, from arrays (x, y, z) of the times at which cells
    were seen, infinite for never: times, corners (N, 4, 3) in cells, and normals (N, 3), by time.

    Corners go around counter-clockwise for an observer in the free cell.
    """
    times, corners, normals = [], [], []
    for axis in range(3):
        lower = tuple(slice(None, -1) if one == axis else slice(None) for one in range(3))
        upper = tuple(slice(1, None) if one == axis else slice(None) for one in range(3))
        along, across, up = (np.roll(np.eye(3), axis, axis=1)[number] for number in range(3))
        for seen, direction in (
            (np.maximum(wall[lower], free[upper]), 1),
            (np.maximum(free[lower], wall[upper]), -1),
        ):
            cells = np.argwhere(np.isfinite(seen))
            square = [0 * along, across, across + up, up][::direction]
            times.append(seen[tuple(cells.T)])
            corners.append((cells + along)[:, None, :] + np.array(square))
            normals.append(np.broadcast_to(along * direction, (len(cells), 3)))
    of_all = np.concatenate(times)
    order = np.argsort(of_all, kind="stable")
    return of_all[order], np.concatenate(corners)[order], np.concatenate(normals)[order]


def _send_explored(stream: rr.RecordingStream, recording: Recording, agents: int) -> None:
    cave = _cave(recording)
    size, cell_m = cave.size, cave.cell_m
    seen_at = []
    for kind, name, colour in (("free", "free", _FREE), ("wall", "walls", _WALL)):
        cells, times = _first_seen(recording, agents, kind)
        grid = np.full(math.prod(size), np.inf)
        grid[cells] = times
        # The index of a cell has x last.
        seen_at.append(grid.reshape(size[::-1]).T)
        if len(cells):
            centres = (np.stack(np.unravel_index(cells, size[::-1])[::-1], axis=1) + 0.5) * cell_m
            path = f"world/explored/{name}"
            radii = [cell_m / 4]
            stream.log(path, rr.Points3D.from_fields(colors=[colour], radii=radii), static=True)
            ends = _row_ends(times)
            rows = rr.Points3D.columns(positions=centres).partition(np.diff(ends, prepend=0))
            stream.send_columns(path, _times(times[ends - 1]), rows)

    times, corners, normals = _faces(*seen_at)
    if not len(times):
        return
    ends = _row_ends(times)
    lengths = np.diff(ends, prepend=0)
    # Corners are numbered from zero in each row.
    first_corner = 4 * (np.arange(len(times)) - np.repeat(ends - lengths, lengths))
    triangles = first_corner[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    heights = corners[:, :, 2].reshape(-1, 1) / size[2]
    columns = [
        *rr.Mesh3D.columns(
            vertex_positions=corners.reshape(-1, 3) * cell_m,
            vertex_normals=np.repeat(normals, 4, axis=0),
            vertex_colors=(_LOW + heights * (_HIGH - _LOW)).astype(np.uint8),
        ).partition(lengths * 4),
        *rr.Mesh3D.columns(triangle_indices=triangles.reshape(-1, 3)).partition(lengths * 2),
    ]
    path = "world/explored/surface"
    # From behind the surface is not drawn, so that the agents inside are visible.
    stream.log(path, rr.Mesh3D.from_fields(face_rendering="Front"), static=True)
    stream.send_columns(path, _times(times[ends - 1]), columns)


def _send_agent(
    stream: rr.RecordingStream, recording: Recording, agent: int, poses: _Poses, end_s: float
) -> None:
    times, positions, quaternions = poses
    name, colour = f"agent_{agent}", _colour(agent)
    body = f"world/agents/{name}"
    columns = rr.Transform3D.columns(translation=positions, quaternion=quaternions)
    stream.send_columns(body, _times(times), columns)
    # Not static: a body is where it is from its first pose on.
    radius = _radius_m(recording.scenario, agent)
    half_sizes, labels = [[radius] * 3], [name]
    ellipsoid = rr.Ellipsoids3D.columns(half_sizes=half_sizes, colors=[colour], labels=labels)
    stream.send_columns(body, _times(times[:1]), ellipsoid)
    stream.log(body, rr.Ellipsoids3D.from_fields(fill_mode="solid"), static=True)

    hits = [scan for scan in recording.hits(agent) if len(scan.point_m)]
    if hits:
        lidar = f"{body}/lidar"
        stream.log(lidar, rr.Points3D.from_fields(colors=[colour], radii=[radius / 8]), static=True)
        positions_of = rr.Points3D.columns(positions=np.concatenate([hit.point_m for hit in hits]))
        lengths = [len(hit.point_m) for hit in hits]
        times_of = _times([hit.time_s for hit in hits])
        stream.send_columns(lidar, times_of, positions_of.partition(lengths))

    if times[-1] < end_s:
        after_last = _times(times[-1:] + 1e-9)
        for path in (body, f"world/paths/{name}"):
            stream.send_columns(path, after_last, rr.Clear.columns(is_recursive=[True]))

    ends = _row_ends(times)
    # Each strip continues where the one before it ends.
    starts = np.concatenate([[0], ends[:-1] - 1])
    strips = [positions[start:end] for start, end in zip(starts, ends)]
    trail = f"world/trails/{name}"
    stream.log(trail, rr.LineStrips3D.from_fields(colors=[colour]), static=True)
    stream.send_columns(trail, _times(times[ends - 1]), rr.LineStrips3D.columns(strips=strips))


def _send_tasks(stream: rr.RecordingStream, recording: Recording, agent: int) -> None:
    observed = recording.poses(agent)
    position_at = dict(zip(observed.time_s, observed.position_m))
    times, strips = [], []
    for time_s, command in recording.messages(f"/agent_{agent}/command"):
        task = command["task"]
        if task["kind"] != _KEEP:
            times.append(time_s)
            is_path = task["kind"] == _PATH
            strips.append([[tuple(position_at[time_s]), *_points(task["path"])]] if is_path else [])
    if times:
        path = f"world/paths/agent_{agent}"
        stream.log(path, rr.LineStrips3D.from_fields(colors=[_colour(agent)]), static=True)
        _send_strips(stream, path, times, strips)


def _send_contacts(stream: rr.RecordingStream, recording: Recording) -> None:
    times, strips = [], []
    for time_s, marker in recording.messages("/sim/contacts"):
        is_drawn = marker["action"] == _ADD and marker["type"] == _LINE_LIST
        ends = _points(marker["points"]) if is_drawn else []
        times.append(time_s)
        strips.append([list(pair) for pair in zip(ends[::2], ends[1::2])])
    if times:
        path = "world/contacts"
        stream.log(path, rr.LineStrips3D.from_fields(colors=[_CONTACTS]), static=True)
        _send_strips(stream, path, times, strips)


def _send_strips(
    stream: rr.RecordingStream, path: str, times: Sequence[float], strips: Sequence[list[Any]]
) -> None:
    """Line strips of which each row has some."""
    flat = [np.array(strip) for row in strips for strip in row]
    columns = rr.LineStrips3D.columns(strips=flat).partition([len(row) for row in strips])
    stream.send_columns(path, _times(times), columns)


def _send_progress(stream: rr.RecordingStream, recording: Recording, agents: int) -> None:
    messages = recording.messages("/sim/progress")
    times = [time_s for time_s, _ in messages]
    curves = []
    for key, colour in (("explored", _EXPLORED), ("covered", _COVERED)):
        shares = [one[key] for _, one in messages]
        curves.append((f"team/{key}", f"{key} by the team", colour, shares))
    for agent in range(agents):
        shares = [one["explored_by"][agent] for _, one in messages]
        curves.append((f"explored_by/agent_{agent}", f"agent_{agent}", _colour(agent), shares))
    for path, name, colour, shares in curves:
        path = f"progress/{path}"
        stream.log(path, rr.SeriesLines(colors=[colour], names=[name]), static=True)
        stream.send_columns(path, _times(times), rr.Scalars.columns(scalars=shares))


def send(recording: Recording, stream: rr.RecordingStream) -> None:
    """Sends a recording to a stream, which may lead to a viewer, a server or a file."""
    agents = int(recording.scenario["agents.count"])
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    poses = _poses(recording)
    end_s = max((times[-1] for times, _, _ in poses.values()), default=0.0)
    for agent, of_agent in poses.items():
        _send_tasks(stream, recording, agent)
        _send_agent(stream, recording, agent, of_agent, end_s)
    _send_contacts(stream, recording)
    _send_progress(stream, recording, agents)
    _send_explored(stream, recording, agents)


def blueprint(recording: Recording) -> rrb.Blueprint:
    """The layout: the explored cave with the agents, and beside it the shares over time."""
    cave = _cave(recording)
    edges = np.array(cave.size) * cave.cell_m
    eye = rrb.EyeControls3D(
        position=edges * (-0.3, -0.7, 0.9), look_target=edges / 2, eye_up=(0.0, 0.0, 1.0)
    )
    begin, now = rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.cursor_relative()
    so_far = rrb.VisibleTimeRanges(rrb.VisibleTimeRange(TIMELINE, start=begin, end=now))
    end_s = max((time_s for time_s, _ in recording.messages("/sim/digest")), default=0.0)
    whole_run = rrb.TimeAxis(
        view_range=rrb.TimeRange(
            start=rrb.TimeRangeBoundary.absolute(seconds=0.0),
            end=rrb.TimeRangeBoundary.absolute(seconds=end_s),
        )
    )
    shares, legend = rrb.ScalarAxis(range=(0.0, 1.0)), rrb.Corner2D.RightBottom
    agents = range(int(recording.scenario["agents.count"]))
    overrides: dict[str, Any] = {f"world/trails/agent_{agent}": [so_far] for agent in agents}
    overrides["world/explored/surface"] = [so_far]
    for cells in ("free", "walls"):
        overrides[f"world/explored/{cells}"] = [so_far, rrb.EntityBehavior(visible=False)]
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Spatial3DView(name="Cave", origin="world", overrides=overrides, eye_controls=eye),
            rrb.Vertical(
                *(
                    rrb.TimeSeriesView(
                        name=name,
                        origin=f"progress/{origin}",
                        axis_x=whole_run,
                        axis_y=shares,
                        plot_legend=legend,
                    )
                    for name, origin in (
                        ("Explored and covered", "team"),
                        ("Explored by agent", "explored_by"),
                    )
                )
            ),
            column_shares=[2, 1],
        ),
        rrb.TimePanel(timeline=TIMELINE),
        collapse_panels=True,
    )


def save(recording: Recording, file: str | os.PathLike[str]) -> None:
    """Saves a recording with the layout as `.rrd`, a file of the viewer."""
    file = os.fspath(file)
    if not file.endswith(".rrd"):
        raise _maes.BadInput(f"{file}: expected a file name that ends with .rrd")
    layout = blueprint(recording)
    # Rerun's own error for a file that cannot be written has no type.
    open(file, "ab").close()
    stream = rr.RecordingStream("maes")
    stream.save(file, default_blueprint=layout)
    stream.send_recording_name(os.path.basename(recording.file))
    send(recording, stream)
    stream.disconnect()


def show(recording: Recording) -> int:
    """Shows a recording in a viewer of its own until that is closed; returns its exit code."""
    with tempfile.TemporaryDirectory(prefix="maes-") as folder:
        file = os.path.join(folder, os.path.basename(recording.file) + ".rrd")
        save(recording, file)
        # Rather than `spawn` of the stream, with which the viewer listens on all interfaces.
        flags = ["--bind", "127.0.0.1", "--port", "auto", "--hide-welcome-screen"]
        return subprocess.call([sys.executable, "-m", "rerun", *flags, file])


def main(arguments: list[str]) -> int:
    """Shows or saves the recording of a command line; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m maes.rerun", description="Shows a recording in Rerun."
    )
    parser.add_argument("recording", metavar="RECORDING.mcap")
    parser.add_argument(
        "--save", metavar="FILE.rrd", help="write a file instead of opening the viewer"
    )
    given = parser.parse_args(arguments)
    try:
        recording = Recording(given.recording)
        if given.save is None:
            return show(recording)
        save(recording, given.save)
    except (_maes.BadInput, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
