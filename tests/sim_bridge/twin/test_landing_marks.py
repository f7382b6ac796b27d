"""Landing marks in the twin: tags and mats are drawn where the scene says."""

from __future__ import annotations

from typing import Any

import pytest

from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from sim_bridge.twin.model import build_model
from sim_bridge.twin.objects import Helipad
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.views import render_views
from tests.paper_lab import paper_map
from tests.sim_bridge.twin.lab_world import lens
from tests.worlds import values
from uav_bt.landing_marks import MarkView
from uav_bt.plugins import make_mark_finder

CAMERA_M = 1.5
KINDS: dict[str, dict[str, Any]] = {
    "apriltag": {"family": "25h9", "id": 3, "size_m": 0.35},
    "aruco": {"id": 3, "size_m": 0.35},
    "region": {},
    "helipad": {},
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("height_m", [0.0, 0.5])
def test_each_kind_is_found_where_it_stands(kind: str, height_m: float) -> None:
    """Two views: from straight above, and from 1.5 m to the south with the drone looking north."""
    size_m, place_m = (0.5, 0.5, height_m), (0.6, -0.4)
    mark = Helipad(position_m=place_m, yaw_deg=20.0, size_m=size_m, kind=kind, options=KINDS[kind])
    poses = [lens(0.6, -0.4, CAMERA_M, 90.0, -90.0), lens(0.6, -1.9, CAMERA_M, 90.0, -40.0)]
    finder, camera = make_mark_finder(mark.mark), anafi_camera(640, 360)
    scene = Scene(name="mark", helipad=mark)
    lab = build_model(scene, drawn=False)
    touched = {lab.contact_name(geom) for geom in range(lab.model.ngeom)}
    assert ("mark" in touched) == (height_m > 0.0), "on a mat the drone stands on the ground"
    views = render_views(scene, poses, truth_size_px=(224, 112))
    for pose, view, ahead_m in zip(poses, views, (0.0, 1.5), strict=True):
        frame = values.frame(view.image, pose.pitch_rad, CAMERA_M)
        class_map = paper_map(ids=view.ids, captured_s=0.0)
        seen = finder.find(MarkView(frame=frame, camera=camera, class_map=class_map))
        assert seen is not None
        place = (seen.forward_m - CAMERA_FORWARD_M, seen.right_m, seen.height_m)
        assert place == pytest.approx((ahead_m, 0.0, height_m), abs=0.04)
        if finder.shows_heading:  # the upper edge is 20 degrees counter-clockwise from north
            assert seen.heading_deg == pytest.approx(20.0, abs=0.5)
