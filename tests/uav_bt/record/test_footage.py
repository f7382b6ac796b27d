"""Content of a record for perception and training."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.worlds.footage import LAB_CLASSES, state
from uav_bt.answers import Advance, Answer, Blocked, Done, FollowLeg, Rotate
from uav_bt.errors import FileError
from uav_bt.protocols import Advice
from uav_bt.record import channels
from uav_bt.record.channels import START
from uav_bt.record.reader import RecordReader, footage
from uav_bt.record.record_file import RecordFile
from uav_bt.record.values import dump, encode
from uav_bt.types import CameraModel

CAMERA = CameraModel(width_px=32, height_px=18, fx_px=25.0, fy_px=25.0, cx_px=15.5, cy_px=8.5)
SEEN = {
    "frame_index": 3,
    "captured_s": 0.3,
    "x_m": 0.1,
    "y_m": 0.0,
    "yaw_rad": 0.2,
    "height_above_ground_m": 1.5,
    "gimbal_pitch_rad": -0.5,
    "turning": 0,
    "full_turns": 0,
}


def record_of(path: Path, advice: dict[str, Any]) -> RecordReader:
    """Return a record with one message of advice."""
    file = RecordFile(path)
    file.metadata(
        START,
        {
            "schema_version": str(channels.SCHEMA_VERSION),
            "start_ns": "0",
            "start_s": "0.0",
            "camera_model": dump(encode(CAMERA)).decode(),
            "classes": LAB_CLASSES,
        },
    )
    file.write(channels.STATE, 0, dump(encode(state(0.0))))
    file.write(channels.ADVICE, 300_000_000, dump(advice))
    file.finish()
    return RecordReader(path)


def advice_in(reader: RecordReader) -> list[Advice]:
    return [item for item in footage(reader) if isinstance(item, Advice)]


@pytest.mark.parametrize(
    "answer",
    [
        Advance(forward_m=0.7, free_m=0.9, reason="clear"),
        FollowLeg(yaw_rad=0.1, speed_mps=0.4),
        Rotate(yaw_rad=-2.0, reason="looks"),
        Blocked(yaw_rad=0.5, ground_ends=True),
        Done(reason="covered"),
    ],
)
def test_every_answer_comes_back_from_a_record(tmp_path: Path, answer: Answer) -> None:
    given = Advice(**SEEN, answer=answer, fresh=Blocked(yaw_rad=-0.5))  # type: ignore[arg-type]
    reader = record_of(tmp_path / "now.mcap", encode(given))
    assert advice_in(reader) == [given]


def test_damaged_advice_is_named(tmp_path: Path) -> None:
    reader = record_of(tmp_path / "now.mcap", {**SEEN, "answer": {"type": "Advance"}})
    with pytest.raises(FileError, match=r"a message of the record is damaged"):
        advice_in(reader)
