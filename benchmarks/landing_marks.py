"""Measure landing marks: errors in views by distance and tilt, and scenes to land in.

    python -m benchmarks.landing_marks views --marks apriltag-0,board-0 --views 12
    python -m benchmarks.landing_marks scenes --out runs/marks
    uav-bt campaign land_only --scenes "runs/marks/*.yaml" --flights 1 --exact-masks --out runs/land
    python -m benchmarks.landing_marks corners --scenes 20 --out runs/corners
    uav-bt campaign land_only survey_and_land --scenes "runs/corners/*.yaml" --flights 1 \
        --drone plain --profile harsh --out runs/corner-flights

A mark's name is its kind and its height in metres. `views` renders it through the twin's camera,
with its noise. A scene has one mark, and a random take-off place 2 m and more from it. In `corners`
the mark lies in a corner behind boxes whose entrance is narrower than passages of routes elsewhere.
"""

from __future__ import annotations

import argparse
import itertools
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

from benchmarks.lab_views import frame_of
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import Helipad
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import Scene, TakeOffSpec
from sim_bridge.twin.scene_file import scene_text
from sim_bridge.twin.views import render_views
from uav_bt.landing_marks import MarkView
from uav_bt.plugins import make_mark_finder

CENTRE_M: Final = (1.2, 0.3)  # of the mark in the scene's drawing
YAW_DEG: Final = 25.0
RANGES_M: Final = (0.7, 1.5, 2.0, 3.0, 4.0, 5.0)
DEPRESSIONS_DEG: Final = (90, 60, 45, 30, 20, 15)
_CORNERS: Final = ((-0.12, 0.12), (0.12, 0.12), (-0.12, -0.12), (0.12, -0.12))
_TAGS: Final = [{"id": n, "size_m": 0.19, "at_m": list(at)} for n, at in enumerate(_CORNERS)]
OPTIONS: Final[Mapping[str, tuple[str, dict[str, Any]]]] = {
    "helipad": ("helipad", {}),
    "region": ("region", {}),
    "apriltag": ("apriltag", {"id": 7, "size_m": 0.38}),
    "aruco": ("aruco", {"id": 7, "size_m": 0.36}),
    "board": ("apriltag", {"tags": _TAGS}),
}
MARKS: Final = (
    "helipad-0,helipad-0.2,helipad-0.4,helipad-0.6,apriltag-0,apriltag-0.4,aruco-0.2,board-0,"
    "region-0,region-0.6"
)

HALF_M: Final = 2.5, 2.0  # of the ground's sides, around corners
ENTRANCE_M: Final = 0.6
PAD_M: Final = 0.25  # half of the landing box's side
GAP_M: Final = 0.03  # between two boxes of the wall: they must not touch
THICK_M: Final = 0.3  # of the wall's boxes


def scene_of(name: str) -> Scene:
    """Return a scene with a mark such as `apriltag-0.4`: kind and height in metres."""
    kind, _, height = name.partition("-")
    registered, options = OPTIONS[kind]
    size_m = (0.5, 0.5, float(height or 0.0))
    pad = Helipad(
        position_m=CENTRE_M, yaw_deg=YAW_DEG, size_m=size_m, kind=registered, options=options
    )
    return Scene(name="mark", helipad=pad)


def errors_in_views(
    scene: Scene, range_m: float, below_deg: float, count: int
) -> list[tuple[float, float]]:
    """Return the errors of the place (m) and of the heading (deg) in views from random directions.

    The line of sight has a length, and a depression: 90 degrees from straight above.
    """
    rng = np.random.default_rng([round(10 * range_m), round(below_deg)])
    level_m = range_m * math.cos(math.radians(below_deg))
    poses = [
        CameraPose(
            x_m=CENTRE_M[0] - level_m * math.cos(turn),
            y_m=CENTRE_M[1] - level_m * math.sin(turn),
            z_m=scene.mark.height_m + range_m * math.sin(math.radians(below_deg)),
            yaw_rad=turn + rng.normal(0.0, math.radians(3.0)),  # not in the image's middle
            pitch_rad=math.radians(max(-90.0, -below_deg + rng.normal(0.0, 2.0))),
        )
        for turn in rng.uniform(-math.pi, math.pi, count)
    ]
    finder, camera, errors = make_mark_finder(scene.mark), anafi_camera(640, 360), []
    for view in render_views(scene, poses, profile=Profile(), vary_light=True):
        pose = view.pose
        if (seen := finder.find(MarkView(frame=frame_of(view), camera=camera))) is not None:
            east_m, north_m = CENTRE_M[0] - pose.x_m, CENTRE_M[1] - pose.y_m
            cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
            true_m = (cos * east_m + sin * north_m, sin * east_m - cos * north_m)
            found_m = (seen.forward_m - camera.forward_offset_m, seen.right_m)
            heading_deg = YAW_DEG + 90.0 - math.degrees(pose.yaw_rad)
            turned_deg = math.remainder((seen.heading_deg or 0.0) - heading_deg, 360.0)
            errors.append((math.dist(found_m, true_m), turned_deg))
    return errors


def print_views(name: str, count: int) -> None:
    """Print a table of a mark by distance and depression."""
    print(f"{name}: found; error of the place in cm, mean and 95 %; of the heading in deg, mean")
    for below_deg, range_m in itertools.product(DEPRESSIONS_DEG, RANGES_M):
        found = np.abs(errors_in_views(scene_of(name), range_m, below_deg, count))
        row = f"  {below_deg:3d} deg {range_m:4.1f} m  {len(found):3d} of {count}"
        if len(found):
            place_cm, turned_deg = 100.0 * found[:, 0], found[:, 1]
            row += f"{place_cm.mean():7.1f}{np.percentile(place_cm, 95):7.1f}"
            row += f"{turned_deg.mean():7.1f}"
        print(row, flush=True)


def write_scene(name: str, seed: int, folder: Path) -> None:
    """Write a scene with a mark and a take-off place 2 m and more from it."""
    rng = np.random.default_rng(seed)
    x_m, y_m = CENTRE_M
    while math.dist((x_m, y_m), CENTRE_M) < 2.0:
        x_m, y_m = rng.uniform((-2.2, -1.7), (2.2, 1.7)).tolist()
    take_off = TakeOffSpec(position_m=(x_m, y_m), yaw_deg=float(rng.uniform(-180.0, 180.0)))
    scene = replace(scene_of(name), name=f"{name}-{seed}", take_off=take_off)
    (folder / f"{scene.name}.yaml").write_text(scene_text(scene), encoding="utf-8")


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
    """Print the errors in views, or write scenes."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=("views", "scenes", "corners"))
    parser.add_argument("--marks", default=MARKS)
    parser.add_argument("--views", type=int, default=12, help="for each distance and tilt")
    parser.add_argument("--scenes", type=int, default=4, help="for each mark; corners")
    parser.add_argument("--out", type=Path, default=Path("runs/marks"), help="of the scenes")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    for seed in range(given.scenes if given.what == "corners" else 0):
        text = yaml.safe_dump(corner_scene(seed), sort_keys=False, default_flow_style=None)
        (given.out / f"corner-{seed:02d}.yaml").write_text(text, encoding="utf-8")
    for name in given.marks.split(","):
        if given.what == "views":
            print_views(name, given.views)
        for seed in range(given.scenes if given.what == "scenes" else 0):
            write_scene(name, seed, given.out)


if __name__ == "__main__":
    main()
