"""Bad rooms: each is a lab that can be flown in with `any`, and differs from the good room."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.rooms import bad_rooms
from benchmarks.rooms.bad_rooms import CASES, MIRROR_X_M, SIZE_PX, Watch, write_bad_room
from perception.camera.camera_file import load_camera
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.model import build_model
from sim_bridge.twin.scene_file import load_scene
from uav_bt.app.site import network_of
from uav_bt.lab.shipped import load_lab
from uav_bt.testing import Fault


def test_every_bad_room_is_another_lab_that_flies_with_any(tmp_path: Path) -> None:
    found = set()
    for number, case in enumerate(CASES):
        path = write_bad_room(case, tmp_path / str(number))
        scene = load_scene(str(path))
        assert scene.helipad is None
        build_model(scene, drawn=False)
        assert network_of(load_lab(str(path.parents[1])))["model"] == "any"
        faults = tuple(CASES[case].get("faults", ()))
        assert all(map(Fault.parse, faults))
        lab = (path.parents[1] / "lab.yaml").read_bytes()
        found.add((lab, path.read_bytes(), str(CASES[case].get("camera")), faults))
    assert len(found) == len(CASES)


def test_a_mirror_shows_what_stands_before_it(tmp_path: Path) -> None:
    scene = load_scene(str(write_bad_room("mirror", tmp_path / "room")))
    places = {each.spec.position_m for each in scene.placed}
    assert places == {(2 * MIRROR_X_M - x_m, y_m) for x_m, y_m in places}
    assert all(abs(x_m - MIRROR_X_M) > 0.5 for x_m, _ in places)


def test_the_camera_file_is_wrong_by_its_factor(tmp_path: Path) -> None:
    write_bad_room("camera x2", tmp_path / "room")
    camera = load_camera(tmp_path / "room" / bad_rooms.CAMERA_FILE, size_px=SIZE_PX)
    assert camera.fx_px == pytest.approx(2.0 * anafi_camera(*SIZE_PX).fx_px)


def test_shares_of_frames() -> None:
    watch = Watch()
    assert set(watch.shares().values()) == {None}
    watch.trusted_wrong, watch.followed = [False, True, False, False], [True, False]
    assert watch.shares() == {"trusted_wrong": 0.25, "followed": 0.5}
