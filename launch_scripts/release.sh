#!/usr/bin/env bash
# Makes the files of a release from a checkout without changes:
#
#   launch_scripts/release.sh [FOLDER]     default: out/release
#
#   maes-VERSION-ARCH-linux.tar.gz    binaries with the page in them, completions, manual pages, docs
#   maes_VERSION_ARCH.deb             the same, as a Debian package
#   maes-VERSION-*.whl, .tar.gz       the Python package and its sources (python_wheel.sh)
#   *.cdx.json                        what the binaries and the page are made of (sbom.sh)
#   SHA256SUMS                        of all of them
#   SHA256SUMS.asc                    the signature of it, if MAES_SIGNING_KEY names a key of gpg
#
# Times in the files are those of the commit, order and owners are fixed, and the paths of this
# machine are not in the binaries, so that two checkouts of a commit give the same files with the same
# compilers. Needs what a build needs, Node.js with npm, Python 3 with venv, crates.io, PyPI and, for
# the package, dpkg-deb. `--dirty` builds a checkout with changes.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root"
fail() {
    printf 'error: %s\n' "$1" >&2
    exit 1
}

dirty=
if [[ ${1:-} == --dirty ]]; then
    dirty=1
    shift
fi
out=$(realpath -m "${1:-out/release}")
[[ -n $dirty || -z $(git status --porcelain) ]] ||
    fail "the checkout has changes: commit them, or build a try-out with: launch_scripts/release.sh --dirty"
for program in npm python3 strip gzip; do
    command -v "$program" >/dev/null || fail "$program is missing"
done

version=$(sed -n 's/^version = "\(.*\)"$/\1/p' Cargo.toml | head -n 1)
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct)
export SOURCE_DATE_EPOCH
arch=$(uname -m)
name=maes-$version-$arch-linux
stage=$(mktemp -d)
trap 'rm -rf "$stage"' EXIT
tree=$stage/$name
mkdir -p "$out"

# A program whose paths are those of no machine. `--config` keeps the flags of other settings.
launch_scripts/patched_rustdds.sh >/dev/null
remap="--remap-path-prefix=$root=/maes --remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}=/cargo"
target=${CARGO_TARGET_DIR:-$root/target}/release-files
npm --prefix viewer ci --no-audit --no-fund --loglevel=error >&2
npm --prefix viewer run --silent build >&2
(
    export RUSTFLAGS=$remap CARGO_TARGET_DIR=$target
    cargo build --profile dist --locked --features maes/embedded_page >&2
    launch_scripts/python_wheel.sh "$out"
)

install -d "$tree/bin" "$tree/share/man/man1" "$tree/share/doc/maes"
for program in maes sim_server agent_node; do
    install -m 755 "$target/dist/$program" "$tree/bin/"
    strip "$tree/bin/$program"
done
install -d "$tree/share/"{bash-completion/completions,zsh/site-functions,fish/vendor_completions.d}
"$tree/bin/maes" completions bash >"$tree/share/bash-completion/completions/maes"
"$tree/bin/maes" completions zsh >"$tree/share/zsh/site-functions/_maes"
"$tree/bin/maes" completions fish >"$tree/share/fish/vendor_completions.d/maes.fish"
"$tree/bin/maes" man-pages "$tree/share/man/man1"
gzip --no-name --best "$tree"/share/man/man1/*

# What the documentation names, in the folders of a checkout.
share=$tree/share/maes
install -d "$share/launch_scripts" "$share/experiments" "$share/msgs/src" "$share/viewer/pictures"
cp -r launch_scripts/scenarios launch_scripts/ros_{env.sh,requirements.txt} -t "$share/launch_scripts"
cp launch_scripts/maes.{launch.py,rviz,foxglove.json} -t "$share/launch_scripts"
cp -r experiments/plans -t "$share/experiments"
cp -r examples -t "$share"
cp -r msgs/msg msgs/srv msgs/package.xml msgs/CMakeLists.txt -t "$share/msgs"
cp -r msgs/src/standard -t "$share/msgs/src"
# For `maes snapshot` and `maes movie`; `maes view` has the page in it.
cp -r viewer/dist -t "$share/viewer"
find viewer/pictures -name '*.mjs' ! -name '*.test.mjs' -exec cp -t "$share/viewer/pictures" {} +
cp -r README.md ARCHITECTURE.md CONTRIBUTING.md CHANGELOG.md SECURITY.md CITATION.cff LICENSE-MIT LICENSE-APACHE docs -t "$tree/share/doc/maes"
install -D -m 644 contrib/rustdds/README.md -t "$tree/share/doc/maes/contrib/rustdds"
python3 launch_scripts/third_party.py "$tree/share/doc/maes/THIRD-PARTY-LICENCES.txt"
launch_scripts/sbom.sh "$out" >/dev/null
find "$tree" \( -name __pycache__ -o -name target -o -name node_modules \) -prune -exec rm -rf {} +

# One order, one owner, one time.
find "$tree" -exec touch --no-dereference --date "@$SOURCE_DATE_EPOCH" {} +
chmod -R u=rwX,go=rX "$tree"
tar --create --directory "$stage" --sort=name --owner=0 --group=0 --numeric-owner \
    --mtime "@$SOURCE_DATE_EPOCH" "$name" | gzip --no-name --best >"$out/$name.tar.gz"

# Of the same tree as the tarball, byte for byte; cargo-deb would build and strip once more.
if command -v dpkg-deb >/dev/null; then
    debian=$(dpkg --print-architecture)
    package=$stage/package
    install -d "$package/DEBIAN" "$package/usr"
    cp -a "$tree/." "$package/usr/"
    {
        echo "MAES, under the MIT License or the Apache License 2.0, at your choice; the licences of what is"
        echo "linked in are in THIRD-PARTY-LICENCES.txt."
        cat "$package"/usr/share/doc/maes/LICENSE-{MIT,APACHE}
    } >"$package/usr/share/doc/maes/copyright"
    libc=$(objdump -T "$tree"/bin/* | grep -o 'GLIBC_[0-9.]*' | sort -uV | tail -n 1)
    cat >"$package/DEBIAN/control" <<EOF
Package: maes
Version: $version
Architecture: $debian
Maintainer: The maintainers <maes@localhost.localdomain>
Section: science
Priority: optional
Installed-Size: $(find "$package/usr" -type f -printf '%s\n' | awk '{ kib += int(($1 + 1023) / 1024) } END { print kib }')
Depends: libc6 (>= ${libc#GLIBC_}), libgcc-s1
Suggests: chromium, ffmpeg, nodejs
Description: deterministic simulator of 3-D multi-robot exploration for ROS 2
 A world server and a process for each agent explore voxel caves in lock-step
 over ROS 2. The same scenario gives the same recording, byte for byte.
EOF
    find "$package" -exec touch --no-dereference --date "@$SOURCE_DATE_EPOCH" {} +
    dpkg-deb --root-owner-group --build "$package" "$out/maes_${version}_$debian.deb" >&2
else
    echo "dpkg-deb is missing: no Debian package is made" >&2
fi
cd "$out"
files=()
for file in *.tar.gz *.deb *.whl *.cdx.json; do [[ ! -e $file ]] || files+=("$file"); done
sha256sum -- "${files[@]}" | tee SHA256SUMS
rm -f SHA256SUMS.asc
if [[ -n ${MAES_SIGNING_KEY:-} ]]; then
    gpg --batch --local-user "$MAES_SIGNING_KEY" -a --detach-sign SHA256SUMS
fi
