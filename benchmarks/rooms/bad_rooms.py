r"""Fly in rooms and with inputs that perception is not made for.

    python -m benchmarks.rooms.bad_rooms --out runs/bad-rooms
    python -m benchmarks.rooms.bad_rooms --cases mirror "camera x2" --seeds 3 --out runs/bad-rooms

Each case is a lab folder without a network, so the network `any` flies there. The rooms are made of
the depot's own files. The flights are written at once as lines of `flights.jsonl`; the same command
resumes where it was stopped. Exit codes: 0 without a contact, 1 with one.
"""

from __future__ import annotations

import argparse
import copy
import json
import shutil
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
import yaml

from benchmarks.rooms.bad_flights import BadFlight, fly
from sim_bridge.anafi import anafi_camera
from uav_bt.lab.lab import LAB_FILE, SCENES_FOLDER
from uav_bt.lab.shipped import load_lab

SIZE_PX: Final = (320, 180)
FLIGHTS_FILE: Final = "flights.jsonl"
CAMERA_FILE: Final = "camera.yaml"
MIRROR_X_M: Final = 0.0
_COLUMNS: Final = (
    *("case", "seed", "outcome", "reason", "contacts", "time, s", "covered", "drift, m"),
    *("trusted and wrong", "doubted", "followed"),
)
_GREY_FILE: Final = "grey.png"
_FROM: Final = "depot"
_SCENE: Final = "depot-val-a"
_NEAR_MIRROR_M: Final = 0.8  # no object stands nearer to its image than twice this
_TAKE_OFF: Final = {"from": [-2.4, 1.4], "yaw_deg": -35}

Lab = dict[str, Any]
Scene = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class BadRoom:
    """A room, or an input, that perception is not made for.

    Attributes:
        name: Its name in the table.
        change: Changes the lab file and the scene of the good room.
        focal: Factor of the focal length in the camera file; None: no camera file.
        faults: Of the drone.
        mirror_x_m: World x of a mirror that nothing shows; None without one.
    """

    name: str
    change: Callable[[Lab, Scene], None] = lambda _lab, _scene: None
    focal: float | None = None
    faults: tuple[str, ...] = ()
    mirror_x_m: float | None = None


def _plain_floor(lab: Lab, scene: Scene) -> None:
    del scene
    lab["room"]["ground"]["surface"] = {"generator": "paint", "colour": "#8f908c"}


def _one_colour(lab: Lab, scene: Scene) -> None:
    del scene
    lab["room"]["ground"]["surface"] = {"image": _GREY_FILE, "tile_m": [1.0, 1.0]}


def _walls_like_floor(lab: Lab, scene: Scene) -> None:
    del scene
    surface = {"generator": "concrete", "colour": "#8f908c"}
    lab["room"]["ground"]["surface"] = dict(surface)
    lab["room"]["walls"]["surface"] = dict(surface)


def _rug(lab: Lab, scene: Scene) -> None:
    """Lay a red rug with a dark border, 2.6 m by 1.9 m, and another beside it."""
    del scene
    lines = []
    for x_m, y_m, colour in ((-2.0, 0.6, "#8c2f39"), (2.1, -1.2, "#d9cfb8")):
        middle = [[x_m - 1.2, y_m], [x_m + 1.2, y_m]]
        lines.append({"points_m": middle, "width_m": 1.9, "colour": "#15120f"})
        inner = [[x_m - 1.05, y_m], [x_m + 1.05, y_m]]
        lines.append({"points_m": inner, "width_m": 1.6, "colour": colour})
    surface = lab["room"]["ground"]["surface"]
    surface["lines"] = [*surface["lines"], *lines]


def _mirror(lab: Lab, scene: Scene) -> None:
    """Put a wall-high mirror across the room: behind it stands the mirrored room."""
    del lab
    before = [
        each for each in scene["objects"] if each["position_m"][0] < MIRROR_X_M - _NEAR_MIRROR_M
    ]
    images = []
    for each in before:
        x_m, y_m = each["position_m"]
        images.append(
            {**each, "position_m": [2 * MIRROR_X_M - x_m, y_m], "yaw_deg": -each.get("yaw_deg", 0)}
        )
    scene["objects"] = before + images
    scene["take_off"] = {"from": [-1.6, 1.6], "yaw_deg": 0}


def _mirror_beyond_area(lab: Lab, scene: Scene) -> None:
    """State an area that ends 0.5 m before the mirror."""
    _mirror(lab, scene)
    lab["area"] = "start:-2.2,-1.2; start:1.1,-1.2; start:1.1,4.4; start:-2.2,4.4"


def _light(ambient: float, share: float) -> Callable[[Lab, Scene], None]:
    def change(lab: Lab, scene: Scene) -> None:
        del scene
        light = lab["room"]["light"]
        light["ambient"] = ambient
        for lamp in light["lamps"]:
            lamp["brightness"] = round(share * lamp["brightness"], 3)

    return change


BAD_ROOMS: Final = (
    BadRoom(name="good room"),
    BadRoom(name="painted floor", change=_plain_floor),
    BadRoom(name="floor of one colour", change=_one_colour),
    BadRoom(name="walls like the floor", change=_walls_like_floor),
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
    """Write a bad room as a lab folder without a network, and return its scene.

    Args:
        room: The room.
        folder: The folder; it must not exist.
    """
    depot = load_lab(_FROM)
    lab = yaml.safe_load(depot.file.read_text(encoding="utf-8"))
    scene = yaml.safe_load(depot.scenes[_SCENE].read_text(encoding="utf-8"))
    lab.pop("network", None)
    lab = {**lab, "limits": {"speed_mps": 0.6, "ceiling_m": 2.6}}
    scene = {"objects": scene["objects"], "take_off": copy.deepcopy(_TAKE_OFF)}
    room.change(lab, scene)
    scenes = folder / SCENES_FOLDER
    scenes.mkdir(parents=True)
    for file in ("barrier.obj", "crate.jpg"):
        shutil.copyfile(depot.folder / file, folder / file)
    cv2.imwrite(str(folder / _GREY_FILE), np.full((64, 64, 3), 143, np.uint8))
    if room.focal is not None:
        (folder / CAMERA_FILE).write_text(_camera_text(room.focal), encoding="utf-8")
    (folder / LAB_FILE).write_text(yaml.safe_dump(lab, sort_keys=False), encoding="utf-8")
    path = scenes / f"{folder.name}.yaml"
    path.write_text(yaml.safe_dump(scene, sort_keys=False), encoding="utf-8")
    return path


def _camera_text(factor: float) -> str:
    camera = anafi_camera(*SIZE_PX)
    return yaml.safe_dump(
        {
            "width_px": camera.width_px,
            "height_px": camera.height_px,
            "K": [
                [factor * camera.fx_px, 0.0, camera.cx_px],
                [0.0, factor * camera.fy_px, camera.cy_px],
                [0.0, 0.0, 1.0],
            ],
            "distortion": [0.0] * 5,
        },
        sort_keys=False,
    )


def table(flights: Iterable[dict[str, Any]]) -> str:
    """Return the table of flights, as Markdown."""
    rows = [f"| {' | '.join(_COLUMNS)} |", "|---" * len(_COLUMNS) + "|"]
    for each in flights:
        numbers = [
            _number(each["duration_s"], ".0f"),
            _number(each["covered"], ".0%"),
            _number(each["drift_m"], ".2f"),
            _number(each["trusted_wrong"], ".1%"),
            _number(each["doubted"], ".1%"),
            _number(each["followed"], ".0%"),
        ]
        cells = [
            each["case"],
            str(each["seed"]),
            each["outcome"],
            each["reason"],
            ", ".join(each["contacts"]) or "none",
            *numbers,
        ]
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows)


def _number(value: float | None, form: str) -> str:
    return "" if value is None else format(value, form)


def _flown(path: Path) -> list[dict[str, Any]]:
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def main(arguments: Sequence[str] | None = None) -> int:
    """Fly, print the table, and return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", nargs="+", choices=[each.name for each in BAD_ROOMS])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--tree", default="survey_any_room")
    parser.add_argument("--set", nargs="*", default=["CoverFor.duration_ms=60000"], dest="ports")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args(arguments)
    file = given.out / FLIGHTS_FILE
    flights = _flown(file)
    done = {(each["case"], each["seed"], each["tree"]) for each in flights}
    for seed in range(given.seeds):
        for room in BAD_ROOMS:
            if given.cases is not None and room.name not in given.cases:
                continue
            if (room.name, seed, given.tree) in done:
                continue
            folder = given.out / room.name.replace(" ", "-")
            scene = folder / SCENES_FOLDER / f"{folder.name}.yaml"
            flight = BadFlight(
                case=room.name,
                seed=seed,
                tree=given.tree,
                lab=folder,
                scene=scene if scene.exists() else write_bad_room(room, folder),
                camera=None if room.focal is None else folder / CAMERA_FILE,
                faults=room.faults,
                mirror_x_m=room.mirror_x_m,
                ports=dict(each.split("=", 1) for each in given.ports),
            )
            flights.append(fly(flight, SIZE_PX, given.out / "frames"))
            with file.open("a", encoding="utf-8") as lines:
                lines.write(json.dumps(flights[-1]) + "\n")
            print(json.dumps(flights[-1]), file=sys.stderr, flush=True)
    flights.sort(key=lambda each: [room.name for room in BAD_ROOMS].index(each["case"]))
    print(table(flights))
    return 1 if any(each["contacts"] for each in flights) else 0


if __name__ == "__main__":
    raise SystemExit(main())
