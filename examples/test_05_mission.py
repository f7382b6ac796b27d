"""A test of a mission: scripted leaves, and assertions on the event log."""

from uav_bt.testing import TreeBench, parse_tree
from uav_bt.tree import NodeRegistry, Status

MISSION = """
<root BTCPP_format="4">
  <BehaviorTree ID="Careful">
    <Fallback name="careful">
      <Sequence name="mission">
        <TakeOff/>
        <RetryUntilSuccessful num_attempts="2">
          <ReturnToBase/>
        </RetryUntilSuccessful>
        <Land/>
      </Sequence>
      <EmergencyLand/>
    </Fallback>
  </BehaviorTree>
</root>
"""


def bench(**answers: str) -> TreeBench:
    """Return the mission with scripted leaves: R running, S success, F failure."""
    return parse_tree(MISSION, NodeRegistry.installed(), mocks={"TakeOff": "RS", **answers})


def test_it_lands_at_the_second_attempt() -> None:
    careful = bench(ReturnToBase="RFRS", Land="RS", EmergencyLand="F")
    assert careful.tick_until(Status.SUCCESS, max_ticks=10)
    careful.log.assert_order("ReturnToBase failed", "ReturnToBase succeeded", "Land started")
    careful.log.assert_not_started("EmergencyLand")


def test_it_comes_down_when_the_way_home_is_not_found() -> None:
    careful = bench(ReturnToBase="F", Land="S", EmergencyLand="RF")  # it ends in FAILURE
    assert careful.tick_until(Status.FAILURE, max_ticks=10)
    careful.log.assert_started("ReturnToBase", times=2)
    careful.log.assert_not_started("Land")
    careful.log.assert_failed("EmergencyLand")
