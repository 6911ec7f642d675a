#!/usr/bin/env bash
# Runs tests/tf2_buffer.py with the tf2 of Debian 12, the only package of it on the registries of the
# tests:
#
#   tests/tf2_buffer.sh ARRIVED.txt
#
# The packages are unpacked into ${XDG_CACHE_HOME:-$HOME/.cache}/maes-tf2, once, and not installed.
# Needs Debian 12 on x86_64 with lists of packages (`apt-get update`).
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
dir=${XDG_CACHE_HOME:-${HOME:?}/.cache}/maes-tf2
mkdir -p "$dir"
exec 9>"$dir.lock"
flock 9
if [[ ! -f $dir/stamp ]]; then
    rm -rf "$dir"
    mkdir -p "$dir/debs/partial" "$dir/root"
    # Nothing of it is installed, so that what others install at the same time is no hindrance.
    apt-get install -qq -y --download-only --no-install-recommends -o Debug::NoLocking=1 -o APT::Sandbox::User=root \
        -o Dir::Cache::archives="$dir/debs" python3-tf2=0.7.6-1+b2 python3-geometry-msgs python3-rospy >&2
    find "$dir/debs" -name '*.deb' -exec dpkg -x {} "$dir/root" \;
    touch "$dir/stamp"
fi
flock -u 9
library=$dir/root/usr/lib/x86_64-linux-gnu
export LD_LIBRARY_PATH=$library:$library/blas:$library/lapack PYTHONPATH=$dir/root/usr/lib/python3/dist-packages
exec /usr/bin/python3 "$here/tf2_buffer.py" "$@"
