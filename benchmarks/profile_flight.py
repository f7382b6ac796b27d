"""Profile a flight of the twin by sampling, and show where its wall time goes.

    pip install py-spy
    taskset -c 0 python benchmarks/profile_flight.py survey_and_land --scene val-a --seed 3
    ONEDNN_MAX_CPU_ISA=AVX2 python benchmarks/profile_flight.py TREE     # as without VNNI

py-spy reads the stacks of the flight's process 200 times a second, from outside. A sample belongs
to the innermost function of this repository in its stack: a call of NumPy or OpenCV counts for the
module that makes it. The tables show the mission's thread. py-spy slows a flight by about a third,
so the milliseconds compare parts of one flight; `uav-bt fly` reports stages without it.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path

RATE_HZ = 200
RUNNER = "uav_bt/mission/runner.py"
OURS = ("uav_bt/", "behaviours/", "perception/", "sim_bridge/")
Sample = tuple[list[str], int]  # functions as `name (file:line)`, outermost first; how often seen


def main() -> None:
    """Fly, and print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--functions", type=int, default=25, help="how many functions are listed")
    given, flight = parser.parse_known_args()
    with tempfile.TemporaryDirectory() as folder:
        report, samples = Path(folder) / "report.json", Path(folder) / "samples.txt"
        spy = ["py-spy", "record", "--rate", str(RATE_HZ), "--format", "raw", "--output"]
        fly = [sys.executable, "-m", "uav_bt", "fly", *flight, "--report", str(report)]
        done = subprocess.run(  # noqa: S603  (our own command)
            [*spy, str(samples), "--", *fly], capture_output=True, text=True, check=False
        )
        if not report.exists():
            raise SystemExit(done.stderr or done.stdout)
        ticks = json.loads(report.read_text())["ticks"]
        taken = [read(line) for line in samples.read_text().splitlines()]
    flown = [sample for sample in taken if any(RUNNER in place for place in sample[0])]
    beside = sum(count for _, count in taken) - sum(count for _, count in flown)
    print(
        f"{processor()}, {len(os.sched_getaffinity(0))} core(s); {ticks} ticks, {' '.join(flight)}"
    )
    print(f"start, end and other threads: {beside / RATE_HZ:.1f} s; a tick, start to start:\n")
    print_table("room", flown, ticks, lambda place: place.split(" (")[1].rpartition("/")[0], 40)
    print_table(
        "function", flown, ticks, lambda place: place.rpartition(":")[0] + ")", given.functions
    )


def read(line: str) -> Sample:
    """Return a line of py-spy's raw format."""
    stack, _, count = line.rpartition(" ")
    return stack.split(";"), int(count)


def print_table(
    title: str, samples: list[Sample], ticks: int, name: Callable[[str], str], longest: int
) -> None:
    """Print the milliseconds of each tick by the name of the innermost function of ours."""
    found: Counter[str] = Counter()
    for stack, count in samples:
        ours = next(place for place in reversed(stack) if place.partition(" (")[2].startswith(OURS))
        found[name(ours)] += count
    total = sum(found.values())
    print(f"| {title} | ms | share |\n|---|---|---|")
    for what, count in found.most_common(longest):
        print(f"| {what} | {1e3 * count / RATE_HZ / ticks:.2f} | {count / total:.1%} |")
    print(f"| all | {1e3 * total / RATE_HZ / ticks:.2f} | |\n")


def processor() -> str:
    """Return the processor's name, and whether it has VNNI."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    facts = dict(line.split(":", 1) for line in lines if ":" in line)
    facts = {name.strip(): value.strip() for name, value in facts.items()}
    has = "with" if "vnni" in facts.get("flags", "") else "without"
    limit = os.environ.get("ONEDNN_MAX_CPU_ISA")
    return f"{facts.get('model name', platform.machine())} {has} VNNI" + (
        f", networks limited to {limit}" if limit else ""
    )


if __name__ == "__main__":
    main()
