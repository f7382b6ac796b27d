"""Boxes that show their roof but not their base: shape from geometry, height from a network."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.camera.ground_plane import CameraView, GroundPlane
from perception.depth.contact.depth import ContactDepth, ContactDepthConfig, ContactEstimation
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import BoxSpec, Helipad
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.views import View, render_views
from tests.paper_lab import BOXES, ROOFS, paper_map
from uav_bt.errors import ShapeError

SIZE = (224, 112)
CAMERA = anafi_camera(640, 360).resized(*SIZE)
VIEW = CameraView(camera=CAMERA, pitch_rad=math.radians(-28.0), height_m=1.5)
CONFIG = ContactDepthConfig()


def look(*boxes: BoxSpec) -> View:
    """Draw boxes from 1.5 m above (-1, 0), looking along x."""
    pose = CameraPose(x_m=-1.0, y_m=0.0, z_m=1.5, yaw_rad=0.0, pitch_rad=VIEW.pitch_rad)
    scene = Scene(name="near", helipad=Helipad(position_m=(-2.0, -1.5)), boxes=boxes)
    (drawn,) = render_views(scene, [pose], size_px=(160, 90), truth_size_px=SIZE)
    return drawn


def near_box(yaw_deg: float = 20.0, pattern: int = 1, y_m: float = 0.0) -> BoxSpec:
    """Return a low box whose base is below the image."""
    return BoxSpec(pattern=pattern, position_m=(0.05, y_m), size_m=(0.4, 0.4, 0.8), yaw_deg=yaw_deg)


def noisy(drawn: View, spread: float = 0.2) -> np.ndarray:
    """Return a network's depth: wrong at every pixel, and by as much as roofs are off."""
    noise = np.random.default_rng(0).normal(0.0, spread, drawn.depth.shape)
    return (drawn.depth * CONFIG.roof_too_far * np.exp(noise)).astype(np.float32)


def estimate(drawn: View, network_m: np.ndarray | None) -> ContactDepth:
    estimation = ContactEstimation(paper_map(drawn.ids), GroundPlane.of(VIEW), CONFIG)
    if network_m is not None:
        estimation.complete(network_m)
    return estimation.result()


@pytest.mark.parametrize("yaw_deg", [0.0, 20.0, 45.0])
def test_a_near_box_has_its_shape_though_the_network_errs_everywhere(yaw_deg: float) -> None:
    drawn = look(near_box(yaw_deg))
    sides, roof = drawn.ids == BOXES[0], drawn.ids == ROOFS[0]
    assert sides.sum() > 500
    assert roof.sum() > 500
    assert np.isnan(estimate(drawn, None).depth[sides | roof]).mean() > 0.95

    found = estimate(drawn, noisy(drawn))

    error_m = np.abs(found.depth - drawn.depth)
    for face in (sides, roof):
        assert np.isfinite(error_m[face]).mean() > 0.97
        assert np.nanmedian(error_m[face]) < 0.02
        assert np.nanpercentile(error_m[face], 95) < 0.06


def test_a_network_that_smears_a_roof_into_what_is_behind_does_not_bend_it() -> None:
    """Its outer pixels are said to be twice as far away; the roof stays level."""
    drawn = look(near_box())
    roof = drawn.ids == ROOFS[0]
    network_m = noisy(drawn, spread=0.0)
    rows, columns = np.nonzero(roof)
    outer = roof & (
        (np.indices(roof.shape)[1] < np.percentile(columns, 15))
        | (np.indices(roof.shape)[0] < np.percentile(rows, 15))
    )
    network_m[outer] *= 2.0

    error_m = np.abs(estimate(drawn, network_m).depth - drawn.depth)[roof]

    assert outer.sum() > 0.2 * roof.sum()
    assert np.nanpercentile(error_m, 95) < 0.03


def test_a_base_in_view_comes_before_the_network() -> None:
    drawn = look(BoxSpec(pattern=1, position_m=(1.0, 0.0), size_m=(0.4, 0.4, 0.9), yaw_deg=15.0))
    plain = estimate(drawn, None).depth
    misled = estimate(drawn, 3.0 * drawn.depth).depth
    known = np.isfinite(plain)

    assert known[drawn.ids == ROOFS[0]].mean() > 0.95
    np.testing.assert_array_equal(misled[known], plain[known])


def test_of_two_boxes_with_one_roof_only_the_hidden_one_asks_the_network() -> None:
    """Boxes 1 and 6 wear one pattern."""
    far = BoxSpec(pattern=6, position_m=(1.6, -0.9), size_m=(0.4, 0.4, 0.5), yaw_deg=10.0)
    drawn = look(near_box(y_m=0.1), far)
    network_m = noisy(drawn)
    plain, found = estimate(drawn, None), estimate(drawn, network_m)
    roofs = drawn.ids == ROOFS[0]
    nearer = roofs & (drawn.depth < 2.0)
    assert np.isfinite(plain.depth[roofs & ~nearer]).mean() > 0.9
    assert np.isnan(plain.depth[nearer]).mean() > 0.9

    error_m = np.abs(found.depth - drawn.depth)

    assert np.nanpercentile(error_m[roofs & ~nearer], 90) < 0.05
    assert np.nanmedian(error_m[nearer]) < 0.03
    assert np.nanmedian(error_m[drawn.ids == BOXES[0]]) < 0.03


def test_a_network_cannot_stand_a_side_behind_the_ground_below_it() -> None:
    drawn = look(near_box())
    sides = drawn.ids == BOXES[0]
    found = estimate(drawn, 5.0 * drawn.depth)

    assert np.isfinite(found.depth[sides]).mean() > 0.97
    assert np.all(found.depth[sides] <= found.at_most[sides] + 0.005)


def test_a_networks_depth_of_another_size_is_refused() -> None:
    drawn = look(near_box())
    with pytest.raises(ShapeError, match=r"network's depth.*112x224"):
        estimate(drawn, np.ones((56, 112), dtype=np.float32))
