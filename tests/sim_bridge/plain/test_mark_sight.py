"""Sights of a landing mark without images are those of a finder in the drawn image."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_bridge.anafi import anafi_camera
from sim_bridge.plain.caster import Caster
from sim_bridge.plain.sight import SIZE_PX, see_mark
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import Helipad, ObjectSpec
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.views import render_views
from tests.sim_bridge.twin.lab_world import lens
from tests.worlds import values
from uav_bt.landing_marks import MarkSighting, MarkView
from uav_bt.plugins import make_mark_finder

KIND = {"kind": "apriltag", "options": {"id": 7, "size_m": 0.3}}
TAG = Helipad(position_m=(1.0, 0.5), yaw_deg=20.0, size_m=(0.5, 0.5, 0.2), **KIND)
COVER = ObjectSpec(kind="box-1", position_m=(0.0, 0.5), size_m=(0.3, 0.4, 1.4))
ROOM = Scene(name="mark", helipad=TAG, objects=(COVER,))
BESIDE = (2.4, -0.6, 1.5, 140.0, -38.0)


def sighted(camera: CameraPose, seed: int = 0) -> MarkSighting | None:
    _, depth_m = Caster(ROOM, SIZE_PX).cast(camera)
    return see_mark(TAG, camera, depth_m, np.random.default_rng(seed))


@pytest.mark.parametrize(
    ("at", "visible"),
    [
        (BESIDE, True),
        ((1.2, -1.2, 1.3, 95.0, -30.0), True),
        ((1.0, 0.4, 2.0, 20.0, -90.0), True),
        ((2.4, -0.6, 1.5, -40.0, -38.0), False),  # behind
        ((2.4, -0.6, 1.5, 140.0, 0.0), False),  # below the view
        ((-0.88, -0.18, 0.35, 20.0, -5.0), False),  # too flat
        ((-1.0, 0.5, 1.0, 0.0, -20.0), False),  # behind the box
    ],
)
def test_a_mark_is_sighted_as_a_finder_sees_it_in_the_image(
    at: tuple[float, float, float, float, float], *, visible: bool
) -> None:
    camera = lens(*at)
    (view,) = render_views(ROOM, [camera])
    frame = values.frame(view.image, camera.pitch_rad, camera.z_m)
    found = make_mark_finder(TAG.mark).find(MarkView(frame=frame, camera=anafi_camera(640, 360)))
    seen = sighted(camera)
    assert (found is not None) == (seen is not None) == visible
    if found and seen:
        for name in ("forward_m", "right_m", "height_m"):
            assert getattr(seen, name) == pytest.approx(getattr(found, name), abs=0.08)
        off_deg = math.remainder(seen.heading_deg - found.heading_deg, 360.0)
        assert off_deg == pytest.approx(0.0, abs=2)


def test_sightings_have_the_stated_errors() -> None:
    """Of a tag of full confidence: 0.3 degrees of heading, and a hundredth of the range."""
    found = [sighted(lens(*BESIDE), seed) for seed in range(300)]
    headings, ranges_m = np.array([(each.heading_deg, each.range_m) for each in found]).T
    assert {each.confidence for each in found} == {1.0}
    assert np.std(headings) == pytest.approx(0.3, rel=0.15)
    assert np.std(ranges_m) / np.mean(ranges_m) == pytest.approx(0.01, rel=0.15)
