"""Executes the scenario of a YAML file with `maes batch`, and leaves its time series for stage 3.

    python run.py SCENARIO.yaml OUT

writes OUT/output/series.csv: one row every 10 s of sim time, numbers only. `maes` is looked for in
MAES_BIN_DIR, or else in PATH.
"""

import csv
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import yaml
from series import PERIOD_S, row_count

COLUMNS = ["t_s", "explored", "covered", "distance_m"]


def toml(value) -> str:
    """A value of YAML as an inline value of TOML."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {toml(value[key])}" for key in value) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value)


def execute(scenario: dict) -> list[dict[str, str]]:
    """The rows of series.csv of a run."""
    seed = scenario.pop("seed")
    maes = os.path.join(os.environ.get("MAES_BIN_DIR", ""), "maes")
    with tempfile.TemporaryDirectory() as folder:
        plan, out = Path(folder, "plan.toml"), Path(folder, "out")
        plan.write_text(f"seeds = [{seed}]\nscenario = {toml(scenario)}\n[axes]\n")
        subprocess.run([maes, "batch", plan, "--out", out, "--jobs", "1"], check=True)
        with open(out / "series.csv", newline="") as file:
            return list(csv.DictReader(file))


def main() -> None:
    source, out = map(Path, sys.argv[1:])
    scenario = yaml.safe_load(source.read_text())
    expected = row_count(scenario["duration_s"])
    # The row at the end of the run may follow sooner.
    rows = [row for row in execute(scenario) if float(row["t_s"]) % PERIOD_S == 0]
    if len(rows) != expected:
        sys.exit(
            f"{source}: {len(rows)} rows instead of {expected}: the run ended early, and SIERRA "
            "averages rows by number; set stop_when_explored to false"
        )
    (out / "output").mkdir(parents=True, exist_ok=True)
    with open(out / "output" / "series.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        # As floats: a column of which SIERRA reads integers in one run and floats in another is
        # refused.
        writer.writerows([float(row[column]) for column in COLUMNS] for row in rows)


if __name__ == "__main__":
    main()
