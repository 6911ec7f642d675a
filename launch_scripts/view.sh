#!/usr/bin/env bash
# Shows runs and recordings in a browser; the first call builds the page, which takes some minutes.
#
#   launch_scripts/view.sh                                    runs that are started on the page, one after the other
#   launch_scripts/view.sh FILE.mcap                          a recording
#   launch_scripts/view.sh SCENARIO.toml [any flag of run.sh]  a run, which begins paused
#   --address ADDR:PORT    where the page is to be (default 127.0.0.1:8765)
#   --browser true|false   open a browser (default: if there is a desktop)
#   --build-only true      build the page, and nothing else
#
# Needs Node.js 20.19 or later with npm, and what run.sh needs. Ctrl-C ends it.
# Exit codes: as those of run.sh; 0 if nothing was under way.
set -u

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
address=127.0.0.1:8765
browser=
build_only=
what=
flags=()

fail() {
    printf 'error: %s\n' "$1" >&2
    exit 2
}

if [[ $# -gt 0 && $1 != -* ]]; then
    what=$1
    shift
    [[ -f $what ]] || fail "$what: no such file; expected a recording (.mcap) or a scenario (.toml)"
fi
while [[ $# -gt 0 ]]; do
    case $1 in
        -h | --help)
            sed -n '2,/^set -u/{/^#/s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}"
            exit 0
            ;;
        --*=*) set -- "${1%%=*}" "${1#*=}" "${@:2}" ;;
        --*) [[ $# -ge 2 ]] || fail "$1 needs a value" ;;
        *) fail "unexpected argument: $1 (a file comes first; see --help)" ;;
    esac
    case $1 in
        --address) address=$2 ;;
        --browser) browser=$2 ;;
        --build-only) build_only=$2 ;;
        *) flags+=("$1" "$2") ;;
    esac
    shift 2
done
[[ $address =~ ^(.*):([0-9]{1,5})$ ]] || fail "--address $address: expected ADDR:PORT, such as 127.0.0.1:8765"
host=${BASH_REMATCH[1]} port=${BASH_REMATCH[2]}
[[ ${browser:-true} == true || $browser == false ]] || fail "--browser $browser: expected true or false"
[[ $what != *.mcap || ${#flags[@]} == 0 ]] || fail "${flags[0]}: a recording is as it is; leave it out"
[[ -n $what || ${#flags[@]} == 0 ]] || fail "${flags[0]}: runs that are started on the page have their settings from there"

# The page: built again if anything it is made of is newer.
page=$root/viewer
command -v npm >/dev/null || fail "npm is missing: install Node.js 20.19 or later"
if [[ ! -d $page/node_modules || $page/package-lock.json -nt $page/node_modules ]]; then
    (cd "$page" && npm ci --no-audit --no-fund --loglevel=error && touch node_modules) || exit 1
fi
if [[ ! -f $page/dist/index.html || -n $(find "$page/src" "$page/index.html" "$page/package-lock.json" "$page/vite.config.ts" \
    -newer "$page/dist/index.html" -print -quit) ]]; then
    (cd "$page" && npm run --silent build >&2) || exit 1
fi
[[ $build_only != true ]] || exit 0

# The binaries: those of MAES_BIN_DIR, or built here if needed.
bin=${MAES_BIN_DIR:-}
if [[ -z $bin ]]; then
    (cd "$root" && cargo build --release --quiet) || exit 1
    bin=${CARGO_TARGET_DIR:-$root/target}/release
fi

# Opens the page once somebody answers there.
open_page() {
    [[ $browser != false ]] || return
    if ! command -v xdg-open >/dev/null || [[ $browser != true && -z ${DISPLAY:-}${WAYLAND_DISPLAY:-} ]]; then
        printf 'open %s in a browser\n' "$1" >&2
        return
    fi
    for _ in {1..600}; do
        if (: <"/dev/tcp/$host/$port") 2>/dev/null; then
            xdg-open "$1" >/dev/null 2>&1
            return
        fi
        read -r -t 0.1 <> <(:) || true
    done
}

case $what in
    *.mcap)
        name=$(basename "$what")
        [[ $name =~ ^[A-Za-z0-9._-]+$ ]] || name=recording.mcap
        open_page "http://$address/?recording=recording/$name" &
        exec "$bin/sim_server" view "$what" --address "$address"
        ;;
    ?*)
        open_page "http://$address/" &
        MAES_BIN_DIR=$bin exec "$root/launch_scripts/run.sh" "$what" --view "$address" --paused true "${flags[@]}"
        ;;
esac

# Two servers in one domain would share their agents.
domain=${ROS_DOMAIN_ID:-0}
exec {lock}>"${TMPDIR:-/tmp}/maes-domain-${domain//\//_}.lock"
flock --nonblock "$lock" || fail "a run is under way in ROS domain $domain; choose another ROS_DOMAIN_ID"
logs=$root/out/logs/$(date +%Y%m%d-%H%M%S)-$$
mkdir -p "$logs" && mkfifo "$logs/ready" && exec {ready}<>"$logs/ready" || exit 1

# A signal goes to the server, which ends the run and tells the agents.
server=
trap '[[ -z $server ]] || kill -TERM "$server" 2>/dev/null' INT TERM HUP
setsid "$bin/sim_server" run --idle --view "$address" --log "$logs/server.log" --ready "$logs/ready" {lock}>&- {ready}>&- &
server=$!
open_page "http://$address/" &

# For every run that begins the server says which scenario it is.
while kill -0 "$server" 2>/dev/null; do
    read -r -t 0.2 -u "$ready" scenario || continue
    count=$("$bin/sim_server" scenario "$scenario" --get agents.count) || continue
    for ((id = 0; id < count; id++)); do
        setsid "$bin/agent_node" --id "$id" >"$logs/$(basename "$scenario" .toml)_agent_$id.log" 2>&1 {lock}>&- {ready}>&- &
    done
done
wait "$server"
