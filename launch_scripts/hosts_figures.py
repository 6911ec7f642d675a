#!/usr/bin/env python3
"""Measures runs over hosts, which are network namespaces with an emulated link, and checks a model.

    sudo launch_scripts/hosts_figures.py [--bin DIR] [--rounds N] [--only WORD]

Prints Markdown tables:
  delay   ticks/s asked at every tick against the delay of the link, and the model
  link    10 dsvp agents, half an hour, 1 ms each way, 1 % loss: x real time, and the digest in memory
  model   the cost of a tick, fitted to agents and processes, and checked at three other points
Each figure is the best of the rounds, which other work on the machine disturbs least. Needs root,
iproute2, /dev/net/tun and Python 3; the folder of --bin (default: target/release) has maes, sim_server, agent_node and link_emulator:
cargo build --release --bins. Nothing else should run.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

TICKS = 500
WALL = re.compile(r"wall time ([0-9.]+) s, ([0-9.]+) x real time")


def run(bin_dir: Path, hosts: int, link: list, flags: list, domain: int = 70) -> tuple:
    """One run with the server on the first host and the agents on the others: seconds, x, digest."""
    with tempfile.TemporaryDirectory() as folder:
        script = f"""
printf 'server = "%s"\\n' "$ADDRESS_0" >{folder}/hosts.toml
for ((n = 1; n < {hosts}; n++)); do
    name=HOST_$n
    printf '[[host]]\\nname = "h%d"\\ncommand = ["ip", "netns", "exec", "%s"]\\n' "$n" "${{!name}}" >>{folder}/hosts.toml
done
exec ip netns exec "$HOST_0" "$@" --hosts {folder}/hosts.toml --logs {folder}/logs"""
        command = [
            bin_dir / "link_emulator", "--hosts", hosts, *link, "--", "bash", "-c", script, "-",
            bin_dir / "maes", "run", *flags,
        ]
        done = subprocess.run(
            list(map(str, command)), capture_output=True, text=True, check=False,
            env={**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"},
        )
    return figures(done, command)


def in_memory(bin_dir: Path, flags: list) -> tuple:
    """The same run in memory."""
    command = [bin_dir / "maes", "run", "--transport", "memory", *flags]
    return figures(subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False), command)


def figures(done, command: list) -> tuple:
    """Wall seconds, x real time and digest of a run."""
    found = WALL.search(done.stdout)
    if done.returncode or not found:
        sys.exit(f"error: {' '.join(map(str, command))}: {done.stderr.strip()}")
    return float(found[1]), float(found[2]), done.stdout.split()[-1]


def every_tick(agents: int, per_process: int, ticks: int = TICKS) -> list:
    """Flags of a run whose agents are asked at every tick."""
    return [
        "--controller", "rbw", "--agents", agents, "--size", 50, "--seed", 1, "--duration", ticks / 50,
        "--look-ahead", "false", "--agents-per-process", per_process, "--set", "stop_when_explored=false",
    ]


def tick_ms(args, hosts: int, agents: int, per_process: int, delay_ms: float, ticks: int = TICKS) -> float:
    """Wall time of a tick in which all are asked, without the start of the run."""
    link = ["--delay-ms", delay_ms]
    flags = every_tick(agents, per_process, ticks)
    return min(run(args.bin, hosts, link, flags)[0] for _ in range(args.rounds)) / ticks * 1e3


def table(head: list, rows: list) -> None:
    """A Markdown table."""
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    for row in rows:
        print("| " + " | ".join(row) + " |")
    print(flush=True)


def delays(args) -> None:
    """Ticks/s against delay; the model takes the tick without delay, and two delays."""
    rows, base = [], None
    for delay in [0, 0.2, 1, 5]:
        asked = tick_ms(args, 2, 10, 5, delay)
        base = asked if base is None else base
        flags = ["--controller", "rbw", "--agents", 10, "--size", 50, "--seed", 1, "--duration", 120,
                 "--agents-per-process", 5, "--set", "stop_when_explored=false"]
        ahead = max(run(args.bin, 2, ["--delay-ms", delay], flags)[1] for _ in range(args.rounds))
        rows.append([f"{delay} ms", f"{1e3 / asked:.0f}", f"{1e3 / (base + 2 * delay):.0f}", f"{50 * ahead:.0f}"])
    table(["delay each way", "ticks/s, all asked at every tick", "model", "ticks/s with look-ahead"], rows)


def half_an_hour(args) -> None:
    """The bar: 30 x real time, with the digest of the run in memory."""
    flags = ["--controller", "dsvp", "--agents", 10, "--size", 100, "--seed", 1, "--duration", 1800,
             "--set", "stop_when_explored=false"]
    link = ["--delay-ms", 1, "--loss", 0.01]
    expected = in_memory(args.bin, flags)
    rows = []
    for _ in range(args.rounds):
        seconds, times, digest = run(args.bin, 2, link, flags)
        same = "same" if digest == expected[2] else "ANOTHER"
        rows.append([f"{seconds:.1f} s", f"{times:.0f}", same, f"{expected[1]:.0f}"])
    table(["wall time", "x real time", "digest", "x real time in memory"], rows)


def model(args) -> None:
    """
    The tick costs a + b * processes + c * agents + d * agents^2, as each observation lists all contacts:
    fitted at four points, checked at three others.
    """
    ten, twenty, forty = (tick_ms(args, 2, agents, agents, 0) for agents in (10, 20, 40))
    per_process = (tick_ms(args, 2, 10, 1, 0) - ten) / 9
    # Through three points: the slopes from 10 to 20 and from 20 to 40 are c + 30 d and c + 60 d.
    slopes = (twenty - ten) / 10, (forty - twenty) / 20
    per_square = (slopes[1] - slopes[0]) / 30
    per_agent = slopes[0] - 30 * per_square
    fixed = ten - 10 * per_agent - 100 * per_square - per_process
    print(f"a tick costs {fixed:.3f} ms, {per_process:.3f} ms a process, {per_agent:.4f} ms an agent"
          f" and {per_square:.5f} ms the square of the agents\n")
    rows = []
    for hosts, agents, per, delay in [(2, 20, 2, 0), (3, 40, 4, 1), (5, 100, 10, 0.2)]:
        measured = tick_ms(args, hosts, agents, per, delay)
        asked = fixed + per_process * agents / per + per_agent * agents + per_square * agents**2
        expected = asked + 2 * delay
        rows.append([str(hosts - 1), str(agents), str(agents // per), f"{delay} ms", f"{measured:.2f}", f"{expected:.2f}"])
    table(["hosts", "agents", "processes", "delay", "ms a tick", "model"], rows)


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    root = Path(__file__).resolve().parent.parent
    parser.add_argument("--bin", type=Path, default=root / "target/release")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", choices=["delay", "link", "model"])
    args = parser.parse_args()
    for name, measure in {"delay": delays, "link": half_an_hour, "model": model}.items():
        if args.only in (None, name):
            measure(args)


if __name__ == "__main__":
    main()
