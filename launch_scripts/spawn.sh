#!/usr/bin/env bash
# Starts a world server and N agents by hand, each a process of its own, and waits for the end of the
# run. This is all that a run needs; `maes run` also restarts agents, locks the ROS domain and keeps
# logs. All processes get the same join secret in their environment, so that no other process can
# join the run or command its agents.
#
#   launch_scripts/spawn.sh [N] [any flag of `sim_server run`]      for example 3 --record run.mcap
#
# Exit code: that of the server.
set -eu
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
bin=$("$here/build.sh")
count=5
if [[ ${1:-} =~ ^[0-9]+$ ]]; then
    count=$1
    shift
fi

if [[ -z ${MAES_JOIN_SECRET:-} ]]; then
    MAES_JOIN_SECRET=$(head --bytes 32 /dev/urandom | od --address-radix none --format x1 | tr --delete ' \n')
fi
export MAES_JOIN_SECRET

# The server comes first, so that all agents discover it.
"$bin/sim_server" run "$here/scenarios/default.toml" --agents "$count" "$@" &
server=$!

agents=()
for ((id = 0; id < count; id++)); do
    "$bin/agent_node" --id "$id" &
    agents+=($!)
done

# The server sends the agents a shutdown message when the run is over; without it they are ended.
code=0
wait "$server" || code=$?
if ((code != 0)); then
    kill "${agents[@]}" 2>/dev/null || true
fi
wait
exit "$code"
