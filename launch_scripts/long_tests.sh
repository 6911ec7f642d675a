#!/usr/bin/env bash
# The tests that `cargo test` and .ci/run leave out because they take long:
#
#   launch_scripts/long_tests.sh [WORD...]      default: all; with words, those that have one in their name
#
# All browser tests of the page, movies, the example in C++, plans of own programs, the notebooks
# and the API pages of the Python package, trainings by six libraries for learning, plans over Dask,
# Ray and submitit, SIERRA, exported maps in trimesh, Open3D, pyoctomap and PCL, recordings and topics
# in kappe, baglint, tracecheck, libraries of Foxglove and the buffer of tf2 (Debian 12), the viewer
# Rerun without a window, which needs a driver for Vulkan (Debian: mesa-vulkan-drivers), what
# `cargo install` installs, and the programs and libraries without ROS 2; without words also runs
# over Zenoh, every code block of the documents that takes long, such as movies and benchmarks, the
# site with its links, the first ten minutes of docs/newcomers.md with a stopwatch, and runs in
# poorer environments.
# Installs the Python packages and the mdBook that they need, and takes an hour on two cores. Exit
# code 1 if a test fails.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
launch_scripts/patched_rustdds.sh >/dev/null

failed=0
cargo test --release --workspace --locked --no-fail-fast -- --ignored "$@" || failed=1
if (($# == 0)); then
    cargo test --release --locked -p tests -p ros_node --features tests/zenoh -- zenoh || failed=1
    MAES_DOCUMENTED=long cargo test --release --locked -p tests --test end_to_end documented_blocks || failed=1
    launch_scripts/site.sh || failed=1
    launch_scripts/newcomers.sh || failed=1
    launch_scripts/check_environments.sh || failed=1
fi
exit "$failed"
