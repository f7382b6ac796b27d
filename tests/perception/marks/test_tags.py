"""Tags: place, heading and confidence from one image; options that are refused."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Final

import numpy as np
import pytest

from perception.marks.tag_pose import level_pose, placed_corners
from perception.marks.tags import AprilTagFinder, ArucoFinder, TagFinder
from tests.perception.marks.tag_views import CAMERA, floor_view, tag_mark, view_of
from uav_bt.errors import InputError
from uav_bt.landing_marks import MarkSighting, MarkView
from uav_bt.types import LandingMark
from uav_bt.types.projection import project

OFFSET_M = CAMERA.forward_offset_m
BOARD: Final[dict[str, Any]] = {
    "family": "36h11",
    "tags": [
        {"id": 3, "size_m": 0.18, "at_m": [-0.12, 0.12]},
        {"id": 4, "size_m": 0.18, "at_m": [0.12, 0.12]},
        {"id": 5, "size_m": 0.18, "at_m": [0.12, -0.12]},
    ],
}


def seen(finder: TagFinder, mark: LandingMark, **place: float) -> MarkSighting | None:
    frame = view_of(finder.picture(), mark, **place)
    return finder.find(MarkView(frame=frame, camera=CAMERA))


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
    found = seen(
        finder(mark),
        mark,
        forward_m=forward_m,
        right_m=-0.1,
        heading_deg=35.0,
        pitch_deg=pitch_deg,
    )

    place = (found.forward_m - OFFSET_M, found.right_m, found.height_m)
    assert place == pytest.approx((forward_m, -0.1, height_m), abs=within_m)
    assert found.heading_deg == pytest.approx(35.0, abs=1.0)
    assert found.confidence > 0.8


PAPER = tag_mark(height_m=0.0)  # tag 7 of 0.36 m, on white paper of 0.5 m
SMALL = replace(PAPER, length_m=0.14, width_m=0.14, options={"id": 7, "size_m": 0.1})
FOUR = tag_mark(
    height_m=0.0,
    options={"tags": [*BOARD["tags"], {"id": 6, "size_m": 0.18, "at_m": [-0.12, -0.12]}]},
)
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
    mark: LandingMark,
    prints: list[tuple[LandingMark, float, float]],
    found_at: tuple[float, float] | str | None,
    above_m: float,
) -> None:
    """Prints by the place of their middle to the right and ahead, seen from straight above."""
    frame = replace(floor_view(prints), height_above_ground_m=above_m)
    if found_at == "by height":
        found_at = (0.1, 0.3) if above_m == 1.5 else None
    found = AprilTagFinder(mark).find(MarkView(frame=frame, camera=CAMERA))

    if found_at is None:
        assert found is None
    else:
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
    pixels = project(placed_corners(corners_m, true), CAMERA, pitch_rad)
    pixels += noise_px * np.random.default_rng(1).normal(size=pixels.shape)
    pose = level_pose(corners_m, pixels, CAMERA, pitch_rad)

    within = 0.01 if noise_px else 1e-7
    assert pose[:4] == pytest.approx(tuple(true), abs=within)
    assert pose.error_px == pytest.approx(noise_px * math.sqrt(2.0), abs=noise_px / 2.0 + 1e-7)


def test_corners_above_the_horizon_are_no_level_board() -> None:
    corners_m = np.array([(-1.0, 1, 0), (1, 1, 0), (1, -1, 0), (-1, -1, 0)])
    pixels = np.array([(300.0, 150), (340, 150), (340, 190), (300, 190)])

    assert level_pose(corners_m, pixels, CAMERA, 0.0) is None


def test_other_tags_and_an_empty_view_are_not_the_mark() -> None:
    other = tag_mark(options={"id": 8, "size_m": 0.36})
    for picture in (AprilTagFinder(other).picture(), np.full((64, 64, 3), 255, np.uint8)):
        frame = view_of(picture, other, forward_m=1.0)
        assert AprilTagFinder(tag_mark()).find(MarkView(frame=frame, camera=CAMERA)) is None


def test_prints_of_opencv_are_turned_by_half_a_turn() -> None:
    options = {"id": 7, "size_m": 0.375}  # 384 pixels of the picture, so that no cell is cut
    opencv = tag_mark(options={**options, "print": "opencv"})
    finder, own = AprilTagFinder(opencv), AprilTagFinder(tag_mark(options=options))
    assert (finder.picture()[::-1, ::-1] == own.picture()).all()

    found = seen(finder, opencv, forward_m=1.0, heading_deg=30.0)
    assert found.heading_deg == pytest.approx(30.0, abs=1.0)
    with pytest.raises(InputError, match="landing mark 'aruco' has no option 'print'"):
        ArucoFinder(replace(opencv, kind="aruco"))


def test_a_tag_of_another_size_than_stated_is_hardly_trusted() -> None:
    """The lab says 0.36 m, and the tag that lies there has 0.2 m: it looks farther away."""
    small = tag_mark(options={"id": 7, "size_m": 0.2})
    picture = AprilTagFinder(small).picture()
    frame = view_of(picture, small, forward_m=0.0, pitch_deg=-90.0)
    right, wrong = (
        AprilTagFinder(mark).find(MarkView(frame=frame, camera=CAMERA))
        for mark in (small, tag_mark())
    )

    assert right.confidence == 1.0
    assert wrong.confidence < 0.5


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"id": 7, "size_m": 0.3, "familly": "36h11"},
            "no option 'familly'; did you mean 'family'",
        ),
        ({"id": 7, "size_m": 0.3, "family": "36h12"}, "unknown family of landing mark 'apriltag'"),
        (
            {"id": 7, "size_m": 0.3, "print": "me"},
            "print of .* should be 'apriltag' or 'opencv', got",
        ),
        ({"id": 7}, "needs the option id, .*, and the option size_m"),
        ({"size_m": 0.3}, "needs the option id, .*, and the option size_m"),
        ({"id": 587, "size_m": 0.3}, "family 36h11 has the tags 0 to 586, got id 587"),
        ({"id": 1.5, "size_m": 0.3}, "option id of .* should be a valid integer, got 1.5"),
        ({"id": True, "size_m": 0.3}, "option id of .* should be a valid integer, got True"),
        ({"id": 7, "size_m": -0.3}, "option size_m of .* should be greater than 0, got -0.3"),
        ({"id": 7, "size_m": math.inf}, "option size_m of .* should be a finite number, got inf"),
        ({"id": 7, "size_m": 0.45}, "does not fit on a top of 0.5 x 0.5 m"),
        ({"tags": []}, "or several tags in the option tags"),
        ({"tags": 3}, "option tags of .* should be a valid tuple, got 3"),
        ({"tags": [{"id": 7}]}, "landing mark 'apriltag' needs the option tags.0.size_m"),
        ({"id": 7, "size_m": 0.3, "tags": BOARD["tags"]}, "or several tags in the option tags"),
        (
            {"tags": [{"id": 7, "size_m": 0.1, "at": [0, 0]}]},
            "has no option 'tags.0.at'; did you mean 'at_m'",
        ),
        ({"tags": [{"id": 7, "size_m": 0.1, "at_m": [0.3, 0]}]}, "tag 7 of 0.1 m at .0.3, 0.0."),
        ({"tags": [{"id": 7, "size_m": 0.1}, {"id": 7, "size_m": 0.1}]}, "tag 7 is listed twice"),
    ],
)
def test_wrong_options_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        AprilTagFinder(tag_mark(options=options))
