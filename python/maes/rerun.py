"""Recordings in the viewer Rerun (`pip install maes[rerun]`).

The entities, in metres, with `sim_time` as the timeline:

| entity | content |
|---|---|
| `/world/walls` | by second, the walls that the team saw first in it |
| `/world/agents/<id>` | the body |
| `/world/agents/<id>/heading` | where it is headed |
| `/world/agents/<id>/trail` | by moment, the way to there |
| `/plots/shares/explored`, `/plots/shares/covered` | shares of the free cells, per cent |
| `/plots/in_contact` | pairs of agents in radio contact |

`python -m maes.rerun RECORDING.mcap`, or `maes view RECORDING.mcap --rerun`, opens them in the
viewer, `--save FILE.rrd` in a file.
"""

from __future__ import annotations

import argparse
import colorsys
import sys
from collections import defaultdict
from typing import Any

import numpy as np

from ._maes import BadInput
from .maps import Map
from .recordings import Poses, Recording

try:
    import rerun as rr
    import rerun.blueprint as rrb
except ModuleNotFoundError as error:
    if error.name != "rerun":
        raise
    remedy = "Rerun is not installed: pip install maes[rerun]"
    raise ModuleNotFoundError(remedy, name=error.name) from error

TIMELINE = "sim_time"

PLAYBACK_SPEED = 20.0
"""Seconds of sim time in a second, at first."""


def send(recording: Recording, stream: Any) -> None:
    """Sends a recording to a `rerun.RecordingStream`, and how to arrange it."""
    bodies = _bodies(recording)
    map_ = recording.map() or recording.scenario.map()
    stream.send_blueprint(blueprint(sorted(bodies), map_))
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    _send_walls(recording, map_, stream)
    radius_m = recording.scenario["body.radius_m"]
    for agent, poses in bodies.items():
        _send_body(agent, radius_m, poses, stream)
    _send_plots(recording, stream)


def blueprint(agents: list[int], map_: Map) -> Any:
    """The arrangement: the cave above, the shares over time below. Walls and trails are shown from
    the start of the run on."""
    first, now = rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.cursor_relative()
    from_start = rrb.VisibleTimeRanges(timeline=TIMELINE, start=first, end=now)
    size_m = np.array(map_.size) * map_.cell_m
    centre = size_m / 2
    eye = centre + size_m.max() * np.array([0.7, -1.0, 0.7])
    whole = rrb.TimeAxis(view_range=rr.TimeRange(start=first, end=rrb.TimeRangeBoundary.infinite()))
    accumulated = ["world/walls", *(f"world/agents/{agent}/trail" for agent in agents)]
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Spatial3DView(
                origin="/world",
                name="Cave",
                eye_controls=rrb.EyeControls3D(position=eye, look_target=centre),
                overrides={entity: from_start for entity in accumulated},
            ),
            rrb.Horizontal(
                rrb.TimeSeriesView(origin="/plots/shares", name="Shares of the free cells, %", axis_x=whole),
                rrb.TimeSeriesView(origin="/plots/in_contact", name="Pairs in radio contact", axis_x=whole),
            ),
            row_shares=[3, 1],
        ),
        rrb.TimePanel(timeline=TIMELINE, play_state="playing", playback_speed=PLAYBACK_SPEED),
        collapse_panels=True,
    )


def _bodies(recording: Recording) -> dict[int, Poses]:
    """The poses of each agent, by its id, as often as `/tf` has them."""
    rows: defaultdict[int, list[tuple[float, float, float, float, float]]] = defaultdict(list)
    for time_s, message in recording.messages("/tf"):
        for stamped in message["transforms"]:
            frame = stamped["child_frame_id"]
            if not (frame.startswith("agent_") and frame.endswith("/base_link")):
                continue
            at, rotation = stamped["transform"]["translation"], stamped["transform"]["rotation"]
            # Bodies turn about the z axis alone.
            yaw_rad = 2 * np.arctan2(rotation["z"], rotation["w"])
            agent = int(frame.removeprefix("agent_").removesuffix("/base_link"))
            rows[agent].append((time_s, at["x"], at["y"], at["z"], yaw_rad))
    tables = {agent: np.array(of_agent) for agent, of_agent in rows.items()}
    return {agent: Poses(table[:, 0], table[:, 1:4], table[:, 4]) for agent, table in tables.items()}


def _send_walls(recording: Recording, map_: Map, stream: Any) -> None:
    agents = range(recording.scenario["agents.count"])
    seen = [(scan.time_s, scan.wall) for agent in agents for scan in recording.scans(agent)]
    if not any(len(cells) for _, cells in seen):
        return
    times_s = np.concatenate([np.full(len(cells), time_s) for time_s, cells in seen])
    cells = np.concatenate([cells for _, cells in seen])
    order = np.lexsort((times_s, cells))
    cells, first = np.unique(cells[order], return_index=True)
    times_s = times_s[order][first]
    size_x, size_y, size_z = map_.size
    x, rest = cells % size_x, cells // size_x
    indices = np.stack([x, rest % size_y, rest // size_y], axis=1)
    shade = 0.25 + 0.75 * indices[:, 2] / size_z
    colours = (np.stack([0.75 * shade, 0.85 * shade, shade], axis=1) * 255).astype(np.uint8)
    # What is seen within a second appears at its end.
    seconds = np.ceil(times_s)
    order = np.argsort(seconds, kind="stable")
    ends, lengths = np.unique(seconds, return_counts=True)
    points = rr.Points3D.columns(
        positions=(indices[order] + 0.5) * map_.cell_m, colors=colours[order]
    ).partition(lengths)
    # Small enough to see the agents through them.
    stream.log("world/walls", rr.Points3D.from_fields(radii=map_.cell_m / 6), static=True)
    stream.send_columns("world/walls", [rr.TimeColumn(TIMELINE, duration=ends)], points)


def _send_body(agent: int, radius_m: float, poses: Poses, stream: Any) -> None:
    entity, colour = f"world/agents/{agent}", _colour(agent)
    time_s, position_m, yaw_rad = poses
    times = rr.TimeColumn(TIMELINE, duration=time_s)
    fields = {"radii": radius_m, "colors": colour, "labels": f"agent {agent}"}
    stream.log(entity, rr.Points3D.from_fields(**fields), static=True)
    stream.send_columns(entity, [times], rr.Points3D.columns(positions=position_m))
    direction = np.stack([np.cos(yaw_rad), np.sin(yaw_rad), np.zeros(len(yaw_rad))], axis=1)
    arrow = rr.Arrows3D.from_fields(colors=colour, radii=radius_m / 4)
    stream.log(f"{entity}/heading", arrow, static=True)
    heading = rr.Arrows3D.columns(origins=position_m, vectors=direction * 3 * radius_m)
    stream.send_columns(f"{entity}/heading", [times], heading)
    ways = np.stack([position_m[:-1], position_m[1:]], axis=1)
    moves = np.any(ways[:, 0] != ways[:, 1], axis=1)
    stream.log(f"{entity}/trail", rr.LineStrips3D.from_fields(colors=colour), static=True)
    if moves.any():
        arrived = rr.TimeColumn(TIMELINE, duration=time_s[1:][moves])
        strips = rr.LineStrips3D.columns(strips=list(ways[moves]))
        stream.send_columns(f"{entity}/trail", [arrived], strips)


def _send_plots(recording: Recording, stream: Any) -> None:
    progress = recording.messages("/sim/progress")
    times = rr.TimeColumn(TIMELINE, duration=[time_s for time_s, _ in progress])
    for name, key, factor in [
        ("shares/explored", "explored", 100.0),
        ("shares/covered", "covered", 100.0),
        ("in_contact", "pairs_in_contact", 1.0),
    ]:
        scalars = [message[key] * factor for _, message in progress]
        stream.send_columns(f"plots/{name}", [times], rr.Scalars.columns(scalars=scalars))


def _colour(agent: int) -> tuple[int, int, int]:
    """Hues far apart for neighbouring ids: steps of the golden ratio."""
    red, green, blue = colorsys.hsv_to_rgb(agent * 0.618034 % 1.0, 0.75, 1.0)
    return int(red * 255), int(green * 255), int(blue * 255)


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(prog="maes.rerun", description="Sends a recording to Rerun.")
    parser.add_argument("recording", metavar="RECORDING.mcap")
    parser.add_argument("--save", metavar="FILE.rrd", help="write a file instead of opening the viewer")
    arguments = parser.parse_args()
    try:
        recording = Recording(arguments.recording)
    except (BadInput, OSError) as error:
        sys.exit(f"error: {error}")
    stream = rr.RecordingStream("maes")
    if arguments.save:
        stream.save(arguments.save)
    else:
        stream.spawn()
    send(recording, stream)
    stream.flush()


if __name__ == "__main__":
    main()
