#!/usr/bin/env bash
# polars 2.1.0, pandas 2.3.3: one collision less is 18 446 744 073 709 551 615 more.
#
# Expected: the difference of two columns of counts, unsigned as Parquet stores them, is -1 or an
# error, as in DuckDB, which raises one.
# Seen: polars and pandas wrap without a word, and a mean of such differences is 9e18. `diff()` of
# polars, the same difference along a column, is -1.
# So: cast counts to Int64 before they are subtracted.
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

runs = polars.DataFrame({"a": [1, 2], "b": [2, 2]}, schema={"a": polars.UInt64, "b": polars.UInt64})
runs.write_parquet("runs.parquet")
frame = pandas.DataFrame({"a": [1, 2], "b": [2, 2]}, dtype="uint64")
try:
    of_duckdb = duckdb.sql("select a - b from 'runs.parquet'").fetchall()
except duckdb.Error as error:
    of_duckdb = type(error).__name__
found = [
    polars.read_parquet("runs.parquet").select(polars.col("a") - polars.col("b"))["a"].to_list(),
    (frame.a - frame.b).tolist(),
    polars.Series([2, 1], dtype=polars.UInt64).diff().to_list(),
    of_duckdb,
]
print("polars %s, pandas %s, diff of polars %s, DuckDB %s" % tuple(found))
if found != [[2**64 - 1, 0], [2**64 - 1, 0], [None, -1], "OutOfRangeException"]:
    sys.exit("changed: %r" % found)
PY
