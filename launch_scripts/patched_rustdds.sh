#!/usr/bin/env bash
# Makes cargo build this workspace with the fixes of contrib/rustdds in the DDS library.
#
#   launch_scripts/patched_rustdds.sh          patches a copy, unless it is there
#   launch_scripts/patched_rustdds.sh --off    cargo builds with the published library again
#
# The copy of the published crate, whose checksum Cargo.lock has, lies in .cargo, and so does the
# setting that makes cargo use it (.cargo/config.toml, `paths`). Git ignores both, and Cargo.lock
# stays as it is. From then on every cargo command in this workspace uses the copy. build.sh calls
# this script, and so do run.sh and the other scripts that build.
#
# Prints the folder of the copy on stdout, and errors on stderr (exit code 1).
set -eu

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
config=$root/.cargo/config.toml
marker="# Written by launch_scripts/patched_rustdds.sh"

fail() {
    printf 'error: %s\n' "$1" >&2
    exit 1
}

is_ours() { [[ $(head -n 1 "$config") == "$marker" ]]; }

if [[ ${1:-} == --off ]]; then
    if [[ -e $config ]] && is_ours; then rm "$config"; fi
    rm -rf "$root"/.cargo/rustdds-*
    exit
fi

# Version and checksum of the locked crate.
read -r version checksum < <(awk '$0 == "name = \"rustdds\"" { found = 1 }
    found && $1 == "version" { version = $3 }
    found && $1 == "checksum" { print version, $3; exit }' "$root/Cargo.lock" | tr -d '"') ||
    fail "Cargo.lock has no package rustdds with a checksum: git checkout Cargo.lock"

patches=("$root"/contrib/rustdds/*.patch)
hash=$(cat "${patches[@]}" | sha256sum | cut -c -12)
copy=$root/.cargo/rustdds-$version-$hash
setting="paths = [\".cargo/${copy##*/}\"]"

if [[ -e $config ]] && ! is_ours; then
    grep -qF "$setting" "$config" || fail "$config is not from this script: add to it the line: $setting"
fi

if [[ ! -d $copy ]]; then
    # The setting of an older copy would keep cargo from fetching the crate.
    rm -f "$config"
    crate() {
        for file in "${CARGO_HOME:-$HOME/.cargo}"/registry/cache/*/"rustdds-$version.crate"; do
            [[ -e $file ]] && sha256sum --check --status <<<"$checksum  $file" && echo "$file" && return
        done
        return 1
    }
    file=$(crate) || { (cd "$root" && cargo fetch --locked >&2) && file=$(crate); } ||
        fail "cargo fetch got no rustdds $version with the checksum in Cargo.lock; without the fixes: cargo build --release"
    mkdir -p "$root/.cargo"
    temporary=$(mktemp -d "$root/.cargo/unpacking.XXXXXX")
    trap 'rm -rf "$temporary"' EXIT
    tar --extract --gzip --file "$file" --directory "$temporary" --strip-components 1
    for patch in "${patches[@]}"; do
        if command -v patch >/dev/null; then
            log=$(patch --directory "$temporary" --strip 1 --forward --no-backup-if-mismatch --input "$patch" 2>&1)
        elif command -v git >/dev/null; then
            # As outside of a repository: within one, git skips files that it ignores.
            log=$(cd "$temporary" && GIT_CEILING_DIRECTORIES=$root/.cargo git apply -p1 "$patch" 2>&1)
        else
            fail "patch is missing: install it, on Debian and Ubuntu with: apt install patch"
        fi || fail "${patch##*/} does not fit rustdds $version: $log"
    done
    # By which `ros_node` knows what it is built with.
    printf '\n/// This copy has the fixes of contrib/rustdds.\npub const MAES_FIXES: bool = true;\n' >>"$temporary/src/lib.rs"
    rm -rf "$root"/.cargo/rustdds-*
    # Fails if another call was faster, which made the same.
    mv -T "$temporary" "$copy" 2>/dev/null || [[ -d $copy ]]
fi

if [[ ! -e $config ]] || ! grep -qF "$setting" "$config"; then
    printf '%s\n# The DDS library with the fixes of contrib/rustdds. Without this file: the published one.\n%s\n' \
        "$marker" "$setting" >"$config.$$"
    mv "$config.$$" "$config"
fi
echo "$copy"
