#!/usr/bin/env bash
# Writes bills of materials of what this repository builds, as CycloneDX 1.5 in JSON.
#
#   launch_scripts/sbom.sh [DIR]      default: target/sbom
#
# One file for each binary, with the crates that its build on this machine uses and their checksums,
# and one for the page, viewer.cdx.json, with the packages of its lock file. cargo-cyclonedx comes
# from crates.io, into target/tools, unless it is installed. Needs cargo, npm and crates.io.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
folder=${1:-$root/target/sbom}
version=0.5.9
tools=$root/target/tools

cd "$root"
if ! cargo cyclonedx --version >/dev/null 2>&1; then
    [[ -x $tools/bin/cargo-cyclonedx ]] ||
        cargo install --quiet --locked --root "$tools" cargo-cyclonedx@$version
    PATH=$tools/bin:$PATH
fi
mkdir -p "$folder"
trap 'rm -f */*_bin.cdx.json' EXIT
cargo cyclonedx --quiet --format json --spec-version 1.5 --describe binaries
for binary in maes sim_server agent_node; do
    mv "$binary/${binary}_bin.cdx.json" "$folder/$binary.cdx.json"
done
npm --prefix viewer sbom --package-lock-only --sbom-format cyclonedx >"$folder/viewer.cdx.json"
printf '%s\n' "$folder"/*.cdx.json
