"""Panes of the camera's image and of the readings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import cv2
import numpy as np

from uav_bt.display import canvas
from uav_bt.display.canvas import ACCENT, ALARM, DIM, INK, Colour, Point, Size
from uav_bt.display.flown_path import Shown
from uav_bt.display.phrases import describe_fix, describe_movement
from uav_bt.display.video.perception_panes import Row, empty_pane
from uav_bt.types import CameraModel, Frame, MarkFix
from uav_bt.types.arrays import Image
from uav_bt.types.projection import camera_axes

_PAD_RADIUS_M: Final = 0.3
_NEAR_M: Final = 0.3  # distance from the pad below which it is not marked
_ROW_PX: Final = 22
_INDENT_PX: Final = 14  # of the active branch, by level
_BRANCH_WIDTH_PX: Final = 300
_MARGIN_PX: Final = 18


def project_fix(fix: MarkFix, frame: Frame, camera: CameraModel) -> tuple[float, float, float]:
    """Return a fix in the camera frame: metres right, down and along the optical axis.

    The gimbal keeps the horizon level.
    """
    forward_m = fix.forward_m - camera.forward_offset_m
    below_m = frame.height_above_ground_m - fix.height_m
    level_m = np.array([forward_m, fix.right_m, below_m])
    right_m, down_m, depth_m = (level_m @ camera_axes(frame.gimbal_pitch_rad)).tolist()
    return right_m, down_m, depth_m


def pad_circle(
    fix: MarkFix, frame: Frame, camera: CameraModel
) -> tuple[float, float, float] | None:
    """Return column, row and radius, px, of a circle around the mark; None beyond the image."""
    right_m, down_m, depth_m = project_fix(fix, frame, camera)
    if depth_m <= _NEAR_M:
        return None
    x = camera.cx_px + camera.fx_px * right_m / depth_m
    y = camera.cy_px + camera.fy_px * down_m / depth_m
    inside = 0 <= x < camera.width_px and 0 <= y < camera.height_px
    return (x, y, camera.fx_px * _PAD_RADIUS_M / depth_m) if inside else None


def draw_camera(shown: Shown, camera: CameraModel, size_px: Size) -> Image:
    """Return the camera's image with a ring around the mark and the policy's reason."""
    record, frame = shown.record, shown.frame
    if frame is None:
        return empty_pane("no image yet", size_px)
    image = draw_frame(frame, shown.fix.value, camera, size_px)
    age_ms = 1000.0 * (record.time_s - frame.captured_s)
    canvas.tag(image, f"camera  {age_ms:.0f} ms old", (10, 10), colour=DIM)
    if record.feedback:
        leaf = record.active[-1] if record.active else ""
        canvas.tag(
            image, f"{leaf}: {record.feedback}", (10, size_px[1] - 36), scale=0.6, colour=ACCENT
        )
    return image


def draw_frame(frame: Frame, fix: MarkFix | None, camera: CameraModel, size_px: Size) -> Image:
    """Return a frame with a ring around the mark, or an arrow to it beyond the border."""
    # Strong shrinking needs averaging, which takes four times as long.
    shrinks = frame.image.shape[1] > 1.5 * size_px[0]
    image = canvas.resized(frame.image, size_px, cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
    if fix is None or frame.height_above_ground_m < fix.height_m + _NEAR_M:
        return image  # on or just above the pad, it fills the view
    colour, words = ACCENT if fix.detected else INK, f"mark {fix.range_m:.2f} m"
    ring = pad_circle(fix, frame, camera.resized(*size_px))
    if ring is None:
        right_m, down_m, _ = project_fix(fix, frame, camera)
        _arrow(image, math.atan2(down_m, right_m), words, colour)
        return image
    x, y, radius_px = *ring[:2], min(max(ring[2], 10.0), 150.0)
    _reticle(image, (x, y), radius_px, colour)
    half_words_px = (canvas.text_width_px(words, 0.45) + 12) / 2
    canvas.tag(image, words, (round(x - half_words_px), round(y - radius_px) - 32), colour=colour)
    return image


def _arrow(image: Image, angle_rad: float, words: str, colour: Colour) -> None:
    """Draw an arrow at the border; the angle is clockwise from right."""
    height_px, width_px = image.shape[:2]
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    half_x, half_y = width_px / 2 - 16, height_px / 2 - 16
    length = min(half_x / max(abs(c), 1e-6), half_y / max(abs(s), 1e-6))
    x, y = width_px / 2 + c * length, height_px / 2 + s * length
    barbs = [(x - 16 * c - 14 * k * s, y - 16 * s + 14 * k * c) for k in (1, -1)]
    canvas.line(image, [barbs[0], (x, y), barbs[1]], colour, 3)
    wide = canvas.text_width_px(words, 0.45) + 12
    left = x - c * (wide / 2 + 26) - wide / 2
    canvas.tag(image, words, (round(left), round(y - s * 42) - 10), colour=colour)


def _reticle(image: Image, at_px: Point, radius_px: float, colour: Colour) -> None:
    x, y = at_px
    canvas.line(image, canvas.circle(x, y, radius_px), colour, 2)
    near, far = radius_px - 6, radius_px + 6
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        ends = [(x + dx * reach, y + dy * reach) for reach in (near, far)]
        canvas.line(image, ends, colour, 2)


def draw_readings(shown: Shown, size_px: Size) -> Image:
    """Return the text pane: the active branch on the left, the numbers on the right."""
    record = shown.record
    image = empty_pane("", size_px)
    canvas.put(image, record.phase or "-", (18, 38), scale=0.85, colour=ACCENT, bold=True)
    clock = f"{shown.elapsed_s:.1f} s"
    canvas.put(image, clock, (size_px[0] - 18 - canvas.text_width_px(clock, 0.85), 38), scale=0.85)
    canvas.line(image, [(18, 52), (size_px[0] - 18, 52)], DIM)
    _draw_branch(image, record.active, (18, 76))
    draw_rows(image, _numbers(shown), (_BRANCH_WIDTH_PX + 8, 76))
    return image


def _draw_branch(image: Image, active: Sequence[str], at_px: tuple[int, int]) -> None:
    rows = max((image.shape[0] - at_px[1]) // _ROW_PX + 1, 1)
    shown = list(active[-rows:])
    if not shown:
        canvas.put(image, "tree idle", at_px, colour=DIM, scale=0.45)
    for depth, name in enumerate(shown):
        left, base = at_px[0] + depth * _INDENT_PX, at_px[1] + depth * _ROW_PX
        if depth:
            stem = left - _INDENT_PX + 4
            canvas.line(image, [(stem, base - 17), (stem, base - 5), (left - 3, base - 5)], DIM)
        is_leaf = depth == len(shown) - 1
        words = canvas.shortened(name, _BRANCH_WIDTH_PX - left, 0.48, bold=is_leaf)
        colour = ACCENT if is_leaf else INK
        canvas.put(image, words, (left, base), scale=0.48, colour=colour, bold=is_leaf)


def _numbers(shown: Shown) -> list[Row]:
    record, fix = shown.record, shown.fix
    state = record.observation.state
    speed_mps = math.hypot(state.velocity.forward_mps, state.velocity.right_mps)
    rows = [
        ("command", describe_movement(record.command.movement), INK),
        ("drone", state.flying.value.replace("_", " "), INK),
        ("height", f"{state.height_above_ground_m:.2f} m above the ground", INK),
        ("speed", f"{speed_mps:.2f} m/s,  flown {shown.flown.distance_m:.1f} m", INK),
        ("camera", f"{math.degrees(state.gimbal_pitch_rad):.0f} deg", INK),
        ("mark", describe_fix(fix.value, fix.age_s), INK),
    ]
    truth = record.truth
    if truth is not None and math.isfinite(truth.clearance_m):
        colour = ALARM if truth.clearance_m < 0.2 else INK
        rows.append(("clearance", f"{truth.clearance_m:.2f} m to an obstacle", colour))
    charge = "unknown" if state.battery is None else f"{100 * state.battery:.0f} %"
    rows.append(("battery", charge, INK))
    if record.override is not None:
        rows.append(("override", record.override.value, ALARM))
    return rows


def draw_rows(image: Image, rows: Sequence[Row], at_px: tuple[int, int]) -> None:
    """Write rows of name and value in their colours, inside the image."""
    left = at_px[0] + 84
    for index, (name, value, colour) in enumerate(rows):
        base = at_px[1] + index * _ROW_PX
        canvas.put(image, name, (at_px[0], base), colour=DIM, scale=0.45)
        words = canvas.shortened(value, image.shape[1] - _MARGIN_PX - left, 0.45)
        canvas.put(image, words, (left, base), colour=colour, scale=0.45)
