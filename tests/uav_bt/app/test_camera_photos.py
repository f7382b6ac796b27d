"""Photographs of the drone's camera are fetched after the landing."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from uav_bt import app
from uav_bt.app.drone_of_flight import RehearsedDrone
from uav_bt.app.flight_outputs import fetch_photos
from uav_bt.board.context import FlightFolder
from uav_bt.errors import DroneError, FileError
from uav_bt.mission.drone_wrapper import DroneWrapper
from uav_bt.protocols import Drone, Photographing, Still, StillCamera, StillState
from uav_bt.testing.drone import ScriptedDrone

JPEG = b"\xff\xd8 a photograph"
MISSION = """<root BTCPP_format="4"><BehaviorTree ID="M"><ReactiveSequence>
<Rules land_on="any"/><Segment/><TrackMotion/><MapSite/>
<Sequence><TakeOff/><TakePhoto label="a"/><TakePhoto label="b"/>
<ForceSuccess><EmergencyLand/></ForceSuccess></Sequence>
</ReactiveSequence></BehaviorTree></root>"""


class Camera:
    """Saves each photograph at once; some are not handed out."""

    def __init__(self) -> None:
        self.taken = 0
        self.lost: set[str] = set()
        self.limits_s: list[float] = []

    def take_still(self) -> int:
        self.taken += 1
        return self.taken

    def still(self, number: int) -> Still:
        return Still(state=StillState.SAVED, media=f"m{number}")

    def fetch_still(self, media: str, limit_s: float) -> bytes:
        self.limits_s.append(limit_s)
        if media in self.lost:
            raise DroneError("its web server answers 404")
        return JPEG


class PhotographingDrone(DroneWrapper):
    """The plain drone with a camera for photographs."""

    def __init__(self, drone: Drone, camera: Camera) -> None:
        super().__init__(drone)
        self._camera = camera

    @property
    def stills(self) -> StillCamera | None:
        return self._camera


def fly(camera: Camera, out: Path) -> app.FlownMission:
    plain = app.make_drone(app.FlightOptions(drone="plain", profile="ideal", scene="val-a"))
    return app.fly(MISSION, drone=PhotographingDrone(plain, camera), out=out)


def test_photographs_are_fetched_into_the_folder_of_the_flight(tmp_path: Path) -> None:
    camera = Camera()
    flown = fly(camera, tmp_path / "out")
    assert [photo.camera_file for photo in flown.photos] == [
        "photo-001-a-camera.jpg",
        "photo-002-b-camera.jpg",
    ]
    for photo in flown.photos:
        assert (tmp_path / "out" / str(photo.camera_file)).read_bytes() == JPEG
    assert flown.lost_outputs == {}
    assert all(0.0 < limit_s <= 35.0 for limit_s in camera.limits_s)


def test_a_photograph_that_is_not_fetched_is_named_in_the_report(tmp_path: Path) -> None:
    camera = Camera()
    camera.lost = {"m1"}
    flown = fly(camera, tmp_path / "out")
    assert flown.outcome == "success"
    (reason,) = flown.lost_outputs.values()
    words = "1 of 2 photographs stay on the drone's memory card (photo-001-a-camera.jpg: media m1)"
    assert f"{words}: its web server answers 404" in reason
    assert (tmp_path / "out" / "photo-002-b-camera.jpg").read_bytes() == JPEG
    assert reason in (tmp_path / "out" / "report.json").read_text().replace("\\", "")
    camera.fetch_still = lambda *_: int("no number")  # type: ignore[method-assign,assignment]
    lost = fly(camera, tmp_path / "other").lost_outputs
    assert lost["camera photographs"].startswith("ValueError: invalid literal")
    report = json.loads((tmp_path / "other" / "report.json").read_text(encoding="utf-8"))
    assert report["lost_outputs"] == lost


def test_wrappers_pass_the_camera_on_and_a_rehearsal_does_not() -> None:
    drone = PhotographingDrone(ScriptedDrone(), Camera())
    outer = DroneWrapper(drone)
    assert isinstance(outer, Photographing)
    assert outer.stills is drone.stills
    assert DroneWrapper(ScriptedDrone()).stills is None
    assert RehearsedDrone(drone).stills is None


def test_of_a_flying_drone_nothing_is_fetched(tmp_path: Path) -> None:
    camera = Camera()
    flown = fly(camera, tmp_path / "out")
    flying = replace(flown, airborne_at_end=True)
    camera.limits_s.clear()
    with pytest.raises(FileError, match=r"2 of 2 .*: the drone is still in the air"):
        fetch_photos(flying, camera, FlightFolder(tmp_path / "other"))
    assert camera.limits_s == []
