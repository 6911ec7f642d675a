#!/usr/bin/env bash
# polars 2.1.0, DuckDB 2.0.1, pandas 2.3.3: NaN among three times.
#
# Expected: of 1, NaN and 3 the mean, the median and the greatest value are all NaN, or all those of
# 1 and 3, as in pandas.
# Seen: in polars the mean is NaN, the greatest value is 3, and the median is 3, as if NaN were the
# largest of three numbers. In DuckDB NaN is the greatest value as well.
# So: turn NaN into null (`fill_nan(None)`) before statistics; a null is left out by all of them.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    polars==2.1.0 duckdb==2.0.1 pandas==2.3.3 numpy==2.4.6
"$dir/venv/bin/python" - <<'PY'
import math
import sys
import duckdb
import pandas
import polars

times = [1.0, math.nan, 3.0]
in_pandas, in_polars = pandas.Series(times), polars.Series(times)
rows = "select avg(t), median(t), max(t) from (select unnest([1.0::double, 'nan'::double, 3.0::double]) as t)"
found = {
    "pandas": [in_pandas.mean(), in_pandas.median(), in_pandas.max()],
    "polars": [in_polars.mean(), in_polars.median(), in_polars.max()],
    "with null": [in_polars.fill_nan(None).mean(), in_polars.fill_nan(None).median(), in_polars.fill_nan(None).max()],
    "DuckDB": list(duckdb.sql(rows).fetchall()[0]),
}
found = {name: [str(float(value)) for value in values] for name, values in found.items()}
print("mean, median, greatest:", found)
expected = {"pandas": ["2.0", "2.0", "3.0"], "polars": ["nan", "3.0", "3.0"], "with null": ["2.0", "2.0", "3.0"], "DuckDB": ["nan", "3.0", "nan"]}
if found != expected:
    sys.exit("changed: %r" % found)
PY
