"""A mapper and its views, for the tests of the site map."""

import math

import numpy as np
from numpy.typing import NDArray

from perception.mapping.landmarks import Landmarks
from perception.mapping.site_mapper import SiteMapper
from perception.mapping.view import View
from sim_bridge.anafi import anafi_camera
from tests.paper_lab import paper_map
from tests.worlds import values
from uav_bt.types.dead_reckoning import OdometryPose
from uav_bt.types.site_map import SiteMap


def points(*xy_m: tuple[float, float], weight: float = 1.0, class_id: int = 4) -> Landmarks:
    """Return points seen once from the origin."""
    zeros = np.zeros(len(xy_m))
    return Landmarks(
        xy_m=np.array(xy_m),
        weight=zeros + weight,
        from_m=np.zeros((len(xy_m), 2)),
        ids=np.full(len(xy_m), class_id, dtype=np.uint8),
        **dict.fromkeys(("first_s", "seen_s", "settled_s", "missed"), zeros),
    )


CAMERA = anafi_camera(640, 360).resized(224, 112)
PITCH_RAD = math.radians(-42)
HEIGHT_M = 1.5
AT_START = OdometryPose(time_s=0.0, x_m=0.0, y_m=0.0, yaw_rad=0.0)


def look(
    mapper: SiteMapper,
    ids: NDArray[np.uint8],
    pose: OdometryPose,
    pitch_rad: float = PITCH_RAD,
    height_m: float = HEIGHT_M,
) -> SiteMap:
    """Let the mapper take in a frame that was captured at a dead-reckoned pose."""
    frame = values.frame((4, 8), pitch_rad, height_m, captured_s=pose.time_s)
    mapper.follow(values.motion(pose))
    mapper.add(View.of(paper_map(ids=ids, captured_s=pose.time_s), frame, CAMERA, pose))
    return mapper.map(values.motion(pose))
