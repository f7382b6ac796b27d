"""The 3D scenes of a record, as Foxglove's messages."""

from __future__ import annotations

import numpy as np

from tests.paper_lab import CLASSES
from tests.worlds.values import corridor
from uav_bt.record.scenes import lab_scene, perceived_scene
from uav_bt.types import MarkFix, Pose
from uav_bt.types.ground import Footprint, Ground, Standing

POSE = Pose(x_m=1.0, y_m=0.0, z_m=1.5, yaw_rad=np.pi / 2)


def test_the_lab_has_a_solid_for_each_object_in_the_colour_of_its_class() -> None:
    outline = Footprint(x_m=1.25, y_m=0.5, half_x_m=0.2, half_y_m=0.2)
    box = Standing(footprint=outline, height_m=1.5, class_id=5)
    empty, one = (
        lab_scene(Ground(size_m=(5.0, 4.0), standing=standing), CLASSES, 0)
        for standing in ((), (box,))
    )
    red = np.float64(CLASSES.colours[5][0] / 255).tobytes()
    assert red in one
    assert np.float64(1.25).tobytes() in one
    assert red not in empty


def test_what_is_perceived_stands_where_the_drone_sees_it() -> None:
    """A mark 1 m ahead of a drone with heading +y lies 1 m up the map."""
    fix = MarkFix(captured_s=0.0, forward_m=0.75, right_m=0.0, height_m=0.4, detected=True)
    both = perceived_scene(POSE, corridor(1.0, "left", nearest_m=0.6), fix, 0)
    assert np.float64(0.75).tobytes() in both
    assert b"left, 0.60 m" in both
    assert b"mark 0.75 m" in both
    assert b"mark" not in perceived_scene(POSE, corridor(1.0), None, 0)
