#!/usr/bin/env bash
# polars 2.1.0, DuckDB 2.0.1: the median is not the quantile of one half.
#
# Expected: of the times 1, 2, 3 and 10 s median and quantile(0.5) are 2.5, as in pandas and NumPy
# (type 7 of Hyndman and Fan).
# Seen: polars has the median 2.5, and `quantile(0.5)` and the row `50%` of `describe` are 3.0, the
# nearest value. DuckDB has the median 2.5 and `quantile(x, 0.5)` 2.0, the discrete one. The lower
# quartile is 1.75 in pandas, 2.0 in polars and 1.0 in DuckDB.
# So: `quantile(0.5, "linear")`, `quantile_cont`; compare no boxes of different libraries.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    polars==2.1.0 duckdb==2.0.1 pandas==2.3.3 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import sys
import duckdb
import pandas
import polars

times = [1.0, 2.0, 3.0, 10.0]
in_pandas, in_polars = pandas.Series(times), polars.Series("t", times)
rows = dict(in_polars.to_frame().describe().iter_rows())
of_duckdb = "select median(t), quantile(t, 0.5), quantile(t, 0.25) from (select unnest([1.0::double, 2.0, 3.0, 10.0]) as t)"
found = {
    "pandas": [in_pandas.median(), in_pandas.quantile(0.5), in_pandas.quantile(0.25)],
    "polars": [in_polars.median(), in_polars.quantile(0.5), in_polars.quantile(0.25)],
    "describe": [rows["50%"]],
    "linear": [in_polars.quantile(0.5, "linear")],
    "DuckDB": list(duckdb.sql(of_duckdb).fetchall()[0]),
}
print("median, quantile of 0.5, of 0.25:", found)
expected = {"pandas": [2.5, 2.5, 1.75], "polars": [2.5, 3.0, 2.0], "describe": [3.0], "linear": [2.5], "DuckDB": [2.5, 2.0, 1.0]}
if found != expected:
    sys.exit("changed: %r" % found)
PY
