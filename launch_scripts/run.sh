#!/usr/bin/env bash
# One run: a world server, one process for each agent, one recording, one exit code.
#
#   launch_scripts/run.sh [SCENARIO.toml] [--agents N] [--controller C] [--map spheres|noise|building|FILE] [--size S]
#                         [--seed K] [--duration SECONDS] [--record FILE.mcap] [any other flag of `sim_server run`]
#   --resume FILE.mcap        go on with a run whose server was killed, and complete its recording; not over memory
#   --agent-set KEY=VALUE     a setting of the agents' controllers: the key agents.set.KEY; can be given again
#   --external ID[,ID...]     agents that somebody else starts, each a process of its own; not over memory. Those of the key
#                             agents.cmd_vel are among them
#   --agents-per-process M    run M agents in each process (default 1); not over memory
#   --order forward|reverse|shuffle   in which order to start the agents (default forward); not over memory
#   --chaos-delay-ms MS       let each agent wait up to so long, at random, before it answers
#   --agent-parameters true|false     offer what each agent is as ROS parameters (default: if a process runs no more than
#                             8 agents); not over memory
#   --view [ADDR:PORT]        let people look on in a browser, or in Foxglove (default 127.0.0.1:8765); not over memory. view.sh does more
#   --transport ros2|memory   over ROS 2 (default), or all in one process without a network
#   --logs DIR                where the logs of the processes go (default out/logs/<time>-<pid>; over memory: nowhere)
#
# Where the scenario has lost agents waited for (faults.on_agent_loss = "wait"), agent processes that die are started again, each
# three times at the most.
#
# Exit codes: 0 the run has a result; 1 a failure of the system; 2 bad input; 3 agents were missing at the start;
# 4 an agent was lost; 5 an agent was refused; 130 interrupted, or told to quit.
set -u

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
scenario=$root/launch_scripts/scenarios/default.toml
resume=
transport=ros2
restarts_max=3
per_process=
external=
order=
parameters=
logs=
agent_flags=()
server_flags=()
view_flags=()

fail() {
    printf 'error: %s\n' "$1" >&2
    exit 2
}

# --help, and the checks of what this script reads itself; the binaries check everything else.
named=
if [[ $# -gt 0 && $1 != -* ]]; then
    scenario=$1
    named=1
    shift
fi
while [[ $# -gt 0 ]]; do
    case $1 in
        -h | --help)
            sed -n '2,/^set -u/{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"
            exit 0
            ;;
        --view) [[ $# -ge 2 && $2 != -* ]] || set -- --view "" "${@:2}" ;;
        --*=*) set -- "${1%%=*}" "${1#*=}" "${@:2}" ;;
        --*) [[ $# -ge 2 ]] || fail "$1 needs a value" ;;
        *) fail "unexpected argument: $1 (a scenario comes first; see --help)" ;;
    esac
    case $1 in
        --transport) transport=$2 ;;
        --resume) resume=$2 ;;
        --view) view_flags=(--view ${2:+"$2"}) ;;
        --agents-per-process) per_process=$2 ;;
        --external) external=$2 ;;
        --order) order=$2 ;;
        --logs) logs=$2 ;;
        --chaos-delay-ms) agent_flags+=(--chaos-delay-ms "$2") ;;
        --agent-parameters) parameters=$2 ;;
        --agent-set)
            [[ $2 == ?*=* ]] || fail "--agent-set $2: expected KEY=VALUE"
            server_flags+=(--set "agents.set.$2")
            ;;
        *) server_flags+=("$1" "$2") ;;
    esac
    shift 2
done
[[ $transport == ros2 || $transport == memory ]] || fail "--transport $transport: expected ros2 or memory"
if [[ $transport == memory ]]; then
    [[ -z $per_process ]] || fail "--agents-per-process $per_process: over memory there is one process; leave it out"
    [[ -z $external ]] || fail "--external $external: over memory no processes take part; leave it out"
    [[ -z $order ]] || fail "--order $order: over memory no processes are started; leave it out"
    [[ -z $resume ]] || fail "--resume $resume: over memory all ends together; leave out --transport"
    ((${#view_flags[@]} == 0)) || fail "--view: over memory nobody can look on; record the run, and look at the recording"
    [[ -z $parameters ]] || fail "--agent-parameters $parameters: over memory there are no nodes; leave it out"
fi
[[ -z $parameters ]] || agent_flags+=(--parameters "$parameters")
server_scenario=("$scenario")
if [[ -n $resume ]]; then
    [[ -n $named ]] || server_scenario=()
    scenario=$resume
    server_scenario+=(--resume "$resume")
fi
per_process=${per_process:-1}
order=${order:-forward}
[[ $per_process =~ ^[1-9][0-9]{0,3}$ ]] || fail "--agents-per-process $per_process: expected a number from 1"
[[ $external =~ ^([0-9]{1,4}(,[0-9]{1,4})*)?$ ]] || fail "--external $external: expected ids of agents, such as 0,3"
[[ $order == forward || $order == reverse || $order == shuffle ]] ||
    fail "--order $order: expected forward, reverse or shuffle"

# The binaries: those of MAES_BIN_DIR, or built here if needed.
bin=${MAES_BIN_DIR:-}
if [[ -z $bin ]]; then
    (cd "$root" && cargo build --release --quiet) || exit 1
    bin=${CARGO_TARGET_DIR:-$root/target}/release
fi

# Until there is somebody to tell, a signal ends this script when the command that it waits for has ended.
trap 'exit 130' INT TERM HUP

# The server does not know the controllers: whether there is what the scenario asks for is found out before anything is begun.
value_of() { "$bin/sim_server" scenario "$scenario" "${server_flags[@]}" --get "$1"; }
count=$(value_of agents.count) || exit $?
controller=$(value_of agents.controller) || exit $?
settings=$(value_of agents.set) || exit $?
on_loss=$(value_of faults.on_agent_loss) || exit $?
# The key is left out where there are none.
driven=$(value_of agents.cmd_vel 2>/dev/null)
declare -A is_external=()
for id in ${external//,/ } ${driven//[^0-9]/ }; do
    ((10#$id < count)) || fail "--external $external: agent $id does not take part: ids are 0 to $((count - 1))"
    is_external[$((10#$id))]=1
done
((${#is_external[@]} == 0 || per_process == 1)) ||
    fail "--agents-per-process $per_process: expected 1 where some agents are started by somebody else"
setting_flags=()
while IFS= read -r setting; do
    [[ -z $setting ]] || setting_flags+=(--set "$setting")
done <<<"$settings"
"$bin/agent_node" --check --id 0 --controller "$controller" "${setting_flags[@]}" || exit $?

if [[ $transport == memory ]]; then
    if [[ -n $logs ]]; then
        mkdir -p "$logs" || exit 1
        agent_flags+=(--log "$logs/server.log")
    fi
    exec "$bin/experiments" single "$scenario" "${server_flags[@]}" "${agent_flags[@]}"
fi

# Two servers in one domain would share their agents.
domain=${ROS_DOMAIN_ID:-0}
exec {lock}>"${TMPDIR:-/tmp}/maes-domain-${domain//\//_}.lock"
flock --nonblock "$lock" || fail "a run is under way in ROS domain $domain; choose another ROS_DOMAIN_ID"

logs=${logs:-$root/out/logs/$(date +%Y%m%d-%H%M%S)-$$}
mkdir -p "$logs" || exit 1

# The server comes first: on one machine, the processes that start first are found by all others. All run in sessions of their
# own, so that Ctrl-C reaches this script alone, which knows who has to be told in which order.
rm -f "$logs/ready"
mkfifo "$logs/ready" && exec {ready}<>"$logs/ready" || exit 1

# A signal goes to the server, which ends the run and tells the agents. It goes there as TERM, because what a script starts in
# the background ignores INT until it says otherwise.
server=
interrupted=
trap 'interrupted=1; [[ -z $server ]] || kill -TERM "$server" 2>/dev/null' INT TERM HUP

setsid "$bin/sim_server" run "${server_scenario[@]}" "${server_flags[@]}" "${view_flags[@]}" --log "$logs/server.log" --ready "$logs/ready" \
    {lock}>&- {ready}>&- &
server=$!
[[ -z $interrupted ]] || kill -TERM "$server"
until read -r -t 0.1 -u "$ready"; do
    kill -0 "$server" 2>/dev/null && continue
    wait "$server"
    code=$?
    rm -f "$logs/ready"
    # It has not got as far as to handle the signal.
    [[ -z $interrupted || $code != 143 ]] || code=130
    exit "$code"
done
exec {ready}>&-
rm "$logs/ready"

starts=$(for ((first = 0; first < count; first += per_process)); do [[ ${is_external[$first]:-} ]] || echo "$first"; done)
case $order in
    reverse) starts=$(sort -rn <<<"$starts") ;;
    shuffle) starts=$(shuf <<<"$starts") ;;
esac
declare -A agents=() restarts=()
start_agents() {
    local first=$1 last
    last=$((first + per_process < count ? first + per_process - 1 : count - 1))
    setsid "$bin/agent_node" --id "$first-$last" "${agent_flags[@]}" >>"$logs/agent_$first.log" 2>&1 {lock}>&- &
    agents[$!]=$first
}
for first in $starts; do
    [[ -z $interrupted ]] || break
    rm -f "$logs/agent_$first.log"
    start_agents "$first"
done

code=
refusal=0
while [[ -z $code ]]; do
    wait -n -p ended "$server" "${!agents[@]}"
    status=$?
    [[ -n ${ended:-} ]] || continue # a signal, not a process
    if [[ $ended == "$server" ]]; then
        code=$status
    else
        first=${agents[$ended]}
        unset "agents[$ended]"
        # An agent that cannot take part ends the run, unless another one has taken its place; one that dies is the server's affair.
        if [[ $status == 2 || ($status == 5 && $on_loss != wait) ]] && ((refusal == 0)); then
            refusal=$status
            cat "$logs/agent_$first.log" >&2
            kill -INT "$server" 2>/dev/null
        elif [[ $status != 0 && -z $interrupted ]]; then
            printf 'agent process %s ended with exit code %s; its log: %s\n' "$first" "$status" "$logs/agent_$first.log" >&2
            # Where the clock is held for agents that are lost, somebody has to start them again.
            if [[ $on_loss == wait && $status != 5 ]]; then
                restarts[$first]=$((${restarts[$first]:-0} + 1))
                if ((restarts[$first] <= restarts_max)); then
                    start_agents "$first"
                elif ((refusal == 0)); then
                    printf 'agent process %s is given up after %s restarts\n' "$first" "$restarts_max" >&2
                    refusal=4
                    kill -INT "$server" 2>/dev/null
                fi
            fi
        fi
    fi
    ended=
done

# Agents have been told that the run is over. Who does not go by itself has to.
[[ $code == 0 || ${#agents[@]} == 0 ]] || kill -TERM "${!agents[@]}" 2>/dev/null
for agent in "${!agents[@]}"; do
    timeout 5 tail --pid="$agent" --sleep-interval=0.05 --follow /dev/null || kill -KILL "$agent" 2>/dev/null
    wait "$agent" 2>/dev/null
done
((refusal == 0)) || exit "$refusal"
exit "$code"
