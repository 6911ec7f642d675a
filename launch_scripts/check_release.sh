#!/usr/bin/env bash
# Installs the files of a release on a bare Debian, and takes a first run and a first picture there:
#
#   launch_scripts/check_release.sh [FOLDER] [SUITE]     default: out/release bookworm
#
# Needs root and debootstrap. The bare system is a chroot without Rust, Node.js and Python, made anew
# each time. Prints how long it takes from the installation to the first picture, for the package and
# for the tarball. Exit code 1 if a step fails.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
release=$(realpath "${1:-$root/out/release}")
suite=${2:-bookworm}
expected=$(sed -n 's/^digest: //p' "$root/README.md")
fail() {
    printf 'error: %s\n' "$1" >&2
    exit 1
}
((EUID == 0)) || fail "a chroot needs root"
command -v debootstrap >/dev/null || fail "debootstrap is missing: apt install debootstrap"

system=$(mktemp -d)
cleanup() {
    # Before anything is removed: these folders are those of this system.
    for mounted in proc dev; do
        if mountpoint --quiet "$system/$mounted"; then umount "$system/$mounted"; fi
    done
    rm -rf --one-file-system "$system"
}
trap cleanup EXIT
debootstrap --variant=minbase "$suite" "$system" >"$release/debootstrap.log" 2>&1 ||
    fail "debootstrap: see $release/debootstrap.log"
mount -t proc proc "$system/proc"
mount --bind /dev "$system/dev"
for program in cargo node python3; do
    if chroot "$system" sh -c "command -v $program" >/dev/null; then fail "$program is in the bare system"; fi
done

# In the bare system, from a folder of its own: a run over ROS 2, what it is worth, and its picture.
first_run='
set -eu
cd "$(mktemp -d)"
maes run --agents 5 --record run.mcap >result.txt 2>run.log || { cat run.log; exit 1; }
grep "^digest: " result.txt
maes verify run.mcap >/dev/null
maes view run.mcap --browser false --address 127.0.0.1:0 >address.txt &
viewer=$!
until grep -q http address.txt; do kill -0 $viewer || exit 1; done
url=$(head -n 1 address.txt)
address=${url#http://}
address=${address%%/*}
get() {
    exec 3<>"/dev/tcp/${address%:*}/${address##*:}"
    printf "GET %s HTTP/1.1\r\nHost: %s\r\nCookie: %s\r\nConnection: close\r\n\r\n" "$1" "$address" "${2:-}" >&3
    cat <&3
}
cookie=$(get "/${url#http://*/}" | tr -d "\r" | sed -n "s/^set-cookie: \([^;]*\);.*/\1/p")
get / "$cookie" | grep -q "<title>" || { echo "the page is not served"; kill $viewer; exit 1; }
kill -INT $viewer
wait $viewer
'
check() {
    local what=$1 begun=$SECONDS digest
    shift
    digest=$("$@" bash -c "$first_run") || fail "$what: $digest"
    [[ $digest == "digest: $expected" ]] || fail "$what: $digest, expected $expected"
    echo "$what: first run, verified, and its page in $((SECONDS - begun)) s"
}

package=$(echo "$release"/maes_*.deb)
cp "$package" "$system/tmp/maes.deb"
chroot "$system" dpkg --install /tmp/maes.deb >/dev/null || fail "$package does not install"
check "Debian package" chroot "$system" env HOME=/root
chroot "$system" dpkg --purge maes >/dev/null
[[ ! -e $system/usr/bin/maes ]] || fail "the package leaves files behind"

tar --extract --gzip --file "$(echo "$release"/maes-*-linux.tar.gz)" --directory "$system/opt" --strip-components 1
check "tarball" chroot "$system" env HOME=/root PATH="/opt/bin:$PATH"
