"""Fly a mission many times and say how it went: outcomes with 95 % intervals, distances, times.

    python benchmarks/flights.py explore_and_land_segmentation --scenes test-a test-b --flights 50

Finished flights are kept at once, one JSON object a line, in the `--out` file; a run that was
stopped goes on where it was. Each flight has one inference thread, so that results do not depend on
`--workers`.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np

from uav_bt import app


def wilson(successes: int, trials: int, z: float = 1.96) -> tuple[float, float]:
    """Return the 95 % Wilson score interval of a proportion."""
    share = successes / trials
    middle = (share + z * z / (2 * trials)) / (1 + z * z / trials)
    half = (
        z
        / (1 + z * z / trials)
        * math.sqrt(share * (1 - share) / trials + z * z / (4 * trials * trials))
    )
    return middle - half, middle + half


def fly_one(tree: str, scene: str, seed: int, options: dict[str, Any]) -> dict[str, Any]:
    """Fly once in this process and return the report with the wall time."""
    began = time.perf_counter()
    try:
        report = app.fly(tree, app.FlightOptions(scene=scene, seed=seed, **options)).to_json()
    except app.NodeFailedError as error:
        report = {"scene": scene, "seed": seed, "outcome": "error", "reason": str(error)}
    report["wall_s"] = round(time.perf_counter() - began, 3)
    return report


def summarise(flights: list[dict[str, Any]]) -> None:
    """Print the table of a set of flights."""
    outcomes: dict[str, int] = {}
    for flight in flights:
        outcomes[flight["outcome"]] = outcomes.get(flight["outcome"], 0) + 1
    good = outcomes.get("success", 0)
    low, high = wilson(good, len(flights))
    print(
        f"\n{len(flights)} flights: success {100 * good / len(flights):.1f} % "
        f"(95 % Wilson {100 * low:.1f} to {100 * high:.1f} %), {outcomes}"
    )
    names = (
        "explore_distance_m",
        "search_distance_m",
        "time_to_find_helipad_s",
        "time_to_land_s",
        "landing_error_m",
        "min_clearance_m",
        "total_distance_m",
        "duration_s",
    )
    print(f"{'':26s} {'n':>4s} {'mean':>8s} {'median':>8s} {'p5':>8s} {'p95':>8s} {'max':>8s}")
    for name in names:
        values = np.array([f[name] for f in flights if f.get(name) is not None])
        if values.size:
            p5, p50, p95 = np.percentile(values, [5, 50, 95])
            print(
                f"{name:26s} {values.size:4d} {values.mean():8.2f} {p50:8.2f} {p5:8.2f} "
                f"{p95:8.2f} {values.max():8.2f}"
            )
    speeds = [f["duration_s"] / f["wall_s"] for f in flights if f.get("duration_s")]
    if speeds:
        print(f"speed: median {np.median(speeds):.1f} times real time, one process")
    for flight in flights:
        if flight["outcome"] != "success":
            print(
                f"  {flight['scene']} seed {flight['seed']}: {flight['outcome']}, "
                f"{flight['reason']} (after {flight.get('duration_s')} s)"
            )


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tree")
    parser.add_argument("--scenes", nargs="+", default=["val-a", "val-b"])
    parser.add_argument("--flights", type=int, default=10, help="seeds per scene")
    parser.add_argument("--seed-from", type=int, default=0)
    parser.add_argument("--profile", default="lab")
    parser.add_argument("--exact-masks", action="store_true")
    parser.add_argument("--width", type=int, default=640, help="of the 16:9 video, pixels")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("runs/flights.jsonl"))
    args = parser.parse_args()

    args.out.parent.mkdir(parents=True, exist_ok=True)
    options = {
        "profile": args.profile,
        "exact_masks": args.exact_masks,
        "image_size_px": (args.width, args.width * 9 // 16),
    }
    done = (
        [json.loads(line) for line in args.out.read_text().splitlines()]
        if args.out.exists()
        else []
    )
    wanted = [
        (scene, seed)
        for seed in range(args.seed_from, args.seed_from + args.flights)
        for scene in args.scenes
    ]
    have = {(flight["scene"], flight["seed"]) for flight in done}
    flights = [flight for flight in done if (flight["scene"], flight["seed"]) in set(wanted)]
    print(
        f"{platform.processor() or platform.machine()}, {time.strftime('%Y-%m-%d')}, "
        f"{args.workers} workers; {len(flights)} of {len(wanted)} flights were already flown"
    )
    with ProcessPoolExecutor(args.workers) as pool, args.out.open("a") as out:
        jobs = [
            pool.submit(fly_one, args.tree, scene, seed, options)
            for scene, seed in wanted
            if (scene, seed) not in have
        ]
        for job in as_completed(jobs):
            flight = job.result()
            out.write(json.dumps(flight) + "\n")
            out.flush()
            flights.append(flight)
            print(
                f"{len(flights):4d}/{len(wanted)} {flight['scene']} {flight['seed']}: "
                f"{flight['outcome']}",
                file=sys.stderr,
            )
    summarise(sorted(flights, key=lambda f: (f["scene"], f["seed"])))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
