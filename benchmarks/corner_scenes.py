"""Write scenes whose landing mark lies in a corner behind boxes that leave one entrance of 0.6 m.

    python -m benchmarks.corner_scenes --out runs/corners
    uav-bt campaign land_only survey_and_land --scenes "runs/corners/*.yaml" --flights 1 \
        --drone plain --profile harsh --out runs/corner-flights

The entrance is narrower than the passages that routes use elsewhere.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

HALF_M: Final = 2.5, 2.0  # of the ground's sides
ENTRANCE_M: Final = 0.6
PAD_M: Final = 0.25  # half of the landing box's side
GAP_M: Final = 0.03  # between two boxes of the wall: they must not touch
THICK_M: Final = 0.3  # of the wall's boxes


def corner_scene(seed: int) -> dict[str, Any]:
    """Return a scene: an L of boxes around the mark in one of the corners, and a box elsewhere."""
    rng = np.random.default_rng(seed)
    side = rng.choice([-1.0, 1.0], size=2)  # of the corner
    pad = rng.uniform(0.65, 0.8, size=2)  # distances of the mark's middle from the two edges
    wall = pad + rng.uniform(0.75, 0.95, size=2)  # of the two arms of the L, to their middles
    arm = int(rng.integers(2))  # the one with the entrance
    boxes = []
    for which in (0, 1):
        along, half = 1 - which, THICK_M / 2  # one arm has the L's outer corner
        length = wall[along] - half - GAP_M if which else wall[along] + half
        ends = [(0.1, length)]
        if which == arm:
            least = 0.15 + ENTRANCE_M / 2
            most = wall[along] - THICK_M / 2 - 0.15 - ENTRANCE_M / 2
            middle = rng.uniform(max(least, pad[along] - 0.3), min(most, pad[along] + 0.3))
            door = middle - ENTRANCE_M / 2, middle + ENTRANCE_M / 2
            ends = [(0.1, door[0]), (door[1], length)]
        for begin, end in ends:
            count = max(1, math.ceil((end - begin) / 0.6))
            size = (end - begin - (count - 1) * GAP_M) / count
            for number in range(count):
                middle = begin + number * (size + GAP_M) + size / 2
                at, size_m = np.array([[wall[which], middle], [THICK_M, size]])[:, [which, along]]
                if size > 0.05:
                    boxes.append(_box(rng, side * (np.array(HALF_M) - at), size_m))
    boxes.append(_box(rng, -side * rng.uniform(1.2, 1.5, size=2), np.array([0.4, 0.4])))
    start = -side * (0.6, -0.9) + rng.uniform(-0.15, 0.15, size=2)
    pad_m = side * (np.array(HALF_M) - pad)
    return {
        "name": f"corner-{seed}",
        "helipad": {"position_m": _rounded(pad_m), "yaw_deg": 0, "size_m": [0.5, 0.5, 0.4]},
        "boxes": boxes,
        "take_off": {"from": _rounded(start), "yaw_deg": int(rng.integers(-180, 180))},
    }


def _box(
    rng: np.random.Generator, at_m: np.ndarray[Any, Any], size_m: np.ndarray[Any, Any]
) -> dict[str, Any]:
    height_m = float(rng.uniform(1.0, 2.2))
    return {
        "pattern": int(rng.integers(1, 9)),
        "position_m": _rounded(at_m),
        "size_m": [*_rounded(size_m), round(height_m, 2)],
    }


def _rounded(values: np.ndarray[Any, Any]) -> list[float]:
    return [round(float(value), 3) for value in values]


def main() -> None:
    """Write the scenes of the seeds from 0."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--count", type=int, default=20)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    for seed in range(options.count):
        text = yaml.safe_dump(corner_scene(seed), sort_keys=False, default_flow_style=None)
        (options.out / f"corner-{seed:02d}.yaml").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
