"""A lab of every shape for tests of the twin, and scenes in it."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from sim_bridge.twin.flying_body import FlyingBody
from sim_bridge.twin.model import build_model
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene

LAB = """\
version: 1
mark: {size_m: [0.5, 0.5], height_m: 0.2}
classes:
  hall: {role: outside, colour: "#202020"}
  floor: {role: ground, colour: "#808080"}
  pad_top: {role: mark, colour: "#ffffff"}
  pad: {role: mark, colour: "#ffaa00", top: pad_top}
  drum: {role: obstacle, colour: "#0000ff", top: lid}
  table: {role: obstacle, colour: "#00ff00", top: board}
  lid: {role: obstacle, colour: "#000080"}
  board: {role: obstacle, colour: "#008000"}
room:
  ground: {size_m: [6, 4], surface: {generator: concrete}}
  walls: {height_m: 4, beside_m: 0, surface: {colour: "#c0c0c0"}}
  light: {ambient: 0.4, lamps: [{position_m: [-2, 0, 3.8]}]}
  objects:
    drum: {class: drum, shape: cylinder, size_m: [0.6, 0.6, 0.9], surface: {colour: "#3060b0"}}
    crate: {class: drum, shape: box, size_m: [0.6, 0.4, 0.5], surface: {image: wood.png}}
    table: {class: table, shape: table, size_m: [1.0, 0.6, 0.8], surface: {generator: wood}}
    rack: {class: table, shape: rack, size_m: [1.2, 0.4, 2.0], shelves: 3,
      surface: {generator: wood}, frame: {colour: "#303030"}}
    cone:
      class: drum
      shape: mesh
      file: cone.obj
      size_m: [0.6, 0.5, 0.7]
      surface: {colour: "#ff7000"}
      moves: true
"""
FURNITURE = "chair", "round_table", "shelf", "cabinet", "person"
FURNISHED = "\n    ".join(
    [
        LAB.rstrip(),
        *(f"{shape}: {{class: drum, shape: {shape}}}" for shape in FURNITURE),
        "door: {shape: door}",
        "window: {shape: window}\n",
    ]
)
"""The lab with furniture of its usual size and look, a door and a window."""
OUTLINE = "outline_m: [[-3, -2], [3, -2], [3, 0], [0, 0], [0, 2], [-3, 2]]"
L_SHAPED = LAB.replace("size_m: [6, 4]", OUTLINE)
START = "take_off: {from: [-2.5, -1.5]}\n"
CONE = """\
# two closed pieces: a pyramid, and a small one beside it
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0.5 0.5 1
f 4 3 2 1
f 1 2 5
f 2 3 5
f 3 4 5
f 4 1 5
v 1.5 0 0
v 2 0 0
v 1.75 0.5 0
v 1.75 0.2 0.6
f 8 7 6
f 6 7 9
f 7 8 9
f 8 6 9
"""


def write_lab(folder: Path, text: str = LAB) -> Path:
    """Write a lab with its picture and mesh; return its folder."""
    (folder / "scenes").mkdir(parents=True)
    (folder / "lab.yaml").write_text(text, encoding="utf-8")
    (folder / "cone.obj").write_text(CONE, encoding="utf-8")
    picture = np.random.default_rng(0).integers(0, 255, (16, 16, 3), dtype=np.uint8)
    cv2.imwrite(str(folder / "wood.png"), picture)
    return folder


def scene_of(folder: Path, text: str) -> Scene:
    """Return a scene of a lab, written into its folder."""
    path = folder / "scenes" / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return load_scene(path)


def alone(folder: Path, kind: str, *, yaw_deg: float = 20.0) -> Scene:
    """Return a scene with one object in the middle."""
    item = f"{{kind: {kind}, position_m: [0.1, -0.1], yaw_deg: {yaw_deg}}}"
    return scene_of(folder, f"objects: [{item}]\n{START}")


def body_in(scene: Scene) -> FlyingBody:
    """Return the drone's body in a scene, without images."""
    return FlyingBody(build_model(scene, drawn=False), lag_s=0.12)
