"""A mission composed in Python: find the mark, and land on it."""

from behaviours.fly.helipad_center import HelipadCenter
from behaviours.fly.land import Land
from behaviours.fly.take_off import TakeOff
from behaviours.perceive.class_map import FindMark, Segment
from behaviours.perceive.site_map import MapSite, TrackMotion
from uav_bt import app
from uav_bt.tree import MissionTree, shipped_subtree
from uav_bt.tree.nodes import ReactiveSequence, RetryUntilSuccessful, Sequence


def mission() -> MissionTree:
    """Return the mission; perception comes first, so that it is ticked every time."""
    landing = Sequence("landing", [shipped_subtree("ReturnToBase"), HelipadCenter(), Land()])
    return MissionTree(
        ReactiveSequence(
            "perceive and act",
            [
                Segment(model="unet"),
                FindMark(),
                TrackMotion(),
                MapSite(),
                Sequence(
                    "mission",
                    [
                        TakeOff(height_m=1.5, gimbal_deg=-30.0),
                        RetryUntilSuccessful("try again", landing, num_attempts=3),
                    ],
                ),
            ],
        ),
        name="Landing",
    )


if __name__ == "__main__":
    options = app.FlightOptions(scene="train-a", exact_masks=True, image_size_px=(320, 180))
    report = app.fly(mission(), options)
    assert report.landing_error_m is not None
    print(report.outcome, f"{100 * report.landing_error_m:.0f} cm from the middle of the pad")
