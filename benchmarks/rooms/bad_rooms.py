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
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import cv2
import numpy as np

from sim_bridge.anafi import anafi_camera
from uav_bt import app
from uav_bt.board import FRAME, METRIC_DEPTH, ODOMETRY
from uav_bt.lab.lab import LAB_FILE, SCENES_FOLDER
from uav_bt.lab.shipped import load_lab
from uav_bt.mission.judge import LANDING_SURFACES
from uav_bt.mission.tick import TickRecord
from uav_bt.yaml_file import read_yaml, yaml_text

SIZE_PX: Final = (320, 180)
CAMERA_FILE: Final = "camera.yaml"
MIRROR_X_M: Final = 0.0  # world x of a mirror that nothing shows
_NEAR_MIRROR_M: Final = 0.8  # no object stands nearer to its image than twice this
_GREY_FILE: Final = "grey.png"
TRUSTED: Final = 0.5  # least confidence of a trusted depth
WRONG: Final = math.log(1.2)
GROUND: Final = 0.2  # least share of an image that shows ground, as in `SensesAgree`
_NEAR_M: Final = 6.0  # depth beyond is not compared
_FLYING_M: Final = 0.8  # lower than this it takes off or lands
_HULL_M: Final = 0.15  # half of the body's length
Values = dict[str, Any]


def _surface(parts: tuple[str, ...], surface: Values, lab: Values, _scene: Values) -> None:
    for part in parts:
        lab["room"][part]["surface"] = dict(surface)


def _rugs(lab: Values, _scene: Values) -> None:
    """Lay a red rug with a dark border, 2.6 m by 1.9 m, and another beside it."""
    for x_m, y_m, colour in ((-2.0, 0.6, "#8c2f39"), (2.1, -1.2, "#d9cfb8")):
        for half_m, width_m, of in ((1.2, 1.9, "#15120f"), (1.05, 1.6, colour)):
            ends_m = [[x_m - half_m, y_m], [x_m + half_m, y_m]]
            line = {"points_m": ends_m, "width_m": width_m, "colour": of}
            lab["room"]["ground"]["surface"]["lines"].append(line)


def _mirror(area: str | None, lab: Values, scene: Values) -> None:
    """Put a wall-high mirror across the room: behind it stands the mirrored room."""
    edge_m = MIRROR_X_M - _NEAR_MIRROR_M
    scene["objects"] = [each for each in scene["objects"] if each["position_m"][0] < edge_m]
    for each in list(scene["objects"]):
        x_m, y_m = each["position_m"]
        image = {"position_m": [2 * MIRROR_X_M - x_m, y_m], "yaw_deg": -each.get("yaw_deg", 0)}
        scene["objects"].append({**each, **image})
    scene["take_off"] = {"from": [-1.6, 1.6], "yaw_deg": 0}
    lab |= {} if area is None else {"area": area}


def _light(ambient: float, share: float, lab: Values, _scene: Values) -> None:
    lab["room"]["light"]["ambient"] = ambient
    for lamp in lab["room"]["light"]["lamps"]:
        lamp["brightness"] = round(share * lamp["brightness"], 3)


class BadRoom(NamedTuple):
    """A room, or an input, that perception is not made for."""

    name: str
    change: Callable[[Values, Values], None] = lambda _lab, _scene: None  # of the good room
    focal: float | None = None  # factor of the focal length in the camera file; None: no file
    faults: tuple[str, ...] = ()


_CONCRETE: Final = {"generator": "concrete", "colour": "#8f908c"}
_GREY: Final = {"image": _GREY_FILE, "tile_m": [1.0, 1.0]}
_BEFORE_MIRROR: Final = "start:-2.2,-1.2; start:1.1,-1.2; start:1.1,4.4; start:-2.2,4.4"  # by 0.5 m
BAD_ROOMS: Final = (
    BadRoom("good room"),
    BadRoom("painted floor", partial(_surface, ("ground",), _CONCRETE | {"generator": "paint"})),
    BadRoom("floor of one colour", partial(_surface, ("ground",), _GREY)),
    BadRoom("walls like the floor", partial(_surface, ("ground", "walls"), _CONCRETE)),
    BadRoom("rugs with a dark border", _rugs),
    BadRoom("mirror", partial(_mirror, None)),
    BadRoom("mirror beyond the area", partial(_mirror, _BEFORE_MIRROR)),
    BadRoom("dim", partial(_light, 0.1, 0.15)),
    BadRoom("dark", partial(_light, 0.02, 0.02)),
    BadRoom("camera x2", focal=2.0),
    BadRoom("camera x0.5", focal=0.5),
    BadRoom("height +0.5 m", faults=("height-bias=0.5",)),
    BadRoom("height -0.5 m", faults=("height-bias=-0.5",)),
)


def write_bad_room(room: BadRoom, folder: Path) -> Path:
    """Write a bad room as a new lab folder without a network, and return its scene."""
    depot, path = load_lab("depot"), folder / SCENES_FOLDER / f"{folder.name}.yaml"
    lab = read_yaml(depot.file, Values, "lab file").value
    scene = read_yaml(depot.scenes["depot-val-a"], Values, "scene file").value
    lab.pop("network", None)
    lab["limits"] = {"speed_mps": 0.6, "ceiling_m": 2.6}
    scene = {"objects": scene["objects"], "take_off": {"from": [-2.4, 1.4], "yaw_deg": -35}}
    room.change(lab, scene)
    path.parent.mkdir(parents=True)
    for file in ("barrier.obj", "crate.jpg"):
        shutil.copyfile(depot.folder / file, folder / file)
    cv2.imwrite(str(folder / _GREY_FILE), np.full((64, 64, 3), 143, np.uint8))
    written = {folder / LAB_FILE: lab, path: scene}
    if room.focal is not None:
        matrix = anafi_camera(*SIZE_PX).matrix @ np.diag([room.focal, room.focal, 1.0])
        size = dict(zip(("width_px", "height_px"), SIZE_PX, strict=True))
        written[folder / CAMERA_FILE] = {**size, "K": matrix.tolist(), "distortion": [0.0] * 5}
    for target, content in written.items():
        target.write_text(yaml_text(content), encoding="utf-8")
    return path


class Watch:
    """Notes contacts, and compares depth with the truth; beyond a mirror is a contact, too."""

    def __init__(self, mirror_x_m: float) -> None:
        self._mirror_x_m, self._last = mirror_x_m, -1
        self.contacts: dict[str, float] = {}  # first time of each, s
        self.depths: list[tuple[float, float]] = []  # confidence, logarithm of the error
        self.followed: list[bool] = []  # of the frames with ground: whether its motion was measured

    def follow(self, flight: app.Flight[Any]) -> list[Watch]:
        """Become a listener of a flight."""
        self._referee, self._board = flight.drone.referee, flight.context.board
        return [self]

    def on_tick(self, record: TickRecord) -> None:
        """Note contacts, and compare the depth of a new frame."""
        if (truth := record.truth) is None:
            return
        mirror = ["mirror"] * (truth.pose.x_m > self._mirror_x_m - _HULL_M)
        for name in {*truth.contacts, *mirror} - set(LANDING_SURFACES):
            self.contacts.setdefault(name, round(record.time_s, 1))
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


def fly(room: BadRoom, seed: int, given: argparse.Namespace) -> Values:
    """Fly once in a bad room and return the flight's line."""
    folder = given.out / room.name.replace(" ", "-")
    watch = Watch(MIRROR_X_M if "mirror" in room.name else math.inf)
    scene = folder / SCENES_FOLDER / f"{folder.name}.yaml"
    options = app.FlightOptions(
        lab=folder,
        scene=str(scene if scene.exists() else write_bad_room(room, folder)),
        seed=seed,
        camera=None if room.focal is None else folder / CAMERA_FILE,
        faults=room.faults,
        ports=dict(each.split("=", 1) for each in given.ports),
        image_size_px=SIZE_PX,
    )
    report = app.fly(given.tree, options, listeners=[watch.follow]).to_json()
    kept = ("outcome", "reason", "duration_s", "coverage_passed", "map_drift_m", "warnings")
    line = {"case": room.name, "seed": seed, "contacts": watch.contacts, **watch.shares()}
    return line | {name: report[name] for name in kept}


def main() -> None:
    """Fly, and print a line for each flight."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", nargs="+", default=[room.name for room in BAD_ROOMS])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--tree", default="survey_any_room")
    parser.add_argument("--set", nargs="*", default=["CoverFor.duration_ms=60000"], dest="ports")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    for room in BAD_ROOMS:
        for seed in range(given.seeds if room.name in given.cases else 0):
            print(json.dumps(fly(room, seed, given)), flush=True)


if __name__ == "__main__":
    main()
