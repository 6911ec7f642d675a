#!/usr/bin/env bash
# Builds the wheel and the source distribution of the Python package, and installs the wheel in an
# environment of its own as a check.
#
#   launch_scripts/python_wheel.sh [DIR]        # default: out/wheels
#
# Needs Rust, and Python 3.10 or later with venv and PyPI. The wheel is for every Python from 3.10 on,
# on this architecture and a C library that is no older. MAES_WHEEL_TARGET=aarch64-unknown-linux-gnu
# builds for another one, if Rust and a linker for it are installed, and leaves out the check.

set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

dir=$(mkdir -p "${1:-out/wheels}" && cd "${1:-out/wheels}" && pwd)
target=${MAES_WHEEL_TARGET:-}
environment=$(mktemp -d)
trap 'rm -rf "$environment"' EXIT

launch_scripts/patched_rustdds.sh >&2
python3 -m venv "$environment/build"
"$environment/build/bin/pip" install --quiet --disable-pip-version-check maturin==1.16.0 >&2
"$environment/build/bin/maturin" build --profile dist --locked --manifest-path python/Cargo.toml \
    ${target:+--target "$target"} --out "$dir" >&2
"$environment/build/bin/maturin" sdist --manifest-path python/Cargo.toml --out "$dir" >&2
if [[ -z $target ]]; then
    wheel=$(find "$dir" -name 'maes-*.whl' -printf '%T@ %p\n' | sort -n | tail -1 | cut -d' ' -f2-)
    python3 -m venv "$environment/check"
    "$environment/check/bin/pip" install --quiet --disable-pip-version-check "$wheel" >&2
    "$environment/check/bin/python" -c 'import maes; print(maes.run(size=20, duration=10.0))' >&2
fi
ls -l "$dir" >&2
