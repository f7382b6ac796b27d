"""Short flights: a landing continues if video or telemetry stops."""

from __future__ import annotations

import pytest

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
        <TakeOff height_m="1.2" gimbal_deg="-30"/> <HoverFor seconds="1"/> <Land/>
      </Sequence>
    </ReactiveSequence>
  </BehaviorTree>
</root>
"""


class Landing:
    """Stores the ticks of the landing phase."""

    def __init__(self) -> None:
        self.ticks: list[TickRecord] = []

    def on_tick(self, record: TickRecord) -> None:
        if record.phase == MissionPhase.LAND:
            self.ticks.append(record)


@pytest.mark.parametrize("fault", ["video-lost@land+2", "late=1@land+2", "no-telemetry@land+2~2"])
def test_a_landing_goes_on_when_data_stop(fault: str) -> None:
    """At 0.5 m the data stop; the drone neither hovers nor waits for their return."""
    plain = app.make_drone(app.FlightOptions(drone="plain", scene="train-a", seed=1))
    drone, landing = FaultyDrone(plain, Fault.parse(fault)), Landing()
    options = app.FlightOptions(
        drone=drone,
        seed=1,
        judge=JudgeConfig(time_limit_s=40.0, land_on=LandOn.ANY),
    )
    report = app.fly(TREE, options, listeners=[lambda _: [landing]])

    assert report.outcome == "success", report.reason
    assert landing.ticks[-1].time_s - landing.ticks[0].time_s < 7.0
    overridden = [tick for tick in landing.ticks if tick.override is not None]
    assert overridden
    assert not any(isinstance(tick.command.movement, Hover) for tick in overridden)
