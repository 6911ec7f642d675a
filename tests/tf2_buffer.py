"""Looks up with the buffer of tf2 what `tf_observer.py` has printed, for tests/clients.rs.

    tf2_buffer.py ARRIVED.txt

Transforms enter in the order of their arrival, and each cloud is looked up when it arrives, or as
soon as its stamp is not in the future any more. Prints a line for each lookup, `STAMP FRAME X Y Z
QX QY QZ QW`. Needs tf2_py (see tf2_buffer.sh).
"""

import sys

import rospy
import tf2_py
from geometry_msgs.msg import TransformStamped


def time(stamp_ns):
    return rospy.Time(*divmod(int(stamp_ns), 1_000_000_000))


def look_up(buffer, stamp_ns, frame):
    """Whether the transform is there; if so, it is printed."""
    try:
        found = buffer.lookup_transform_core("map", frame, time(stamp_ns)).transform
    except (tf2_py.ExtrapolationException, tf2_py.LookupException):
        return False
    place, turn = found.translation, found.rotation
    print(stamp_ns, frame, *map(repr, (place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w)))
    return True


def main():
    buffer, waiting = tf2_py.BufferCore(rospy.Duration(10)), []
    for line in open(sys.argv[1]):
        if line == "ready\n":
            continue
        kind, stamp_ns, *words = line.split()
        if kind == "at":
            waiting.append((stamp_ns, *words))
        else:
            parent, child, *numbers = words
            message = TransformStamped(child_frame_id=child)
            message.header.frame_id, message.header.stamp = parent, time(stamp_ns)
            place, turn = message.transform.translation, message.transform.rotation
            place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w = map(float, numbers)
            buffer.set_transform(message, "maes")
        waiting = [cloud for cloud in waiting if not look_up(buffer, *cloud)]


if __name__ == "__main__":
    main()
