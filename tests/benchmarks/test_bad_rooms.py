"""Bad rooms: each is a lab that can be flown in with `any`, and differs from the good room."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.rooms.bad_flights import followed_share, share_of
from benchmarks.rooms.bad_rooms import (
    BAD_ROOMS,
    CAMERA_FILE,
    MIRROR_X_M,
    SIZE_PX,
    BadRoom,
    table,
    write_bad_room,
)
from perception.camera.camera_file import load_camera
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.model import build_model
from sim_bridge.twin.scene_file import load_scene
from uav_bt.app.lab_network import network_of
from uav_bt.lab.shipped import load_lab
from uav_bt.testing import Fault


def named(name: str) -> BadRoom:
    return next(each for each in BAD_ROOMS if each.name == name)


@pytest.mark.parametrize("room", BAD_ROOMS, ids=lambda room: room.name)
def test_a_bad_room_is_a_lab_that_flies_with_any(room: BadRoom, tmp_path: Path) -> None:
    path = write_bad_room(room, tmp_path / "room")
    scene = load_scene(str(path))
    assert scene.helipad is None
    build_model(scene, drawn=False)
    assert network_of(load_lab(str(tmp_path / "room")))["model"] == "any"
    assert all(Fault.parse(text) for text in room.faults)


def test_every_bad_room_differs_from_the_good_one(tmp_path: Path) -> None:
    texts = set()
    for number, room in enumerate(BAD_ROOMS):
        path = write_bad_room(room, tmp_path / str(number))
        lab = (path.parents[1] / "lab.yaml").read_text(encoding="utf-8")
        texts.add((lab, path.read_text(encoding="utf-8"), room.focal, room.faults))
    assert len(texts) == len(BAD_ROOMS)


def test_a_mirror_shows_what_stands_before_it(tmp_path: Path) -> None:
    scene = load_scene(str(write_bad_room(named("mirror"), tmp_path / "room")))
    places = {each.spec.position_m for each in scene.placed}
    assert places == {(2 * MIRROR_X_M - x_m, y_m) for x_m, y_m in places}
    assert all(abs(x_m - MIRROR_X_M) > 0.5 for x_m, _ in places)


def test_the_camera_file_is_wrong_by_its_factor(tmp_path: Path) -> None:
    write_bad_room(named("camera x2"), tmp_path / "room")
    camera = load_camera(tmp_path / "room" / CAMERA_FILE, size_px=SIZE_PX)
    assert camera.fx_px == pytest.approx(2.0 * anafi_camera(*SIZE_PX).fx_px)


def test_depth_is_trusted_and_wrong_or_doubted() -> None:
    frames = [
        {"confidence": 0.9, "off": 0.0},
        {"confidence": 0.9, "off": -0.3},
        {"confidence": 0.4, "off": 0.3},
        {"time_s": 1.0},
        {"confidence": 0.3, "off": 0.0},
    ]
    assert share_of(frames, trusted=True) == 0.25
    assert share_of(frames, trusted=False) == 0.5
    assert share_of([{"time_s": 1.0}], trusted=True) is None


def test_only_frames_with_ground_count_as_followed_or_not() -> None:
    frames = [
        {"ground": 0.5, "followed": 1.0},
        {"ground": 0.5, "followed": 0.0},
        {"ground": 0.1, "followed": 0.0},
        {"time_s": 1.0},
    ]
    assert followed_share(frames) == 0.5
    assert followed_share(frames[2:]) is None


def test_the_table_has_a_line_for_each_flight() -> None:
    flight = {
        "case": "dark",
        "seed": 0,
        "outcome": "aborted",
        "reason": "no usable frame",
        "contacts": {},
        "duration_s": 21.04,
        "covered": None,
        "drift_m": 0.123,
        "trusted_wrong": 0.0,
        "doubted": 0.5,
        "followed": 0.92,
    }
    line = table([flight]).splitlines()[-1]
    cells = "dark | 0 | aborted | no usable frame | none | 21 |  | 0.12 | 0.0% | 50.0% | 92%"
    assert line == f"| {cells} |"
