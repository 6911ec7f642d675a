#!/usr/bin/env bash
# Executes runs over ROS 2, their verification and the page on a Linux that has less than a desktop:
#
#   launch_scripts/check_environments.sh [MAES]     default: the `maes` of this checkout's build
#
# A /dev/shm of 64 MB and of 1 MB, as containers have; no network but a loopback without multicast,
# as behind the NAT of WSL 2; a home that cannot be written to; neither display nor terminal. Each is
# a namespace of its own, so nothing of this machine changes. Needs root, or user namespaces. Exit
# code 1 if a run has another digest than the first run of README.md.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
maes=$(realpath "${1:-${MAES_BIN_DIR:-${CARGO_TARGET_DIR:-$root/target}/release}/maes}")
digest=$(sed -n 's/^digest: //p' "$root/README.md")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
own=(unshare --mount --net)
((EUID == 0)) || own+=(--user --map-root-user)
export maes digest ROS_DOMAIN_ID=${ROS_DOMAIN_ID:-77}

# The first run of README.md over ROS 2, and a check of its recording.
first_run='
run() {
    "$maes" run --agents 5 --record run.mcap >said.txt 2>errors.txt || { cat errors.txt; return 1; }
    grep --quiet --fixed-strings --line-regexp "digest: $digest" said.txt
    "$maes" verify run.mcap >/dev/null
    rm run.mcap
}
'
failed=0
check() {
    local begun=$SECONDS
    if "${own[@]}" bash -euc "ip link set lo up; $first_run$2" >log.txt 2>&1; then
        echo "ok      $1 ($((SECONDS - begun)) s)"
    else
        echo "failed  $1: $(tail -n 5 log.txt)"
        failed=1
    fi
}

for size in 64m 1m; do
    check "/dev/shm of $size" "mount -t tmpfs -o size=$size tmpfs /dev/shm; run"
done
check "loopback only, no multicast" '
ip link set lo multicast off
if ip route show table all | grep "^multicast 224"; then exit 1; fi
run'
check "a home that is read-only" '
mkdir home; mount -t tmpfs tmpfs home; mount -o remount,ro home
export HOME=$PWD/home; unset XDG_RUNTIME_DIR XDG_CACHE_HOME; if touch home/x; then exit 1; fi
run'
check "no display, no terminal" '
unset DISPLAY WAYLAND_DISPLAY TERM
"$maes" run --agents 2 --duration 5 --transport memory --record shown.mcap >/dev/null
mkfifo address
setsid "$maes" view shown.mcap --address 127.0.0.1:0 </dev/null >address & viewer=$!
read -r url <address
curl --silent --fail --location --cookie-jar cookies "$url" | grep --quiet "<div id=.app.>"
kill -INT $viewer
wait $viewer'
exit "$failed"
