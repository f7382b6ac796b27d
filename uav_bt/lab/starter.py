"""The lab file that a new place begins with."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from uav_bt.errors import FileError, InputError
from uav_bt.files import writing
from uav_bt.lab.lab import LAB_FILE, check_lab_name
from uav_bt.lab.shipped import shipped_labs

STARTER: Final = """\
# A place to fly in. docs/labs.md explains every key; `uav-bt lab schema --out labs/lab.schema.json`
# lets editors complete and check this file.
# yaml-language-server: $schema=../lab.schema.json
version: 1

# What stands there. The order gives the class ids. Roles: ground is flown over, obstacle is kept
# away from, mark is landed on, outside is everything beyond the ground.
classes:
  outside: {role: outside, colour: "#282830"}
  floor: {role: ground, colour: "#7e9e78"}
  pad: {role: mark, colour: "#ffffff"}
  obstacle: {role: obstacle, colour: "#d62728"}

# The landing mark: an AprilTag with a side of 0.4 m on a mat. docs/landing-marks.md has others.
mark:
  kind: apriltag
  size_m: [0.5, 0.5]       # of the surface that the drone lands on, along its x and y
  height_m: 0.0            # of that surface above the ground
  options: {family: 36h11, id: 7, size_m: 0.4}
  # position_m: [1.5, 1.0] # in the drawing of the place, with yaw_deg: for places such as lab:1,2
  # yaw_deg: 90

# How it is flown. Without these keys the mission file and the drone decide.
# flight_height_m: 1.2     # above the ground
limits: {speed_mps: 0.6, ceiling_m: 2.0}
# margins: {obstacle_m: 0.5, edge_m: 0.4}
# take_off: {position_m: [-1.5, -1.0], yaw_deg: 45}
# area: "lab:-3,-2; lab:3,-2; lab:3,2; lab:-3,2"   # that every mission stays in

# Networks and camera, as files in this folder. `uav-bt lab train` writes segmentation.onnx, with
# which the place is flown unless this file states a network.
# network: {model: other.onnx, classes: other-classes.yaml}
# camera: camera.yaml      # of `uav-bt lab calibrate`
"""


def write_lab(name: str, folder: Path) -> Path:
    """Write the commented lab file of a new place into the folder of the labs; return its path."""
    check_lab_name(name)
    if name in shipped_labs():
        raise InputError(f"a lab '{name}' ships with uav-bt: choose another name")
    path = folder / name / LAB_FILE
    if path.parent.exists():
        raise FileError(path.parent, "exists: choose another name, or edit its lab.yaml")
    with writing(path):
        path.parent.mkdir(parents=True)
        path.write_text(STARTER, encoding="utf-8")
    return path
