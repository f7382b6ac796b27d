"""The check before take-off: everything that is wrong, in one list, with what to do."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from uav_bt.clock import ManualClock
from uav_bt.errors import DroneError, ValueRangeError
from uav_bt.mission.preflight import Check, PreflightConfig, check_drone, refuse_faults
from uav_bt.types import (
    CameraModel,
    Command,
    DroneFault,
    DroneState,
    FlyingState,
    Frame,
    Observation,
)


class Parked:
    """A drone on the ground whose video runs."""

    def __init__(self, *, frames: bool = True, silent: bool = False, **state: Any) -> None:
        self.clock = ManualClock()
        self._frames, self._silent, self._state = frames, silent, state
        self._count = 0
        self.told: list[Command] = []

    referee = None
    camera = CameraModel(width_px=64, height_px=36, fx_px=50, fy_px=50, cx_px=32, cy_px=18)

    def connect(self) -> None:
        return

    def disconnect(self) -> None:
        return

    def send(self, command: Command) -> Command:
        self.told.append(command)
        return command

    def observe(self) -> Observation:
        now_s = self.clock.now()
        state = DroneState(captured_s=-100.0 if self._silent else now_s, flying=FlyingState.LANDED)
        frame = None
        if self._frames:
            image = np.zeros((36, 64, 3), np.uint8)
            frame = Frame(image=image, index=self._count, captured_s=now_s, gimbal_pitch_rad=0.0)
            self._count += 1
        return Observation(frame=frame, state=replace(state, **self._state))


DARK = DroneFault(what="light", found="too dark", remedy="switch lights on")


def faults(drone: Parked, config: PreflightConfig | None = None) -> dict[str, Check]:
    return {check.what: check for check in check_drone(drone, config) if not check.good}


def test_a_good_drone_is_ready_and_was_told_nothing() -> None:
    drone = Parked()
    checks = check_drone(drone)
    refuse_faults(checks)
    assert [check.what for check in checks] == [
        *("telemetry", "control", "battery", "link", "video", "self-report")
    ]
    assert drone.told == []
    assert drone.clock.now() < 1.0
    assert str(checks[2]) == "battery: ok, 100 %, at least 30 % wanted"


@pytest.mark.parametrize(
    ("drone", "what", "found"),
    [
        (Parked(battery=0.2), "battery", "20 %, at least 30 % wanted: charge it"),
        (Parked(link=0.2), "link", "20 %, at least 40 % wanted: come nearer"),
        (Parked(flying=FlyingState.HOVERING), "control", "the drone is hovering: .*land it first"),
        (Parked(pilot_has_control=True), "control", "a pilot has it: hand over"),
        (Parked(frames=False), "video", "no frame within 5 s: see that no firewall"),
        (Parked(silent=True), "telemetry", "last heard 105.. s ago: connect again"),
        (Parked(connected=False), "telemetry", "last heard .* and the connection is broken"),
        (Parked(battery=None), "battery", "not reported within 5 s, at least 30 % wanted"),
        (Parked(faults=(DARK,)), "light", "too dark: switch lights on"),
    ],
    ids=[
        *("battery", "link", "flying", "pilot", "no video", "silent", "broken"),
        *("battery unknown", "self-report"),
    ],
)
def test_each_fault_is_named_with_its_cure(drone: Parked, what: str, found: str) -> None:
    bad = faults(drone)
    assert list(bad) == [what]
    with pytest.raises(DroneError, match=f"nothing was flown\n  {what}: NOT READY, {found}"):
        refuse_faults(list(bad.values()))


def test_a_link_that_is_not_rated_is_said_and_no_fault() -> None:
    drone = Parked(link=None)
    assert not faults(drone)
    assert "link: ok, its quality is not reported" in [str(each) for each in check_drone(drone)]


def test_all_faults_come_together() -> None:
    assert set(faults(Parked(battery=0.0, link=0.0, frames=False))) == {"battery", "link", "video"}


def test_a_video_that_stands_still_is_a_fault() -> None:
    class Stuck(Parked):
        def observe(self) -> Observation:
            self._count = 0
            return super().observe()

    assert "1 frames seen" in faults(Stuck())["video"].found


def test_waiting_is_bounded() -> None:
    drone = Parked(frames=False)
    check_drone(drone, PreflightConfig(wait_s=2.0))
    assert drone.clock.now() == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize("changes", [{"battery": 1.5}, {"link": -0.1}, {"wait_s": 0.0}])
def test_absurd_demands_are_refused(changes: dict[str, float]) -> None:
    with pytest.raises(ValueRangeError, match="shares from 0 to 1"):
        PreflightConfig(**changes)
