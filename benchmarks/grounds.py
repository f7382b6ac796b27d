r"""Write scenes of the paper's lab on grounds of several sizes, with random objects.

    python -m benchmarks.grounds --out runs/grounds
    uav-bt campaign survey_and_land --scenes "runs/grounds/*.yaml" --exact-masks \
        --image-size 320x180 --time-limit 900 --out runs/grounds-flights

Each scene has at most one object per 2 square metres of ground, and the gaps between objects let
the drone pass.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Final

import numpy as np

from sim_bridge.twin.layout import GroundSpec, layout_problem
from sim_bridge.twin.objects import BoxSpec, Helipad
from sim_bridge.twin.scene_file import load_scene

GROUNDS: Final = ((4, 5), (4, 8), (6, 12), (8, 16), (8, 32), (10, 24), (12, 40))
"""Side of the square ground in metres, and number of objects."""

APART_M: Final = 1.05  # between the centres of two objects
FROM_PAD_M: Final = 0.95
FROM_EDGE_M: Final = 0.4
TRIES: Final = 100_000
PATTERNS: Final = 8


def random_boxes(
    side_m: float, count: int, pad: Helipad, rng: np.random.Generator
) -> list[BoxSpec]:
    """Return boxes at random places of a square ground.

    Args:
        side_m: Side of the ground.
        count: Number of boxes.
        pad: The landing mark, which stays free.
        rng: Source of the random numbers.
    """
    ground = GroundSpec(size_m=(side_m, side_m))
    boxes: list[BoxSpec] = []
    for _ in range(TRIES):
        if len(boxes) == count:
            return boxes
        half_m = side_m / 2 - FROM_EDGE_M
        x_m, y_m = rng.uniform(-half_m, half_m, 2).round(2).tolist()
        length_m, width_m = rng.uniform(0.3, 0.5, 2).round(2).tolist()
        box = BoxSpec(
            pattern=len(boxes) % PATTERNS + 1,
            position_m=(x_m, y_m),
            yaw_deg=float(rng.integers(-45, 45)),
            size_m=(length_m, width_m, round(float(rng.uniform(0.6, 2.2)), 2)),
        )
        near = any(math.dist(box.position_m, other.position_m) < APART_M for other in boxes)
        if near or math.dist(box.position_m, pad.position_m) < FROM_PAD_M:
            continue
        if layout_problem(pad, [*boxes, box], ground) is None:
            boxes.append(box)
    raise SystemExit(f"{count} objects have no room on {side_m:g} x {side_m:g} m")


def scene_text(name: str, side_m: float, boxes: list[BoxSpec], pad: Helipad) -> str:
    """Return the scene file."""
    lines = [
        f"name: {name}",
        f"ground: {{size_m: [{side_m:g}, {side_m:g}]}}",
        f"helipad: {{position_m: {list(pad.position_m)}, yaw_deg: 0, size_m: {list(pad.size_m)}}}",
        "boxes:",
        *(
            f"  - {{pattern: {box.pattern}, position_m: {list(box.position_m)}, "
            f"yaw_deg: {box.yaw_deg:g}, size_m: {list(box.size_m)}}}"
            for box in boxes
        ),
        "lighting: {ambient: 0.40, direction: [0.5, 0.3, -1.0], shadows: false}",
        "take_off: {from: helipad, yaw_deg: 45}",
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Write a scene for each ground."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    for number, (side_m, count) in enumerate(GROUNDS):
        rng = np.random.default_rng((given.seed, number))
        corner_m = round(-side_m / 2 + 0.8, 2)
        pad = Helipad(position_m=(corner_m, corner_m), yaw_deg=0.0, size_m=(0.5, 0.5, 0.4))
        boxes = random_boxes(side_m, count, pad, rng)
        name = f"ground-{side_m}m-{count}"
        path = given.out / f"{name}.yaml"
        path.write_text(scene_text(name, side_m, boxes, pad), encoding="utf-8")
        scene = load_scene(str(path))
        print(f"{path}: {scene.ground.size_m[0]:g} x {scene.ground.size_m[1]:g} m, {count} objects")


if __name__ == "__main__":
    main()
