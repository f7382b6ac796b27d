"""A furnished room by chance, as a lab folder with a scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np

from benchmarks.rooms.pictures import draw_surface
from uav_bt.lab.lab import LAB_FILE, SCENES_FOLDER
from uav_bt.types.arrays import Image
from uav_bt.yaml_file import yaml_text

LAB: Final = {
    "version": 1,
    "classes": {
        "outside": {"role": "outside", "colour": "#282830"},
        "floor": {"role": "ground", "colour": "#7e9e78"},
        "mark": {"role": "mark", "colour": "#ffffff"},
        "obstacle": {"role": "obstacle", "colour": "#d62728"},
    },
    "mark": {
        "kind": "apriltag",
        "size_m": [0.5, 0.5],
        "height_m": 0.01,
        "options": {"family": "36h11", "id": 7, "size_m": 0.4},
    },
    "limits": {"speed_mps": 0.6, "ceiling_m": 2.0},
    "margins": {"edge_m": 0.45},  # walls stand at the edge of the floor
}
TRIES: Final = 200
WALL_GAP_M: Final = 0.04


@dataclass(frozen=True, kw_only=True)
class Furniture:
    """A model: its OBJ file; length, width and height."""

    path: Path
    size_m: tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Assets:
    """What rooms are made of: models, and photographs of materials, (H, W, 3) uint8 RGB."""

    furniture: Sequence[Furniture]
    photographs: Sequence[Image]


@dataclass(frozen=True, kw_only=True)
class RoomPlan:
    """How rooms are furnished: ranges."""

    sides_m: tuple[float, float] = (3.5, 8.0)
    per_m2: tuple[float, float] = (0.2, 0.6)  # objects
    gap_m: float = 0.15  # between two objects that stand away from the walls
    ambient: tuple[float, float] = (0.2, 0.75)
    plain_floors: float = 0.15  # share of floors that are nearly of one colour


FLOWN: Final = RoomPlan(gap_m=0.9, per_m2=(0.2, 0.45), ambient=(0.45, 0.8), plain_floors=0.0)
"""Rooms to fly in: with passages, light, and floors on which odometry works."""


def write_room(folder: Path, assets: Assets, rng: np.random.Generator, plan: RoomPlan) -> Path:
    """Write a room as a lab folder, and return its scene with a landing mark."""
    scenes = folder / SCENES_FOLDER
    scenes.mkdir(parents=True)
    size_m = tuple(round(float(side), 2) for side in rng.uniform(*plan.sides_m, 2))
    kinds = _kinds(folder, assets, rng)
    room = {
        "ground": {"size_m": list(size_m), "surface": _floor(folder, assets, rng, plan)},
        "walls": {
            "height_m": _drawn(rng, 2.4, 3.6),
            "beside_m": 0,
            "surface": _surface(folder, "walls", assets, rng, plain=0.55),
        },
        "light": _light(size_m, rng, plan),
        "objects": kinds,
    }
    _write(folder / LAB_FILE, {**LAB, "room": room})
    wanted = round(size_m[0] * size_m[1] * float(rng.uniform(*plan.per_m2)))
    pad_m = [_drawn(rng, -side / 2 + 0.8, side / 2 - 0.8) for side in size_m]
    pad = {"position_m": pad_m, "yaw_deg": _drawn(rng, 0, 360, None)}
    objects = _placed(kinds, size_m, pad_m, wanted, rng=rng, gap_m=plan.gap_m)
    yaw_deg = _drawn(rng, 0, 360, None)
    path = scenes / f"{folder.name}.yaml"
    take_off = {"from": "helipad", "yaw_deg": yaw_deg}
    _write(path, {"helipad": pad, "objects": objects, "take_off": take_off})
    return path


def _write(path: Path, content: dict[str, Any]) -> None:
    path.write_text(yaml_text(content), encoding="utf-8")


def _drawn(rng: np.random.Generator, low: float, high: float, digits: int | None = 2) -> float:
    return round(float(rng.uniform(low, high)), digits)


def _surface(
    folder: Path, name: str, assets: Assets, rng: np.random.Generator, plain: float
) -> dict[str, Any]:
    image = draw_surface(assets.photographs, rng, plain)
    file = f"{name}.jpg"
    cv2.imwrite(str(folder / file), image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 90])
    side_m = round(float(np.exp(rng.uniform(np.log(0.4), np.log(2.5)))), 2)
    return {"image": file, "tile_m": [side_m, side_m]}


def _floor(
    folder: Path, assets: Assets, rng: np.random.Generator, plan: RoomPlan
) -> dict[str, Any]:
    """Return a floor, with a rug on some."""
    surface = _surface(folder, "floor", assets, rng, plain=plan.plain_floors)
    if rng.random() < 0.35:
        x, y = rng.uniform(-1.0, 1.0, 2).round(2).tolist()
        half_m, angle = 0.5 * rng.uniform(1.0, 2.5), rng.uniform(0, math.pi)
        right, up = half_m * math.cos(angle), half_m * math.sin(angle)
        ends = [[round(x + sign * right, 2), round(y + sign * up, 2)] for sign in (-1, 1)]
        colour = "#{:02x}{:02x}{:02x}".format(*rng.integers(30, 220, 3))
        width_m = _drawn(rng, 0.6, 1.8)
        surface["lines"] = [{"points_m": ends, "width_m": width_m, "colour": colour}]
    return surface


def _light(size_m: tuple[float, ...], rng: np.random.Generator, plan: RoomPlan) -> dict[str, Any]:
    lamps = []
    for _ in range(int(rng.integers(1, 5))):
        place = [_drawn(rng, -side / 2, side / 2) for side in size_m]
        lamp = {"position_m": [*place, _drawn(rng, 2.0, 2.4)], "brightness": _drawn(rng, 0.3, 1.2)}
        lamps.append({**lamp, "reach_m": _drawn(rng, 1.5, 6.0, 1)})
    return {"ambient": _drawn(rng, *plan.ambient), "lamps": lamps}


def _kinds(folder: Path, assets: Assets, rng: np.random.Generator) -> dict[str, Any]:
    """Return the kinds of objects of a room: furniture, boxes, tables and racks."""
    count = min(len(assets.furniture), int(rng.integers(4, 9)))
    kinds: dict[str, Any] = {}
    for index in rng.choice(len(assets.furniture), count, replace=False).tolist():
        model = assets.furniture[index]
        file = f"{model.path.stem.lower()}.obj"
        (folder / file).write_bytes(model.path.read_bytes())
        scale = rng.uniform(0.85, 1.15)
        kinds[f"model_{model.path.stem.lower()}"] = {
            "shape": "mesh",
            "file": file,
            "size_m": [round(scale * side, 3) for side in model.size_m],
        }
    for number in range(int(rng.integers(1, 4))):
        kinds[f"part{number}"] = _simple(rng)
    for name, kind in kinds.items():
        kind["class"] = "obstacle"
        kind["surface"] = _surface(folder, f"{name}-look", assets, rng, plain=0.4)
    return kinds


def _simple(rng: np.random.Generator) -> dict[str, Any]:
    shape = str(rng.choice(["box", "cylinder", "table", "rack"]))
    low, high = {
        "box": ((0.25, 0.25, 0.2), (1.2, 0.7, 2.2)),
        "cylinder": ((0.25, 0.25, 0.4), (0.7, 0.7, 1.8)),
        "table": ((0.7, 0.5, 0.4), (1.8, 0.9, 0.95)),
        "rack": ((0.6, 0.3, 0.8), (1.4, 0.5, 2.1)),
    }[shape]
    size_m = rng.uniform(low, high).round(2).tolist()
    if shape == "cylinder":
        size_m[1] = size_m[0]
    return {"shape": shape, "size_m": size_m}


def _placed(
    kinds: dict[str, Any],
    size_m: tuple[float, ...],
    pad_m: list[float],
    wanted: int,
    *,
    rng: np.random.Generator,
    gap_m: float,
) -> list[dict[str, Any]]:
    """Return objects at places: most along the walls, and the others with gaps between them."""
    circles = [(*pad_m, 0.75)]
    objects: list[dict[str, Any]] = []
    names = sorted(kinds)
    for _ in range(TRIES):
        if len(objects) == wanted:
            break
        name = names[int(rng.integers(len(names)))]
        length_m, width_m, _ = kinds[name]["size_m"]
        along = rng.random() < 0.6
        yaw_deg = 90.0 * int(rng.integers(4)) if along else _drawn(rng, 0, 360, None)
        yaw_rad = math.radians(yaw_deg)
        cos, sin = abs(math.cos(yaw_rad)), abs(math.sin(yaw_rad))
        half = ((length_m * cos + width_m * sin) / 2, (length_m * sin + width_m * cos) / 2)
        room = [side / 2 - each - WALL_GAP_M for side, each in zip(size_m, half, strict=True)]
        if min(room) <= 0.0:
            continue
        place = [float(rng.uniform(-each, each)) for each in room]
        if along:
            axis = int(rng.integers(2))
            place[axis] = room[axis] * (1 if rng.random() < 0.5 else -1)
        radius = math.hypot(length_m, width_m) / 2
        gap = 0.0 if along else gap_m
        if all(math.dist(place, other[:2]) > radius + other[2] + gap for other in circles):
            circles.append((place[0], place[1], radius))
            spot = [round(each, 3) for each in place]
            objects.append({"kind": name, "position_m": spot, "yaw_deg": yaw_deg})
    return objects
