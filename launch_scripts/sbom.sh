#!/usr/bin/env bash
# Writes bills of materials of what this repository builds, as CycloneDX 1.5 in JSON.
#
#   launch_scripts/sbom.sh [DIR]      default: target/sbom
#
# One file for each binary and for the library of the Python package (python.cdx.json), with the
# crates that its build on this machine uses and their checksums, and one for the page,
# viewer.cdx.json, with the packages of its lock file. cargo-cyclonedx comes from crates.io, into
# target/tools, unless it is installed. Needs cargo, npm, Python 3 and crates.io.
#
# The same commit gives the same files: their time is that of the commit (or SOURCE_DATE_EPOCH), their
# serial number is made from their content, and the folder of the checkout is called /maes.
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
# The tool writes into every folder with a crate.
trap 'git ls-files --others --exclude-standard -- "*_bin.cdx.json" "*_cdylib.cdx.json" | xargs --no-run-if-empty rm' EXIT
cargo cyclonedx --quiet --format json --spec-version 1.5 --describe binaries
for binary in maes sim_server agent_node; do
    mv "$binary/${binary}_bin.cdx.json" "$folder/$binary.cdx.json"
done
mv python/*_cdylib.cdx.json "$folder/python.cdx.json"
npm --prefix viewer sbom --package-lock-only --sbom-format cyclonedx >"$folder/viewer.cdx.json"
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct)} python3 - "$root" "$folder"/*.cdx.json <<'EOF'
import datetime, json, os, pathlib, sys, uuid

time = datetime.datetime.fromtimestamp(int(os.environ["SOURCE_DATE_EPOCH"]), datetime.timezone.utc)
for path in map(pathlib.Path, sys.argv[2:]):
    bill = json.loads(path.read_text().replace(f"file://{sys.argv[1]}/", "file:///maes/"))
    bill["metadata"]["timestamp"] = time.strftime("%Y-%m-%dT%H:%M:%SZ")
    bill.pop("serialNumber", None)
    content = json.dumps(bill, sort_keys=True)
    bill["serialNumber"] = uuid.uuid5(uuid.NAMESPACE_OID, content).urn
    path.write_text(json.dumps(bill, indent=2) + "\n")
EOF
printf '%s\n' "$folder"/*.cdx.json
