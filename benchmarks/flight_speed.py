"""Measure how fast whole flights of the twin are, one process each, start included.

    python benchmarks/flight_speed.py --cores 0                    # one core
    python benchmarks/flight_speed.py --cores 0,1 --threads 2
    python benchmarks/flight_speed.py --exact-masks --image-size 320x180
    python benchmarks/flight_speed.py --python OTHER_CHECKOUT/.venv/bin/python   # paired with it
    ONEDNN_MAX_CPU_ISA=AVX2 python benchmarks/flight_speed.py      # networks as without VNNI

With several `--python` each flight is flown by all of them in turn before the next one. The scenes
are val-a and val-b, without film and record. A row holds the medians over the flights of a tree.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

TREES = ("survey_and_land", "explore_and_land_depth", "explore_and_land_segmentation")
SCENES = ("val-a", "val-b")


def main() -> None:
    """Fly in turn and print a row a tree and Python."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--trees", nargs="+", default=TREES)
    parser.add_argument("--flights", type=int, default=1, help="seeds in each scene")
    parser.add_argument("--cores", help="pin flights to these, such as 0 or 0,1")
    parser.add_argument("--python", action="append", help="default: this one")
    given, options = parser.parse_known_args()
    print(f"{processor()}; cores {given.cores or 'all'}; {' '.join(options)}")
    print("| tree | python | times real time | tick p50 | p99, ms | peak MiB | flights |")
    print("|---|---|---|---|---|---|---|", flush=True)
    cores = [int(core) for core in given.cores.split(",")] if given.cores else None
    for tree in given.trees:
        rows: dict[str, list[list[float]]] = {}
        for seed in range(given.flights):
            for scene in SCENES:
                for python in given.python or [sys.executable]:
                    flight = [tree, "--scene", scene, "--seed", str(seed), *options]
                    rows.setdefault(python, []).append(measure(python, flight, cores))
        for python, flown in rows.items():
            factor, p50, p99, mib = map(statistics.median, zip(*flown, strict=True))
            name = python.removesuffix("/.venv/bin/python")
            print(
                f"| {tree} | {name} | {factor:.2f} | {p50:.1f} | {p99:.1f} | "
                f"{mib:.0f} | {len(flown)} |",
                flush=True,
            )


def measure(python: str, flight: Sequence[str], cores: list[int] | None) -> list[float]:
    """Fly once.

    Args:
        python: a Python with uav-bt; its checkout is the working folder.
        flight: arguments of `uav-bt fly`.
        cores: cores that the flight may use; None for all.

    Returns:
        Times real time, 50 and 99 % of the ticks in ms, and peak memory in MiB.
    """
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        command = [python, "-m", "uav_bt", "fly", *flight, "--report", str(report)]
        began_s = time.perf_counter()
        child = os.fork()
        if child == 0:
            if cores is not None:
                os.sched_setaffinity(0, cores)
            os.chdir(Path(python).absolute().parents[2])
            silent = os.open(os.devnull, os.O_WRONLY)
            os.dup2(silent, 1)
            os.execv(python, command)  # noqa: S606  (our own command)
        _, status, used = os.wait4(child, 0)
        wall_s = time.perf_counter() - began_s
        if not report.exists():
            raise SystemExit(f"{' '.join(command)} ended with {os.waitstatus_to_exitcode(status)}")
        flown = json.loads(report.read_text())
    return [
        flown["duration_s"] / wall_s,
        flown["tick_ms"]["p50"],
        flown["tick_ms"]["p99"],
        used.ru_maxrss / 1024,
    ]


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
