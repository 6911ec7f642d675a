"""Writes the trajectories of the agents of a recording as TUM files, true and as they believe them.

    python examples/python/trajectories.py run.mcap
    evo_ape tum agent_0_true.tum agent_0_map.tum

It needs the package rosbags, which evo brings. evo itself reads trajectories from /tf only with the
ROS 2 package tf2_py. Each pose is composed from the transforms between its frames, which a recording
has in one message.
"""

import math
import sys
from collections import defaultdict
from pathlib import Path

from rosbags.highlevel import AnyReader


def composed(outer, inner):
    """The pose (x, y, z, yaw) of `inner`, which is in the frame of `outer`, in that of `outer`."""
    x, y, z, yaw = outer
    cos, sin = math.cos(yaw), math.sin(yaw)
    return (x + cos * inner[0] - sin * inner[1], y + sin * inner[0] + cos * inner[1], z + inner[2], yaw + inner[3])


def pose_of(transform):
    place, turn = transform.translation, transform.rotation
    return (place.x, place.y, place.z, 2 * math.atan2(turn.z, turn.w))


def line(stamp, pose):
    x, y, z, yaw = pose
    quaternion = f"0 0 {math.sin(yaw / 2):.9f} {math.cos(yaw / 2):.9f}"
    return f"{stamp.sec}.{stamp.nanosec:09} {x:.9f} {y:.9f} {z:.9f} {quaternion}\n"


def main(recording):
    lines = defaultdict(dict)
    with AnyReader([Path(recording)]) as reader:
        connections = [connection for connection in reader.connections if connection.topic == "/tf"]
        for connection, _, data in reader.messages(connections):
            of_map, present = {}, {}
            for stamped in reader.deserialize(data, connection.msgtype).transforms:
                agent, frame = stamped.child_frame_id.split("/")
                pose = pose_of(stamped.transform)
                present[agent] = composed(present.get(agent, (0, 0, 0, 0)), pose)
                # The first transform leads to the map of the agent, if it is not the only one.
                of_map[agent] = composed(of_map[agent], pose) if agent in of_map else (0, 0, 0, 0)
                if frame != "base_link":
                    continue
                believed = of_map[agent] if stamped.header.frame_id != "map" else present[agent]
                stamp = stamped.header.stamp
                time_ns = stamp.sec * 1_000_000_000 + stamp.nanosec
                lines[f"{agent}_true.tum"][time_ns] = line(stamp, present[agent])
                lines[f"{agent}_map.tum"][time_ns] = line(stamp, believed)
    for file, poses in sorted(lines.items()):
        Path(file).write_text("".join(poses[time_ns] for time_ns in sorted(poses)))
        print(file)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
