"""How a place is flown, in its lab file; and the schema of lab files."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from tests.uav_bt.lab.test_lab_file import GOOD, lab_folder
from tests.worlds.tables import cases
from uav_bt.app.site import Site, load_site, site_of_lab
from uav_bt.errors import FileError
from uav_bt.lab.lab_file import lab_schema, read_lab
from uav_bt.lab.shipped import load_lab
from uav_bt.mission.limits import Limits
from uav_bt.types import Pose2D

CASES = cases("labs")

KEYS = """
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


def filled(folder: Path) -> Path:
    """Make the files that the keys name."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("camera.yaml", "hall.onnx", "classes.yaml"):
        (folder / name).touch()
    return folder


def test_a_lab_file_has_the_keys_of_a_site_file(tmp_path: Path) -> None:
    """The same text gives the same site."""
    folder = lab_folder(filled(tmp_path / "hall"), GOOD + KEYS)
    (folder / "site.yaml").write_text(KEYS)
    site = site_of_lab(read_lab(folder))

    assert replace(site, depth=None) == load_site(folder / "site.yaml")
    assert (site.lab, site.file) == ("hall", folder / "lab.yaml")
    assert (site.flight_height_m, site.camera) == (1.2, folder / "camera.yaml")
    assert site.take_off_pose == Pose2D(x_m=-1.0, y_m=0.5, yaw_rad=math.radians(90))
    assert site.mark_pose == Pose2D(x_m=1.0, y_m=-1.0, yaw_rad=math.pi)


def test_a_take_off_without_a_position_is_from_the_mark(tmp_path: Path) -> None:
    """A lab with classes only is a site with the network for any room."""
    assert site_of_lab(read_lab(lab_folder(tmp_path))) == Site(model="any", depth="any")
    text = "mark: {size_m: [1, 1], height_m: 0, position_m: [1, -1]}\ntake_off: {yaw_deg: 90}\n"
    site = site_of_lab(read_lab(lab_folder(tmp_path, GOOD + text)))
    assert site.take_off_pose == Pose2D(x_m=1.0, y_m=-1.0, yaw_rad=math.radians(90))


@pytest.mark.parametrize(("keys", "message"), CASES["refused_keys"])
def test_what_is_wrong_is_named_with_its_line(tmp_path: Path, keys: str, message: str) -> None:
    with pytest.raises(FileError, match=message):
        site_of_lab(read_lab(lab_folder(tmp_path, f"{GOOD}{keys}\n")))


def test_the_papers_lab_states_the_defaults() -> None:
    """Its sections are examples and change no flight; a real drone takes off from its box."""
    stated, usual = site_of_lab(load_lab("paper")), Site(limits=Limits())
    assert stated.take_off_surface_m == 0.4
    for name in ("limits", "clearances", "preflight", "video_latency_s", "area", "ground"):
        assert getattr(stated, name) == getattr(usual, name)


# --- the schema for editors -----------------------------------------------------------------------


def test_the_schema_beside_the_shipped_labs_is_current() -> None:
    """`uav-bt lab schema --out labs/lab.schema.json` writes it."""
    paper = load_lab("paper").file
    assert (paper.parents[1] / "lab.schema.json").read_text() == lab_schema()
    assert paper.read_text().startswith("# yaml-language-server: $schema=../lab.schema.json\n")
