#!/usr/bin/env python3
"""Measures how the cost of a tick grows with agents, cells and rays, and draws it on logarithmic axes.

    launch_scripts/scaling.py [--bin DIR] [--rounds N] [--out FILE.svg]

Each point is the median over the rounds of the processor time of runs in memory on one thread (dsvp,
cave of spheres, 60 s of sim time, which are 3000 ticks; 10 agents, 100^3 cells and 5124 rays unless
varied), less that of a run of one tick, which is the start. Prints the figures as a Markdown table
and writes the plot. Needs Python 3 alone.
"""

import argparse
import math
import resource
import statistics
import subprocess
import sys
from pathlib import Path

TICKS = 3000
USUAL = {"agents": 10, "size": 100, "rays": 5124}
VARIED = {
    "agents": [2, 5, 10, 20, 50, 100],
    "size": [50, 75, 100, 150, 200],
    "rays": [320, 1281, 5124, 20496],
}
LABEL = {"agents": "agents", "size": "cells", "rays": "rays of a scan"}
COLOUR = {"agents": "#4269d0", "size": "#e07b39", "rays": "#3c9d5b"}


def processor_seconds(maes: Path, parameters: dict, ticks: int) -> float:
    """One run."""
    command = [
        maes, "run", "--transport", "memory", "--together", "--threads=1", "--controller=dsvp", "--seed=1",
        f"--agents={parameters['agents']}", f"--size={parameters['size']}", f"--duration={ticks / 50}",
        "--set", f"lidar.rays={parameters['rays']}", "--set", "stop_when_explored=false",
    ]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        sys.exit(f"error: {' '.join(map(str, command))}: {done.stderr.strip()}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def microseconds_per_tick(maes: Path, parameters: dict) -> float:
    """Processor time for each tick after the first."""
    return (processor_seconds(maes, parameters, TICKS) - processor_seconds(maes, parameters, 1)) / (TICKS - 1) * 1e6


def units(name: str, value: int) -> int:
    """What the axis counts."""
    return value**3 if name == "size" else value


def plot(figures: dict) -> str:
    """The picture: cost relative to the usual run over the relative change of each quantity."""
    width, height, margin = 640, 420, 60
    points = {
        name: [(units(name, value) / units(name, USUAL[name]), cost / of[USUAL[name]]) for value, cost in of.items()]
        for name, of in figures.items()
    }
    xs, ys = ([math.log10(point[axis]) for line in points.values() for point in line] for axis in (0, 1))
    low = [math.floor(min(xs)), math.floor(min(ys))]
    high = [math.ceil(max(xs)), math.ceil(max(ys))]

    def at(value: float, axis: int) -> float:
        share = (math.log10(value) - low[axis]) / (high[axis] - low[axis])
        return margin + share * (width - 2 * margin) if axis == 0 else height - margin - share * (height - 2 * margin)

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="13">',
        f'<rect width="{width}" height="{height}" fill="white"/>',
    ]
    for axis in (0, 1):
        for power in range(low[axis], high[axis] + 1):
            place, text = at(10.0**power, axis), f"{10.0**power:g}"
            if axis == 0:
                line = f'x1="{place:.1f}" y1="{margin}" x2="{place:.1f}" y2="{height - margin}"'
                label = f'x="{place:.1f}" y="{height - margin + 18}" text-anchor="middle"'
            else:
                line = f'x1="{margin}" y1="{place:.1f}" x2="{width - margin}" y2="{place:.1f}"'
                label = f'x="{margin - 8}" y="{place + 4:.1f}" text-anchor="end"'
            parts += [f'<line {line} stroke="#ddd"/>', f"<text {label}>{text}</text>"]
    for number, (name, line) in enumerate(points.items()):
        path = " ".join(f"{at(x, 0):.1f},{at(y, 1):.1f}" for x, y in line)
        parts.append(f'<polyline points="{path}" fill="none" stroke="{COLOUR[name]}" stroke-width="2"/>')
        parts += [f'<circle cx="{at(x, 0):.1f}" cy="{at(y, 1):.1f}" r="3.5" fill="{COLOUR[name]}"/>' for x, y in line]
        parts.append(f'<text x="{margin + 12}" y="{margin + 18 + 18 * number}" fill="{COLOUR[name]}">{LABEL[name]}</text>')
    usual = f"{USUAL['agents']} agents, {USUAL['size']}^3 cells, {USUAL['rays']} rays"
    parts += [
        f'<text x="{width / 2}" y="{height - 14}" text-anchor="middle">how many times as many as in: {usual}</text>',
        f'<text transform="translate(16 {height / 2}) rotate(-90)" text-anchor="middle">relative processor time of a tick</text>',
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def main() -> None:
    root = Path(__file__).resolve().parent.parent
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=Path, default=root / "target" / "release", help="the folder with maes")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--out", type=Path, default=root / "docs" / "images" / "scaling.svg")
    arguments = parser.parse_args()
    samples: dict = {name: {value: [] for value in values} for name, values in VARIED.items()}
    for _ in range(arguments.rounds):
        for name, of in samples.items():
            for value, costs in of.items():
                costs.append(microseconds_per_tick(arguments.bin / "maes", USUAL | {name: value}))
    figures = {name: {value: statistics.median(costs) for value, costs in of.items()} for name, of in samples.items()}
    print("| varied | | us of processor time for each tick |\n|---|---|---|")
    for name, of in figures.items():
        for value, cost in of.items():
            print(f"| {LABEL[name]} | {f'{value}^3' if name == 'size' else value} | {cost:.1f} |")
    arguments.out.write_text(plot(figures))


if __name__ == "__main__":
    main()
