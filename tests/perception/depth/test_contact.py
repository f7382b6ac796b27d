"""Depth by ground contact: base, scan and map."""

import math

import numpy as np
import pytest

from perception.camera.ground_plane import CameraView, GroundPlane
from perception.depth.contact.base import Remembered, fit_base
from perception.depth.contact.depth import ROOF_TOO_FAR, ContactDepth, ContactEstimation
from perception.depth.contact.scan import NOT_IN_IMAGE, Panorama
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import Helipad, ObjectSpec
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.views import View, render_views
from tests.paper_lab import (
    BACKGROUND,
    BOXES,
    CARPET,
    CLASS_COUNT,
    HELIPAD_BOX,
    HELIPAD_H,
    ROOFS,
    paper_map,
)
from uav_bt.testing import pinhole
from uav_bt.types.projection import project

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


# --- lines of bases -------------------------------------------------------------------------------

PIXEL_RAD = 1 / 145
HEIGHT_M = 1.5


def slope_of(azimuth: np.ndarray, *faces: tuple[float, float]) -> np.ndarray:
    """Height over range of vertical planes, each by its normal's azimuth and its distance."""
    lines = [HEIGHT_M * np.cos(azimuth - normal) / distance for normal, distance in faces]
    return np.min(lines, axis=0)


@pytest.mark.parametrize("middle", [-2.5, -0.4, 0.0, 0.9])
def test_one_face_is_recovered_at_any_azimuth(middle: float) -> None:
    azimuth = np.linspace(middle - 0.15, middle + 0.15, 50)
    line = fit_base(azimuth, slope_of(azimuth, (middle + 0.3, 2.0)), PIXEL_RAD)
    assert line.corner_rad == math.inf
    assert line.rms_px < 1e-4
    assert line.spread_rad == pytest.approx(0.3)
    beyond = np.array([middle - 0.4, middle + 0.4])
    assert line.slope(beyond) == pytest.approx(slope_of(beyond, (middle + 0.3, 2.0)))


def test_rounding_to_pixels_makes_no_corner_and_specks_do_not_move_the_line() -> None:
    azimuth = np.linspace(-0.1, 0.1, 32)
    exact = slope_of(azimuth, (0.2, 2.5))
    seen = np.tan(np.round(np.arctan(exact) / PIXEL_RAD) * PIXEL_RAD)
    for specks in ([], [3, 24]):
        seen[specks] *= 0.7
        line = fit_base(azimuth, seen, PIXEL_RAD)
        assert line.corner_rad == math.inf
        assert line.slope(azimuth) == pytest.approx(exact, rel=0.01)
    assert fit_base(azimuth[:3], seen[:3], PIXEL_RAD) is None  # three bearings are too few


@pytest.mark.parametrize("corner", [False, True])
def test_the_fit_has_the_least_squares_in_pixels(*, corner: bool) -> None:
    azimuth = np.linspace(-0.2, 0.3, 41)
    faces = ((-0.4, 1.7), (0.9, 1.2)) if corner else ((0.2, 2.0),)
    noise = np.random.default_rng(3).normal(0.0, 0.1 * PIXEL_RAD, 41)
    slope = slope_of(azimuth, *faces) + noise
    line = fit_base(azimuth, slope, PIXEL_RAD)
    weight = 1.0 / ((1.0 + slope**2) * PIXEL_RAD)
    basis = np.column_stack([np.cos(azimuth), np.sin(azimuth)]) * weight[:, None]

    def fitted(part: slice) -> tuple[np.ndarray, float]:
        factors, squares, _, _ = np.linalg.lstsq(basis[part], (slope * weight)[part], rcond=None)
        return factors, float(squares[0])

    splits = [
        (fitted(slice(0, at))[1] + fitted(slice(at, 41))[1], at) for at in range(4, 38) if corner
    ]
    least, at = min(splits, default=(fitted(slice(0, 41))[1], 41))
    parts = [slice(0, at), slice(at, 41)] if corner else [slice(0, 41)]
    assert line.faces == pytest.approx(np.stack([fitted(part)[0] for part in parts]), rel=1e-7)
    assert line.rms_px == pytest.approx(math.sqrt(least / 41))
    if corner:
        apart = slope_of(azimuth, faces[0]) - slope_of(azimuth, faces[1])
        assert line.corner_rad == pytest.approx(azimuth[np.abs(apart).argmin()], abs=0.02)


# --- the panorama of a class map ------------------------------------------------------------------

SMALL = pinhole(64, 36)
BOX = 5


@pytest.mark.parametrize(("pitch_rad", "roll_rad"), [(-0.4, 0.0), (-0.6, 0.05), (-1.5, 0.0)])
def test_a_cell_has_the_class_of_the_nearest_pixel(pitch_rad: float, roll_rad: float) -> None:
    ids = np.random.default_rng(0).integers(0, CLASS_COUNT, (36, 64), dtype=np.uint8)
    view = CameraView(camera=SMALL, pitch_rad=pitch_rad, height_m=1.5, roll_rad=roll_rad)
    panorama = Panorama.of(ids, view)
    azimuth, depression = np.meshgrid(panorama.azimuth_rad, panorama.depression_rad)
    level = np.stack([np.cos(azimuth), np.sin(azimuth), np.tan(depression)], axis=-1)
    with np.errstate(invalid="ignore"):
        exact = project(level, SMALL, pitch_rad, roll_rad)
        inside = ((exact > -0.5) & (exact < (63.5, 35.5))).all(axis=-1)
        # Between two pixels rounding decides.
        clear = (np.abs(exact % 1.0 - 0.5) > 1e-3).all(axis=-1)
    columns, rows = np.rint(exact[inside & clear]).astype(int).T
    assert np.array_equal(panorama.ids[inside & clear], ids[rows, columns])
    assert (panorama.ids[~inside & (clear | np.isnan(exact).any(axis=-1))] == NOT_IN_IMAGE).all()


def panorama_of(*columns: str) -> Panorama:
    """Return a panorama of columns, each from low to high: c carpet, b box, o other, - outside."""
    table = {"c": CARPET, "b": BOX, "o": 0, "-": NOT_IN_IMAGE}
    ids = np.array([[table[cell] for cell in row] for row in zip(*columns, strict=True)], np.uint8)
    azimuth_rad, depression_rad = np.zeros(len(columns)), np.linspace(0.9, 0.1, len(ids))
    return Panorama(ids=ids, azimuth_rad=azimuth_rad, depression_rad=depression_rad, pixel_rad=0.1)


def test_the_lowest_long_run_of_a_class_counts() -> None:
    """Two pixels at least, and a pixel has two rows."""
    panorama = panorama_of("-cbbbobbbb", "bbbbcccccc", "ccccbbbccb", "----------")
    first, last = panorama.runs(CLASS_COUNT)
    assert first[BOX].tolist() == [6, 0, -1, -1]
    assert last[BOX].tolist() == [9, 3, 9, -1]
    assert first[CARPET].tolist() == [-1, 4, 0, -1]


def test_a_class_follows_within_a_gap_and_the_panorama() -> None:
    """Two pixels of another class at most."""
    panorama = panorama_of("cobbbbbb", "coooobbb", "cooooobb", "bbbbbbbb")
    rows, columns = np.array([2, 5, 6, 0]), np.arange(4)
    below = panorama.next_row(rows, columns, CARPET, -1)
    assert below.tolist() == [0, 0, -1, -1]
    assert panorama.next_row(below, columns, BOX, 1).tolist()[:2] == [2, 5]
