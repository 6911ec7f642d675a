#!/usr/bin/env bash
# polars 2.1.0, DuckDB 2.0.1: times that few runs reach are text.
#
# Expected: a column of a CSV file with empty fields and the number 12.5 is a column of numbers, as
# in pandas.
# Seen: polars looks at 100 rows, DuckDB at some 20 000. If the first run that has reached its goal
# comes later, the column is text, without a warning, and the greatest of 9.5 and 120.0 is "9.5".
# So: name the types (`schema_overrides`, `types`), let all rows be looked at
# (`infer_schema_length=None`, `sample_size=-1`), or read Parquet.
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

def write(name, empty):
    with open(name, "w") as file:
        file.write("seed,t99_s\n" + "".join(f"{seed},\n" for seed in range(empty)) + f"{empty},9.5\n{empty + 1},120.0\n")

write("few.csv", 150)
write("many.csv", 30_000)
found = [
    pandas.read_csv("few.csv").t99_s.max(),
    polars.read_csv("few.csv")["t99_s"].max(),
    polars.read_csv("few.csv", infer_schema_length=None)["t99_s"].max(),
    duckdb.sql("select max(t99_s) from 'few.csv'").fetchall()[0][0],
    duckdb.sql("select max(t99_s) from 'many.csv'").fetchall()[0][0],
    duckdb.sql("select max(t99_s) from read_csv('many.csv', sample_size = -1)").fetchall()[0][0],
]
print("greatest time: pandas %r, polars %r, of all rows %r, DuckDB %r, of many rows %r, of all rows %r" % tuple(found))
if found != [120.0, "9.5", 120.0, 120.0, "9.5", 120.0]:
    sys.exit("changed: greatest times are %r" % found)
PY
