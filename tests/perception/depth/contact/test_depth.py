"""Depth by ground contact against the twin's exact depth, and cases that must stay unknown."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.camera.ground_plane import CameraView
from perception.depth.contact.contacts import Remembered
from perception.depth.contact.depth import ContactDepth, contact_depth
from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import BoxSpec, Helipad
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import View, render_views, sample_flight_poses
from tests.paper_lab import BACKGROUND, BOXES, CARPET, HELIPAD_BOX, HELIPAD_H, ROOFS, paper_map
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.types.projection import camera_axes

SIZE = (224, 112)
CAMERA = anafi_camera(640, 360).resized(*SIZE)
PITCH_RAD = math.radians(-28.0)
PAD = Helipad(position_m=(-2.0, -1.5))


def look(*boxes: BoxSpec, pad: Helipad = PAD, pitch_rad: float = PITCH_RAD) -> View:
    """Draw boxes from 1.5 m above (-1, 0), looking along x."""
    pose = CameraPose(x_m=-1.0, y_m=0.0, z_m=1.5, yaw_rad=0.0, pitch_rad=pitch_rad)
    scene = Scene(name="few", helipad=pad, boxes=boxes)
    (drawn,) = render_views(scene, [pose], size_px=(160, 90), truth_size_px=SIZE)
    return drawn


def estimate(drawn: View, ids: np.ndarray | None = None) -> ContactDepth:
    view = CameraView(camera=CAMERA, pitch_rad=drawn.pose.pitch_rad, height_m=drawn.pose.z_m)
    return contact_depth(paper_map(drawn.ids if ids is None else ids), view)


def box(
    x_m: float, y_m: float, height_m: float = 2.0, yaw_deg: float = 0.0, pattern: int = 1
) -> BoxSpec:
    return BoxSpec(
        pattern=pattern, position_m=(x_m, y_m), size_m=(0.4, 0.4, height_m), yaw_deg=yaw_deg
    )


@pytest.mark.parametrize("yaw_deg", [0.0, 20.0, 45.0])
def test_a_standing_box_is_where_the_twin_has_it(yaw_deg: float) -> None:
    """All of its sides, up to the image's upper edge, within centimetres at two metres."""
    drawn = look(box(1.0, 0.3, yaw_deg=yaw_deg))
    found = estimate(drawn)
    sides = drawn.ids == BOXES[0]
    error_m = np.abs(found.depth - drawn.depth)[sides]

    assert np.isfinite(error_m).mean() > 0.97
    assert np.nanmedian(error_m) < 0.01
    assert np.nanpercentile(error_m, 90) < 0.05
    assert found.known_share > 0.97


def test_a_roof_lies_level_behind_the_edge() -> None:
    drawn = look(box(1.0, 0.0, height_m=0.9, yaw_deg=15.0))
    roof = drawn.ids == ROOFS[0]
    error_m = np.abs(estimate(drawn).depth - drawn.depth)[roof]

    assert roof.sum() > 100
    assert np.isfinite(error_m).mean() > 0.95
    assert np.nanmedian(error_m) < 0.03


def test_two_boxes_with_the_same_roof_keep_their_heights() -> None:
    """Boxes 1 and 6 wear one pattern; each roof goes to the box below it."""
    drawn = look(box(0.9, 0.5, height_m=0.6), box(1.6, -0.6, height_m=1.1, pattern=6))
    roof = drawn.ids == ROOFS[0]
    error_m = np.abs(estimate(drawn).depth - drawn.depth)[roof]

    assert np.isfinite(error_m).mean() > 0.95
    assert np.nanpercentile(error_m, 90) < 0.05


def test_the_mark_is_known_by_its_height() -> None:
    drawn = look(pad=Helipad(position_m=(1.0, 0.2), yaw_deg=25.0))
    pad = (drawn.ids == HELIPAD_H) | (drawn.ids == HELIPAD_BOX)
    error_m = np.abs(estimate(drawn).depth - drawn.depth)[pad]

    assert np.isfinite(error_m).mean() > 0.97
    assert np.nanmedian(error_m) < 0.005
    assert np.nanpercentile(error_m, 95) < 0.05


def test_straight_down_the_mark_is_known_too() -> None:
    """All around the nadir, where azimuths go once around."""
    drawn = look(pad=Helipad(position_m=(-1.0, 0.0)), pitch_rad=-math.pi / 2)
    panel = drawn.ids == HELIPAD_H

    assert estimate(drawn).depth[panel] == pytest.approx(drawn.depth[panel], abs=0.002)


def test_the_ground_is_exact_and_the_background_unknown() -> None:
    drawn = look(box(1.0, 0.3))
    found = estimate(drawn)

    ground = drawn.ids == CARPET
    assert found.depth[ground] == pytest.approx(drawn.depth[ground], abs=1e-3)
    assert np.isnan(found.depth[drawn.ids == BACKGROUND]).all()


def test_a_base_below_the_image_is_unknown_but_bounded() -> None:
    """A box that fills the view's lower middle is nearer than the ground beside it."""
    drawn = look(box(0.2, 0.0))
    found = estimate(drawn)
    sides = drawn.ids == BOXES[0]

    assert np.isnan(found.depth[sides]).all()
    assert np.isfinite(found.at_most[sides]).all()
    assert np.all(drawn.depth[sides] <= found.at_most[sides] + 0.02)
    assert found.known_share == 0.0


def test_a_hidden_base_follows_its_face_or_stays_unknown() -> None:
    """A low box hides half of the base of the tall one behind it: no depth of the low one."""
    drawn = look(box(1.6, 0.1, pattern=2), box(0.8, -0.12, height_m=0.7, pattern=1))
    found = estimate(drawn)
    behind = drawn.ids == BOXES[1]
    error_m = np.abs(found.depth - drawn.depth)[behind]

    assert np.nanpercentile(error_m, 95) < 0.1
    assert np.isfinite(error_m).mean() > 0.5


def test_a_base_that_is_hidden_entirely_is_unknown() -> None:
    tall = BoxSpec(pattern=2, position_m=(1.6, 0.0), size_m=(0.3, 0.3, 2.0))
    low = BoxSpec(pattern=1, position_m=(1.1, 0.0), size_m=(0.4, 0.8, 0.6))
    drawn = look(tall, low)
    found = estimate(drawn)
    behind = drawn.ids == BOXES[1]

    assert behind.sum() > 100
    assert np.isnan(found.depth[behind]).all()
    assert np.all(drawn.depth[behind] <= found.at_most[behind] + 0.02)


def test_specks_and_blurred_borders_of_the_mask_do_no_harm() -> None:
    """Some wrong pixels on the ground, and a line of background between ground and box."""
    drawn = look(box(1.0, 0.3, yaw_deg=20.0))
    ids = drawn.ids.copy()
    lower = (ids[:-1] == BOXES[0]) & (ids[1:] == CARPET)
    ids[:-1][lower] = BACKGROUND
    ids[100, 30:33] = BOXES[0]
    ids[95, 120] = BOXES[0]
    sides = (drawn.ids == BOXES[0]) & (ids == BOXES[0])
    error_m = np.abs(estimate(drawn, ids).depth - drawn.depth)[sides]

    assert np.isfinite(error_m).mean() > 0.9
    assert np.nanmedian(error_m) < 0.05


def test_a_known_roll_is_taken_out() -> None:
    """Masks drawn by casting rays of a rolled camera onto a wall across the way."""
    view = CameraView(camera=CAMERA, pitch_rad=PITCH_RAD, height_m=1.5, roll_rad=0.08)
    columns, rows = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    rays = np.stack(
        [
            (columns - CAMERA.cx_px) / CAMERA.fx_px,
            (rows - CAMERA.cy_px) / CAMERA.fy_px,
            np.ones_like(rows, dtype=float),
        ],
        axis=-1,
    )
    level = rays @ camera_axes(PITCH_RAD, 0.08).T
    wall = 2.0 / level[..., 0]
    ids = np.where(wall * level[..., 2] <= 1.5, BOXES[0], CARPET).astype(np.uint8)
    found = contact_depth(paper_map(ids), view)

    error_m = np.abs(found.depth - wall)[ids == BOXES[0]]
    assert np.nanmedian(error_m) < 0.01
    assert np.nanmax(error_m) < 0.1


def test_over_many_views_the_error_is_centimetres() -> None:
    """Flight views of a validation scene, boxes nearer than 5 m."""
    scene = load_scene("val-b")
    poses = [
        pose
        for pose in sample_flight_poses(scene, np.random.default_rng(3), 24)
        if pose.pitch_rad > math.radians(-35.0)
    ]
    errors, sides, standing = [], 0, 0
    for drawn in render_views(scene, poses, size_px=(160, 90), truth_size_px=SIZE):
        found = estimate(drawn)
        for thing in BOXES:
            here = (drawn.ids == thing) & (drawn.depth < 5.0)
            if not here.any() or (drawn.ids[-1] == thing).any():
                continue  # its base is cut off
            error_m = np.abs(found.depth - drawn.depth)[here]
            errors.append(error_m[np.isfinite(error_m)])
            sides += int(here.sum())
            standing += int(np.isfinite(error_m).sum())
    error_m = np.concatenate(errors)
    assert np.median(error_m) < 0.01
    assert error_m.mean() < 0.06
    assert standing / sides > 0.9


def test_wrong_input_is_refused() -> None:
    view = CameraView(camera=CAMERA, pitch_rad=PITCH_RAD, height_m=1.5)
    with pytest.raises(ShapeError, match="112x224"):
        contact_depth(paper_map(np.ones((10, 20), dtype=np.uint8)), view)
    low = CameraView(camera=CAMERA, pitch_rad=PITCH_RAD, height_m=0.0)
    with pytest.raises(ValueRangeError, match="above the plane"):
        contact_depth(paper_map(np.ones((112, 224), dtype=np.uint8)), low)


def test_below_the_marks_top_its_top_is_not_guessed() -> None:
    """A lens lower than the pad sees sides only; the panel has no place then."""
    view = CameraView(camera=CAMERA, pitch_rad=-0.2, height_m=0.3)
    ids = np.full((112, 224), CARPET, dtype=np.uint8)
    ids[40:60, 80:140] = HELIPAD_H
    assert np.isnan(contact_depth(paper_map(ids), view).depth[40:60, 80:140]).all()
    assert CAMERA.forward_offset_m == CAMERA_FORWARD_M


# --- remembered bases -----------------------------------------------------------------------------


def outline(x_m: float, y_m: float, half_m: float = 0.2) -> np.ndarray:
    """Return the outline of an upright box from the lens at (-1, 0), metres forward and right."""
    edge = np.linspace(-half_m, half_m, 9)
    rim = np.concatenate(
        [
            np.stack([np.full(9, sign * half_m), edge], axis=1)[:, ::order]
            for sign in (-1, 1)
            for order in (1, -1)
        ]
    )
    return (rim + np.array([x_m + 1.0, y_m])) * np.array([1.0, -1.0])


def recall(drawn: View, points_m: np.ndarray) -> ContactDepth:
    view = CameraView(camera=CAMERA, pitch_rad=PITCH_RAD, height_m=1.5)
    return contact_depth(paper_map(drawn.ids), view, remembered=Remembered.at(points_m))


@pytest.mark.parametrize(("x_m", "y_m"), [(0.0, 0.0), (-0.1, 0.4), (0.1, -0.3)])
def test_a_base_below_the_view_is_known_where_it_was_seen_before(x_m: float, y_m: float) -> None:
    """All around, also its far sides: the near one counts."""
    drawn = look(box(x_m, y_m))
    sides = drawn.ids == BOXES[0]
    assert np.isnan(estimate(drawn).depth[sides]).mean() > 0.8

    error_m = np.abs(recall(drawn, outline(x_m, y_m)).depth - drawn.depth)[sides]
    assert np.isfinite(error_m).mean() > 0.95
    assert np.median(error_m[np.isfinite(error_m)]) < 0.02
    assert np.nanpercentile(error_m, 95) < 0.08


def test_what_is_remembered_behind_or_elsewhere_says_nothing() -> None:
    drawn = look(box(0.0, 0.0))
    sides = drawn.ids == BOXES[0]

    for elsewhere in (
        outline(1.6, 0.0),
        outline(-0.2, 1.2),
        outline(0.0, 0.0)[:2],
        np.empty((0, 2)),
    ):
        assert np.isnan(recall(drawn, elsewhere).depth[sides]).all()


def test_a_base_in_view_comes_before_what_is_remembered() -> None:
    drawn = look(box(1.0, 0.3))
    plain, misled = estimate(drawn), recall(drawn, outline(0.7, 0.3))

    np.testing.assert_array_equal(plain.depth, misled.depth)


def test_what_another_box_hides_is_not_taken_for_that_one() -> None:
    """The near box's outline is remembered on the same azimuths; it is not the other's base."""
    tall = BoxSpec(pattern=2, position_m=(1.6, 0.0), size_m=(0.3, 0.3, 2.0))
    low = BoxSpec(pattern=1, position_m=(1.1, 0.0), size_m=(0.4, 0.8, 0.6))
    drawn = look(tall, low)
    found = recall(drawn, outline(1.1, 0.0))

    assert np.isnan(found.depth[drawn.ids == BOXES[1]]).all()


def test_a_memory_that_strays_stays_within_its_bound() -> None:
    """Remembered a little too far away, the box is at least as near as its lowest pixel says."""
    drawn = look(box(0.0, 0.0))
    sides = drawn.ids == BOXES[0]
    found = recall(drawn, outline(0.25, 0.0))

    known = sides & np.isfinite(found.depth)
    assert known.any()
    assert np.all(found.depth[known] <= found.at_most[known] + 1e-4)


@pytest.mark.parametrize("pitch_deg", [-15.0, -8.0])
def test_nothing_is_claimed_to_be_beyond_the_lab(pitch_deg: float) -> None:
    """Mask noise of a box at the horizon has no base: the ground ends nearer."""
    view = CameraView(camera=CAMERA, pitch_rad=math.radians(pitch_deg), height_m=1.5)
    ids = np.full((SIZE[1], SIZE[0]), CARPET, dtype=np.uint8)
    horizon = round(CAMERA.cy_px + CAMERA.fy_px * math.tan(view.pitch_rad))
    ids[: horizon + 1] = BACKGROUND
    ids[: horizon + 3, 80:120] = BOXES[0]

    depth = contact_depth(paper_map(ids), view).depth

    assert np.isfinite(depth).any()
    assert np.nanmax(depth) <= 8.0
