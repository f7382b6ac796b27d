"""The take-off spot: found on textured ground, and only there."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from perception.marks.spot import SpotFinder
from sim_bridge.anafi import anafi_camera
from tests.paper_lab import paper_map
from uav_bt.errors import InputError
from uav_bt.lab.shipped import load_lab
from uav_bt.landing_marks import MarkSighting, MarkView
from uav_bt.types import Frame, LandingMark, Pose2D
from uav_bt.types.arrays import Image
from uav_bt.types.projection import ground_points

CAMERA = anafi_camera(320, 180)
CAMERA_M = 1.5
CELL_M = 0.01  # of the drawn ground
SIDE_PX = 800
MARK = LandingMark(kind="spot", length_m=0.5, width_m=0.5, height_m=0.0)
CLASSES = load_lab().classes
AT_THE_SPOT = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0)


def texture(side_px: int = SIDE_PX) -> Image:
    """Return ground with spots of some centimetres, (side_px, side_px)."""
    noise = np.random.default_rng(1).normal(0.0, 1.0, (side_px, side_px))
    smooth = gaussian_filter(noise, 4.0, mode="wrap")
    return np.clip(120.0 + 25.0 * smooth / smooth.std(), 0.0, 255.0).astype(np.uint8)


def view(
    ground: Image, body: Pose2D, *, off: tuple[float, float, float] = (0.0, 0.0, 0.0), at_s: float
) -> MarkView:
    """Return a noisy view straight down.

    Args:
        ground: (S, S) grey, rows along x and columns along y, the take-off spot in its middle.
        body: Pose of the body in the take-off frame.
        off: Error of the drone's estimate of that pose: x, y in metres, yaw in degrees.
        at_s: Capture time.
    """
    pitch_rad = -math.pi / 2.0
    grid = np.stack(np.meshgrid(np.arange(320), np.arange(180)), axis=-1).reshape(-1, 2)
    places_m = ground_points(grid, CAMERA, pitch_rad, CAMERA_M)
    places_m[:, 0] += CAMERA.forward_offset_m
    cells = body.points_to_world(places_m) / CELL_M + (len(ground) - 1) / 2.0
    rows, columns = cells.T.astype(np.float32).reshape(2, 180, 320)
    seen = cv2.remap(ground, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    noise = np.random.default_rng(round(10.0 * at_s)).normal(0.0, 3.0, seen.shape)
    grey = np.clip(seen + noise, 0.0, 255.0).astype(np.uint8)
    frame = Frame(
        image=np.repeat(grey[:, :, None], 3, axis=2),
        index=round(10.0 * at_s),
        captured_s=at_s,
        gimbal_pitch_rad=pitch_rad,
        height_above_ground_m=CAMERA_M,
    )
    ids: NDArray[np.uint8] = np.full((90, 160), CLASSES.ground, dtype=np.uint8)
    believed = Pose2D(
        x_m=body.x_m + off[0], y_m=body.y_m + off[1], yaw_rad=body.yaw_rad + math.radians(off[2])
    )
    return MarkView(
        frame=frame,
        camera=CAMERA,
        class_map=paper_map(ids=ids, captured_s=at_s),
        take_off=believed.pose_to_body(AT_THE_SPOT),
    )


def after_take_off(ground: Image) -> SpotFinder:
    """Return a finder that has seen the spot from above and flown away."""
    finder = SpotFinder(MARK)
    for index in range(5):
        place = Pose2D(x_m=0.02 * index - 0.04, y_m=0.01 * index, yaw_rad=0.0)
        assert finder.find(view(ground, place, at_s=0.1 * index)) is None
    assert finder.find(view(ground, Pose2D(x_m=2.0, y_m=0.0, yaw_rad=0.0), at_s=5.0)) is None
    return finder


def back(
    finder: SpotFinder, ground: Image, body: Pose2D, off: tuple[float, float, float]
) -> MarkSighting | None:
    """Return the sighting of the second of two views from a pose."""
    assert finder.find(view(ground, body, off=off, at_s=10.0)) is None  # one view is not enough
    return finder.find(view(ground, body, off=off, at_s=10.1))


@pytest.mark.parametrize("yaw_deg", [0.0, 80.0, -170.0])
@pytest.mark.parametrize("off", [(0.0, 0.0, 0.0), (0.3, -0.2, 2.0), (-0.4, 0.1, -3.0)])
def test_on_textured_ground_the_spot_is_found(
    yaw_deg: float, off: tuple[float, float, float]
) -> None:
    ground, body = texture(), Pose2D(x_m=0.1, y_m=-0.15, yaw_rad=math.radians(yaw_deg))
    found = back(after_take_off(ground), ground, body, off)

    assert found is not None
    true = body.pose_to_body(AT_THE_SPOT)
    assert math.hypot(found.forward_m - true.x_m, found.right_m - true.y_m) < 0.03
    assert found.height_m == 0.0


def test_ground_without_texture_shows_no_spot() -> None:
    plain = np.full((SIDE_PX, SIDE_PX), 120, dtype=np.uint8)

    assert back(after_take_off(plain), plain, AT_THE_SPOT, (0.1, 0.0, 0.0)) is None


def test_other_ground_shows_no_spot() -> None:
    ground = texture()
    elsewhere = np.ascontiguousarray(ground.T[::-1])

    assert back(after_take_off(ground), elsewhere, AT_THE_SPOT, (0.0, 0.0, 0.0)) is None


@pytest.mark.parametrize("off_m", [0.05, 0.1, 0.2, 0.25, 0.3, 0.4, 0.45])
def test_on_repeated_tiles_only_the_right_one_is_believed(off_m: float) -> None:
    """Tiles of half a metre: the estimate must leave no doubt which of them is meant."""
    tiles = np.tile(texture(50), (16, 16))
    found = back(after_take_off(tiles), tiles, AT_THE_SPOT, (off_m, 0.0, 0.0))

    if off_m <= 0.1:
        assert found is not None
        assert math.hypot(found.forward_m, found.right_m) < 0.03
    elif off_m < 0.4:
        assert found is None
    elif found is not None:  # the next tile looks like the right one: off by a tile at most
        assert math.hypot(found.forward_m, found.right_m) < 0.55


def test_a_spot_that_was_not_seen_from_above_is_not_found() -> None:
    ground, finder = texture(), SpotFinder(MARK)
    finder.find(view(ground, Pose2D(x_m=2.0, y_m=0.0, yaw_rad=0.0), at_s=5.0))

    assert back(finder, ground, AT_THE_SPOT, (0.0, 0.0, 0.0)) is None


def test_an_option_is_refused() -> None:
    with pytest.raises(InputError, match="landing mark 'spot' has no option 'size_m'"):
        SpotFinder(replace(MARK, options={"size_m": 1.0}))
