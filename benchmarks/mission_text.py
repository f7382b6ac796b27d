"""Texts of the missions that benchmarks fly."""

from __future__ import annotations


def in_flight(work: str, *, gimbal_deg: int) -> str:
    """Return the text of a tree that takes off and works; it lands at once if that fails.

    Args:
        work: Nodes after the take-off, the landing included.
        gimbal_deg: Pitch of the camera from the take-off on.
    """
    return f"""
<root BTCPP_format="4">
  <BehaviorTree ID="Mission">
    <ReactiveSequence>
      <SubTree ID="Perceive"/>
      <Fallback>
        <Sequence>
          <TakeOff height_m="1.5" gimbal_deg="{gimbal_deg}"/>
          {work}
        </Sequence>
        <EmergencyLand/>
      </Fallback>
    </ReactiveSequence>
  </BehaviorTree>
</root>"""


def cover_or_turn(policy: str = "coverage", *, by_map: bool = True) -> str:
    """Return the node that explores in `trees/survey_and_land.xml`.

    Args:
        policy: that chooses the way.
        by_map: whether it flies by the site map.
    """
    ports = f'policy="{policy}"' + by_map * ' looks_down="true" gives_way="true"'
    return f"""<RetryUntilSuccessful num_attempts="-1"><Fallback>
        <Explore {ports}/><ForceFailure><Avoid {ports}/></ForceFailure>
        </Fallback></RetryUntilSuccessful>"""


def explore_and_come_home(
    *, explore: str, explore_s: int, home: str, gimbal_deg: int, mapper: str = "MapSite"
) -> str:
    """Return the text of a tree file.

    Args:
        explore: the node that explores.
        explore_s: s after which it is halted.
        home: the leaf that flies back to the mark.
        gimbal_deg: where the camera points from the take-off on, deg.
        mapper: the leaf that keeps the site map.
    """
    return f"""
<root BTCPP_format="4">
  <BehaviorTree ID="Mission">
    <ReactiveSequence>
      <Segment/>
      <FindMark/>
      <TrackMotion/>
      <{mapper}/>
      <Fallback>
        <Sequence>
          <TakeOff height_m="1.5" gimbal_deg="{gimbal_deg}"/>
          <ForceSuccess>
            <Timeout msec="{explore_s * 1000}">{explore}</Timeout>
          </ForceSuccess>
          <RetryUntilSuccessful num_attempts="5">
            <Sequence>{home}<HelipadCenter/></Sequence>
          </RetryUntilSuccessful>
          <Land/>
        </Sequence>
        <EmergencyLand/>
      </Fallback>
    </ReactiveSequence>
  </BehaviorTree>
</root>"""
