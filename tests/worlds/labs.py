"""Texts and folders of small labs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

LAB = """\
version: 1
classes:
  wall: {role: outside, colour: "#000000"}
  floor: {role: ground, colour: "#0a0b0c"}
  drum: {role: obstacle, colour: "#ff0000", top: lid}
  lid: {role: obstacle, colour: "#800000"}
"""
HALL = """\
version: 1
classes:
  wall: {role: outside, colour: "#000000"}
  floor: {role: ground, colour: "#0a0b0c"}
  pad: {role: mark, colour: "#ffffff"}
  side: {role: mark, colour: "#ff00ff", top: pad}
  drum: {role: obstacle, colour: "#ff0000", top: lid}
  lid: {role: obstacle, colour: "#800000"}
"""
MARK = "mark: {size_m: [0.6, 0.6], height_m: 0.05, position_m: [1, 0.5]}\n"
SCENE = "helipad: {position_m: [1, 0.5], size_m: [0.6, 0.6, 0.05]}\n"
SITE = """
flight_height_m: 1.2
take_off_surface_m: 0.4
camera: camera.yaml
network: {model: hall.onnx, classes: classes.yaml}
ground: [floor, wall]
limits: {speed_mps: 0.6, ceiling_m: 2}
take_off: {position_m: [-1, 0.5], yaw_deg: 90}
area: "lab:-2,-2; lab:2,-2; lab:2,2; lab:-2,2"
mark: {size_m: [0.6, 0.4], height_m: 0.05, position_m: [1, -1], yaw_deg: 180}
margins: {obstacle_m: 0.5}
battery: {take_off: 0.4, critical: 0.15}
link: {take_off: 0.6}
video: {latency_s: 0.2}
ports: {http: 8080, rtsp: 8554}
return_home: off
"""
"""Every key that says how a place is flown, for a lab file or a site file."""


def lab_folder(folder: Path, text: str = LAB, *, scenes: Sequence[str] = ()) -> Path:
    """Write a lab file and scenes, and return their folder."""
    (folder / "scenes").mkdir(parents=True, exist_ok=True)
    (folder / "lab.yaml").write_text(text, encoding="utf-8")
    for scene in scenes:
        (folder / "scenes" / f"{scene}.yaml").write_text(SCENE, encoding="utf-8")
    return folder


def with_files_of_site(folder: Path) -> Path:
    """Make the files that the keys of `SITE` name."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("camera.yaml", "hall.onnx", "classes.yaml"):
        (folder / name).touch()
    return folder
