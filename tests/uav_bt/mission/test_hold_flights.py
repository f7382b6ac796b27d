"""Short flights: a drone that drifts hardly moves, and a landing goes on when data stop."""

from __future__ import annotations

import math

import pytest

from sim_bridge.anafi import CAMERA_FORWARD_M
from uav_bt import app
from uav_bt.mission.judge import JudgeConfig
from uav_bt.mission.tick import TickRecord
from uav_bt.testing import Fault, FaultyDrone
from uav_bt.types import Hover, MissionPhase
from uav_bt.types.mission_rules import LandOn

pytestmark = pytest.mark.flight

TREE = """
<root BTCPP_format="4">
  <BehaviorTree ID="Mission">
    <ReactiveSequence>
      <Segment/> <TrackMotion/> <MapSite/>
      <Sequence>
        <TakeOff height_m="1.2" gimbal_deg="-30"/> <HoverFor seconds="{seconds}"/> <Land/>
      </Sequence>
    </ReactiveSequence>
  </BehaviorTree>
</root>
"""


class Ticks(list[TickRecord]):
    def on_tick(self, record: TickRecord) -> None:
        self.append(record)


def fly(drone: str, fault: str, seconds: int) -> tuple[app.FlownMission, Ticks]:
    """Fly a hover and a landing with a fault."""
    size = {"image_size_px": (160, 90)} if drone == "twin" else {}
    made = app.make_drone(app.FlightOptions(drone=drone, scene="train-a", seed=1, **size))
    ticks, judge = Ticks(), JudgeConfig(time_limit_s=40.0, land_on=LandOn.ANY)
    options = app.FlightOptions(
        drone=FaultyDrone(made, Fault.parse(fault)),
        seed=1,
        judge=judge,
        exact_masks=drone == "twin",
    )
    report = app.fly(TREE.format(seconds=seconds), options, listeners=[lambda _: [ticks]])
    assert report.outcome == "success", report.reason
    return report, ticks


@pytest.mark.parametrize("fault", ["video-lost@land+2", "late=1@land+2", "no-telemetry@land+2~2"])
def test_a_landing_goes_on_when_data_stop(fault: str) -> None:
    """At 0.5 m the data stop; the drone neither hovers nor waits for their return."""
    _, ticks = fly("plain", fault, 1)
    landing = [tick for tick in ticks if tick.phase == MissionPhase.LAND]
    assert landing[-1].time_s - landing[0].time_s < 7.0
    overridden = [tick for tick in landing if tick.override is not None]
    assert overridden
    assert not any(isinstance(tick.command.movement, Hover) for tick in overridden)


@pytest.mark.parametrize("fault", ["drift=0.1@hover", "velocity-bias=-0.2@hover"])
def test_a_fault_of_the_velocity_moves_the_drone_by_decimetres_only(fault: str) -> None:
    """In 10 s the drift alone would be 1 m, and in the descent another 0.2 m."""
    report, ticks = fly("twin", fault, 10)
    places = [
        (tick.phase, (tick.truth.pose.x_m, tick.truth.pose.y_m)) for tick in ticks if tick.truth
    ]
    hovering = [place for phase, place in places if phase == MissionPhase.HOVER]
    assert len(hovering) > 90
    assert max(math.dist(place, hovering[0]) for place in hovering) < 0.3
    assert math.dist(hovering[-1], hovering[0]) < 0.15
    # Before the descent it moves the body to the camera's position.
    moved_m = math.dist(places[-1][1], hovering[-1])
    assert moved_m == pytest.approx(CAMERA_FORWARD_M, abs=0.13)
    assert len(report.warnings) == 1
    assert "velocity" in report.warnings[0]
