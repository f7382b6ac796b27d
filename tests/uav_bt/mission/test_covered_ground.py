"""Coverage: covered and seen shares of the free ground, against areas and rendered images."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import render_views
from tests.paper_lab import CARPET
from tests.worlds import values
from uav_bt.mission.covered_ground import CoveredGround, GroundCells
from uav_bt.types import Pose, Truth, projection
from uav_bt.types.arrays import Flags
from uav_bt.types.ground import Footprint, Ground, Standing

CAMERA = anafi_camera(640, 360)
BARE = Ground(size_m=(5.0, 4.0))
TURNED = Footprint(x_m=1.0, y_m=0.5, half_x_m=0.5, half_y_m=0.25, yaw_rad=math.pi / 2)


def truth(x_m: float, y_m: float, yaw_rad: float = 0.0, pitch_rad: float | None = -0.5) -> Truth:
    return values.truth(
        Pose(x_m=x_m, y_m=y_m, z_m=1.5, yaw_rad=yaw_rad),
        clearance_m=math.inf,
        gimbal_pitch_rad=pitch_rad,
    )


def test_ground_under_what_stands_on_it_is_not_free() -> None:
    cells = GroundCells(
        Ground(size_m=(5.0, 4.0), standing=(Standing(footprint=TURNED, height_m=1),))
    )
    assert cells.free.shape == (80, 100)
    rows, columns = np.nonzero(~cells.free)
    assert cells.x_m[columns].min() == pytest.approx(0.775)
    assert cells.x_m[columns].max() == pytest.approx(1.225)
    assert cells.y_m[rows].min() == pytest.approx(0.025)
    assert cells.y_m[rows].max() == pytest.approx(0.975)
    assert cells.share(~cells.free) == 0.0
    assert cells.share(cells.free) == 1.0


def test_hovering_passes_a_disc_and_a_straight_way_a_band() -> None:
    hovering = CoveredGround(BARE, CAMERA)
    hovering.add(0.0, truth(0.0, 0.0))
    assert hovering.shares()[0] == pytest.approx(math.pi * 0.25 / 20.0, rel=0.02)
    along = CoveredGround(BARE, CAMERA)
    for step in range(51):
        along.add(step / 10, truth(-2.5 + step / 10, 0.0))
    assert along.shares()[0] == pytest.approx(0.25, abs=0.002)


def _seen_by_rendering(pose: CameraPose, ids: NDArray[np.uint8]) -> tuple[Flags, Flags]:
    """Return the mask of cells that an image shows as ground, and of cells away from edges."""
    height_px, width_px = ids.shape
    cells = GroundCells(load_scene("val-a").ground_plan)
    x, y = np.meshgrid(cells.x_m, cells.y_m)
    dx, dy = x - pose.x_m, y - pose.y_m
    c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    level = np.stack([c * dx + s * dy, s * dx - c * dy, np.full_like(x, pose.z_m)], axis=-1)
    pixels = projection.project(level, anafi_camera(width_px, height_px), pose.pitch_rad)
    far = np.sqrt(dx**2 + dy**2 + pose.z_m**2) > 3.0
    shows = np.zeros(x.shape, np.bool_)
    sure = np.ones(x.shape, np.bool_)
    for place in np.ndindex(x.shape):
        column, row = pixels[place]
        inside = -0.5 <= column <= width_px - 0.5 and -0.5 <= row <= height_px - 0.5
        if not inside or far[place]:
            continue
        near = ids[
            max(0, round(row) - 2) : round(row) + 3, max(0, round(column) - 2) : round(column) + 3
        ]
        shows[place] = ids[round(row), round(column)] == CARPET
        sure[place] = bool((near == near[0, 0]).all())
    return shows & cells.free, sure & cells.free


@pytest.mark.parametrize(
    ("x_m", "y_m", "yaw_deg", "pitch_deg"),
    [(-1.2, -0.9, 40, -30), (1.4, 0.2, 150, -25), (0.4, -0.3, -100, -60), (0.9, 1.0, 200, -89)],
)
def test_the_seen_ground_is_what_an_image_shows_of_the_ground(
    x_m: float, y_m: float, yaw_deg: float, pitch_deg: float
) -> None:
    """The twin's exact masks are independent of the tested geometry."""
    scene = load_scene("val-a")
    body = truth(x_m, y_m, math.radians(yaw_deg), math.radians(pitch_deg))
    lens_x, lens_y = body.pose.to_world(CAMERA_FORWARD_M, 0.0)
    pose = CameraPose(
        x_m=lens_x,
        y_m=lens_y,
        z_m=1.5,
        yaw_rad=body.pose.yaw_rad,
        pitch_rad=math.radians(pitch_deg),
    )
    (view,) = render_views(scene, [pose])
    shows, sure = _seen_by_rendering(pose, view.ids)
    coverage = CoveredGround(scene.ground_plan, CAMERA)
    coverage.add(0.0, body)
    assert shows.sum() > 100
    disagree = (coverage.seen != shows) & sure
    assert (coverage.seen & sure).sum() > 100
    assert disagree.sum() == 0


def test_looks_are_taken_five_times_a_second() -> None:
    coverage = CoveredGround(BARE, CAMERA)
    coverage.add(0.0, truth(-2.0, 0.0))
    first = coverage.shares()[1]
    coverage.add(0.1, truth(-2.0, 0.0, math.pi / 4))
    assert coverage.shares()[1] == first
    coverage.add(0.2, truth(-2.0, 0.0, math.pi / 4))
    assert coverage.shares()[1] > first
