#!/usr/bin/env bash
# pandas 2.3.3, polars 2.1.0, DuckDB 2.0.1: hexadecimal names of runs become numbers.
#
# Expected: a column with 0123456789012345 and 1234567890123e45, ids of runs or of commits, is text,
# as in DuckDB: the zero in front says so.
# Seen: in pandas and polars it is 123456789012345.0 and 1.234567890123e+57. One id with another
# letter among the rows makes it text, so it works until the file is short.
# So: `dtype={"id": str}`, `schema_overrides`, or ids with a letter in front.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    polars==2.1.0 duckdb==2.0.1 pandas==2.3.3 numpy==2.4.6
cd "$dir"
"$dir/venv/bin/python" - <<'PY'
import sys
import duckdb
import pandas
import polars

ids = ["0123456789012345", "1234567890123e45"]
with open("runs.csv", "w") as file:
    file.write("id,seed\n%s,1\n%s,2\n" % tuple(ids))
found = [
    pandas.read_csv("runs.csv").id.tolist(),
    polars.read_csv("runs.csv")["id"].to_list(),
    [row[0] for row in duckdb.sql("select id from 'runs.csv'").fetchall()],
    pandas.read_csv("runs.csv", dtype={"id": str}).id.tolist(),
]
print("pandas %s, polars %s, DuckDB %s, as text %s" % tuple(found))
number = [123456789012345.0, 1.234567890123e57]
if found != [number, number, ids, ids]:
    sys.exit("changed: %r" % found)
PY
