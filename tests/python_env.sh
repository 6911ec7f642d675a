#!/usr/bin/env bash
# Makes a Python environment with the packages of tests/NAME_requirements.txt, and prints its
# interpreter.
#
#   tests/python_env.sh NAME
#
# Environments are in ${XDG_CACHE_HOME:-$HOME/.cache}/maes-python; one that is up to date is kept.
# Only files with a hash in the list are installed; `pip-compile --generate-hashes` (pip-tools) makes
# them. Needs Python 3.10 or later with venv, and PyPI or an index that pip is set to. Progress goes to
# stderr.

set -euo pipefail

requirements=$(dirname "${BASH_SOURCE[0]}")/$1_requirements.txt
dir=${XDG_CACHE_HOME:-${HOME:?}/.cache}/maes-python/$1

fail() {
    printf 'python_env: %s\n' "$1" >&2
    exit 1
}

mkdir -p "$dir"
exec 9>"$dir.lock"
flock 9

stamp="$(python3 --version) $(sha256sum <"$requirements")"
if [[ ! -f $dir/stamp || $(cat "$dir/stamp") != "$stamp" ]]; then
    printf 'python_env: installing %s into %s\n' "$requirements" "$dir" >&2
    rm -rf "$dir"
    python3 -m venv "$dir" || fail "python3 cannot make environments; install its venv module (Debian: apt install python3-venv)"
    "$dir/bin/python" -m pip install --quiet --disable-pip-version-check --require-hashes \
        -r "$requirements" >&2 ||
        fail "pip cannot install $requirements; is PyPI within reach, or the index that pip is set to?"
    printf '%s' "$stamp" >"$dir/stamp"
fi
printf '%s\n' "$dir/bin/python"
