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
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from sim_bridge.anafi import anafi_camera
from uav_bt import app
from uav_bt.board import FRAME, METRIC_DEPTH, ODOMETRY
from uav_bt.lab.lab import LAB_FILE, SCENES_FOLDER
from uav_bt.lab.shipped import load_lab
from uav_bt.mission.judge import LANDING_SURFACES
from uav_bt.mission.tick import TickRecord
from uav_bt.protocols import Drone
from uav_bt.yaml_file import read_yaml, yaml_text

SIZE_PX: Final = (320, 180)
CAMERA_FILE: Final = "camera.yaml"
MIRROR_X_M: Final = 0.0
TRUSTED: Final = 0.5  # least confidence of a trusted depth
WRONG: Final = math.log(1.2)
GROUND: Final = 0.2  # least share of an image that shows ground, as in `SensesAgree`
_NEAR_M: Final = 6.0  # depth beyond is not compared
_FLYING_M: Final = 0.8  # lower than this it takes off or lands
_HULL_M: Final = 0.15  # half of the body's length
_GREY_FILE: Final = "grey.png"
_NEAR_MIRROR_M: Final = 0.8  # no object stands nearer to its image than twice this

Lab = dict[str, Any]
Scene = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class BadRoom:
    """A room, or an input, that perception is not made for."""

    name: str
    change: Callable[[Lab, Scene], None] = lambda _lab, _scene: None  # of the good room
    focal: float | None = None  # factor of the focal length in the camera file; None: no file
    faults: tuple[str, ...] = ()
    mirror_x_m: float | None = None  # world x of a mirror that nothing shows


def _floor(surface: dict[str, Any], *, walls: bool = False) -> Callable[[Lab, Scene], None]:
    def change(lab: Lab, _scene: Scene) -> None:
        for part in ("ground", "walls") if walls else ("ground",):
            lab["room"][part]["surface"] = dict(surface)

    return change


def _rug(lab: Lab, _scene: Scene) -> None:
    """Lay a red rug with a dark border, 2.6 m by 1.9 m, and another beside it."""
    lines = []
    for x_m, y_m, colour in ((-2.0, 0.6, "#8c2f39"), (2.1, -1.2, "#d9cfb8")):
        middle = [[x_m - 1.2, y_m], [x_m + 1.2, y_m]]
        lines.append({"points_m": middle, "width_m": 1.9, "colour": "#15120f"})
        inner = [[x_m - 1.05, y_m], [x_m + 1.05, y_m]]
        lines.append({"points_m": inner, "width_m": 1.6, "colour": colour})
    surface = lab["room"]["ground"]["surface"]
    surface["lines"] = [*surface["lines"], *lines]


def _mirror(_lab: Lab, scene: Scene) -> None:
    """Put a wall-high mirror across the room: behind it stands the mirrored room."""
    objects = scene["objects"]
    scene["objects"] = [
        each for each in objects if each["position_m"][0] < MIRROR_X_M - _NEAR_MIRROR_M
    ]
    for each in list(scene["objects"]):
        x_m, y_m = each["position_m"]
        image = {"position_m": [2 * MIRROR_X_M - x_m, y_m], "yaw_deg": -each.get("yaw_deg", 0)}
        scene["objects"].append({**each, **image})
    scene["take_off"] = {"from": [-1.6, 1.6], "yaw_deg": 0}


def _mirror_beyond_area(lab: Lab, scene: Scene) -> None:
    """State an area that ends 0.5 m before the mirror."""
    _mirror(lab, scene)
    lab["area"] = "start:-2.2,-1.2; start:1.1,-1.2; start:1.1,4.4; start:-2.2,4.4"


def _light(ambient: float, share: float) -> Callable[[Lab, Scene], None]:
    def change(lab: Lab, _scene: Scene) -> None:
        light = lab["room"]["light"]
        light["ambient"] = ambient
        for lamp in light["lamps"]:
            lamp["brightness"] = round(share * lamp["brightness"], 3)

    return change


_CONCRETE: Final = {"generator": "concrete", "colour": "#8f908c"}
BAD_ROOMS: Final = (
    BadRoom(name="good room"),
    BadRoom(name="painted floor", change=_floor({"generator": "paint", "colour": "#8f908c"})),
    BadRoom(name="floor of one colour", change=_floor({"image": _GREY_FILE, "tile_m": [1.0, 1.0]})),
    BadRoom(name="walls like the floor", change=_floor(_CONCRETE, walls=True)),
    BadRoom(name="rugs with a dark border", change=_rug),
    BadRoom(name="mirror", change=_mirror, mirror_x_m=MIRROR_X_M),
    BadRoom(name="mirror beyond the area", change=_mirror_beyond_area, mirror_x_m=MIRROR_X_M),
    BadRoom(name="dim", change=_light(0.1, 0.15)),
    BadRoom(name="dark", change=_light(0.02, 0.02)),
    BadRoom(name="camera x2", focal=2.0),
    BadRoom(name="camera x0.5", focal=0.5),
    BadRoom(name="height +0.5 m", faults=("height-bias=0.5",)),
    BadRoom(name="height -0.5 m", faults=("height-bias=-0.5",)),
)


def write_bad_room(room: BadRoom, folder: Path) -> Path:
    """Write a bad room as a new lab folder without a network, and return its scene."""
    depot = load_lab("depot")
    lab = read_yaml(depot.file, dict[str, Any], "lab file").value
    scene = read_yaml(depot.scenes["depot-val-a"], dict[str, Any], "scene file").value
    lab.pop("network", None)
    lab = {**lab, "limits": {"speed_mps": 0.6, "ceiling_m": 2.6}}
    scene = {"objects": scene["objects"], "take_off": {"from": [-2.4, 1.4], "yaw_deg": -35}}
    room.change(lab, scene)
    path = folder / SCENES_FOLDER / f"{folder.name}.yaml"
    path.parent.mkdir(parents=True)
    for file in ("barrier.obj", "crate.jpg"):
        shutil.copyfile(depot.folder / file, folder / file)
    cv2.imwrite(str(folder / _GREY_FILE), np.full((64, 64, 3), 143, np.uint8))
    written = {folder / LAB_FILE: lab, path: scene}
    if room.focal is not None:
        lens = anafi_camera(*SIZE_PX)
        fx_px, fy_px = room.focal * lens.fx_px, room.focal * lens.fy_px
        written[folder / CAMERA_FILE] = {
            "width_px": lens.width_px,
            "height_px": lens.height_px,
            "K": [[fx_px, 0.0, lens.cx_px], [0.0, fy_px, lens.cy_px], [0.0, 0.0, 1.0]],
            "distortion": [0.0] * 5,
        }
    for file, content in written.items():
        file.write_text(yaml_text(content), encoding="utf-8")
    return path


class Watch:
    """Notes contacts, and compares depth with the truth; beyond a mirror is a contact, too."""

    def __init__(self, mirror_x_m: float | None) -> None:
        self._mirror_x_m = math.inf if mirror_x_m is None else mirror_x_m
        self._last = -1
        self.contacts: dict[str, float] = {}  # first time of each, s
        self.depths: list[tuple[float, float]] = []  # confidence, logarithm of the error
        self.followed: list[bool] = []  # of the frames with ground: whether its motion was measured

    def follow(self, flight: app.Flight[Drone]) -> Sequence[Watch]:
        """Become a listener of a flight."""
        self._referee, self._board = flight.drone.referee, flight.context.board
        return (self,)

    def on_tick(self, record: TickRecord) -> None:
        """Note contacts, and compare the depth of a new frame."""
        truth = record.truth
        if truth is None:
            return
        touched = [name for name in truth.contacts if name not in LANDING_SURFACES]
        touched += ["mirror"] * (truth.pose.x_m > self._mirror_x_m - _HULL_M)
        for name in touched:
            self.contacts.setdefault(name, round(record.time_s, 1))
        frame, depth = self._board.read(FRAME).value, self._board.read(METRIC_DEPTH).value
        if truth.pose.z_m <= _FLYING_M or frame is None or frame.index == self._last:
            return
        self._last = frame.index
        if depth is not None and depth.captured_s == frame.captured_s:
            height_px, width_px = depth.depth.shape
            true = self._referee.depth(frame, width_px, height_px)
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


def fly(room: BadRoom, seed: int, given: argparse.Namespace) -> dict[str, Any]:
    """Fly once in a bad room and return the flight's line."""
    folder, watch = given.out / room.name.replace(" ", "-"), Watch(room.mirror_x_m)
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
