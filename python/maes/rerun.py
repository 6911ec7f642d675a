"""A recording in the viewer Rerun (https://rerun.io), also of a run under way; needs rerun-sdk.

    python -m maes.rerun run.mcap                    # opens the viewer, and follows the run
    python -m maes.rerun run.mcap --save run.rrd     # writes a file for it instead

Sim time is the timeline `sim_time`. Entities, in metres of the frame `map`:

- `world/explored/surface`: the faces between walls and free cells that the team has seen, in a row
  for each second, or part of one of a run under way, with those that are new; `.../walls` and `.../free`: the centres of the cells. The
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
import dataclasses
import os
import socket
import subprocess
import sys
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _maes
from ._explored import Explored
from .maps import Map
from .recordings import Recording, RecordingFollower
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
    *(0xF5A623, 0x56C1F5, 0x1FC795, 0xF6E34C, 0xE98CC4, 0xFF6B3D, 0x5C8DFF, 0xB9F26D),
    *(0xC800FF, 0x4BFAF0, 0xFF00AA, 0x00E100, 0xF5CDFF, 0xFA5FFF, 0xAFA0FF, 0xFAB4A5),
    *(0x00F09B, 0xA5BE0F, 0xAF64C3, 0x2896A5, 0x00A500, 0x915FFF, 0xBE6E78, 0xAFD2A5),
    *(0x8C8CBE, 0x968746, 0xC89B78),
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

# The viewer listens on this machine only.
_HOST = "127.0.0.1"

# Between two readings of a recording that is being written, wall time.
_PERIOD_WALL_S = 0.25

# Of `maes_msgs/Motion` and `visualization_msgs/Marker`.
_KEEP, _PATH = 0, 4
_LINE_LIST, _ADD = 5, 0

_Floats = npt.NDArray[np.float64]
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
    for _, message in recording.messages("/tf"):
        for stamped in message["transforms"]:
            stamp = stamped["header"]["stamp"]
            time_s = stamp["sec"] + stamp["nanosec"] * 1e-9
            agent = int(stamped["child_frame_id"].removeprefix("agent_").partition("/")[0])
            parts = stamped["transform"]["translation"], stamped["transform"]["rotation"]
            numbers = [part[axis] for part, axes in zip(parts, ("xyz", "xyzw")) for axis in axes]
            rows.setdefault(agent, []).append([time_s, *numbers])
    # The transform of a scan comes after those of later ticks.
    arrays = {agent: np.array(sorted(of_agent)) for agent, of_agent in sorted(rows.items())}
    return {agent: (of[:, 0], of[:, 1:4], of[:, 4:]) for agent, of in arrays.items()}


def _cave(recording: Recording) -> Map:
    cave = recording.map()
    if cave is None:
        raise _maes.BadInput(f"{recording.file}: no map in the recording")
    return cave


@dataclasses.dataclass
class _Body:
    """Where an agent was last."""

    time_s: float
    position_m: _Floats
    is_in_world: bool = True


class Sender:
    """Sends a recording to a stream, whole or in the parts of a `RecordingFollower`."""

    def __init__(self, stream: rr.RecordingStream, recording: Recording) -> None:
        self._stream = stream
        self._scenario = recording.scenario
        self._agents = int(self._scenario["agents.count"])
        self._bodies: dict[int, _Body] = {}
        self._explored = Explored(_cave(recording))
        self._styled: set[str] = set()
        stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)

    def send(self, part: Recording) -> None:
        """Sends the messages of a recording, or of a part that follows those sent before."""
        poses = _poses(part)
        for agent, of_agent in poses.items():
            known = self._bodies.get(agent)
            before = known if known is not None and known.is_in_world else None
            self._send_body(agent, of_agent, before)
            self._send_trail(agent, of_agent, before)
            self._bodies[agent] = _Body(of_agent[0][-1], of_agent[1][-1])
        self._clear_who_left()
        for agent in range(self._agents):
            self._send_hits(agent, part)
            self._send_task(agent, part)
        self._send_contacts(part)
        self._send_progress(part)
        self._send_explored(part)

    def _style(self, path: str, archetype: rr.AsComponents) -> None:
        """Logs how the rows of an entity look, once."""
        if path not in self._styled:
            self._styled.add(path)
            self._stream.log(path, archetype, static=True)

    def _send_body(self, agent: int, poses: _Poses, before: _Body | None) -> None:
        times, positions, quaternions = poses
        path = f"world/agents/agent_{agent}"
        columns = rr.Transform3D.columns(translation=positions, quaternion=quaternions)
        self._stream.send_columns(path, _times(times), columns)
        if before is None:
            # Not static: a body is where it is from its first pose on.
            ellipsoid = rr.Ellipsoids3D.columns(
                half_sizes=[[_radius_m(self._scenario, agent)] * 3],
                colors=[_colour(agent)],
                labels=[f"agent_{agent}"],
            )
            self._stream.send_columns(path, _times(times[:1]), ellipsoid)
            self._style(path, rr.Ellipsoids3D.from_fields(fill_mode="solid"))

    def _send_trail(self, agent: int, poses: _Poses, before: _Body | None) -> None:
        times, positions, _ = poses
        ends = _row_ends(times)
        times_of_rows = _times(times[ends - 1])
        if before is not None:
            positions, ends = np.concatenate([before.position_m[None], positions]), ends + 1
        # Each strip continues where the one before it ends.
        starts = np.concatenate([[0], ends[:-1] - 1])
        strips = [positions[start:end] for start, end in zip(starts, ends)]
        path = f"world/trails/agent_{agent}"
        self._style(path, rr.LineStrips3D.from_fields(colors=[_colour(agent)]))
        self._stream.send_columns(path, times_of_rows, rr.LineStrips3D.columns(strips=strips))

    def _clear_who_left(self) -> None:
        # Poses are recorded of all bodies at a time.
        now_s = max((body.time_s for body in self._bodies.values()), default=0.0)
        for agent, body in self._bodies.items():
            if body.is_in_world and body.time_s < now_s:
                body.is_in_world = False
                after_last = _times([body.time_s + 1e-9])
                for path in (f"world/agents/agent_{agent}", f"world/paths/agent_{agent}"):
                    columns = rr.Clear.columns(is_recursive=[True])
                    self._stream.send_columns(path, after_last, columns)

    def _send_hits(self, agent: int, part: Recording) -> None:
        names: list[str | None] = [*part.lidars(agent)]
        for name in names or [None]:
            hits = [scan for scan in part.hits(agent, name) if len(scan.point_m)]
            if hits:
                path = f"world/agents/agent_{agent}/{name or 'lidar'}"
                radii = [_radius_m(self._scenario, agent) / 8]
                self._style(path, rr.Points3D.from_fields(colors=[_colour(agent)], radii=radii))
                points_m = np.concatenate([hit.point_m for hit in hits])
                columns = rr.Points3D.columns(positions=points_m)
                lengths = [len(hit.point_m) for hit in hits]
                times = _times([hit.time_s for hit in hits])
                self._stream.send_columns(path, times, columns.partition(lengths))

    def _send_task(self, agent: int, part: Recording) -> None:
        observed = part.poses(agent)
        position_at = dict(zip(observed.time_s, observed.position_m))
        times, strips = [], []
        for time_s, command in part.messages(f"/agent_{agent}/command"):
            motion = command["motion"]
            if motion["kind"] != _KEEP:
                times.append(time_s)
                points = [tuple(position_at[time_s]), *_points(motion["path"])]
                strips.append([points] if motion["kind"] == _PATH else [])
        self._send_strips(f"world/paths/agent_{agent}", _colour(agent), times, strips)

    def _send_contacts(self, part: Recording) -> None:
        times, strips = [], []
        for time_s, marker in part.messages("/sim/contacts"):
            is_drawn = marker["action"] == _ADD and marker["type"] == _LINE_LIST
            ends = _points(marker["points"]) if is_drawn else []
            times.append(time_s)
            strips.append([list(pair) for pair in zip(ends[::2], ends[1::2])])
        self._send_strips("world/contacts", _CONTACTS, times, strips)

    def _send_strips(
        self, path: str, colour: int, times: Sequence[float], strips: Sequence[list[Any]]
    ) -> None:
        """Line strips of which each row has some."""
        if times:
            self._style(path, rr.LineStrips3D.from_fields(colors=[colour]))
            flat = [np.array(strip) for row in strips for strip in row]
            columns = rr.LineStrips3D.columns(strips=flat).partition([len(row) for row in strips])
            self._stream.send_columns(path, _times(times), columns)

    def _send_progress(self, part: Recording) -> None:
        messages = part.messages("/sim/progress")
        if not messages:
            return
        times = _times([time_s for time_s, _ in messages])

        def send(path: str, name: str, colour: int, shares: list[float]) -> None:
            self._style(path, rr.SeriesLines(colors=[colour], names=[name]))
            self._stream.send_columns(path, times, rr.Scalars.columns(scalars=shares))

        for key, colour in (("explored", _EXPLORED), ("covered", _COVERED)):
            shares = [one[key] for _, one in messages]
            send(f"progress/team/{key}", f"{key} by the team", colour, shares)
        for agent in range(self._agents):
            name, shares = f"agent_{agent}", [one["explored_by"][agent] for _, one in messages]
            send(f"progress/explored_by/{name}", name, _colour(agent), shares)

    def _send_explored(self, part: Recording) -> None:
        explored = self._explored
        free, walls = explored.add([scan for agent in range(self._agents) for scan in part.scans(agent)])
        for (cells, times), name, colour in ((free, "free", _FREE), (walls, "walls", _WALL)):
            if len(cells):
                path = f"world/explored/{name}"
                radii = [explored.cell_m / 4]
                self._style(path, rr.Points3D.from_fields(colors=[colour], radii=radii))
                ends = _row_ends(times)
                centres = (explored.coordinates(cells) + 0.5) * explored.cell_m
                rows = rr.Points3D.columns(positions=centres).partition(np.diff(ends, prepend=0))
                self._stream.send_columns(path, _times(times[ends - 1]), rows)
        self._send_surface(*explored.faces(free[0], walls[0]))

    def _send_surface(self, times: _Floats, corners: _Floats, normals: _Floats) -> None:
        if not len(times):
            return
        explored, path = self._explored, "world/explored/surface"
        ends = _row_ends(times)
        lengths = np.diff(ends, prepend=0)
        # Corners are numbered from zero in each row.
        first_corner = 4 * (np.arange(len(times)) - np.repeat(ends - lengths, lengths))
        triangles = first_corner[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
        heights = corners[:, :, 2].reshape(-1, 1) / explored.size[2]
        columns = [
            *rr.Mesh3D.columns(
                vertex_positions=corners.reshape(-1, 3) * explored.cell_m,
                vertex_normals=np.repeat(normals, 4, axis=0),
                vertex_colors=(_LOW + heights * (_HIGH - _LOW)).astype(np.uint8),
            ).partition(lengths * 4),
            *rr.Mesh3D.columns(triangle_indices=triangles.reshape(-1, 3)).partition(lengths * 2),
        ]
        # From behind the surface is not drawn, so that the agents inside are visible.
        self._style(path, rr.Mesh3D.from_fields(face_rendering="Front"))
        self._stream.send_columns(path, _times(times[ends - 1]), columns)


def send(recording: Recording, stream: rr.RecordingStream) -> None:
    """Sends a recording to a stream, which may lead to a viewer, a server or a file."""
    Sender(stream, recording).send(recording)


def blueprint(recording: Recording) -> rrb.Blueprint:
    """The layout: the explored cave with the agents, and beside it the shares over time."""
    cave = _cave(recording)
    edges = np.array(cave.size) * cave.cell_m
    eye = rrb.EyeControls3D(
        position=edges * (-0.3, -0.7, 0.9), look_target=edges / 2, eye_up=(0.0, 0.0, 1.0)
    )
    begin, now = rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.cursor_relative()
    so_far = rrb.VisibleTimeRanges(rrb.VisibleTimeRange(TIMELINE, start=begin, end=now))
    end_s = max((time_s for time_s, _ in recording.messages("/sim/result")), default=None)
    whole_run = None if end_s is None else rrb.TimeAxis(
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
        rrb.TimePanel(timeline=TIMELINE, play_state=None if end_s is not None else "following"),
        collapse_panels=True,
    )


def _stream_of(recording: Recording) -> rr.RecordingStream:
    stream = rr.RecordingStream("maes")
    stream.send_recording_name(os.path.basename(recording.file))
    return stream


def save(recording: Recording, file: str | os.PathLike[str]) -> None:
    """Saves a recording with the layout as `.rrd`, a file of the viewer."""
    file = os.fspath(file)
    if not file.endswith(".rrd"):
        raise _maes.BadInput(f"{file}: expected a file name that ends with .rrd")
    layout = blueprint(recording)
    # Rerun's own error for a file that cannot be written has no type.
    open(file, "ab").close()
    stream = _stream_of(recording)
    stream.save(file, default_blueprint=layout)
    send(recording, stream)
    stream.disconnect()


def show(file: str | os.PathLike[str]) -> int:
    """Shows a recording in a viewer of its own until that is closed, and follows it while it is
    written; returns the viewer's exit code."""
    follower = RecordingFollower(file)
    recording = follower.read()
    layout = blueprint(recording)
    with socket.socket() as probe:
        probe.bind((_HOST, 0))
        port = probe.getsockname()[1]
    # Rather than `spawn` of the stream, with which the viewer listens on all interfaces.
    flags = ["--bind", _HOST, "--port", str(port), "--hide-welcome-screen"]
    with subprocess.Popen([sys.executable, "-m", "rerun", *flags]) as viewer:
        try:
            while not _accepts_connections(port):
                if (code := _exit_code(viewer)) is not None:
                    return code
            stream = _stream_of(recording)
            stream.connect_grpc(f"rerun+http://{_HOST}:{port}/proxy", default_blueprint=layout)
            sender = Sender(stream, recording)
            sender.send(recording)
            stream.flush()
            while not follower.has_ended:
                if (code := _exit_code(viewer)) is not None:
                    return code
                sender.send(follower.read())
                stream.flush()
            return viewer.wait()
        except BaseException:
            viewer.kill()
            raise


def _accepts_connections(port: int) -> bool:
    try:
        socket.create_connection((_HOST, port)).close()
    except ConnectionRefusedError:
        return False
    return True


def _exit_code(viewer: subprocess.Popen[bytes]) -> int | None:
    """Of a viewer that is closed within a while; `None` if it is not."""
    try:
        return viewer.wait(_PERIOD_WALL_S)
    except subprocess.TimeoutExpired:
        return None


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
        if given.save is None:
            return show(given.recording)
        save(Recording(given.recording), given.save)
    except (_maes.BadInput, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
