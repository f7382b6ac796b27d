"""Fly in rooms and with inputs that perception is not made for.

    python -m benchmarks.rooms.bad_rooms --out runs/bad-rooms
    python -m benchmarks.rooms.bad_rooms --cases mirror "camera x2" --seeds 3 --out runs/bad-rooms

Each case is a lab folder without a network, so the network `any` flies there. The rooms are made of
the depot's own files. Each flight is printed as a line of JSON.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from sim_bridge.anafi import anafi_camera
from uav_bt import app
from uav_bt.board import FRAME, METRIC_DEPTH, ODOMETRY
from uav_bt.lab.lab import LAB_FILE, SCENES_FOLDER
from uav_bt.lab.shipped import load_lab
from uav_bt.mission.tick import TickRecord
from uav_bt.yaml_file import read_yaml, yaml_text

CASES: Final = (
    *("good room", "painted floor", "floor of one colour", "walls like the floor"),
    *("rugs with a dark border", "mirror", "mirror beyond the area", "dim", "dark"),
    *("camera x2", "camera x0.5", "height +0.5 m", "height -0.5 m"),
)
FOCAL: Final = {"camera x2": 2.0, "camera x0.5": 0.5}  # factor of the length in the camera file
FAULTS: Final = {f"height {off} m": (f"height-bias={float(off)}",) for off in ("+0.5", "-0.5")}
SIZE_PX: Final = (320, 180)
CAMERA_FILE: Final = "camera.yaml"
MIRROR_X_M: Final = 0.0  # world x of a mirror that nothing shows
_NEAR_MIRROR_M: Final = 0.8  # no object stands nearer to its image than twice this
_BEFORE_MIRROR: Final = "start:-2.2,-1.2; start:1.1,-1.2; start:1.1,4.4; start:-2.2,4.4"  # by 0.5 m
_GREY_FILE: Final = "grey.png"
_CONCRETE: Final = {"generator": "concrete", "colour": "#8f908c"}
TRUSTED: Final = 0.5  # least confidence of a trusted depth
WRONG: Final = math.log(1.2)
GROUND: Final = 0.2  # least share of an image that shows ground, as in `SensesAgree`
_NEAR_M: Final = 6.0  # depth beyond is not compared
_FLYING_M: Final = 0.8  # lower than this it takes off or lands
_HULL_M: Final = 0.15  # half of the body's length
Values = dict[str, Any]


def _change(case: str, lab: Values) -> None:
    """Make a bad room of the good one."""
    room = lab["room"]
    if case == "painted floor":
        room["ground"]["surface"] = {**_CONCRETE, "generator": "paint"}
    elif case == "floor of one colour":
        room["ground"]["surface"] = {"image": _GREY_FILE, "tile_m": [1.0, 1.0]}
    elif case == "walls like the floor":
        room["ground"]["surface"], room["walls"]["surface"] = {**_CONCRETE}, {**_CONCRETE}
    elif case == "rugs with a dark border":  # two, 2.6 m by 1.9 m
        for x_m, y_m, colour in ((-2.0, 0.6, "#8c2f39"), (2.1, -1.2, "#d9cfb8")):
            for half_m, width_m, of in ((1.2, 1.9, "#15120f"), (1.05, 1.6, colour)):
                ends_m = [[x_m - half_m, y_m], [x_m + half_m, y_m]]
                line = {"points_m": ends_m, "width_m": width_m, "colour": of}
                room["ground"]["surface"]["lines"].append(line)
    elif case == "mirror beyond the area":
        lab["area"] = _BEFORE_MIRROR
    elif case in ("dim", "dark"):
        ambient, share = (0.1, 0.15) if case == "dim" else (0.02, 0.02)
        room["light"]["ambient"] = ambient
        for lamp in room["light"]["lamps"]:
            lamp["brightness"] = round(share * lamp["brightness"], 3)


def _mirrored(objects: list[Values]) -> list[Values]:
    """Put a wall-high mirror across the room: behind it stands the image of what is before it."""
    kept = [each for each in objects if each["position_m"][0] < MIRROR_X_M - _NEAR_MIRROR_M]
    for each in kept.copy():
        x_m, y_m = each["position_m"]
        place = {"position_m": [2 * MIRROR_X_M - x_m, y_m], "yaw_deg": -each.get("yaw_deg", 0)}
        kept.append({**each, **place})
    return kept


def write_bad_room(case: str, folder: Path) -> Path:
    """Write a bad room as a new lab folder without a network, and return its scene."""
    depot, path = load_lab("depot"), folder / SCENES_FOLDER / f"{folder.name}.yaml"
    lab = read_yaml(depot.file, Values, "lab file").value
    lab |= {"limits": {"speed_mps": 0.6, "ceiling_m": 2.6}}
    lab.pop("network", None)
    _change(case, lab)
    objects = read_yaml(depot.scenes["depot-val-a"], Values, "scene file").value["objects"]
    scene = {"objects": objects, "take_off": {"from": [-2.4, 1.4], "yaw_deg": -35}}
    if "mirror" in case:
        scene = {"objects": _mirrored(objects), "take_off": {"from": [-1.6, 1.6], "yaw_deg": 0}}
    path.parent.mkdir(parents=True)
    for file in ("barrier.obj", "crate.jpg"):
        shutil.copyfile(depot.folder / file, folder / file)
    cv2.imwrite(str(folder / _GREY_FILE), np.full((64, 64, 3), 143, np.uint8))
    written = {folder / LAB_FILE: lab, path: scene}
    if case in FOCAL:
        matrix = anafi_camera(*SIZE_PX).matrix @ np.diag([FOCAL[case], FOCAL[case], 1.0])
        size = dict(zip(("width_px", "height_px"), SIZE_PX, strict=True))
        written[folder / CAMERA_FILE] = {**size, "K": matrix.tolist(), "distortion": [0.0] * 5}
    for target, content in written.items():
        target.write_text(yaml_text(content), encoding="utf-8")
    return path


class Watch:
    """Compares depth with the truth, and notes when the drone is beyond a mirror."""

    def __init__(self, mirror_x_m: float) -> None:
        self._mirror_x_m, self._last = mirror_x_m, -1
        self.mirror_s: float | None = None  # first time beyond the mirror
        self.depths: list[tuple[float, float]] = []  # confidence, logarithm of the error
        self.followed: list[bool] = []  # of the frames with ground: whether its motion was measured

    def follow(self, flight: app.Flight[Any]) -> list[Watch]:
        """Become a listener of a flight."""
        self._referee, self._board = flight.drone.referee, flight.context.board
        return [self]

    def on_tick(self, record: TickRecord) -> None:
        """Compare the depth of a new frame."""
        if (truth := record.truth) is None:
            return
        if self.mirror_s is None and truth.pose.x_m > self._mirror_x_m - _HULL_M:
            self.mirror_s = round(record.time_s, 1)
        frame, depth = self._board.read(FRAME).value, self._board.read(METRIC_DEPTH).value
        if truth.pose.z_m <= _FLYING_M or frame is None or frame.index == self._last:
            return
        self._last = frame.index
        if depth is not None and depth.captured_s == frame.captured_s:
            true = self._referee.depth(frame, *depth.depth.shape[::-1])
            near = np.isfinite(depth.depth) & (depth.depth > 0.0) & (true > 0.0) & (true < _NEAR_M)
            ratios = np.log(depth.depth[near] / true[near])
            self.depths.append((depth.confidence, float(np.median(ratios)) if near.any() else 0.0))
        motion = self._board.read(ODOMETRY).value
        if motion is not None and (motion.ground_share or 0.0) >= GROUND:
            self.followed.append(motion.tracked_s == motion.seen.time_s)

    def shares(self) -> dict[str, float | None]:
        """Return shares of the frames with depth, and of those with ground."""
        wrong = [sure > TRUSTED and abs(off) > WRONG for sure, off in self.depths]
        doubted = [sure <= TRUSTED for sure, _ in self.depths]
        shares = {"trusted_wrong": wrong, "doubted": doubted, "followed": self.followed}
        return {name: sum(each) / len(each) if each else None for name, each in shares.items()}


def fly(case: str, seed: int, given: argparse.Namespace) -> Values:
    """Fly once in a bad room and return the flight's line."""
    folder = given.out / case.replace(" ", "-")
    watch = Watch(MIRROR_X_M if "mirror" in case else math.inf)
    scene = folder / SCENES_FOLDER / f"{folder.name}.yaml"
    options = app.FlightOptions(
        lab=folder,
        scene=str(scene if scene.exists() else write_bad_room(case, folder)),
        seed=seed,
        camera=folder / CAMERA_FILE if case in FOCAL else None,
        faults=FAULTS.get(case, ()),
        ports=dict(each.split("=", 1) for each in given.ports),
        image_size_px=SIZE_PX,
    )
    report = app.fly(given.tree, options, listeners=[watch.follow]).to_json()
    kept = ("outcome", "reason", "duration_s", "coverage_passed", "map_drift_m", "warnings")
    line = {"case": case, "seed": seed, "mirror_s": watch.mirror_s, **watch.shares()}
    return line | {name: report[name] for name in kept}


def main() -> None:
    """Fly, and print a line for each flight."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", nargs="+", default=CASES, choices=CASES, metavar="CASE")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--tree", default="survey_any_room")
    parser.add_argument("--set", nargs="*", default=["CoverFor.duration_ms=60000"], dest="ports")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    for case in given.cases:
        for seed in range(given.seeds):
            print(json.dumps(fly(case, seed, given)), flush=True)


if __name__ == "__main__":
    main()
