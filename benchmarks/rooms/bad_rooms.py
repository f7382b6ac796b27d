"""Fly in rooms and with inputs that perception is not made for.

    python -m benchmarks.rooms.bad_rooms --cases mirror "camera x2" --seeds 3 --out runs/bad-rooms

`bad_rooms.yaml` has the cases. Each becomes a lab folder without a network, so the network `any`
flies there. Each flight is printed as a line of JSON.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
from functools import reduce
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from uav_bt import app
from uav_bt.board import FRAME, METRIC_DEPTH, ODOMETRY
from uav_bt.lab.lab import LAB_FILE, SCENES_FOLDER
from uav_bt.lab.shipped import load_lab
from uav_bt.mission.tick import TickRecord
from uav_bt.yaml_file import read_yaml, yaml_text

Values = dict[str, Any]
CASES: Final = read_yaml(Path(__file__).with_suffix(".yaml"), dict[str, Values], "cases").value
SIZE_PX: Final = (320, 180)
CAMERA_FILE: Final = "camera.yaml"
MIRROR_X_M: Final = 0.0  # world x of a mirror that nothing shows
_NEAR_MIRROR_M: Final = 0.8  # no object stands nearer to its image than twice this
TRUSTED: Final = 0.5  # least confidence of a trusted depth
WRONG: Final = math.log(1.2)
GROUND: Final = 0.2  # least share of an image that shows ground, as in `SensesAgree`
_NEAR_M: Final = 6.0  # depth beyond is not compared
_FLYING_M: Final = 0.8  # lower than this it takes off or lands


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
    bad, lab = CASES[case], read_yaml(depot.file, Values, "lab file").value
    lab |= {"limits": {"speed_mps": 0.6, "ceiling_m": 2.6}}
    lab.pop("network", None)
    for key, value in bad.get("lab", {}).items():
        *sections, name = key.split(".")
        section = reduce(Values.__getitem__, sections, lab)
        section[name] = section[name] + value if isinstance(value, list) else value
    for lamp in lab["room"]["light"]["lamps"]:
        lamp["brightness"] = round(bad.get("brightness", 1) * lamp["brightness"], 3)
    objects = read_yaml(depot.scenes["depot-val-a"], Values, "scene file").value["objects"]
    scene = {"objects": objects, "take_off": {"from": [-2.4, 1.4], "yaw_deg": -35}}
    if "mirror" in bad:
        scene = {"objects": _mirrored(objects), "take_off": {"from": [-1.6, 1.6], "yaw_deg": 0}}
    path.parent.mkdir(parents=True, exist_ok=True)
    for file in ("barrier.obj", "crate.jpg"):
        shutil.copyfile(depot.folder / file, folder / file)
    cv2.imwrite(str(folder / "grey.png"), np.full((64, 64, 3), 143, np.uint8))
    written = {folder / LAB_FILE: lab, path: scene}
    if "camera" in bad:
        written[folder / CAMERA_FILE] = bad["camera"]
    for target, content in written.items():
        target.write_text(yaml_text(content), encoding="utf-8")
    return path


class Watch:
    """Compares depth with the truth, and notes when the drone is beyond a mirror."""

    def __init__(self) -> None:
        self._last = -1
        self.mirror_s: float | None = None  # first time where the mirror is, or would be
        self.trusted_wrong: list[bool] = []  # of the frames with depth
        self.followed: list[bool] = []  # of the frames with ground: whether its motion was measured

    def follow(self, flight: app.Flight[Any]) -> list[Watch]:
        """Become a listener of a flight."""
        self._referee, self._board = flight.drone.referee, flight.context.board
        return [self]

    def on_tick(self, record: TickRecord) -> None:
        """Compare the depth of a new frame."""
        if (truth := record.truth) is None:
            return
        if self.mirror_s is None and truth.pose.x_m > MIRROR_X_M - 0.15:  # the nose touches it
            self.mirror_s = round(record.time_s, 1)
        frame, depth = self._board.read(FRAME).value, self._board.read(METRIC_DEPTH).value
        if truth.pose.z_m <= _FLYING_M or frame is None or frame.index == self._last:
            return
        self._last = frame.index
        if depth is not None and depth.captured_s == frame.captured_s:
            true = self._referee.depth(frame, *depth.depth.shape[::-1])
            near = np.isfinite(depth.depth) & (depth.depth > 0.0) & (true > 0.0) & (true < _NEAR_M)
            off = np.median(np.log(depth.depth[near] / true[near])) if near.any() else 0.0
            self.trusted_wrong.append(depth.confidence > TRUSTED and abs(off) > WRONG)
        motion = self._board.read(ODOMETRY).value
        if motion is not None and (motion.ground_share or 0.0) >= GROUND:
            self.followed.append(motion.tracked_s == motion.seen.time_s)

    def shares(self) -> dict[str, float | None]:
        """Return shares of the frames with depth, and of those with ground."""
        shares = {"trusted_wrong": self.trusted_wrong, "followed": self.followed}
        return {name: sum(each) / len(each) if each else None for name, each in shares.items()}


def fly(case: str, scene: Path, seed: int) -> Values:
    """Fly once in a bad room and return the flight's line."""
    watch, folder = Watch(), scene.parents[1]
    options = app.FlightOptions(
        lab=folder,
        scene=str(scene),
        seed=seed,
        camera=folder / CAMERA_FILE if "camera" in CASES[case] else None,
        faults=tuple(CASES[case].get("faults", ())),
        ports={"CoverFor.duration_ms": "60000"},
        image_size_px=SIZE_PX,
    )
    report = app.fly("survey_any_room", options, listeners=[watch.follow]).to_json()
    kept = ("outcome", "reason", "duration_s", "coverage_passed", "map_drift_m", "warnings")
    line = {"case": case, "seed": seed, "mirror_s": watch.mirror_s, **watch.shares()}
    return line | {name: report[name] for name in kept}


def main() -> None:
    """Fly, and print a line for each flight."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", nargs="+", default=CASES, choices=CASES, metavar="CASE")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--out", type=Path, required=True, help="of the rooms")
    given = parser.parse_args()
    for case in given.cases:
        scene = write_bad_room(case, given.out / case.replace(" ", "-"))
        for seed in range(given.seeds):
            print(json.dumps(fly(case, scene, seed)), flush=True)


if __name__ == "__main__":
    main()
