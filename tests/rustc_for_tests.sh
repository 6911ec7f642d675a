#!/usr/bin/env bash
# A RUSTC_WRAPPER for those who build all tests and run them once, as .ci/run does: test
# programs are compiled without link-time optimisation, which takes a third of their compile time
# and which they seldom repay. Libraries and programs are compiled as ever.
set -eu
for argument in "$@"; do
    if [[ $argument == --test ]]; then exec "$@" -C lto=off; fi
done
exec "$@"
