"""A leaf policy: it decides on one view where to fly next. A node gets it as an object."""

import math

import numpy as np

from uav_bt import app
from uav_bt.answers import Advance, Answer, Blocked
from uav_bt.protocols import PolicyView

MISSION = """
<root BTCPP_format="4">
  <BehaviorTree ID="Look">
    <ReactiveSequence>
      <Segment model="unet"/>
      <FindMark/>
      <TrackMotion/>
      <MapSite/>
      <Sequence>
        <TakeOff height_m="1.5" gimbal_deg="-30"/>
        <ForceSuccess>
          <Timeout msec="15000">
            <KeepRunningUntilFailure>
              <Fallback>
                <Explore/>
                <Avoid/>
              </Fallback>
            </KeepRunningUntilFailure>
          </Timeout>
        </ForceSuccess>
        <ReturnToBase/>
        <HelipadCenter/>
        <Land/>
      </Sequence>
    </ReactiveSequence>
  </BehaviorTree>
</root>
"""


class FollowTheGround:
    """Advance over ground; otherwise turn to the side with more ground."""

    def decide(self, view: PolicyView) -> Answer:
        ground = view.class_map.is_ground
        near = ground[ground.shape[0] // 2 :]
        left, middle, right = (part.mean() for part in np.array_split(near, 3, axis=1))
        if middle > 0.95:
            return Advance(forward_m=0.3, reason="ground")
        clockwise = 1 if right > left else -1
        return Blocked(yaw_rad=clockwise * math.radians(30), reason="no ground")


if __name__ == "__main__":
    options = app.FlightOptions(
        scene="train-b",
        policies={"Explore": FollowTheGround(), "Avoid": FollowTheGround()},
        exact_masks=True,  # the simulator's class maps instead of a network's: faster
        image_size_px=(320, 180),
    )
    report = app.fly(MISSION, options)
    print(report.outcome, f"{report.total_distance_m:.1f} m flown")
