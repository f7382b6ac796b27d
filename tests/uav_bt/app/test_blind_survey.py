"""A survey without ground in view: it warns, stays in place, and lands there."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from sim_bridge.plain import PlainConfig
from tests.paper_lab import BACKGROUND
from uav_bt import app
from uav_bt.mission.drone_wrapper import DroneWrapper
from uav_bt.protocols import Referee
from uav_bt.types import Frame, Truth
from uav_bt.types.ground import Ground

pytestmark = pytest.mark.flight


class GroundlessReferee:
    """A referee whose class ids are background everywhere."""

    def __init__(self, referee: Referee) -> None:
        self._referee = referee

    def truth(self) -> Truth:
        return self._referee.truth()

    def ground(self) -> Ground | None:
        return self._referee.ground()

    def class_ids(self, _: Frame, width_px: int, height_px: int) -> NDArray[np.uint8]:
        return np.full((height_px, width_px), BACKGROUND, dtype=np.uint8)

    def depth(self, frame: Frame, width_px: int, height_px: int) -> NDArray[np.float32]:
        return self._referee.depth(frame, width_px, height_px)


class OverUnknownGround(DroneWrapper):
    """A drone over a floor that is not ground in any mask."""

    @property
    def referee(self) -> Referee | None:
        inner = self._drone.referee
        return None if inner is None else GroundlessReferee(inner)


def test_a_survey_without_ground_lands_where_it_is() -> None:
    drone = OverUnknownGround(PlainConfig(seed=1).create())
    options = app.FlightOptions(drone=drone, seed=1, exact_masks=True)
    report = app.fly("survey_and_land", options)

    assert report.outcome == "aborted"
    assert report.reason.startswith("no ground in view for 30 s")
    assert any("no ground in view" in warning for warning in report.warnings)
    assert not report.airborne_at_end
    assert np.hypot(*(report.path[:, 1:3] - report.path[0, 1:3]).T).max() < 1.0
