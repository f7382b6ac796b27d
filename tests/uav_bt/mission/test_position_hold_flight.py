"""Short flights of the twin: the position is held by the camera's view of the ground."""

from __future__ import annotations

import math

import pytest

from sim_bridge.anafi import CAMERA_FORWARD_M
from uav_bt import app
from uav_bt.mission.judge import JudgeConfig
from uav_bt.mission.tick import TickRecord
from uav_bt.testing import Fault, FaultyDrone
from uav_bt.types import MissionPhase
from uav_bt.types.mission_rules import LandOn

pytestmark = pytest.mark.flight

TREE = """
<root BTCPP_format="4">
  <BehaviorTree ID="Mission">
    <ReactiveSequence>
      <Segment/> <TrackMotion/> <MapSite/>
      <Sequence>
        <TakeOff height_m="1.2" gimbal_deg="-30"/> <HoverFor seconds="10"/> <Land/>
      </Sequence>
    </ReactiveSequence>
  </BehaviorTree>
</root>
"""


class Places:
    """Records the true position while the drone hovers, and at the end."""

    def __init__(self) -> None:
        self.hovering: list[tuple[float, float]] = []
        self.last = (0.0, 0.0)

    def on_tick(self, record: TickRecord) -> None:
        assert record.truth is not None
        self.last = record.truth.pose.x_m, record.truth.pose.y_m
        if record.phase == MissionPhase.HOVER:
            self.hovering.append(self.last)


@pytest.mark.parametrize("fault", ["drift=0.1@hover", "velocity-bias=-0.2@hover"])
def test_a_fault_of_the_velocity_moves_the_drone_by_decimetres_only(fault: str) -> None:
    """In 10 s the drift alone would be 1 m, and in the descent another 0.2 m."""
    twin = app.make_drone(app.FlightOptions(scene="train-a", seed=1, image_size_px=(160, 90)))
    drone, places = FaultyDrone(twin, Fault.parse(fault)), Places()
    options = app.FlightOptions(
        drone=drone,
        seed=1,
        exact_masks=True,
        judge=JudgeConfig(time_limit_s=40.0, land_on=LandOn.ANY),
    )
    report = app.fly(TREE, options, listeners=[lambda _: [places]])

    assert report.outcome == "success", report.reason
    assert len(places.hovering) > 90
    assert max(math.dist(place, places.hovering[0]) for place in places.hovering) < 0.3
    assert math.dist(places.hovering[-1], places.hovering[0]) < 0.15
    # Before the descent it moves the body to the camera's position.
    moved_m = math.dist(places.last, places.hovering[-1])
    assert moved_m == pytest.approx(CAMERA_FORWARD_M, abs=0.13)
    assert len(report.warnings) == 1
    assert "velocity" in report.warnings[0]
