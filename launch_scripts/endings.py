#!/usr/bin/env python3
"""Runs every built-in controller on small worlds, in memory, and prints how each run ends.

    launch_scripts/endings.py [--bin DIR] [--jobs N] [--only WORDS] [--controllers A,B]
                              [--seed K] [--minutes N]

For each run: the share of the free cells that the team has seen, and that its bodies can see; the
distance of the team; the sim time of the last new cell, of the last motion and of the end; why it
ended; and the slowest decision. A run that has not ended by itself, or in which no body has moved
for a minute at its end, is marked with *. Exit code 1 if there is one, apart from the random walks.
Needs Python 3 alone.
"""

import argparse
import concurrent.futures
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

# Walks at random end with the duration.
WALKS = {"rbw", "rbw-maes3d"}

SMALL = {
    "agents.count": 4, "body.kind": '"aerial"', "body.radius_m": 0.3, "body.speed_max_m_s": 2.0,
    "body.acceleration_m_s2": 2.0, "body.deceleration_m_s2": 2.0, "lidar.range_m": 4.5,
}
SCENE = {"map.kind": '"scene"', "map.cell_m": 0.2}
OFFICE = {**SCENE, "map.scene.name": '"office"', "map.size": "[102, 102, 16]", **SMALL}
BUILDING = {"map.kind": '"building"', "map.size": "[40, 40, 13]", "spawn.kind": '"entrances"', "agents.count": 4}
RING = {"lidar.preset": '"vlp-16"', "lidar.mount_height_m": 0.2}
GROUND = {"body.kind": '"ground"', "body.step_max_m": 0.2, "body.slope_max_rad": 0.6}

# Keys of the scenario by case; the sim time is bounded by --minutes.
CASES = {
    "office": OFFICE,
    "office, batteries": {
        **OFFICE, "energy.endurance_s": 90.0, "energy.idle_w": 10.0, "energy.hover_w": 190.0,
        "energy.move_j_per_m": 20.0, "energy.charge_w": 400.0,
    },
    "office, depth cameras": {**OFFICE, "lidar.preset": '"depth-camera"'},
    "office, ground, ring LiDAR": {**OFFICE, **GROUND, **RING},
    "octagonal maze": {**OFFICE, "map.scene.name": '"octagon-maze"', "map.size": "[102, 102, 12]"},
    "tunnels": {
        **SCENE, **SMALL, "map.scene.name": '"tunnels"', "map.size": "[256, 181, 21]", "map.cell_m": 0.4,
        "lidar.range_m": 15.0,
    },
    "building": {**BUILDING, "body.kind": '"aerial"'},
    "building, ground, ring LiDAR": {**BUILDING, **GROUND, **RING, "body.step_max_m": 1.0},
}


def controllers(binary: Path) -> list[str]:
    """The names of the built-in controllers."""
    listed = subprocess.run([binary, "agent_node", "--controllers"], capture_output=True, text=True, check=True).stdout
    return [line.split(":")[0] for line in listed.splitlines() if line and not line[0].isspace()]


def measured(binary: Path, case: str, controller: str, seed: int, minutes: float) -> dict:
    """One run."""
    with tempfile.TemporaryDirectory() as folder:
        recording = Path(folder) / "run.mcap"
        keys = {"seed": seed, "duration_s": 60.0 * minutes, "agents.controller": f'"{controller}"', **CASES[case]}
        command = [
            binary, "run", "--transport", "memory", "--together", "--threads=1", "--decision-times",
            f"--record={recording}", *(f"--set={key}={value}" for key, value in keys.items()),
        ]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            return {"case": case, "controller": controller, "error": done.stderr.strip().splitlines()[-1]}
        metrics = subprocess.run(
            [binary, "info", "--cmu-metrics", recording], capture_output=True, text=True, check=True
        ).stdout

    def found(pattern: str, default: str = "") -> str:
        match = re.search(pattern, done.stdout + done.stderr)
        return match.group(1) if match else default

    samples = [tuple(map(float, line.split())) for line in metrics.splitlines() if line[:1].isdigit()]
    team = re.search(r"team\s*[^\d]*([\d.]+) %[^\d]*[\d.]+ %[^\d]*([\d.]+) m", done.stdout)
    minutes_text, seconds, reason = re.search(r"ended after (\d+):([\d.]+) of sim time \(tick \d+\): (.*)", done.stdout).groups()
    return {
        "case": case, "controller": controller, "explored": float(team.group(1)), "distance": float(team.group(2)),
        "attainable": float(found(r"can see ([\d.]+) % of the free", "100")),
        "new": last_rise_s(samples, 0), "moved": last_rise_s(samples, 1), "end": 60 * int(minutes_text) + float(seconds), "reason": reason,
        "slowest": found(r"longest ([\d.]+\S+)"), "empty": int(found(r"ran_empty (\d+)", "0")),
    }


def last_rise_s(samples: list, column: int) -> float:
    """The time of the last sample in which a column has grown; 0 if it never has."""
    pairs = zip(samples, samples[1:])
    return max((after[3] for before, after in pairs if after[column] > before[column] + 1e-6), default=0.0)


def is_bad(run: dict) -> bool:
    """Whether a run does not end by itself, or only long after the last motion."""
    return "error" in run or run["controller"] not in WALKS and (
        run["reason"] == "duration" or run["end"] - run["moved"] > 60.0 or run["empty"] > 0
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=Path, default=None, help="folder of the binary maes")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--only", default="", help="only this case, or those with these words in their names")
    parser.add_argument("--controllers", default="", help="only these, separated by commas")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=15.0, help="longest sim time of a run")
    args = parser.parse_args()
    root = Path(__file__).resolve().parent.parent
    folder = args.bin or Path(
        subprocess.run([root / "launch_scripts/build.sh"], capture_output=True, text=True, check=True).stdout.strip()
    )
    binary = folder / "maes"
    names = args.controllers.split(",") if args.controllers else controllers(binary)
    cases = [args.only] if args.only in CASES else [case for case in CASES if args.only in case]
    runs = [(case, name) for case in cases for name in names]
    print("| world | controller | explored, of what can be seen | distance | last new cell | last motion | end | ended | slowest decision |")
    print("|---|---|---|---|---|---|---|---|---|")
    bad = 0
    with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        of_run = lambda run: measured(binary, *run, args.seed, args.minutes)
        for run in pool.map(of_run, runs):
            bad += is_bad(run)
            mark = "*" if is_bad(run) else ""
            if "error" in run:
                print(f"| {run['case']} | `{run['controller']}` | {mark}{run['error']} |", flush=True)
                continue
            empty = f", ran empty {run['empty']} times" if run["empty"] else ""
            print(
                f"| {run['case']} | `{run['controller']}` | {run['explored']:.2f} of {run['attainable']:.2f} % "
                f"| {run['distance']:.0f} m | {run['new']:.0f} s | {run['moved']:.0f} s | {run['end']:.0f} s "
                f"| {mark}{run['reason']}{empty} | {run['slowest']} |",
                flush=True,
            )
    print(f"\n{len(runs)} runs, {bad} marked")
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
