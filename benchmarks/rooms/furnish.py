"""A furnished room by chance, as a lab folder with a scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

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
SIMPLE: Final = {  # least and greatest size of drawn furniture, m
    "box": ((0.25, 0.25, 0.2), (1.2, 0.7, 2.2)),
    "cylinder": ((0.25, 0.25, 0.4), (0.7, 0.7, 1.8)),
    "table": ((0.7, 0.5, 0.4), (1.8, 0.9, 0.95)),
    "rack": ((0.6, 0.3, 0.8), (1.4, 0.5, 2.1)),
}
TRIES: Final = 200
WALL_GAP_M: Final = 0.04


class Furniture(NamedTuple):
    """A model: its OBJ file; length, width and height."""

    path: Path
    size_m: tuple[float, ...]


class Assets(NamedTuple):
    """What rooms are made of: models, and photographs of materials, (H, W, 3) uint8 RGB."""

    furniture: Sequence[Furniture]
    photographs: Sequence[Image]


class RoomPlan(NamedTuple):
    """How rooms are furnished: ranges."""

    sides_m: tuple[float, float] = (3.5, 8.0)
    per_m2: tuple[float, float] = (0.2, 0.6)  # objects
    gap_m: float = 0.15  # between two objects that stand away from the walls
    ambient: tuple[float, float] = (0.2, 0.75)
    plain_floors: float = 0.15  # share of floors that are nearly of one colour


FLOWN: Final = RoomPlan(gap_m=0.9, per_m2=(0.2, 0.45), ambient=(0.45, 0.8), plain_floors=0.0)
"""Rooms to fly in: with passages, light, and floors on which odometry works."""


@dataclass(frozen=True)
class Furnisher:
    """Writes a room as a lab folder."""

    folder: Path
    assets: Assets
    rng: np.random.Generator
    plan: RoomPlan

    def write(self) -> Path:
        """Write the room, and return its scene with a landing mark."""
        path = self.folder / SCENES_FOLDER / f"{self.folder.name}.yaml"
        path.parent.mkdir(parents=True, exist_ok=True)
        size_m = [round(float(side), 2) for side in self.rng.uniform(*self.plan.sides_m, 2)]
        kinds = self._kinds()
        room = {
            "ground": {"size_m": size_m, "surface": self._floor()},
            "walls": {
                "height_m": self._drawn(2.4, 3.6),
                "beside_m": 0,
                "surface": self._surface("walls", plain=0.55),
            },
            "light": self._light(size_m),
            "objects": kinds,
        }
        wanted = round(size_m[0] * size_m[1] * float(self.rng.uniform(*self.plan.per_m2)))
        pad_m = [self._drawn(-side / 2 + 0.8, side / 2 - 0.8) for side in size_m]
        pad = {"position_m": pad_m, "yaw_deg": self._drawn(0, 360, None)}
        objects = self._placed(kinds, size_m, pad_m, wanted)
        take_off = {"from": "helipad", "yaw_deg": self._drawn(0, 360, None)}
        scene = {"helipad": pad, "objects": objects, "take_off": take_off}
        for file, content in ((self.folder / LAB_FILE, {**LAB, "room": room}), (path, scene)):
            file.write_text(yaml_text(content), encoding="utf-8")
        return path

    def _drawn(self, low: float, high: float, digits: int | None = 2) -> float:
        return round(float(self.rng.uniform(low, high)), digits)

    def _surface(self, name: str, plain: float) -> dict[str, Any]:
        image = draw_surface(self.assets.photographs, self.rng, plain)
        file = f"{name}.jpg"
        cv2.imwrite(str(self.folder / file), image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 90])
        side_m = round(float(np.exp(self.rng.uniform(np.log(0.4), np.log(2.5)))), 2)
        return {"image": file, "tile_m": [side_m, side_m]}

    def _floor(self) -> dict[str, Any]:
        """Return a floor, with a rug on some."""
        surface = self._surface("floor", plain=self.plan.plain_floors)
        if self.rng.random() < 0.35:
            x, y = self.rng.uniform(-1.0, 1.0, 2).round(2).tolist()
            half_m, angle = 0.5 * self.rng.uniform(1.0, 2.5), self.rng.uniform(0, math.pi)
            right, up = half_m * math.cos(angle), half_m * math.sin(angle)
            ends = [[round(x + sign * right, 2), round(y + sign * up, 2)] for sign in (-1, 1)]
            colour = "#{:02x}{:02x}{:02x}".format(*self.rng.integers(30, 220, 3))
            width_m = self._drawn(0.6, 1.8)
            surface["lines"] = [{"points_m": ends, "width_m": width_m, "colour": colour}]
        return surface

    def _light(self, size_m: list[float]) -> dict[str, Any]:
        lamps = []
        for _ in range(int(self.rng.integers(1, 5))):
            place = [*(self._drawn(-side / 2, side / 2) for side in size_m), self._drawn(2.0, 2.4)]
            lamp = {"position_m": place, "brightness": self._drawn(0.3, 1.2)}
            lamps.append({**lamp, "reach_m": self._drawn(1.5, 6.0, 1)})
        return {"ambient": self._drawn(*self.plan.ambient), "lamps": lamps}

    def _kinds(self) -> dict[str, Any]:
        """Return the kinds of objects of a room: furniture, boxes, tables and racks."""
        models, kinds = self.assets.furniture, dict[str, Any]()
        count = min(len(models), int(self.rng.integers(4, 9)))
        for index in self.rng.choice(len(models), count, replace=False).tolist():
            name = models[index].path.stem.lower()
            (self.folder / f"{name}.obj").write_bytes(models[index].path.read_bytes())
            scale = self.rng.uniform(0.85, 1.15)
            size_m = [round(scale * side, 3) for side in models[index].size_m]
            kinds[f"model_{name}"] = {"shape": "mesh", "file": f"{name}.obj", "size_m": size_m}
        for number in range(int(self.rng.integers(1, 4))):
            shape = str(self.rng.choice(list(SIMPLE)))
            size_m = self.rng.uniform(*SIMPLE[shape]).round(2).tolist()
            if shape == "cylinder":
                size_m[1] = size_m[0]
            kinds[f"part{number}"] = {"shape": shape, "size_m": size_m}
        for name, kind in kinds.items():
            kind |= {"class": "obstacle", "surface": self._surface(f"{name}-look", plain=0.4)}
        return kinds

    def _placed(
        self, kinds: dict[str, Any], size_m: list[float], pad_m: list[float], wanted: int
    ) -> list[dict[str, Any]]:
        """Return objects at places: most along the walls, and the others with gaps between them."""
        rng, circles, objects = self.rng, [(*pad_m, 0.75)], list[dict[str, Any]]()
        names = sorted(kinds)
        for _ in range(TRIES):
            if len(objects) == wanted:
                break
            name = names[int(rng.integers(len(names)))]
            length_m, width_m, _ = kinds[name]["size_m"]
            along = rng.random() < 0.6
            yaw_deg = 90.0 * int(rng.integers(4)) if along else self._drawn(0, 360, None)
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
            gap = 0.0 if along else self.plan.gap_m
            if all(math.dist(place, other[:2]) > radius + other[2] + gap for other in circles):
                circles.append((place[0], place[1], radius))
                spot = [round(each, 3) for each in place]
                objects.append({"kind": name, "position_m": spot, "yaw_deg": yaw_deg})
        return objects


# --- looks of surfaces ----------------------------------------------------------------------------

SIDE_PX: Final = 384
PATCHED: Final = 0.3  # share of the surfaces with rectangles of another look
_Colours = NDArray[np.float32]


def draw_surface(photographs: Sequence[Image], rng: np.random.Generator, plain: float) -> Image:
    """Return a picture that repeats without seams, uint8 RGB; a share is nearly of one colour."""
    image = _base(photographs, rng, plain)
    if rng.random() < PATCHED:  # doors or pictures on a wall, rugs on a floor, labels on a box
        for _ in range(int(rng.integers(1, 4))):
            other = _base(photographs, rng, plain)
            low, high = np.sort(rng.integers(0, SIDE_PX, (2, 2)), axis=0)
            part = (slice(low[0], high[0]), slice(low[1], high[1]))
            image[part] = other[part]
    return np.asarray(np.clip(image, 0, 255), np.uint8)


def _base(photographs: Sequence[Image], rng: np.random.Generator, plain: float) -> _Colours:
    kind = rng.random()
    if kind < plain:
        image = _noise(rng, strength=rng.uniform(1.0, 8.0)) + _colour(rng)
    elif kind < plain + 0.6 * (1.0 - plain):
        image = _photograph(photographs[int(rng.integers(len(photographs)))], rng)
    else:
        image = _PATTERNS[int(rng.integers(len(_PATTERNS)))](rng)
        image = image + _noise(rng, strength=rng.uniform(2.0, 14.0))
    return np.array(image, np.float32)


def _photograph(photograph: Image, rng: np.random.Generator) -> _Colours:
    """Return a mirrored part of a photograph in another tint and contrast."""
    side = int(min(photograph.shape[:2]) * rng.uniform(0.5, 1.0))
    row, column = (int(rng.integers(0, length - side + 1)) for length in photograph.shape[:2])
    part = np.rot90(photograph[row : row + side, column : column + side], int(rng.integers(4)))
    half = cv2.resize(part, (SIDE_PX // 2,) * 2, interpolation=cv2.INTER_AREA).astype(np.float32)
    grey = half.mean(axis=2, keepdims=True)
    # Half of the surfaces keep the photograph's colours.
    keep = 1.0 if rng.random() < 0.5 else rng.uniform(0.0, 0.8)
    tinted = keep * half + (1.0 - keep) * grey * (_colour(rng) / 128.0)
    middle = tinted.mean(axis=(0, 1))
    tinted = middle * rng.uniform(0.6, 1.3) + (tinted - middle) * rng.uniform(0.5, 1.3)
    upper = np.concatenate([tinted, tinted[:, ::-1]], axis=1)
    return np.concatenate([upper, upper[::-1]]).astype(np.float32)


def _colour(rng: np.random.Generator) -> _Colours:
    """Return a colour, (3,); most materials of a room are pale."""
    hsv = (rng.uniform(0, 180), 255 * rng.beta(1.2, 3.0), 255 * rng.beta(2.5, 1.5))
    pixel = cv2.cvtColor(np.array([[hsv]], np.uint8), cv2.COLOR_HSV2RGB)
    return np.asarray(pixel[0, 0], np.float32)


def _noise(rng: np.random.Generator, strength: float) -> _Colours:
    """Return noise of a random grain that repeats, (SIDE_PX, SIDE_PX, 1)."""
    total = np.zeros((SIDE_PX, SIDE_PX), np.float32)
    for cells in (8, 32, 128, SIDE_PX):
        layer = rng.standard_normal((cells, cells)).astype(np.float32) * rng.random()
        wrapped, scale = np.pad(layer, 1, mode="wrap"), SIDE_PX // cells
        large = cv2.resize(wrapped, None, fx=scale, fy=scale, interpolation=cv2.INTER_LINEAR)
        total += large[scale : scale + SIDE_PX, scale : scale + SIDE_PX]
    return np.asarray(strength * total[..., None], np.float32)


def _mixed(share: NDArray[Any], rng: np.random.Generator) -> _Colours:
    first = _colour(rng)
    second = _colour(rng) if rng.random() < 0.4 else first * rng.uniform(0.5, 0.9)
    mix = share.astype(np.float32)[..., None]
    return np.asarray((1.0 - mix) * first + mix * second, np.float32)


def _grid(rng: np.random.Generator) -> _Colours:
    """Return tiles with joints."""
    count, joint = int(rng.choice([1, 2, 3, 4, 6])), rng.uniform(0.01, 0.06)
    at = np.arange(SIDE_PX) / SIDE_PX * count % 1.0
    seam = (at < joint) | (at > 1.0 - joint)
    shade = rng.uniform(-12, 12, (count, count)).astype(np.float32)
    large = np.kron(shade, np.ones((SIDE_PX // count,) * 2, np.float32))
    return _mixed(seam[:, None] | seam, rng) + large[..., None]


def _planks(rng: np.random.Generator) -> _Colours:
    """Return planks of several tones, with grain along them."""
    count = int(rng.choice([4, 6, 8, 12]))
    image = np.zeros((SIDE_PX, SIDE_PX, 3), np.float32) + _colour(rng)
    for band in np.split(image, count):
        cut, (left, right) = int(rng.integers(0, SIDE_PX)), rng.uniform(-22, 22, 2)
        band[:] += np.where(np.arange(SIDE_PX) < cut, left, right)[:, None]
        band[:2] *= 0.6
        band[:, cut : cut + 2] *= 0.6
    noise = rng.standard_normal((SIDE_PX,) * 2).astype(np.float32)
    grain = cv2.GaussianBlur(noise, (0, 0), 8, None, 0.7)
    image += rng.uniform(10, 60) * grain[..., None]
    return np.rot90(image) if rng.random() < 0.5 else image


def _checks(rng: np.random.Generator) -> _Colours:
    count = int(rng.choice([2, 4, 8, 16]))
    small = np.indices((count, count)).sum(axis=0) % 2
    return _mixed(np.kron(small, np.ones((SIDE_PX // count,) * 2)), rng)


def _stripes(rng: np.random.Generator) -> _Colours:
    count, share = int(rng.choice([2, 4, 8, 16])), rng.uniform(0.2, 0.8)
    stripe = np.arange(SIDE_PX) / SIDE_PX * count % 1.0 < share
    image = _mixed(np.tile(stripe, (SIDE_PX, 1)), rng)
    return np.rot90(image) if rng.random() < 0.5 else image


def _speckles(rng: np.random.Generator) -> _Colours:
    """Return the flecks of terrazzo, carpet and chipboard."""
    spots = _noise(rng, 1.0)[..., 0] + rng.standard_normal((SIDE_PX,) * 2).astype(np.float32)
    return _mixed(np.clip(4.0 * (spots - rng.uniform(-0.5, 2.0)), 0.0, 1.0), rng)


_PATTERNS: Final = (_grid, _planks, _planks, _checks, _stripes, _speckles, _speckles)
