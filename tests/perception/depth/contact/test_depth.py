"""Depth by ground contact against the twin's exact depth, and cases that must stay unknown."""

import math

import numpy as np
import pytest

from perception.camera.ground_plane import CameraView, GroundPlane
from perception.depth.contact.base import Remembered
from perception.depth.contact.depth import ROOF_TOO_FAR, ContactDepth, ContactEstimation
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import Helipad, ObjectSpec
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.views import View, render_views
from tests.paper_lab import BACKGROUND, BOXES, CARPET, HELIPAD_BOX, HELIPAD_H, ROOFS, paper_map

SIZE = (224, 112)
CAMERA = anafi_camera(640, 360).resized(*SIZE)
PITCH_RAD = math.radians(-28.0)
PAD = Helipad(position_m=(-2.0, -1.5))


def look(*boxes: ObjectSpec, pad: Helipad = PAD, pitch_rad: float = PITCH_RAD) -> View:
    """Draw boxes from 1.5 m above (-1, 0), looking along x."""
    pose = CameraPose(x_m=-1.0, y_m=0.0, z_m=1.5, yaw_rad=0.0, pitch_rad=pitch_rad)
    scene = Scene(name="few", helipad=pad, objects=boxes)
    (drawn,) = render_views(scene, [pose], size_px=(160, 90), truth_size_px=SIZE)
    return drawn


def estimate(
    drawn: View, *, points_m: np.ndarray | None = None, network_m: np.ndarray | None = None
) -> ContactDepth:
    """Return the depth by the exact ids, with remembered points or a network's depth."""
    view = CameraView(camera=CAMERA, pitch_rad=drawn.pose.pitch_rad, height_m=drawn.pose.z_m)
    remembered = None if points_m is None else Remembered.at(points_m)
    estimation = ContactEstimation(paper_map(drawn.ids), GroundPlane.of(view), remembered)
    if network_m is not None:
        estimation.complete(network_m)
    return estimation.result()


def by_ids(ids: np.ndarray, view: CameraView) -> np.ndarray:
    return ContactEstimation(paper_map(ids), GroundPlane.of(view)).result().depth


def box(
    x_m: float, y_m: float, height_m: float = 2.0, yaw_deg: float = 0.0, pattern: int = 1
) -> ObjectSpec:
    return ObjectSpec(
        kind=f"box-{pattern}", position_m=(x_m, y_m), size_m=(0.4, 0.4, height_m), yaw_deg=yaw_deg
    )


def check(
    drawn: View,
    found: ContactDepth,
    class_id: int,
    *,
    known: float = 0.95,
    median_m: float = 0.02,
    most_m: float = 0.05,
) -> None:
    """Check the share of known pixels of a class, their median error, and that of 90 % of them."""
    faces = drawn.ids == class_id
    error_m = np.abs(found.depth - drawn.depth)[faces]
    assert error_m.size > 100
    assert np.isfinite(error_m).mean() > known
    assert np.nanmedian(error_m) < median_m
    assert np.nanpercentile(error_m, 90) < most_m


@pytest.mark.parametrize("yaw_deg", [0.0, 20.0, 45.0])
def test_a_standing_box_is_where_the_twin_has_it(yaw_deg: float) -> None:
    """All of its sides, up to the image's upper edge, within centimetres at two metres."""
    drawn = look(box(1.0, 0.3, yaw_deg=yaw_deg))
    found = estimate(drawn)
    ground = drawn.ids == CARPET
    check(drawn, found, BOXES[0], known=0.97, median_m=0.01)
    assert found.known_share > 0.97
    assert found.depth[ground] == pytest.approx(drawn.depth[ground], abs=1e-3)
    assert np.isnan(found.depth[drawn.ids == BACKGROUND]).all()


@pytest.mark.parametrize(
    "boxes",
    [
        pytest.param((box(1.0, 0.0, 0.9, 15.0),), id="one"),
        # Each roof goes to the box below it.
        pytest.param((box(0.9, 0.5, 0.6), box(1.6, -0.6, 1.1, pattern=6)), id="two of one pattern"),
    ],
)
def test_a_roof_lies_level_behind_the_edge(boxes: tuple[ObjectSpec, ...]) -> None:
    drawn = look(*boxes)
    check(drawn, estimate(drawn), ROOFS[0], median_m=0.03)


def test_the_mark_is_known_by_its_height() -> None:
    drawn = look(pad=Helipad(position_m=(1.0, 0.2), yaw_deg=25.0))
    for class_id in (HELIPAD_H, HELIPAD_BOX):
        check(drawn, estimate(drawn), class_id, median_m=0.01)
    # Straight down, azimuths go once around.
    drawn = look(pad=Helipad(position_m=(-1.0, 0.0)), pitch_rad=-math.pi / 2)
    panel = drawn.ids == HELIPAD_H
    assert estimate(drawn).depth[panel] == pytest.approx(drawn.depth[panel], abs=0.002)


def test_a_base_below_the_image_is_unknown_but_bounded() -> None:
    """A box that fills the view's lower middle is nearer than the ground beside it."""
    drawn = look(box(0.2, 0.0))
    found, sides = estimate(drawn), drawn.ids == BOXES[0]
    assert np.isnan(found.depth[sides]).all()
    assert np.all(drawn.depth[sides] <= found.at_most[sides] + 0.02)
    assert np.isfinite(found.at_most[sides]).all()
    assert found.known_share == 0.0


def test_a_hidden_base_follows_its_face() -> None:
    """A low box hides half of the base of the tall one behind it: no depth of the low one."""
    drawn = look(box(1.6, 0.1, pattern=2), box(0.8, -0.12, height_m=0.7, pattern=1))
    check(drawn, estimate(drawn), BOXES[1], known=0.5, median_m=0.03, most_m=0.1)


@pytest.mark.parametrize("remembers", [False, True])
def test_a_base_that_is_hidden_entirely_is_unknown(*, remembers: bool) -> None:
    """The near box's outline is remembered on the same azimuths; it is not the other's base."""
    low = ObjectSpec(kind="box-1", position_m=(1.1, 0.0), size_m=(0.4, 0.8, 0.6))
    drawn = look(box(1.6, 0.0, pattern=2), low)
    found = estimate(drawn, points_m=outline(1.1, 0.0) if remembers else None)
    behind = drawn.ids == BOXES[1]
    assert behind.sum() > 100
    assert np.isnan(found.depth[behind]).all()
    assert np.all(drawn.depth[behind] <= found.at_most[behind] + 0.02)


def test_below_the_marks_top_its_top_is_not_guessed() -> None:
    """A lens lower than the pad sees sides only; the panel has no place then."""
    ids = np.full((112, 224), CARPET, dtype=np.uint8)
    ids[40:60, 80:140] = HELIPAD_H
    low = CameraView(camera=CAMERA, pitch_rad=-0.2, height_m=0.3)
    assert np.isnan(by_ids(ids, low)[40:60, 80:140]).all()


@pytest.mark.parametrize("pitch_deg", [-15.0, -8.0])
def test_nothing_is_claimed_to_be_beyond_the_lab(pitch_deg: float) -> None:
    """Mask noise of a box at the horizon has no base: the ground ends nearer."""
    view = CameraView(camera=CAMERA, pitch_rad=math.radians(pitch_deg), height_m=1.5)
    ids = np.full((SIZE[1], SIZE[0]), CARPET, dtype=np.uint8)
    horizon = round(CAMERA.cy_px + CAMERA.fy_px * math.tan(view.pitch_rad))
    ids[: horizon + 1] = BACKGROUND
    ids[: horizon + 3, 80:120] = BOXES[0]
    assert np.nanmax(by_ids(ids, view)) <= 8.0


def outline(x_m: float, y_m: float) -> np.ndarray:
    """Return the outline of an upright box from the lens at (-1, 0), metres forward and right."""
    grid = np.stack(np.meshgrid(*[np.linspace(-0.2, 0.2, 9)] * 2), axis=-1).reshape(-1, 2)
    rim = grid[np.abs(grid).max(axis=1) > 0.19]
    return (rim + np.array([x_m + 1.0, y_m])) * np.array([1.0, -1.0])


@pytest.mark.parametrize(("x_m", "y_m"), [(0.0, 0.0), (-0.1, 0.4), (0.1, -0.3)])
def test_a_base_below_the_view_is_known_where_it_was_seen_before(x_m: float, y_m: float) -> None:
    """All around, also its far sides: the near one counts."""
    drawn = look(box(x_m, y_m))
    sides = drawn.ids == BOXES[0]
    assert np.isnan(estimate(drawn).depth[sides]).mean() > 0.8
    found = estimate(drawn, points_m=outline(x_m, y_m))
    check(drawn, found, BOXES[0], most_m=0.08)
    # Remembered a little too far away, the box is at least as near as its lowest pixel shows.
    strayed = estimate(drawn, points_m=outline(x_m + 0.25, y_m))
    known = sides & np.isfinite(strayed.depth)
    assert np.all(strayed.depth[known] <= strayed.at_most[known] + 1e-4)


def test_what_is_remembered_behind_or_elsewhere_says_nothing() -> None:
    drawn = look(box(0.0, 0.0))
    few, none = outline(0.0, 0.0)[:2], np.empty((0, 2))
    for elsewhere in (outline(1.6, 0.0), outline(-0.2, 1.2), few, none):
        found = estimate(drawn, points_m=elsewhere)
        assert np.isnan(found.depth[drawn.ids == BOXES[0]]).all()


def noisy(drawn: View, spread: float = 0.2) -> np.ndarray:
    """Return a network's depth: wrong at every pixel, and by as much as roofs are off."""
    noise = np.random.default_rng(0).normal(0.0, spread, drawn.depth.shape)
    return (drawn.depth * ROOF_TOO_FAR * np.exp(noise)).astype(np.float32)


@pytest.mark.parametrize("yaw_deg", [0.0, 20.0, 45.0])
def test_a_near_box_has_its_shape_though_the_network_errs_everywhere(yaw_deg: float) -> None:
    """It shows its roof but not its base: the height is the network's."""
    drawn = look(box(0.05, 0.0, 0.8, yaw_deg))
    sides, roof = drawn.ids == BOXES[0], drawn.ids == ROOFS[0]
    assert np.isnan(estimate(drawn).depth[sides | roof]).mean() > 0.95
    found = estimate(drawn, network_m=noisy(drawn))
    for class_id in (BOXES[0], ROOFS[0]):
        check(drawn, found, class_id, known=0.97, most_m=0.06)
    far = estimate(drawn, network_m=5.0 * drawn.depth)  # never behind the ground below it
    assert np.isfinite(far.depth[sides]).mean() > 0.97
    assert np.all(far.depth[sides] <= far.at_most[sides] + 0.005)


def test_a_network_that_smears_a_roof_into_what_is_behind_does_not_bend_it() -> None:
    """Its outer pixels are said to be twice as far away; the roof stays level."""
    drawn = look(box(0.05, 0.0, 0.8, 20.0))
    network_m = noisy(drawn, spread=0.0)
    rows, columns = np.nonzero(drawn.ids == ROOFS[0])
    outer = (columns < np.percentile(columns, 15)) | (rows < np.percentile(rows, 15))
    assert outer.mean() > 0.2
    network_m[rows[outer], columns[outer]] *= 2.0
    found = estimate(drawn, network_m=network_m)
    check(drawn, found, ROOFS[0], known=0.97, most_m=0.03)


def test_a_base_in_view_comes_before_the_network_and_what_is_remembered() -> None:
    drawn = look(box(1.0, 0.0, height_m=0.9, yaw_deg=15.0))
    plain = estimate(drawn).depth
    known = np.isfinite(plain)
    assert known[drawn.ids == ROOFS[0]].mean() > 0.95
    misled = estimate(drawn, points_m=outline(0.7, 0.0), network_m=3.0 * drawn.depth).depth
    np.testing.assert_array_equal(misled[known], plain[known])
