#!/usr/bin/env python3
"""Compares controllers on many maps, over the in-memory link, and prints a table of means.

Every controller meets the same maps (seed 1, 2, ... of the generator), so that rows can be compared map by map. One line for each
run goes into a CSV file; runs that are in it already are not made again.

    launch_scripts/compare.py --controllers rbw,lvd,dsvp --sizes 50,75,100 --agents 2,5,10 --maps 10 --out compare.csv
"""

import argparse
import csv
import itertools
import os
import re
import statistics
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HERE = Path(__file__).resolve().parent
TICK_S = 0.02
FIELDS = [
    "controller", "size", "agents", "map", "explored", "end_s", "t50_s", "t90_s", "t99_s", "t99_9_s", "t100_s", "redundancy",
    "distance_m", "decisions", "collisions", "parcel_bytes", "wall_s", "digest",
]
MILESTONES = {"t50_s": "50", "t90_s": "90", "t99_s": "99", "t99_9_s": "99.9", "t100_s": "100"}


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words = lambda text: text.split(",")
    numbers = lambda text: [int(part) for part in text.split(",")]
    parser.add_argument("--controllers", type=words, default=["rbw", "lvd", "dsvp"], help="names, with commas between")
    parser.add_argument("--sizes", type=numbers, default=[50, 75, 100], help="cells along each axis")
    parser.add_argument("--agents", type=numbers, default=[2, 5, 10])
    parser.add_argument("--maps", type=int, default=10, help="how many maps: seeds 1 to this")
    parser.add_argument("--duration", type=float, default=1800.0, help="sim time, seconds")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="runs at a time")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="a key of the scenario; can be given again")
    parser.add_argument("--out", type=Path, default=Path("compare.csv"))
    return parser.parse_args()


def run(binary, args, controller, size, agents, seed):
    command = [binary, "single", HERE / "scenarios" / "default.toml", "--controller", controller, "--size", str(size)]
    command += ["--agents", str(agents), "--seed", str(seed), "--duration", str(args.duration), "--threads", "1"]
    command += [part for key in args.set for part in ("--set", key)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    if ended.returncode != 0:
        sys.exit(f"error: {controller}, {size} cells, {agents} agents, map {seed}: {ended.stderr.strip()}")
    text = ended.stdout
    value = lambda pattern: re.search(pattern, text)[1]
    counter = lambda name: int(found[1]) if (found := re.search(rf"\b{name} (\d+)", text)) else 0
    share = lambda who: [float(number) for number in re.findall(rf"{who} +┆ +([\d.]+) %", text)]
    team = share("team")[0]
    row = dict(controller=controller, size=size, agents=agents, map=seed, explored=team)
    row["end_s"] = round(int(value(r"\(tick (\d+)\)")) * TICK_S, 2)
    for name, percent in MILESTONES.items():
        reached = re.search(rf"^time to see .*\b{re.escape(percent)} % (\d+):([\d.]+)", text, re.MULTILINE)
        row[name] = "" if reached is None else round(60 * int(reached[1]) + float(reached[2]), 2)
    row["redundancy"] = round(sum(share(r"agent \d+")) / team - 1, 4)
    row["distance_m"] = value(r"team .*┆ +([\d.]+) m")
    row["decisions"] = counter("decisions")
    row["collisions"] = counter("collisions")
    row["parcel_bytes"] = counter("parcel_bytes_delivered")
    row["wall_s"] = value(r"wall time ([\d.]+) s")
    row["digest"] = value(r"digest: (\w+)")
    return row


def key(row):
    return row["controller"], int(row["size"]), int(row["agents"]), int(row["map"])


def table(rows, args):
    """Means; a time that some run did not reach counts as the whole duration there, and is marked."""
    print("| size | agents | controller | explored, mean (min) | time to 90 % | to 99 % | to 99.9 % | to 100 % | redundancy | way | wall time |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for size, agents, controller in itertools.product(args.sizes, args.agents, args.controllers):
        group = [row for row in rows if key(row)[:3] == (controller, size, agents) and int(row["map"]) <= args.maps]
        if not group:
            continue
        mean = lambda name: statistics.fmean(float(row[name]) for row in group)

        def reached(name):
            times = [float(row[name]) if row[name] != "" else args.duration for row in group]
            missed = sum(row[name] == "" for row in group)
            return f"{statistics.fmean(times):.0f} s" + (f" ({missed} of {len(group)} not)" if missed else "")

        explored = f"{mean('explored'):.2f} % ({min(float(row['explored']) for row in group):.2f})"
        times = " | ".join(reached(name) for name in ("t90_s", "t99_s", "t99_9_s", "t100_s"))
        print(f"| {size} | {agents} | {controller} | {explored} | {times} | {mean('redundancy'):.2f} "
              f"| {mean('distance_m'):.0f} m | {mean('wall_s'):.1f} s |")


def main():
    args = arguments()
    folder = Path(os.environ.get("MAES_BIN_DIR", HERE.parent / "target" / "release"))
    binary = folder / "experiments"
    if not binary.exists():
        sys.exit(f"error: {binary} is missing; build it with `cargo build --release` or set MAES_BIN_DIR")
    rows = list(csv.DictReader(args.out.open())) if args.out.exists() else []
    done = {key(row) for row in rows}
    wanted = itertools.product(args.controllers, args.sizes, args.agents, range(1, args.maps + 1))
    todo = [one for one in wanted if one not in done]
    with args.out.open("a", newline="") as file, ThreadPoolExecutor(args.jobs) as pool:
        writer = csv.DictWriter(file, FIELDS)
        if not rows:
            writer.writeheader()
        for row in pool.map(lambda one: run(binary, args, *one), todo):
            writer.writerow(row)
            file.flush()
            rows.append({name: str(value) for name, value in row.items()})
    table(rows, args)


if __name__ == "__main__":
    main()
