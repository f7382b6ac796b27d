"""The segmentation rule on ray-cast class maps of known geometry."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from behaviours.policies.segmentation_rule import (
    Rectangle,
    SegmentationRule,
    SegmentationRuleConfig,
)
from tests.behaviours.policies.cast_world import (
    CAMERA,
    FOR_EVER,
    HEIGHT_M,
    PITCH_RAD,
    Box,
    cast,
    view,
)
from tests.paper_lab import BACKGROUND, BOXES, HELIPAD_BOX
from tests.worlds.leaves import map_with
from uav_bt.answers import Advance, Blocked
from uav_bt.errors import ValueRangeError
from uav_bt.protocols import PolicyView
from uav_bt.types import CameraModel, NearObstacles
from uav_bt.types.projection import ground_points

# Fixed here, so that tuning the defaults does not change what these tests ask.
CONFIG = SegmentationRuleConfig(
    step_m=0.3,
    turn_rad=math.radians(30),
    obstacle_threshold_px=900.0,
    ground_threshold_px=1600.0,
    threshold_pitch_rad=PITCH_RAD,
    threshold_height_m=HEIGHT_M,
    obstacle_range_m=1.9,
    obstacle_half_angle_rad=math.radians(22),
    ground_range_m=1.75,
    ground_half_angle_rad=math.radians(18),
    hysteresis=0.75,
    obstacle_relief=0.35,
    ground_relief=0.2,
    max_full_turns=3,
    margin_m=0.42,
    tie_ratio=0.1,
)
RULE = SegmentationRule(CONFIG)

# --- the rule's table -----------------------------------------------------------------------------


def test_open_ground_is_advanced_over() -> None:
    """Ground without end and nothing on it: a step ahead, no turn."""
    decision = RULE.decide(view(cast()))

    assert decision == Advance(forward_m=0.3, reason="clear")


@pytest.mark.parametrize(("left_m", "right_m", "side"), [(-0.9, 0.1, 1), (-0.1, 0.9, -1)])
def test_a_box_is_turned_away_from(left_m: float, right_m: float, side: int) -> None:
    """A near box more to the left turns the drone to the right, and the other way round."""
    decision = RULE.decide(view(cast([(1.2, left_m, right_m)])))

    assert isinstance(decision, Blocked)
    assert decision.reason == "obstacle"
    assert decision.yaw_rad == pytest.approx(side * CONFIG.turn_rad)


@pytest.mark.parametrize(("tie_break", "side"), [(0.1, -1), (0.9, 1)])
def test_a_box_dead_ahead_is_left_to_the_random_draw(tie_break: float, side: int) -> None:
    """Halves that differ by less than a tenth are a tie."""
    decision = RULE.decide(view(cast([(1.2, -0.4, 0.4)]), tie_break=tie_break))

    assert decision.yaw_rad == pytest.approx(side * CONFIG.turn_rad)


@pytest.mark.parametrize(("slant", "side"), [(0.6, -1), (-0.6, 1)])
def test_the_grounds_edge_is_turned_along(slant: float, side: int) -> None:
    """Where the ground ends aslant, the turn goes to where more of it lies."""
    decision = RULE.decide(view(cast(ground_m=1.35, slant=slant)))

    assert isinstance(decision, Blocked)
    assert decision.reason == "edge"
    assert decision.yaw_rad == pytest.approx(side * CONFIG.turn_rad)


@pytest.mark.parametrize(("tie_break", "side"), [(0.1, -1), (0.9, 1)])
def test_a_corner_is_turned_round_in(tie_break: float, side: int) -> None:
    """An obstacle and no ground: right about, the random draw chooses the side."""
    ids = cast(ground_m=0.0)
    ids[:, 80:120] = BOXES[0]

    decision = RULE.decide(view(ids, tie_break=tie_break))

    assert decision.reason == "corner"
    assert decision.yaw_rad == pytest.approx(side * math.pi)


def test_what_stands_on_the_ground_counts_as_ground() -> None:
    """A box or the pad in view hides ground that is there all the same."""
    narrow_strip = cast(ground_m=1.3)
    assert RULE.decide(view(narrow_strip)).reason == "edge"

    behind_a_pad = np.where(narrow_strip == BACKGROUND, HELIPAD_BOX, narrow_strip).astype(np.uint8)

    assert RULE.decide(view(behind_a_pad)).reason == "clear"


def test_the_pad_is_no_obstacle() -> None:
    """What would block the way as a box does not as the pad: the drone flies above it."""
    front = [(1.2, -0.4, 0.4)]

    assert isinstance(RULE.decide(view(cast(front))), Blocked)
    assert isinstance(RULE.decide(view(cast(front, thing=HELIPAD_BOX))), Advance)


def test_only_boxes_within_range_block() -> None:
    """A wall based beyond `obstacle_range_m` does not reach into the rectangle; nearer, it does."""
    wide = 3.0

    assert isinstance(RULE.decide(view(cast([(2.0, -wide, wide)]))), Advance)
    assert isinstance(RULE.decide(view(cast([(1.5, -wide, wide)]))), Blocked)


def test_boxes_beside_the_way_do_not_block() -> None:
    """A box a metre aside is passed."""
    assert isinstance(RULE.decide(view(cast([(1.3, 1.0, 1.6)]))), Advance)
    assert isinstance(RULE.decide(view(cast([(1.3, -1.6, -1.0)]))), Advance)


# --- thresholds -----------------------------------------------------------------------------------


def with_obstacle_pixels(count: int, camera: CameraModel = CAMERA) -> NDArray[np.uint8]:
    """Open ground with `count` obstacle pixels in the high rectangle, from its lower left up."""
    ids = cast(camera=camera)
    high, _ = RULE.rectangles(view(ids, camera=camera))
    region = high.of(ids)
    rows, columns = np.divmod(np.arange(count), region.shape[1])
    region[region.shape[0] - 1 - rows, columns] = BOXES[0]
    return ids


def test_the_obstacle_threshold_is_exact() -> None:
    """900 pixels are still free, 901 are not."""
    assert isinstance(RULE.decide(view(with_obstacle_pixels(900))), Advance)
    assert isinstance(RULE.decide(view(with_obstacle_pixels(901))), Blocked)


@pytest.mark.parametrize("turning", [1, -1])
def test_leaving_a_turn_takes_a_freer_way(turning: int) -> None:
    """Under way in a turn the threshold is three quarters of 900: no dithering around it."""
    assert isinstance(RULE.decide(view(with_obstacle_pixels(676), turning=turning)), Blocked)
    assert isinstance(RULE.decide(view(with_obstacle_pixels(675), turning=turning)), Advance)


@pytest.mark.parametrize(
    ("size_px", "share"), [((112, 56), 0.25), ((448, 224), 4.0), ((640, 360), 640 * 360 / 25088)]
)
def test_thresholds_scale_with_the_map(size_px: tuple[int, int], share: float) -> None:
    """A map of another size is judged by the same share of its pixels."""
    camera = CAMERA.resized(*size_px)
    limit = math.floor(900 * share)

    assert isinstance(
        RULE.decide(view(with_obstacle_pixels(limit, camera), camera=camera)), Advance
    )
    assert isinstance(
        RULE.decide(view(with_obstacle_pixels(limit + 1, camera), camera=camera)), Blocked
    )


@pytest.mark.parametrize("size_px", [(112, 56), (448, 224), (640, 360)])
@pytest.mark.parametrize(
    ("boxes", "ground_m"),
    [
        ([], FOR_EVER),
        ([(1.2, -0.9, 0.1)], FOR_EVER),
        ([(1.3, 1.0, 1.6)], FOR_EVER),
        ([], 1.2),
        ([(1.6, -2.0, 2.0)], FOR_EVER),
    ],
)
def test_the_decision_does_not_depend_on_the_map_size(
    size_px: tuple[int, int], boxes: Sequence[Box], ground_m: float
) -> None:
    """The same scene at another resolution gives the same decision."""
    camera = CAMERA.resized(*size_px)
    other = RULE.decide(view(cast(boxes, ground_m=ground_m, camera=camera), camera=camera))

    assert other == RULE.decide(view(cast(boxes, ground_m=ground_m)))


# --- the turn under way ---------------------------------------------------------------------------


@pytest.mark.parametrize("turning", [1, -1])
@pytest.mark.parametrize(
    ("boxes", "ground_m"),
    [([(1.2, -0.9, 0.1)], FOR_EVER), ([(1.2, -0.1, 0.9)], FOR_EVER), ([], 1.0), ([], 0.0)],
)
def test_a_turn_keeps_its_direction(turning: int, boxes: Sequence[Box], ground_m: float) -> None:
    """Whatever comes into view, a turn under way goes on the same way until the way is free."""
    decision = RULE.decide(view(cast(boxes, ground_m=ground_m), turning=turning))

    assert decision.yaw_rad == pytest.approx(turning * CONFIG.turn_rad)


@pytest.mark.parametrize("turning", [1, -1])
def test_a_turn_ends_when_the_way_is_free(turning: int) -> None:
    """Open ground ends it."""
    assert isinstance(RULE.decide(view(cast(), turning=turning)), Advance)


def test_full_turns_in_vain_lower_the_demands() -> None:
    """After each full turn a little more obstacle and less ground will do, up to a limit."""
    crowded = view(with_obstacle_pixels(1200))
    assert isinstance(RULE.decide(crowded), Blocked)
    assert isinstance(RULE.decide(replace(crowded, full_turns=1)), Advance)

    very_crowded = view(with_obstacle_pixels(1900))  # 900 * (1 + 3 * 0.35) = 1845
    assert isinstance(RULE.decide(replace(very_crowded, full_turns=3)), Blocked)
    assert isinstance(RULE.decide(replace(very_crowded, full_turns=100)), Blocked)


# --- obstacles on the map -------------------------------------------------------------------------


def remembered(*points: tuple[float, float], unplaced_deg: Sequence[float] = ()) -> PolicyView:
    """Open ground, and points remembered: forward and right of the body's centre."""
    return replace(
        view(cast()),
        site_map=map_with(
            NearObstacles(
                points_m=np.array(points, dtype=np.float64).reshape(-1, 2),
                captured_s=0.0,
                unplaced_rad=np.radians(unplaced_deg),
            )
        ),
    )


def test_nothing_remembered_does_not_block() -> None:
    """An empty map, and a tree without one, leave it to the view."""
    assert isinstance(RULE.decide(remembered()), Advance)
    assert isinstance(RULE.decide(view(cast())), Advance)


@pytest.mark.parametrize("right_m", [0.41, -0.41])
def test_a_step_keeps_its_margin_from_what_left_the_view(right_m: float) -> None:
    """An obstacle beside where the step would end blocks it, a little further aside does not."""
    assert isinstance(RULE.decide(remembered((0.3, right_m))), Blocked)
    assert isinstance(
        RULE.decide(remembered((0.3, right_m + math.copysign(0.02, right_m)))), Advance
    )


def test_too_near_already_a_step_may_lead_away() -> None:
    """Inside the margin, a step that comes no nearer is free; one that does is not."""
    assert isinstance(RULE.decide(remembered((-0.1, 0.3))), Advance)
    assert isinstance(RULE.decide(remembered((0.2, 0.3))), Blocked)


def test_an_obstacle_of_unknown_range_ahead_blocks() -> None:
    """A few columns of it do; specks, and what lies far aside, do not."""
    assert isinstance(RULE.decide(remembered(unplaced_deg=[10, 11, 12, 13])), Blocked)
    assert isinstance(RULE.decide(remembered(unplaced_deg=[10])), Advance)
    assert isinstance(RULE.decide(remembered(unplaced_deg=[80, 81, 82, 83])), Advance)


# --- the rectangles -------------------------------------------------------------------------------


@pytest.mark.parametrize("pitch_deg", [-40, -28, -20])
@pytest.mark.parametrize("height_m", [0.8, 1.5, 2.0])
@pytest.mark.parametrize("size_px", [(224, 112), (640, 360)])
def test_the_rectangles_follow_pitch_and_height(
    pitch_deg: float, height_m: float, size_px: tuple[int, int]
) -> None:
    """Their upper edges see the ground at the configured ranges, their sides the angles.

    If the nearest ground in view is further away than in the view of the thresholds, the ranges
    count from it.
    """
    camera = CAMERA.resized(*size_px)
    look = replace(
        view(cast(camera=camera), camera=camera),
        gimbal_pitch_rad=math.radians(pitch_deg),
        height_above_ground_m=height_m,
    )
    cfg, lowest = CONFIG, (camera.cx_px, camera.height_px - 1)
    nearest_m, from_m = (
        ground_points(lowest, camera, pitch_rad, above_m)[0]
        for pitch_rad, above_m in ((math.radians(pitch_deg), height_m), (PITCH_RAD, HEIGHT_M))
    )
    beyond_m = max(0.0, nearest_m - from_m)
    for rectangle, range_m, half_angle_rad in zip(
        RULE.rectangles(look),
        (cfg.obstacle_range_m, cfg.ground_range_m),
        (cfg.obstacle_half_angle_rad, cfg.ground_half_angle_rad),
        strict=True,
    ):
        rows = [rectangle.top - 0.5, rectangle.top + 0.5]
        edge = ground_points(
            [(camera.cx_px, row) for row in rows], camera, math.radians(pitch_deg), height_m
        )[:, 0]
        clipped = rectangle.top in {0, camera.height_px - 1}
        assert clipped or edge[1] <= range_m + beyond_m <= edge[0]
        for column in (rectangle.left, rectangle.right - 1):
            angle = math.atan(abs(column - camera.cx_px) / camera.fx_px)
            assert angle == pytest.approx(half_angle_rad, abs=1.0 / camera.fx_px)


@pytest.mark.parametrize(
    ("pitch_deg", "height_m"), [(-28, 2.0), (-28, 1.0), (-45, 2.0), (-56, 1.5)]
)
@pytest.mark.parametrize(
    ("boxes", "ground_m", "is_free"),
    [
        ([], FOR_EVER, True),
        ([(3.0, -3.0, 3.0)], FOR_EVER, True),
        ([(1.2, -3.0, 3.0)], FOR_EVER, False),
        ([(1.2, -0.2, 0.6)], FOR_EVER, False),
        ([], 1.1, False),
    ],
)
def test_pitch_and_height_do_not_change_the_decision(
    pitch_deg: float, height_m: float, boxes: Sequence[Box], ground_m: float, *, is_free: bool
) -> None:
    """A scene is judged alike from a higher drone and by a camera that looks further down."""
    pitch_rad = math.radians(pitch_deg)
    ids = cast(boxes, ground_m=ground_m, pitch_rad=pitch_rad, height_m=height_m)
    look = replace(view(ids), gimbal_pitch_rad=pitch_rad, height_above_ground_m=height_m)

    assert isinstance(RULE.decide(look), Advance) is is_free


@pytest.mark.parametrize("pitch_deg", [-90, -60, 0, 30])
@pytest.mark.parametrize("height_m", [0.0, 0.1, 3.0])
def test_the_rectangles_never_leave_the_map(pitch_deg: float, height_m: float) -> None:
    """Whatever pitch and height: inside the map and not empty."""
    look = replace(
        view(cast()), gimbal_pitch_rad=math.radians(pitch_deg), height_above_ground_m=height_m
    )
    for rectangle in RULE.rectangles(look):
        assert 0 <= rectangle.top < rectangle.bottom <= CAMERA.height_px
        assert 0 <= rectangle.left < rectangle.right <= CAMERA.width_px
    RULE.decide(look)


def test_a_rectangle_and_its_halves() -> None:
    """Halves split the region without overlap; regions are views."""
    image = np.arange(48, dtype=np.uint8).reshape(6, 8)
    rectangle = Rectangle(top=2, bottom=5, left=1, right=7)

    left, right = rectangle.halves(image)

    assert np.array_equal(np.hstack([left, right]), rectangle.of(image))
    assert left.shape == right.shape == (3, 3)
    assert np.shares_memory(rectangle.of(image), image)


# --- manners --------------------------------------------------------------------------------------


def test_the_rule_is_pure() -> None:
    """The same view gives the same decision, and is left as it was."""
    look = view(cast([(1.2, -0.4, 0.4)]))
    before = look.class_map.ids.copy()

    assert RULE.decide(look) == RULE.decide(look)
    assert np.array_equal(look.class_map.ids, before)


def test_refuses_an_unknown_class() -> None:
    """A map with ids beyond the seventeen is a mistake upstream, not background."""
    ids = cast()
    ids[0, 0] = 17

    with pytest.raises(ValueRangeError, match="class ids"):
        RULE.decide(view(ids))


@pytest.mark.parametrize(
    "bad", [{"step_m": 0.0}, {"step_m": -0.1}, {"turn_rad": 0.0}, {"turn_rad": 4.0}]
)
def test_refuses_a_step_or_turn_that_is_none(bad: dict[str, float]) -> None:
    """A policy that never moves would fly for ever."""
    with pytest.raises(ValueRangeError, match="step and turn"):
        SegmentationRuleConfig(**bad)
