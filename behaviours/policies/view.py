"""The input of a leaf policy: the board's values that belong to one frame."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from uav_bt.answers import Answer
from uav_bt.board import CAMERA, CLASS_MAP, CORRIDOR, FRAME, HELD_TURN, RECENT_VIEWS, SITE_MAP
from uav_bt.errors import AnswerError, MissionError, PolicyFailedError
from uav_bt.protocols import LeafPolicy, PolicyView
from uav_bt.tree import Leaf
from uav_bt.types import MIN_VIEW_HEIGHT_M, CameraModel, ClassMap, Frame, HeldTurn
from uav_bt.types.projection import ground_points

# The keys that a leaf must declare in `reads` before it asks policies.
VIEW_KEYS: Final = (FRAME, CLASS_MAP, CAMERA, CORRIDOR, SITE_MAP, RECENT_VIEWS, HELD_TURN)
# An obstacle of unknown range within this bearing from straight ahead forbids a step. Outside it
# the path passes the obstacle at 0.7 of its range or more.
_UNPLACED_HALF_ANGLE_RAD: Final = math.radians(45)
_UNPLACED_MIN: Final = 2  # fewer are mask noise
_TIE_RATIO: Final = 0.1  # halves closer than this are a tie, which the random sample decides
FrameView = tuple[Frame, ClassMap, CameraModel]  # a frame, its class map, the camera at its size


def current_view(leaf: Leaf) -> FrameView | None:
    """Return the newest frame with its class map; None without one."""
    frame, class_map = leaf.read(FRAME).value, leaf.read(CLASS_MAP).value
    camera = leaf.read(CAMERA).value
    # Pitch and height belong to the frame that the class map was made from.
    if frame is None or class_map is None or camera is None:
        return None
    if class_map.captured_s != frame.captured_s:
        return None
    return frame, class_map, camera.resized(*class_map.ids.shape[::-1])


def ask(leaf: Leaf, policy: LeafPolicy, view: PolicyView) -> Answer | None:
    """Return a policy's answer to a view; None with a warning where its network has none."""
    try:
        answer: object = policy.decide(view)
    except AnswerError as error:
        leaf.feedback_message = f"no answer: {error}"
        leaf.mission.warn_once(leaf.feedback_message, leaf.path)
        return None
    except Exception as error:
        raise PolicyFailedError(policy, error) from error
    if not isinstance(answer, Answer):
        name = type(policy).__qualname__
        raise MissionError(
            f"decide() of {name} must return Advance, FollowLeg, Rotate, Blocked or Done of "
            f"uav_bt.answers, got {answer!r:.80}"
        )
    return answer


def policy_view(leaf: Leaf, view: FrameView, *, held: HeldTurn, tie_break: float) -> PolicyView:
    """Return the input of a policy for a view; `tie_break` is a random sample from [0, 1)."""
    (frame, class_map, camera), recent = view, leaf.read(RECENT_VIEWS).value
    if recent is not None and recent.newest.frame.index != frame.index:
        recent = None
    return PolicyView(
        class_map=class_map,
        camera=camera,
        gimbal_pitch_rad=frame.gimbal_pitch_rad,
        height_above_ground_m=frame.height_above_ground_m,
        corridor=leaf.read(CORRIDOR).value,
        site_map=leaf.read(SITE_MAP).value,
        recent=recent,
        turning=held.direction,
        full_turns=held.full_turns,
        tie_break=tie_break,
        clearances=leaf.mission.clearances,
    )


def is_unplaced_ahead(view: PolicyView) -> bool:
    """Return whether the map has an obstacle of unknown range ahead, which forbids a step."""
    if view.site_map is None:
        return False
    return view.site_map.near.unplaced_within(_UNPLACED_HALF_ANGLE_RAD) >= _UNPLACED_MIN


def greater_side(view: PolicyView, left: int, right: int) -> float:
    """Return the side of the greater count, positive: the right one; chance decides a tie."""
    is_tie = abs(left - right) <= _TIE_RATIO * max(left, right)
    return view.tie_break - 0.5 if is_tie else float(right - left)


def nearest_ground_m(view: PolicyView) -> float:
    """Return the distance ahead of the camera of the nearest ground in view; 0 without any."""
    camera, height_m = view.camera, max(view.height_above_ground_m, MIN_VIEW_HEIGHT_M)
    lowest = camera.cx_px, camera.height_px - 1
    ahead_m = ground_points(lowest, camera, view.gimbal_pitch_rad, height_m)[0]
    return max(0.0, float(np.nan_to_num(ahead_m)))
