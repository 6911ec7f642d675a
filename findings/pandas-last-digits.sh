#!/usr/bin/env bash
# pandas 2.3.3: numbers of a CSV file lose their last digits.
#
# Expected: a number that was written with the digits that round-trip is read as the same number, as
# by Python's float(), polars and DuckDB.
# Seen: of 1000 shares between 0 and 0.01 most are read as another number, the worst with an error
# of more than 1e-13, a thousand times the rounding. Equal runs that one program reads and another
# one computes are unequal, and ties of a rank test are none.
# So: `float_precision="round_trip"`, or Parquet.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q --no-compile --disable-pip-version-check \
    pandas==2.3.3 polars==2.1.0 duckdb==2.0.1 numpy==2.4.6
cd "$dir"
"$dir/venv/bin/python" - <<'PY'
import random
import sys
import duckdb
import numpy
import pandas
import polars

random.seed(1)
numbers = numpy.array([random.random() * 0.01 for _ in range(1000)])
with open("x.csv", "w") as file:
    file.write("x\n" + "\n".join(map(repr, numbers.tolist())) + "\n")
read = {
    "pandas": pandas.read_csv("x.csv").x.to_numpy(),
    "round_trip": pandas.read_csv("x.csv", float_precision="round_trip").x.to_numpy(),
    "polars": polars.read_csv("x.csv")["x"].to_numpy(),
    "DuckDB": duckdb.sql("select x from 'x.csv'").fetchnumpy()["x"],
}
other = {name: int((values != numbers).sum()) for name, values in read.items()}
worst = float(abs(read["pandas"] / numbers - 1).max())
print("other numbers of 1000: %s; worst error %.1e" % (other, worst))
if not (other["pandas"] > 900 and worst > 1e-13 and other["round_trip"] == other["polars"] == other["DuckDB"] == 0):
    sys.exit("changed: %s, worst %g" % (other, worst))
PY
