#!/usr/bin/env bash
# message_filters 1.15.15 of Python (Debian 12): images and scans 10 ms apart are passed on in pairs
# that are 90 ms apart.
#
# Expected: `ApproximateTimeSynchronizer` pairs the messages that lie closest in time, as the policy
# ApproximateTime of the same package in C++ is made to; arrival decides nothing, and a difference
# of exactly `slop` is allowed.
# Seen: each message that arrives takes the nearest of those that are *there*, if it is within the
# slop. Images at 0.0, 0.1, ..., scans at 0.09, 0.19, ...: scan 0.09 arrives 10 ms before image 0.1
# and takes image 0.0, and so on for the whole run, with a slop of 0.1. Of the same stamps, each
# scan delivered 20 ms later, each pair is 10 ms apart. Two messages exactly one slop apart are no
# pair.
# So: choose a slop below half the period, and log the difference of the stamps; a live robot and
# its recording, played in another order, have other pairs.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
cd "$dir"
mkdir debs root
apt-get install -qq -y --download-only --no-install-recommends -o Debug::NoLocking=1 -o APT::Sandbox::User=root \
    -o Dir::Cache::archives="$dir/debs" python3-message-filters=1.15.15+ds-2 >/dev/null 2>&1
find debs -name '*.deb' -exec dpkg -x {} root \;
library=$dir/root/usr/lib/x86_64-linux-gnu
export LD_LIBRARY_PATH=$library:$library/blas:$library/lapack PYTHONPATH=$dir/root/usr/lib/python3/dist-packages
/usr/bin/python3 - <<'PY'
import sys
import rospy
from message_filters import ApproximateTimeSynchronizer, SimpleFilter
from std_msgs.msg import Header

rospy.rostime.set_rostime_initialized(True)

class Stamped:
    def __init__(self, stamp):
        self.header = Header(stamp=stamp)

def pairs(stream, slop):
    filters, found = {"image": SimpleFilter(), "scan": SimpleFilter()}, []
    joined = ApproximateTimeSynchronizer(list(filters.values()), 10, slop)
    joined.registerCallback(lambda image, scan: found.append((scan.header.stamp - image.header.stamp).to_nsec() // 10**6))
    for _, name, ms in stream:
        filters[name].signalMessage(Stamped(rospy.Time(0, ms * 10**6)))
    return found

def stream(delay_of_scans):
    images = [(ms, "image", ms) for ms in range(0, 1000, 100)]
    scans = [(ms + delay_of_scans, "scan", ms) for ms in range(90, 1000, 100)]
    return sorted(images + scans)

found = [pairs(stream(0), 0.1), pairs(stream(20), 0.1), pairs([(0, "image", 0), (1, "scan", 50)], 0.05)]
print("ms between scan and image, in order of their stamps:", found[0])
print("the same stamps, scans 20 ms late:                ", found[1])
print("a pair exactly one slop apart:", found[2])
if found[0] != [90] * 10 or found[1][:9] != [-10] * 9 or found[2] != []:
    sys.exit("changed: differences are %s" % found)
PY
