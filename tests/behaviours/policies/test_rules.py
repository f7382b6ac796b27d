"""The paper's rules: by the class map and by the corridor."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from behaviours.policies import segmentation_rule as rule
from behaviours.policies.corridor_rule import GROUND_END_M, CorridorRule, ground_reach
from behaviours.policies.segmentation_rule import TURN_RAD, SegmentationRule
from tests.behaviours.policies.cast_world import CAMERA, Box, cast, view
from tests.paper_lab import BACKGROUND, BOXES, HELIPAD_BOX
from tests.worlds.leaves import map_with
from tests.worlds.values import corridor
from uav_bt.answers import Advance, Blocked
from uav_bt.lab.classes import GROUND, OUTSIDE
from uav_bt.protocols import PolicyView
from uav_bt.types import CameraModel, Corridor, NearObstacles
from uav_bt.types.projection import ground_points

RULE = SegmentationRule()
FRONT: Box = (1.2, -0.4, 0.4)


def is_free(look: PolicyView) -> bool:
    return isinstance(RULE.decide(look), Advance)


def test_a_step_is_taken_over_open_ground() -> None:
    assert RULE.decide(view(cast())) == Advance(forward_m=0.3, reason="clear")
    assert RULE.decide(view(cast(), turning=1)) == Advance(forward_m=0.3, reason="clear")


def test_the_turn_goes_to_the_freer_side() -> None:
    for seen, tie_break, reason, side in (
        # A box is turned away from, to the half with fewer obstacle pixels.
        ({"boxes": [(1.2, -0.9, 0.1)]}, 0.9, "obstacle", 1),
        ({"boxes": [(1.2, -0.1, 0.9)]}, 0.9, "obstacle", -1),
        # Halves that differ by less than a tenth are a tie.
        ({"boxes": [FRONT]}, 0.1, "obstacle", -1),
        ({"boxes": [FRONT]}, 0.9, "obstacle", 1),
        # Where the ground ends aslant, the turn goes to where more of it lies.
        ({"ground_m": 1.35, "slant": 0.6}, 0.9, "edge", -1),
        ({"ground_m": 1.35, "slant": -0.6}, 0.9, "edge", 1),
    ):
        look = view(cast(**seen), tie_break=tie_break)
        decision = RULE.decide(look)
        assert isinstance(decision, Blocked)
        assert (decision.reason, decision.ground_ends) == (reason, reason == "edge")
        assert decision.yaw_rad == pytest.approx(side * TURN_RAD)
        for turning in (1, -1):  # a turn under way keeps its direction
            held = RULE.decide(replace(look, turning=turning))
            assert held.yaw_rad == pytest.approx(turning * TURN_RAD)


@pytest.mark.parametrize(("tie_break", "side"), [(0.1, -1), (0.9, 1)])
def test_in_a_corner_the_drone_turns_round(tie_break: float, side: int) -> None:
    """An obstacle and no ground: the random sample chooses the side."""
    ids = cast(ground_m=0.0)
    ids[:, 80:120] = BOXES[0]
    decision = RULE.decide(view(ids, tie_break=tie_break))
    assert decision.reason == "corner"
    assert decision.yaw_rad == pytest.approx(side * math.pi)
    assert RULE.decide(view(ids, turning=-side)).yaw_rad == pytest.approx(-side * TURN_RAD)


def test_the_mark_counts_as_ground() -> None:
    strip = cast(ground_m=1.3)
    assert RULE.decide(view(strip)).reason == "edge"
    behind_a_pad = np.where(strip == BACKGROUND, HELIPAD_BOX, strip).astype(np.uint8)
    assert RULE.decide(view(behind_a_pad)).reason == "clear"


def test_only_boxes_on_the_way_block() -> None:
    for box, thing, free in (
        (FRONT, BOXES[2], False),
        (FRONT, HELIPAD_BOX, True),  # the drone flies above the mark
        ((2.0, -3.0, 3.0), BOXES[2], True),  # beyond the range
        ((1.3, -3.0, 3.0), BOXES[2], False),
        ((1.3, 1.0, 1.6), BOXES[2], True),  # beside the way
        ((1.3, -1.6, -1.0), BOXES[2], True),
    ):
        assert is_free(view(cast([box], thing=thing))) is free


def with_obstacle_pixels(count: int, camera: CameraModel = CAMERA) -> NDArray[np.uint8]:
    """Return open ground with obstacle pixels in the high rectangle, from its lower left up."""
    ids = cast(camera=camera)
    high, _ = RULE.rectangles(view(ids, camera=camera))
    rows, columns = np.divmod(np.arange(count), high.right - high.left)
    ids[high.bottom - 1 - rows, high.left + columns] = BOXES[0]
    return ids


@pytest.mark.parametrize(
    ("size_px", "share"),
    [(None, 1.0), ((112, 56), 0.25), ((448, 224), 4.0), ((640, 360), 640 * 360 / 25088)],
)
def test_the_obstacle_threshold_is_a_share_of_the_map(
    size_px: tuple[int, int] | None, share: float
) -> None:
    """900 pixels of 224 x 112 are still free; in a turn three quarters of them, no dithering."""
    camera = CAMERA if size_px is None else CAMERA.resized(*size_px)
    for turning, limit_px in ((0, 900), (1, 675), (-1, 675)):
        limit = math.floor(limit_px * share)
        looks = [
            view(with_obstacle_pixels(count, camera), camera=camera, turning=turning)
            for count in (limit, limit + 1)
        ]
        assert [is_free(look) for look in looks] == [True, False]


@pytest.mark.parametrize(
    ("pixels", "full_turns", "free"),
    [(1200, 0, False), (1200, 1, True), (1900, 3, False), (1900, 100, False)],
)
def test_full_turns_in_vain_lower_the_demands_up_to_a_limit(
    pixels: int, full_turns: int, *, free: bool
) -> None:
    """To 900 * (1 + 3 * 0.35) = 1845 pixels."""
    assert is_free(view(with_obstacle_pixels(pixels), full_turns=full_turns)) is free


def test_a_step_keeps_its_margin_from_remembered_obstacles() -> None:
    for points, unplaced_deg, free in (
        ([], [], True),
        ([(0.3, 0.54)], [], False),  # beside the end of the step
        ([(0.3, -0.54)], [], False),
        ([(0.3, 0.56)], [], True),
        ([(-0.1, 0.3)], [], True),  # within the margin: a step may lead away, but not nearer
        ([(0.2, 0.3)], [], False),
        ([], [10, 11, 12, 13], False),  # of unknown range ahead
        ([], [10], True),  # a speck
        ([], [80, 81, 82, 83], True),  # far aside,
    ):
        near = NearObstacles(
            points_m=np.array(points, dtype=np.float64).reshape(-1, 2),
            captured_s=0.0,
            unplaced_rad=np.radians(unplaced_deg),
        )
        assert is_free(view(cast(), site_map=map_with(near))) is free


@pytest.mark.parametrize("pitch_deg", [-40, -28, -20])
@pytest.mark.parametrize("height_m", [0.8, 1.5, 2.0])
@pytest.mark.parametrize("size_px", [(224, 112), (640, 360)])
def test_the_rectangles_follow_pitch_and_height(
    pitch_deg: float, height_m: float, size_px: tuple[int, int]
) -> None:
    """Their upper edges see the ground at the ranges, their sides the angles."""
    camera, pitch_rad = CAMERA.resized(*size_px), math.radians(pitch_deg)
    look = replace(
        view(cast(camera=camera), camera=camera),
        gimbal_pitch_rad=pitch_rad,
        height_above_ground_m=height_m,
    )
    lowest = (camera.cx_px, camera.height_px - 1)
    usual = rule.THRESHOLD_PITCH_RAD, rule.THRESHOLD_HEIGHT_M
    nearest_m, from_m = (
        ground_points(lowest, camera, *each)[0] for each in ((pitch_rad, height_m), usual)
    )
    # The ranges count from the nearest ground in view, where that is further away than usual.
    beyond_m = max(0.0, nearest_m - from_m)
    for rectangle, range_m, half_angle_rad in zip(
        RULE.rectangles(look),
        (rule.OBSTACLE_RANGE_M, rule.GROUND_RANGE_M),
        (rule.OBSTACLE_HALF_ANGLE_RAD, rule.GROUND_HALF_ANGLE_RAD),
        strict=True,
    ):
        rows = [rectangle.top - 0.5, rectangle.top + 0.5]
        places = [(camera.cx_px, row) for row in rows]
        edge = ground_points(places, camera, pitch_rad, height_m)[:, 0]
        clipped = rectangle.top in {0, camera.height_px - 1}
        assert clipped or edge[1] <= range_m + beyond_m <= edge[0]
        for column in (rectangle.left, rectangle.right - 1):
            angle = math.atan(abs(column - camera.cx_px) / camera.fx_px)
            assert angle == pytest.approx(half_angle_rad, abs=1.0 / camera.fx_px)


@pytest.mark.parametrize("pitch_deg", [-90, 0, 30])
@pytest.mark.parametrize("height_m", [0.0, 3.0])
def test_the_rectangles_never_leave_the_map(pitch_deg: float, height_m: float) -> None:
    pitch_rad = math.radians(pitch_deg)
    look = replace(view(cast()), gimbal_pitch_rad=pitch_rad, height_above_ground_m=height_m)
    for rectangle in RULE.rectangles(look):
        assert 0 <= rectangle.top < rectangle.bottom <= CAMERA.height_px
        assert 0 <= rectangle.left < rectangle.right <= CAMERA.width_px
    RULE.decide(look)


# --- the corridor rule on ray-cast class maps and corridors of known reach ------------------------


def decide(found: Corridor | None = None, ids: Any = None, **seen: Any) -> Advance | Blocked:
    shown = cast() if ids is None else ids
    return CorridorRule().decide(view(shown, corridor=found or corridor(), **seen))


@pytest.mark.parametrize(
    ("free_m", "step_m"),
    [(2.5, 1.0), (1.6, 1.0), (1.3, 0.7), (0.95, 0.35), (0.89, None), (0.5, None), (0.0, None)],
)
def test_the_step_ends_the_margin_before_an_obstacle_ahead(
    free_m: float, step_m: float | None
) -> None:
    decision = decide(corridor(free_m, "front"))
    if isinstance(decision, Advance):
        assert decision.forward_m == pytest.approx(step_m)
        assert (decision.yaw_rad, decision.reason) == (0.0, "clear")
    else:
        assert step_m is None
        assert (decision.reason, decision.ground_ends) == ("obstacle", False)


def test_the_step_ends_the_edges_margin_before_the_end_of_the_ground() -> None:
    """From the body's centre, 0.15 m behind the lens."""
    decision = decide(ids=cast(ground_m=1.3))
    assert isinstance(decision, Advance)
    assert decision.forward_m == pytest.approx(1.3 + 0.15 - GROUND_END_M, abs=0.06)


def test_remembered_obstacles_shorten_or_forbid_the_step() -> None:
    beside = NearObstacles(points_m=np.array([(1.0, 0.4)]), captured_s=0.0)
    decision = decide(site_map=map_with(beside))
    assert isinstance(decision, Advance)
    assert 0.3 <= decision.forward_m <= 1.0 - math.sqrt(0.55**2 - 0.4**2) + 1e-9
    unplaced = NearObstacles(captured_s=0.0, unplaced_rad=np.radians([3.0, 4.0]))
    assert isinstance(decide(site_map=map_with(unplaced)), Blocked)


def test_the_turn_leads_away_from_the_intrusion() -> None:
    for side, box, sign in (
        ("left", None, 1),  # away from the side that is intruded upon, as in the paper
        ("right", None, -1),
        ("front", (1.2, -0.9, 0.1), 1),  # to the half with fewer obstacle pixels
        ("front", (1.2, -0.1, 0.9), -1),
    ):
        found, ids = corridor(0.5, side), cast([] if box is None else [box])
        assert decide(found, ids).yaw_rad == pytest.approx(sign * TURN_RAD)
        for turning in (1, -1):  # a turn under way keeps its direction
            assert decide(found, ids, turning=turning).yaw_rad == pytest.approx(turning * TURN_RAD)


@pytest.mark.parametrize(("slant", "sign"), [(0.6, -1), (-0.6, 1)])
def test_the_edge_is_turned_along(slant: float, sign: int) -> None:
    decision = decide(ids=cast(ground_m=1.2, slant=slant))
    assert isinstance(decision, Blocked)
    assert (decision.reason, decision.ground_ends) == ("edge", True)
    assert decision.yaw_rad == pytest.approx(sign * TURN_RAD)
    corner = decide(corridor(0.4, "front"), cast(ground_m=0.0))
    assert isinstance(corner, Blocked)
    assert (corner.reason, corner.ground_ends) == ("corner", True)


def test_without_depth_the_drone_looks_round() -> None:
    decision = CorridorRule().decide(view(cast(), tie_break=0.1))
    assert isinstance(decision, Blocked)
    assert decision.reason == "no depth"
    assert decision.yaw_rad == pytest.approx(-TURN_RAD)


def test_a_turn_asks_for_more_room_and_full_turns_for_less_up_to_a_limit() -> None:
    for free_m, seen, advances in (
        (0.95, {}, True),
        (0.95, {"turning": 1}, False),  # no dithering at the threshold
        (0.8, {"full_turns": 2}, False),
        (0.8, {"full_turns": 3}, True),
        (0.7, {"full_turns": 50}, False),
    ):
        assert isinstance(decide(corridor(free_m, "front"), **seen), Advance) == advances


@pytest.mark.parametrize("ground_m", [1.4, 2.0, 3.1, math.inf])
def test_the_reach_is_where_the_ground_ends(ground_m: float) -> None:
    """To a step of the scan and a row of the image. Ground goes on behind a box."""
    seen = view(cast([(1.5, -3.0, 3.0)]) if math.isinf(ground_m) else cast(ground_m=ground_m))
    assert ground_reach(seen.class_map.roles, seen) == pytest.approx(ground_m, abs=0.1)


def test_a_high_or_level_camera_sees_the_floor_several_metres_away() -> None:
    for pitch_deg, height_m, role, reach_m in (
        (0, 1.8, OUTSIDE, 0.0),
        (-10, 2.4, OUTSIDE, 0.0),
        (-30, 1.5, OUTSIDE, 0.0),
        (30, 1.5, OUTSIDE, 0.0),
        (0, 1.8, GROUND, math.inf),  # further away than the range of the rule,
    ):
        pitch_rad = math.radians(pitch_deg)
        seen = replace(view(cast()), gimbal_pitch_rad=pitch_rad, height_above_ground_m=height_m)
        assert ground_reach(np.full_like(seen.class_map.roles, role), seen) == reach_m


@given(st.floats(0.0, 5.0), st.integers(0, 9), st.sampled_from([-1, 0, 1]), st.floats(0.0, 5.0))
def test_a_step_never_reaches_an_obstacle(
    free_m: float, full_turns: int, turning: int, ground_m: float
) -> None:
    """Whatever the relief: half a body's length and a little remain."""
    ids = cast(ground_m=ground_m)
    said = decide(corridor(free_m, "front"), ids, full_turns=full_turns, turning=turning)
    if isinstance(said, Advance):
        assert said.forward_m <= max(free_m - 0.4, 0.0) + 1e-9
    assert isinstance(said, Advance) == (said.yaw_rad == 0.0)
