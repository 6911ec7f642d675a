#!/usr/bin/env bash
# A RUSTC_WRAPPER for those who build all tests and run them once, as .ci/run does: test programs
# that run for a moment are compiled without any optimisation, which takes most of their compile
# time. Libraries and programs are compiled as ever.
set -eu
name=
is_test=
previous=
for argument in "$@"; do
    if [[ $previous == --crate-name ]]; then name=$argument; fi
    if [[ $argument == --test ]]; then is_test=1; fi
    previous=$argument
done
if [[ -z $is_test ]]; then exec "$@"; fi
case $name in
msgs | protocol | simulation | system | transport)
    exec "$@" -C opt-level=0
    ;;
*) exec "$@" ;;
esac
