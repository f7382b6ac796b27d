"""The check before take-off: all faults in one list, with remedies."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.worlds.tables import cases
from uav_bt.app.assembly import frame_judge
from uav_bt.errors import DroneError
from uav_bt.mission.preflight import LOOK_S, Check, PreflightConfig, check_drone, refuse_faults
from uav_bt.testing import ScriptedDrone
from uav_bt.types import Observation


class Parked(ScriptedDrone):
    """A drone on the ground whose video runs, of images by their time if a function is given."""

    def __init__(
        self,
        image_at: Callable[[float], NDArray[np.float64]] | None = None,
        *,
        frames: bool = True,
        **state: Any,
    ) -> None:
        super().__init__()
        self.live = True
        self._image_at, self._has_frames, self._state = image_at, frames, state

    def observe(self) -> Observation:
        seen = super().observe()
        frame = seen.frame if self._has_frames else None
        if frame is not None and self._image_at is not None:
            image = np.clip(self._image_at(self.clock.now()), 0, 255).astype(np.uint8)
            frame = replace(frame, image=image)
        return Observation(frame=frame, state=replace(seen.state, **self._state))


def faults(drone: Parked, config: PreflightConfig | None = None) -> dict[str, Check]:
    return {check.what: check for check in check_drone(drone, config) if not check.good}


def test_a_good_drone_is_ready_and_gets_no_command() -> None:
    drone = Parked()
    checks = check_drone(drone)
    refuse_faults(checks)
    assert [check.what for check in checks] == [
        *("telemetry", "control", "battery", "link", "video", "self-report")
    ]
    assert drone.commands == []
    assert drone.clock.now() < 1.0
    assert str(checks[2]) == "battery: ok, 100 %, at least 30 % wanted"


@pytest.mark.parametrize(("state", "what", "found"), cases("mission")["preflight"])
def test_each_fault_is_named_with_its_cure(state: dict[str, Any], what: str, found: str) -> None:
    bad = faults(Parked(**state))
    assert list(bad) == [what]
    with pytest.raises(DroneError, match=f"nothing was flown\n  {what}: NOT READY, {found}"):
        refuse_faults(list(bad.values()))


def test_a_link_that_is_not_rated_is_named_and_no_fault() -> None:
    drone = Parked(link=None)
    assert not faults(drone)
    assert "link: ok, its quality is not reported" in [str(each) for each in check_drone(drone)]


def test_all_faults_come_together() -> None:
    bad = faults(Parked(battery=0.0, link=0.0, frames=False, altitude_m=math.nan))
    assert set(bad) == {"battery", "link", "video", "telemetry"}
    assert "its altitude is nan" in bad["telemetry"].found


RANDOM = np.random.default_rng(0)
LAB = RANDOM.integers(60, 180, (4, 7, 3)).repeat(9, axis=0).repeat(10, axis=1)[:, :64]


def noisy(now_s: float) -> NDArray[np.float64]:
    return LAB + RANDOM.normal(0.0, 3.0, LAB.shape)


@pytest.mark.parametrize("dark_from_s", [0.0, 2.0])
def test_images_that_cannot_be_flown_by_are_refused_by_the_judge_of_the_flight(
    dark_from_s: float,
) -> None:
    drone = Parked(lambda now_s: noisy(now_s) * (now_s < dark_from_s))
    judged = check_drone(drone, judge_frame=frame_judge(drone))
    (video,) = (check for check in judged if not check.good)
    assert video.what == "video"
    assert ", the image is dark" in video.found
    assert "the lens is clean and the place is lit" in str(video)


def test_images_that_can_be_flown_by_are_looked_at_for_as_long_as_a_frozen_video_takes() -> None:
    drone = Parked(lambda now_s: noisy(now_s) if now_s > 0.3 else np.zeros((36, 64, 3)))
    refuse_faults(check_drone(drone, judge_frame=frame_judge(drone)))
    assert drone.clock.now() == pytest.approx(LOOK_S, abs=0.2)


def test_frames_of_another_size_than_the_cameras_are_a_fault() -> None:
    drone = Parked(lambda _: np.zeros((18, 32, 3)))
    assert "its image is 32x18, expected 64x36" in faults(drone)["video"].found
