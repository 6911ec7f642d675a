#!/usr/bin/env bash
# Measures by how much observers slow a run of 20 agents down, and prints ratios.
#
#   launch_scripts/bench_views.sh [ROUNDS]      rounds of a run of every kind (default 5), after a warm-up
#
# The kinds take turns, because the load of a machine changes; what counts is the ratio within a
# round: of wall time, and of the processor time of the run, which says more on a busy machine. The
# observer is a node in Python (rclpy on Fast DDS, see ros_env.sh) on the same machine; its own work
# is in the wall time alone. Every run has the same digest, or the script fails.
set -u
TIMEFORMAT='%U %S'
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
rounds=${1:-5}
out=$(mktemp -d "${TMPDIR:-/tmp}/maes-bench-views-XXXXXX")
trap 'rm -rf "$out"' EXIT
export ROS_DOMAIN_ID=${ROS_DOMAIN_ID:-78} ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
MAES_BIN_DIR=$("$root/launch_scripts/build.sh") || exit 1
export MAES_BIN_DIR
eval "$("$root/launch_scripts/ros_env.sh")" || exit 1

cat >"$out/observer.py" <<'END'
import signal, sys
import rclpy
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import PointCloud2
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker

latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
topics = [("/agent_0/points", PointCloud2, qos_profile_sensor_data)]
if sys.argv[1] == "all":
    topics += [("/tf", TFMessage, 100), ("/agent_0/odom", Odometry, 10), ("/sim/map", Marker, latched)]
    topics += [("/sim/unexplored", Marker, latched), ("/agent_0/map", Marker, latched)]
rclpy.init(signal_handler_options=rclpy.SignalHandlerOptions.NO)
node = rclpy.create_node("observer")
counts = {topic: 0 for topic, _, _ in topics}

def count(topic):
    counts[topic] += 1

for topic, kind, qos in topics:
    # Raw: what is measured is the run, not how Python unpacks messages.
    node.create_subscription(kind, topic, lambda _, topic=topic: count(topic), qos, raw=True)
stopped = []
signal.signal(signal.SIGTERM, lambda *_: stopped.append(True))
executor = SingleThreadedExecutor()
executor.add_node(node)
print("ready", flush=True)
while not stopped:
    executor.spin_once(timeout_sec=0.2)
print(" ".join(f"{topic}:{number}" for topic, number in counts.items()), flush=True)
END

flags=(--agents 20 --size 100 --seed 1 --duration 1800 --set stop_when_explored=false)

# One run; prints its wall seconds, its processor seconds, and what the observer has received.
run() { # none | points | all
    local heard=none
    observer=
    trap '[[ -z $observer ]] || kill "$observer"' EXIT
    if [[ $1 != none ]]; then
        python3 "$out/observer.py" "$1" >"$out/printed" &
        observer=$!
        exec 5<"$out/printed"
        read -r _ <&5
    fi
    { time "$root/launch_scripts/run.sh" "${flags[@]}" --logs "$out/logs" 2>"$out/stderr" >"$out/stdout"; } 2>"$out/time" ||
        { cat "$out/stderr" >&2; exit 1; }
    if [[ $1 != none ]]; then
        kill -TERM "$observer"
        read -r heard <&5
        exec 5<&-
        wait "$observer" 2>/dev/null
        observer=
    fi
    tail -n 1 "$out/stdout" >>"$out/digests"
    echo "$(sed -n 's/^wall time \([0-9.]*\) s.*/\1/p' "$out/stdout") $(awk '{print $1 + $2}' "$out/time") $heard"
}

mkfifo "$out/printed"
echo "$(date -u +%Y-%m-%d), $(nproc) cores, $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -1), load $(cut -d' ' -f1 /proc/loadavg)"
run none >/dev/null
for ((round = 1; round <= rounds; round++)); do
    for kind in none points all; do
        read -r seconds busy heard <<<"$(run "$kind")"
        [[ -n $heard ]] || exit 1
        echo "$kind $seconds $busy" >>"$out/seconds"
        echo "round $round, $kind: $seconds s, processor $busy s ($heard)"
    done
done
[[ $(sort -u "$out/digests" | wc -l) == 1 ]] || { echo "error: the digests differ" >&2; exit 1; }
awk '$1 == "none" {wall = $2; busy = $3} $1 != "none" {print $1, "wall", $2 / wall; print $1, "processor", $3 / busy}' \
    "$out/seconds" | sort -k1,2 -k3,3g | awk '
    {what = $1 ", " $2 " time"; values[what, ++count[what]] = $3}
    END {for (what in count) {n = count[what]; printf "%-24s by that without observers: least %.3f, median %.3f, greatest %.3f\n",
        what, values[what, 1], values[what, int((n + 1) / 2)], values[what, n]}}' | sort
