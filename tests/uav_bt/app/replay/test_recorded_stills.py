"""Replays of flights whose drone's camera took photographs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.worlds.records import NoisyDrone, copy_part, fly_noisy
from uav_bt.app.replay import replay
from uav_bt.app.replay.recorded_stills import RecordedStills
from uav_bt.errors import DroneError, FileError
from uav_bt.protocols import Still, StillState
from uav_bt.record.channels import END
from uav_bt.record.reader import RecordReader

TWICE = (
    "<Sequence><TakeOff/>"
    '<ForceSuccess><TakePhoto label="a"/></ForceSuccess><Turn degrees="30"/>'
    '<ForceSuccess><TakePhoto label="b"/></ForceSuccess><Land/></Sequence>'
)


class SlowCamera:
    """Ends each photograph seven questions after it was asked for: the second one fails."""

    def __init__(self) -> None:
        self.asked = 0
        self.questions = 0

    def take_still(self) -> int:
        self.asked += 1
        self.questions = 0
        return self.asked

    def still(self, number: int) -> Still:
        self.questions += 1
        if self.questions < 7:
            return Still()
        if number == 1:
            return Still(state=StillState.SAVED, media="m1")
        return Still(state=StillState.FAILED, reason="the memory card is full")

    def fetch_still(self, media: str, limit_s: float) -> bytes:
        assert (media, limit_s > 0.0) == ("m1", True)
        return b"\xff\xd8"


class PhotographingDrone(NoisyDrone):
    """A scripted drone whose camera takes photographs."""

    stills = SlowCamera()


@pytest.fixture
def flown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    drone = PhotographingDrone()
    drone.stills = SlowCamera()
    record, report = fly_noisy(tmp_path, monkeypatch, body=TWICE, drone=drone, out=tmp_path / "out")
    assert [photo.camera_media for photo in report.photos] == ["m1", None]
    return record


def test_the_camera_ends_when_it_did_in_the_flight(flown: Path) -> None:
    assert replay(flown).same


def test_a_damaged_report_is_refused(flown: Path, tmp_path: Path) -> None:
    whole = dict(RecordReader(flown).end or {})
    damaged = {END: {**whole, "report": json.dumps({"events": [], "photos": 1})}}
    part = copy_part(flown, tmp_path / "part.mcap", metadata=damaged)
    with pytest.raises(FileError, match="the report in the record is damaged"):
        replay(part)


def test_a_record_hands_out_no_photograph(flown: Path) -> None:
    stills = RecordedStills.of(RecordReader(flown), lambda: 0.0)
    assert stills is not None
    with pytest.raises(DroneError, match="a record has no photograph 'm1'"):
        stills.fetch_still("m1", 1.0)
