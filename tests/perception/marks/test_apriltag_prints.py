"""AprilTag's own images, as people print them: headings and places of single tags and boards."""

from __future__ import annotations

import math
from typing import Any, Final

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from perception.marks.tags import AprilTagFinder
from tests.perception.marks.tag_views import CAMERA, view_of
from uav_bt.landing_marks import MarkView
from uav_bt.types import LandingMark

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


ONE: Final = [{"id": 2, "size_m": 0.34, "at_m": [0.0, 0.0]}]
FOUR: Final = [
    {"id": 2 * row + column, "size_m": 0.15, "at_m": [x_m, y_m]}
    for row, y_m in enumerate((0.12, -0.12))
    for column, x_m in enumerate((-0.12, 0.12))
]


@pytest.mark.parametrize("family", CODES)
@pytest.mark.parametrize(("on_print", "of_mark"), [(ONE, ONE), (FOUR, FOUR), (FOUR[1:2], FOUR)])
def test_the_upper_edge_of_the_image_is_that_of_the_mark(
    family: str, on_print: list[dict[str, Any]], of_mark: list[dict[str, Any]]
) -> None:
    """One tag, a board, and a board of which one tag is in view: 84 views of four families."""
    options = {"family": family, "tags": of_mark}
    mark = LandingMark(kind="apriltag", length_m=0.5, width_m=0.5, height_m=0.1, options=options)
    finder, top = AprilTagFinder(mark), top_of(family, on_print)
    for heading_deg, forward_m, pitch_deg in VIEWS:
        view = {"forward_m": forward_m, "heading_deg": heading_deg, "pitch_deg": pitch_deg}
        frame = view_of(top, mark, **view)
        found = finder.find(MarkView(frame=frame, camera=CAMERA))

        assert found.heading_deg is not None
        assert abs(math.remainder(found.heading_deg - heading_deg, 360.0)) < 2.0
        place = (found.forward_m - CAMERA.forward_offset_m, found.right_m)
        assert place == pytest.approx((forward_m, 0.0), abs=0.02)


def test_the_mark_draws_apriltags_own_image() -> None:
    options = {"family": "36h11", "id": 2, "size_m": 0.3}
    mark = LandingMark(kind="apriltag", length_m=0.5, width_m=0.5, height_m=0.0, options=options)
    drawn = AprilTagFinder(mark).picture()[102:410, 102:410, 0]

    assert (cv2.resize(drawn, (8, 8)) == printed("36h11", 2)).all()
