r"""How the approach fares where it is hard: boxes within a metre of the helipad.

    python benchmarks/narrow_labs.py --labs 12 --workers 2
    python benchmarks/narrow_labs.py --tree explore_and_land_student --beside 1 --from 100

Labs, take-offs and seeds are drawn from the lab's number; masks are exact and images small, so
that what is measured is the flying.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

from uav_bt import app
from uav_bt.errors import UavBtError

_BOXES = 8
_HEIGHTS_M = (0.8, 1.0, 1.6, 1.7, 1.9, 2.1, 2.2)
_NEAREST_M, _NEAR_M, _APART_M = 0.75, 1.05, 0.95  # between centres


def lab(number: int, beside: int = 3) -> dict[str, object]:
    """Return a scene with some boxes beside the pad and the others elsewhere."""
    rng = np.random.default_rng(number)
    while True:
        pad = np.round(rng.uniform((-2.0, -1.4), (2.0, 1.4)), 2)
        boxes = _placed(rng, pad, beside)
        if len(boxes) == _BOXES:
            break
    patterns = rng.permutation(_BOXES) + 1
    return {
        "name": f"narrow-{number}",
        "helipad": {"position_m": pad.tolist(), "yaw_deg": 0, "size_m": [0.5, 0.5, 0.4]},
        "boxes": [
            {
                "pattern": int(pattern),
                "position_m": box.tolist(),
                "yaw_deg": float(round(rng.uniform(-45, 45))),
                "size_m": [0.4, 0.37, float(rng.choice(_HEIGHTS_M))],
            }
            for pattern, box in zip(patterns, boxes, strict=True)
        ],
        "lighting": {"ambient": 0.4, "direction": [0.5, 0.3, -1.0], "shadows": False},
        "take_off": {"from": "random"},
    }


def _placed(
    rng: np.random.Generator, pad: NDArray[np.float64], beside: int
) -> list[NDArray[np.float64]]:
    """Place boxes one by one; fewer than wanted if there was no room."""
    boxes: list[NDArray[np.float64]] = []
    for _ in range(200 * _BOXES):
        if len(boxes) == _BOXES:
            break
        place = rng.uniform((-2.2, -1.7), (2.2, 1.7))
        if len(boxes) < beside:
            angle = rng.uniform(0.0, 2.0 * math.pi)
            away = np.array([math.cos(angle), math.sin(angle)])
            place = pad + rng.uniform(_NEAREST_M, _NEAR_M) * away
        within = (np.abs(place) <= (2.2, 1.7)).all()
        clear = np.linalg.norm(place - pad) >= _NEAREST_M
        if within and clear and all(np.linalg.norm(place - box) > _APART_M for box in boxes):
            boxes.append(np.round(place, 2))
    return boxes


def _fly(tree: str, beside: int, number: int) -> tuple[int, str, float | None, float | None]:
    """Fly one lab; the number, the outcome, the time to land and the least clearance."""
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / f"narrow-{number}.yaml"
        scene.write_text(yaml.safe_dump(lab(number, beside)), encoding="utf-8")
        options = app.FlightOptions(
            scene=str(scene), seed=number, exact_masks=True, image_size_px=(320, 180)
        )
        report = app.fly(tree, options)
    return number, report.outcome, report.time_to_land_s, report.min_clearance_m


def main() -> int:
    """Fly all labs and print each and the sum."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tree", default="explore_and_land_segmentation")
    parser.add_argument("--labs", type=int, default=12)
    parser.add_argument("--from", type=int, default=0, dest="first", help="number of the first lab")
    parser.add_argument("--beside", type=int, default=3, help="boxes within a metre of the pad")
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    numbers = range(arguments.first, arguments.first + arguments.labs)
    fly = partial(_fly, arguments.tree, arguments.beside)
    flights = []
    with ProcessPoolExecutor(arguments.workers, mp_context=get_context("spawn")) as pool:
        for flight in pool.map(fly, numbers):
            flights.append(flight)
            number, outcome, land_s, clearance_m = flight
            landed = "" if land_s is None else f"  {land_s:5.1f} s to land"
            print(
                f"lab {number:3d}  {outcome:10s}{landed}  clearance {clearance_m:.2f} m", flush=True
            )
    times = [land_s for _, outcome, land_s, _ in flights if outcome == "success" and land_s]
    successes = sum(outcome == "success" for _, outcome, _, _ in flights)
    print(f"{successes} of {len(flights)} landed, {np.median(times):.1f} s from sight (median)")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except UavBtError as error:
        sys.exit(f"{error}")
