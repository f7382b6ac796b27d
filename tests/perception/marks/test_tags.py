"""Tags: place, heading and confidence from one image; options that are refused."""

import math
from dataclasses import replace
from typing import Any, Final

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from perception.marks.tag_pose import level_pose, placed_corners
from perception.marks.tags import AprilTagFinder, ArucoFinder, TagFinder
from tests.perception.marks.mark_views import TAG_CAMERA, floor_view, tag_mark, view_of
from tests.worlds.tables import cases
from uav_bt.errors import InputError
from uav_bt.landing_marks import MarkSighting, MarkView
from uav_bt.types import LandingMark
from uav_bt.types.projection import project

OFFSET_M = TAG_CAMERA.forward_offset_m
CORNERS_M = [[-0.12, 0.12], [0.12, 0.12], [0.12, -0.12], [-0.12, -0.12]]
BOARD: Final[dict[str, Any]] = {
    "family": "36h11",
    "tags": [{"id": 3 + i, "size_m": 0.18, "at_m": place} for i, place in enumerate(CORNERS_M[:3])],
}


def seen(finder: TagFinder, mark: LandingMark, **place: float) -> MarkSighting | None:
    frame = view_of(finder.picture(), mark, **place)
    return finder.find(MarkView(frame=frame, camera=TAG_CAMERA))


@pytest.mark.parametrize("finder", [AprilTagFinder, ArucoFinder])
@pytest.mark.parametrize("height_m", [0.0, 0.4, 0.6])
@pytest.mark.parametrize(
    ("forward_m", "pitch_deg", "within_m"),
    [(0.05, -90.0, 0.01), (1.2, -45.0, 0.01), (2.5, -28.0, 0.06)],
)
def test_place_and_heading(
    finder: type[TagFinder], height_m: float, forward_m: float, pitch_deg: float, within_m: float
) -> None:
    mark = tag_mark(kind="tag", height_m=height_m)
    view = {"forward_m": forward_m, "right_m": -0.1, "heading_deg": 35.0, "pitch_deg": pitch_deg}
    found = seen(finder(mark), mark, **view)
    place = (found.forward_m - OFFSET_M, found.right_m, found.height_m)
    assert place == pytest.approx((forward_m, -0.1, height_m), abs=within_m)
    assert found.heading_deg == pytest.approx(35.0, abs=1.0)
    assert found.confidence > 0.8


PAPER = tag_mark(height_m=0.0)  # tag 7 of 0.36 m, on white paper of 0.5 m
SMALL = replace(PAPER, length_m=0.14, width_m=0.14, options={"id": 7, "size_m": 0.1})
FOURTH = {"id": 6, "size_m": 0.18, "at_m": CORNERS_M[3]}
FOUR = tag_mark(height_m=0.0, options={"tags": [*BOARD["tags"], FOURTH]})
THREE = replace(FOUR, options=BOARD)
LOOSE = replace(SMALL, length_m=0.25, width_m=0.25, options={"id": 6, "size_m": 0.18})
LONE = replace(FOUR, options={"tags": [BOARD["tags"][0]]})


@pytest.mark.parametrize("above_m", [1.5, math.nan])
@pytest.mark.parametrize(
    ("mark", "prints", "found_at"),
    [
        (PAPER, [(PAPER, 0.3, 0.1)], (0.1, 0.3)),
        (PAPER, [(PAPER, 0.3, 0.1), (PAPER, -0.5, -0.1)], None),
        (PAPER, [(PAPER, -0.5, -0.1), (PAPER, 0.3, 0.1)], None),
        (FOUR, [(FOUR, 0.05, 0.03)], (0.03, 0.05)),
        (FOUR, [(FOUR, 0.05, 0.03), (LOOSE, -0.6, 0.2)], (0.03, 0.05)),
        (FOUR, [(LOOSE, -0.6, -0.3), (FOUR, 0.05, 0.03)], (0.03, 0.05)),
        (FOUR, [(THREE, 0.05, 0.03), (LOOSE, -0.6, 0.2)], (0.03, 0.05)),
        (FOUR, [(LONE, 0.05, 0.03), (LOOSE, -0.6, 0.2)], None),
        # By its size the small print lies far below the floor, where the height is known.
        (PAPER, [(SMALL, -0.5, 0.2), (PAPER, 0.3, 0.1)], "by height"),
    ],
)
def test_of_two_prints_the_one_that_more_tags_show_counts(
    mark: LandingMark, prints: list[Any], found_at: Any, above_m: float
) -> None:
    """Prints by the place of their middle to the right and ahead, seen from straight above."""
    frame = replace(floor_view(prints), height_above_ground_m=above_m)
    if found_at == "by height":
        found_at = (0.1, 0.3) if above_m == 1.5 else None
    found = AprilTagFinder(mark).find(MarkView(frame=frame, camera=TAG_CAMERA))
    assert (found is None) == (found_at is None)
    if found_at:
        assert (found.forward_m - OFFSET_M, found.right_m) == pytest.approx(found_at, abs=0.01)
        assert found.confidence == 1.0


@pytest.mark.parametrize("pitch_deg", [-90.0, -45.0])
@pytest.mark.parametrize("place", [(0.0, 0.0, 1.5, 0.0), (0.4, -0.2, 1.2, 2.0)])
@pytest.mark.parametrize("noise_px", [0.0, 0.1])
def test_the_pose_of_exact_and_noisy_corners(
    pitch_deg: float, place: tuple[float, float, float, float], noise_px: float
) -> None:
    """Exactly below the lens, too: there the corners are symmetrical around the image's middle."""
    square = np.array([(-1, 1, 0), (1, 1, 0), (1, -1, 0), (-1, -1, 0)]) * 0.08
    ahead_m = 0.0 if pitch_deg == -90.0 else 1.2
    centres = [(x, y, 0.0) for x in (-0.12, 0.12) for y in (-0.12, 0.12)]
    corners_m = np.concatenate([square + np.array(centre) for centre in centres])
    true = np.array(place) + np.array([ahead_m, 0.0, 0.0, 0.0])
    pitch_rad = math.radians(pitch_deg)
    pixels = project(placed_corners(corners_m, true), TAG_CAMERA, pitch_rad)
    pixels += noise_px * np.random.default_rng(1).normal(size=pixels.shape)
    pose = level_pose(corners_m, pixels, TAG_CAMERA, pitch_rad)
    within = 0.01 if noise_px else 1e-7
    assert pose[:4] == pytest.approx(tuple(true), abs=within)
    assert pose.error_px == pytest.approx(noise_px * math.sqrt(2.0), abs=noise_px / 2.0 + 1e-7)


def test_other_tags_and_sizes_and_an_empty_view_are_not_the_mark() -> None:
    other = tag_mark(options={"id": 8, "size_m": 0.36})
    for picture in (AprilTagFinder(other).picture(), np.full((64, 64, 3), 255, np.uint8)):
        frame = view_of(picture, other, forward_m=1.0)
        assert AprilTagFinder(tag_mark()).find(MarkView(frame=frame, camera=TAG_CAMERA)) is None
    # The lab says 0.36 m, and the tag that lies there has 0.2 m: it looks farther away.
    small = tag_mark(options={"id": 7, "size_m": 0.2})
    frame = view_of(AprilTagFinder(small).picture(), small, forward_m=0.0, pitch_deg=-90.0)
    view = MarkView(frame=frame, camera=TAG_CAMERA)
    assert AprilTagFinder(small).find(view).confidence == 1.0
    assert AprilTagFinder(tag_mark()).find(view).confidence < 0.5
    # Corners above the horizon are no level board.
    corners_m = np.array([(-1.0, 1, 0), (1, 1, 0), (1, -1, 0), (-1, -1, 0)])
    pixels = np.array([(300.0, 150), (340, 150), (340, 190), (300, 190)])
    assert level_pose(corners_m, pixels, TAG_CAMERA, 0.0) is None


def test_prints_of_opencv_are_turned_by_half_a_turn() -> None:
    options = {"id": 7, "size_m": 0.375}  # 384 pixels of the picture, so that no cell is cut
    opencv = tag_mark(options={**options, "print": "opencv"})
    finder, own = AprilTagFinder(opencv), AprilTagFinder(tag_mark(options=options))
    assert (finder.picture()[::-1, ::-1] == own.picture()).all()
    found = seen(finder, opencv, forward_m=1.0, heading_deg=30.0)
    assert found.heading_deg == pytest.approx(30.0, abs=1.0)
    with pytest.raises(InputError, match="landing mark 'aruco' has no option 'print'"):
        ArucoFinder(replace(opencv, kind="aruco"))


@pytest.mark.parametrize(("options", "message"), cases("perception")["tag_options"])
def test_wrong_options_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        AprilTagFinder(tag_mark(options=options))


# AprilTag's own images, as people print them
# The first codes of tag16h5.c and so on of github.com/AprilRobotics/apriltag, as the images of
# github.com/AprilRobotics/apriltag-imgs show them
CODES: Final = {
    "16h5": (4, (0x27C8, 0x31B6, 0x3859, 0x569C)),
    "25h9": (5, (0x156F1F4, 0x1F28CD5, 0x16CE32C, 0x1EA379C)),
    "36h10": (6, (0x1A42F9469, 0x21A48C08D, 0x26DFDBC5D, 0x2D19B78FB)),
    "36h11": (6, (0xD7E00984B, 0xDDA664CA7, 0xDC4A1C821, 0xE17B470E9)),
}
PX_PER_M: Final = 1000
# Heading, distance ahead of the lens and pitch of the camera: from above, and tilted
VIEWS: Final = (
    *((heading_deg, 0.05, -90.0) for heading_deg in (0.0, 90.0, 180.0, -135.0)),
    *((heading_deg, 1.2, -45.0) for heading_deg in (10.0, -80.0, 170.0)),
)


def printed(family: str, number: int) -> NDArray[np.uint8]:
    """Return a tag with its black border, one pixel a cell, its upper edge first.

    The bits of a code go around in rings, a quarter of all rings first, and then its turns.
    """
    side, codes = CODES[family]
    rings = [(ring, column) for ring in range(side // 2) for column in range(ring, side - 1 - ring)]
    cells = np.zeros((side, side), dtype=np.uint8)
    places = [*rings]
    for _ in range(3):
        rings = [(column, side - 1 - row) for row, column in rings]
        places += rings
    if side % 2:
        places.append((side // 2, side // 2))
    for place, bit in zip(places, f"{codes[number]:0{side * side}b}", strict=True):
        cells[place] = 255 * int(bit)
    return np.pad(cells, 1)


def top_of(family: str, tags: list[dict[str, Any]]) -> NDArray[np.uint8]:
    """Return a white top of half a metre with tags."""
    top = np.full((PX_PER_M // 2, PX_PER_M // 2), 255, dtype=np.uint8)
    for tag in tags:
        side_px, (right_m, up_m) = round(tag["size_m"] * PX_PER_M), tag["at_m"]
        left, upper = (round((0.25 + off_m) * PX_PER_M - side_px / 2) for off_m in (right_m, -up_m))
        size_px, nearest = (side_px, side_px), cv2.INTER_NEAREST
        drawn = cv2.resize(printed(family, tag["id"]), size_px, interpolation=nearest)
        top[upper : upper + side_px, left : left + side_px] = drawn
    return np.repeat(top[..., None], 3, axis=2)


ONE_TAG: Final = [{"id": 2, "size_m": 0.34, "at_m": [0.0, 0.0]}]
FOUR_TAGS: Final = [
    {"id": 2 * row + column, "size_m": 0.15, "at_m": [x_m, y_m]}
    for row, y_m in enumerate((0.12, -0.12))
    for column, x_m in enumerate((-0.12, 0.12))
]


@pytest.mark.parametrize("family", CODES)
@pytest.mark.parametrize(
    ("on_print", "of_mark"),
    [(ONE_TAG, ONE_TAG), (FOUR_TAGS, FOUR_TAGS), (FOUR_TAGS[1:2], FOUR_TAGS)],
)
def test_the_upper_edge_is_that_of_the_mark(family: str, on_print: Any, of_mark: Any) -> None:
    """One tag, a board, and a board of which one tag is in view: 84 views of four families."""
    mark = tag_mark(height_m=0.1, options={"family": family, "tags": of_mark})
    finder, top = AprilTagFinder(mark), top_of(family, on_print)
    for heading_deg, forward_m, pitch_deg in VIEWS:
        view = {"forward_m": forward_m, "heading_deg": heading_deg, "pitch_deg": pitch_deg}
        frame = view_of(top, mark, **view)
        found = finder.find(MarkView(frame=frame, camera=TAG_CAMERA))
        assert abs(math.remainder(found.heading_deg - heading_deg, 360.0)) < 2.0
        place = (found.forward_m - TAG_CAMERA.forward_offset_m, found.right_m)
        assert place == pytest.approx((forward_m, 0.0), abs=0.02)
