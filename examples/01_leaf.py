"""A leaf of your own, flown without a package."""

from uav_bt import app
from uav_bt.board import STATE
from uav_bt.tree import Leaf, NodeRegistry, Port, Status

MISSION = """
<root BTCPP_format="4">
  <BehaviorTree ID="Hop">
    <Sequence>
      <BatteryAbove share="0.3"/>
      <TakeOff height_m="1.0"/>
      <Land/>
    </Sequence>
  </BehaviorTree>
</root>
"""


class BatteryAbove(Leaf):
    """SUCCESS while the battery holds more than a share of its charge."""

    condition = True  # answers at once, never RUNNING
    ports = (Port("share", float, default=0.5, doc="of a full battery, 0 to 1"),)
    reads = (STATE,)

    def update(self) -> Status:
        state = self.read(STATE).value  # None when the newest telemetry is too old
        above = state is not None and state.battery > self.port_value("share")
        return Status.SUCCESS if above else Status.FAILURE


if __name__ == "__main__":
    report = app.fly(MISSION, registry=NodeRegistry.installed().with_nodes(BatteryAbove))
    print(report.outcome, f"after {report.duration_s:.0f} s")
