"""Labels of recorded flights by the teacher."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from uav_bt.learning.teacher import SHIPPED_TEACHER, UNetPlan, label_flights

from perception.segmentation.teacher import Teacher
from sim_bridge.anafi import anafi_camera
from tests.uav_bt.record.footage_world import frame, write_record
from uav_bt.errors import InputError, ValueRangeError

PLAN = UNetPlan()
EVERY_S = 3.0


@pytest.fixture
def record(tmp_path: Path) -> Path:
    """Return a record with 7 s of noise."""
    rng = np.random.default_rng(0)
    images = rng.integers(0, 256, (15, 36, 64, 3), dtype=np.uint8)
    frames = [frame(image, place, 0.5 * place) for place, image in enumerate(images)]
    return write_record(tmp_path / "flight.mcap", anafi_camera(64, 36), frames, [])


def test_images_and_masks_are_of_the_networks_size(record: Path, tmp_path: Path) -> None:
    """The frames have the requested spacing."""
    rgb, ids = label_flights(SHIPPED_TEACHER, [record], PLAN, tmp_path / "labels", every_s=EVERY_S)

    assert len(rgb) == 3  # from 7 s
    assert rgb.shape[1:] == (112, 224, 3)
    assert ids.shape == rgb.shape[:3]
    assert ids.max() <= 16


def test_what_was_labelled_is_kept(
    record: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = label_flights(SHIPPED_TEACHER, [record], PLAN, tmp_path / "labels", every_s=EVERY_S)
    monkeypatch.setattr(Teacher, "refined_ids", None)

    again = label_flights(SHIPPED_TEACHER, [record], PLAN, tmp_path / "labels", every_s=EVERY_S)

    np.testing.assert_array_equal(again[0], first[0])
    np.testing.assert_array_equal(again[1], first[1])


def test_no_flights_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no frame"):
        label_flights(SHIPPED_TEACHER, [], PLAN, tmp_path)


def test_a_time_of_zero_is_refused(record: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueRangeError, match="positive"):
        label_flights(SHIPPED_TEACHER, [record], PLAN, tmp_path, every_s=0.0)
