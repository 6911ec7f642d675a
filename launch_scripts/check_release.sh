#!/usr/bin/env bash
# Installs the files of a release on a bare Debian, and takes a first run and a first picture there:
#
#   launch_scripts/check_release.sh [FOLDER] [SUITE]     default: out/release bookworm
#
# Needs root and debootstrap. The bare system is a chroot without Rust, Node.js and Python, made anew
# each time; its page is opened by the browser of this system, which needs Node.js, Chromium and the
# packages of viewer/. Prints how long it takes from the installation to the first picture, for the
# package and for the tarball. Exit code 1 if a step fails.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
release=$(realpath "${1:-$root/out/release}")
suite=${2:-bookworm}
expected=$(sed -n 's/^digest: //p' "$root/README.md")
# shellcheck source=launch_scripts/bare_debian.sh
. "$root/launch_scripts/bare_debian.sh"
[[ -d $root/viewer/node_modules ]] || npm --prefix "$root/viewer" ci --no-audit --no-fund --loglevel=error >&2

bare_debian "$suite"
for program in cargo node python3; do
    if chroot "$system" sh -c "command -v $program" >/dev/null; then fail "$program is in the bare system"; fi
done

# In the bare system, from a folder of its own: a run over ROS 2, what it is worth, and the address of
# its page, which is served until a line comes in.
first_run='
set -eu
cd "$(mktemp -d)"
maes run --agents 5 --record run.mcap >result.txt 2>run.log || { cat run.log; exit 1; }
grep "^digest: " result.txt
maes verify run.mcap >/dev/null
maes view run.mcap --browser false --address 127.0.0.1:0 &
viewer=$!
read -r _
kill -INT $viewer
wait $viewer
'
check() {
    local what=$1 begun=$SECONDS digest url picture=$release/${1// /-}.png
    shift
    coproc bare { "$@" bash -c "$first_run"; }
    local process=${bare_PID:?} from=${bare[0]} to=${bare[1]}
    read -r digest <&"$from" && read -r url <&"$from" || fail "$what: ${digest:-no run}"
    [[ $digest == "digest: $expected" ]] || fail "$what: $digest, expected $expected"
    MAES_CAPTURE=$(printf '{"url": "%s", "out": "%s", "size": [1280, 720], "agent": null, "layers": null, "at": 200}' \
        "$url" "$picture") node "$root/viewer/pictures/take.mjs" || fail "$what: no picture"
    echo "$what: first run, verified, and its first picture in $((SECONDS - begun)) s: $picture"
    echo >&"$to"
    wait "$process" || fail "$what: maes view ended with $?"
}

package=$(echo "$release"/maes_*.deb)
cp "$package" "$system/tmp/maes.deb"
chroot "$system" dpkg --install /tmp/maes.deb >/dev/null || fail "$package does not install"
check "Debian package" chroot "$system" env HOME=/root
chroot "$system" dpkg --purge maes >/dev/null
[[ ! -e $system/usr/bin/maes ]] || fail "the package leaves files behind"

tar --extract --gzip --file "$(echo "$release"/maes-*-linux.tar.gz)" --directory "$system/opt" --strip-components 1
check "tarball" chroot "$system" env HOME=/root PATH="/opt/bin:$PATH"
