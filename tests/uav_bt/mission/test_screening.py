"""What nobody can fly by: refused before the take-off, and replaced in flight."""

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
from uav_bt.mission.screening import Screening
from uav_bt.testing import ScriptedDrone, blank_frame, pinhole
from uav_bt.types import MeasurementTimes, Observation
from uav_bt.types.drone_state import BodyVelocity, DroneState, FlyingState

CASES = cases("mission")["screening"]["telemetry"]
CAMERA = pinhole()
STATE = DroneState(captured_s=1.0, flying=FlyingState.HOVERING, altitude_m=1.5, height_m=1.5)
HALF = np.zeros((18, 32, 3), np.uint8)


def observed(state: DroneState, *, index: int = 0, **changes: Any) -> Observation:
    frame = blank_frame(CAMERA, STATE, index=index, captured_s=state.captured_s)
    return Observation(frame=replace(frame, **changes), state=state)


@pytest.mark.parametrize(("changes", "why"), CASES)
def test_impossible_telemetry_is_the_last_good_one(changes: dict[str, Any], why: str) -> None:
    screening = Screening(CAMERA)
    screening.usable(observed(STATE), 1.0)
    bad = replace(STATE, **{"captured_s": 1.2, "flying": FlyingState.LANDED, **changes})
    screening.usable(observed(replace(STATE, captured_s=1.1), index=1), 1.1)
    seen = screening.usable(Observation(frame=None, state=bad), 1.2).state
    assert screening.state_fault == why
    assert seen.captured_s == 1.1
    assert (seen.altitude_m, seen.battery, seen.velocity) == (1.5, 1.0, BodyVelocity())
    assert seen.flying is FlyingState.LANDED  # the flying state is always accepted


def test_one_quantity_from_the_future_refuses_the_telemetry() -> None:
    screening = Screening(CAMERA)
    times = replace(MeasurementTimes.all_at(1.0), gimbal_s=9.0)
    screening.usable(Observation(frame=None, state=replace(STATE, measured=times)), 1.0)
    assert screening.state_fault == "its time is 8.0 s in the future"


def test_an_altitude_may_change_by_the_time_between_its_own_measurements() -> None:
    """0.5 s at 4 m/s and 1.6 m of noise: 3.6 m; the attitude's 0.1 s does not count."""
    screening = Screening(CAMERA)
    times = replace(MeasurementTimes.all_at(1.0), altitude_s=0.6)
    screening.usable(
        Observation(frame=None, state=replace(STATE, captured_s=0.6, measured=times)), 1.0
    )
    later = replace(STATE, captured_s=1.1, altitude_m=5.0)
    screening.usable(Observation(frame=None, state=later), 1.1)
    assert screening.state_fault is None


def test_without_any_good_telemetry_it_is_infinitely_old() -> None:
    screening = Screening(CAMERA)
    seen = screening.usable(Observation(frame=None, state=replace(STATE, height_m=math.nan)), 1.0)
    assert seen.state.captured_s == -math.inf
    assert seen.frame is None


@pytest.mark.parametrize("unknown", [None, -0.01, -1.0, math.nan, 1.5])
def test_a_battery_or_link_that_cannot_be_is_unknown(unknown: float | None) -> None:
    """Nothing is steered by them: the rest of the telemetry is used, and a warning names them."""
    screening = Screening(CAMERA)
    reported = replace(STATE, captured_s=1.1, battery=unknown, link=unknown)
    seen = screening.usable(observed(reported), 1.1).state
    assert screening.refused == ()
    assert (seen.battery, seen.link, seen.captured_s) == (None, None, 1.1)
    warned = unknown is not None and not unknown <= 1.0
    assert len(screening.warnings) == 2 * warned
    assert all("taken for unknown" in warning for warning in screening.warnings)
    screening.usable(observed(STATE, index=1), 1.1)
    assert screening.warnings == ()


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"image": HALF}, "its image is 32x18, expected 64x36 as the camera's"),
        ({"image": HALF[:0, :0]}, "its image is 0x0, expected 64x36 as the camera's"),
        ({"gimbal_pitch_rad": math.nan}, "its gimbal pitch is nan"),
        ({"captured_s": 9.0}, "its time is 7.9 s in the future"),
    ],
)
def test_a_frame_that_cannot_be_leaves_the_last_good_one(changes: dict[str, Any], why: str) -> None:
    screening = Screening(CAMERA)
    good = screening.usable(observed(STATE), 1.0).frame
    later = replace(STATE, captured_s=1.1)
    assert screening.usable(observed(later, index=1, **changes), 1.1).frame is good
    assert screening.refused == (f"frame: {why}",)
    assert screening.usable(observed(later, index=2), 1.1).frame is not good
    assert screening.refused == ()


def test_a_frame_older_than_the_last_one_is_not_used() -> None:
    """A link may deliver frames in another order."""
    screening = Screening(CAMERA)
    newest = screening.usable(observed(STATE, index=5), 1.0).frame
    older = observed(replace(STATE, captured_s=0.9), index=4)
    assert screening.usable(older, 1.1).frame is newest


def test_each_image_is_judged_once() -> None:
    asked: list[int] = []

    def judge(frame: Any, _: DroneState) -> str | None:
        asked.append(frame.index)
        return "too dark" if frame.index == 1 else None

    screening = Screening(CAMERA, judge)
    for index in (0, 0, 1, 1, 2):
        seen = screening.usable(observed(STATE, index=index), 1.0)
        assert seen.frame is not None
        assert seen.frame.index == (0 if index == 1 else index)
    assert asked == [0, 1, 2]


# --- before the take-off: all faults in one list, with remedies -----------------------------------


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
def test_images_that_cannot_be_flown_by_are_refused_by_their_judge(dark_from_s: float) -> None:
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
