"""Panes of the camera image and of the readings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from uav_bt.board.blackboard import Reading
from uav_bt.display.canvas import (
    ACCENT,
    ALARM,
    DIM,
    INK,
    Colour,
    Point,
    circle,
    line,
    put,
    shortened,
    tag,
    text_width_px,
)
from uav_bt.display.phrases import describe_fix, describe_movement
from uav_bt.display.video.depth_panes import empty_pane
from uav_bt.mission.tick import TickRecord
from uav_bt.types import CameraModel, ClassMap, Frame, MarkFix
from uav_bt.types.arrays import Image
from uav_bt.types.projection import camera_axes

_PAD_RADIUS_M: Final = 0.3
_NEAR_M: Final = 0.3  # distance from the pad below which it is not marked
_BRANCH_ROW_PX: Final = 22
_BRANCH_INDENT_PX: Final = 14
_BRANCH_WIDTH_PX: Final = 300
_MARGIN_PX: Final = 18


@dataclass(frozen=True, kw_only=True)
class Readings:
    """Data of one tick for the panes."""

    record: TickRecord
    fix: Reading[MarkFix]
    class_map: Reading[ClassMap]
    elapsed_s: float  # time since the take-off command
    distance_m: float  # travelled distance


def project_fix(fix: MarkFix, frame: Frame, camera: CameraModel) -> tuple[float, float, float]:
    """Return the position of a fix in the camera frame.

    Args:
        fix: position of the mark.
        frame: the image with its telemetry.
        camera: source of the lens's offset from the body's centre.

    Returns:
        Metres right, down and along the optical axis; the gimbal keeps the horizon level.
    """
    forward_m = fix.forward_m - camera.forward_offset_m
    below_m = frame.height_above_ground_m - fix.height_m
    level_m = np.array([forward_m, fix.right_m, below_m])
    right_m, down_m, depth_m = (level_m @ camera_axes(frame.gimbal_pitch_rad)).tolist()
    return right_m, down_m, depth_m


def pad_circle(
    fix: MarkFix, frame: Frame, camera: CameraModel
) -> tuple[float, float, float] | None:
    """Return the circle around the mark in an image; None if it is not in view.

    Args:
        fix: position of the mark.
        frame: the image with its telemetry.
        camera: intrinsics at the size of the image.

    Returns:
        Column, row and radius, pixels.
    """
    right_m, down_m, depth_m = project_fix(fix, frame, camera)
    if depth_m <= _NEAR_M:
        return None
    x = camera.cx_px + camera.fx_px * right_m / depth_m
    y = camera.cy_px + camera.fy_px * down_m / depth_m
    inside = 0 <= x < camera.width_px and 0 <= y < camera.height_px
    return (x, y, camera.fx_px * _PAD_RADIUS_M / depth_m) if inside else None


def draw_camera(readings: Readings, camera: CameraModel, size_px: tuple[int, int]) -> Image:
    """Return the camera's image with a ring around the mark and the policy's reason."""
    record = readings.record
    frame = record.observation.frame
    if frame is None:
        return empty_pane("no image yet", size_px)
    image = resize_image(frame.image, size_px)
    if readings.fix.value is not None:
        mark_fix(image, readings.fix.value, frame, camera)
    age_ms = 1000.0 * (record.time_s - frame.captured_s)
    tag(image, f"camera  {age_ms:.0f} ms old", (10, 10), colour=DIM)
    if record.feedback:
        leaf = record.active[-1] if record.active else ""
        tag(image, f"{leaf}: {record.feedback}", (10, size_px[1] - 36), scale=0.6, colour=ACCENT)
    return image


def resize_image(image: Image, size_px: tuple[int, int]) -> Image:
    """Return an image at the size of its pane."""
    # Strong shrinking needs averaging, which takes four times as long.
    shrinks = image.shape[1] > 1.5 * size_px[0]
    interpolation = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(image, size_px, interpolation=interpolation), dtype=np.uint8)


def mark_fix(image: Image, fix: MarkFix, frame: Frame, camera: CameraModel) -> None:
    """Draw a ring around the mark in a frame's image, or point to it beyond the border."""
    if frame.height_above_ground_m < fix.height_m + _NEAR_M:
        return  # on or just above the pad, which fills the view
    height_px, width_px = image.shape[:2]
    colour = ACCENT if fix.detected else INK
    words = f"mark {fix.range_m:.2f} m"
    ring = pad_circle(fix, frame, camera.resized(width_px, height_px))
    if ring is not None:
        x, y, radius_px = *ring[:2], min(max(ring[2], 10.0), 150.0)
        _reticle(image, (x, y), radius_px, colour)
        half_words_px = (text_width_px(words, 0.45) + 12) / 2
        at_px = (round(x - half_words_px), round(y - radius_px) - 32)
        tag(image, words, at_px, colour=colour)
        return
    right_m, down_m, _ = project_fix(fix, frame, camera)
    _arrow(image, math.atan2(down_m, right_m), words, colour)


def _arrow(image: Image, angle_rad: float, words: str, colour: Colour) -> None:
    """Draw an arrow at the border; the angle is clockwise from right."""
    height_px, width_px = image.shape[:2]
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    half_x, half_y = width_px / 2 - 16, height_px / 2 - 16
    length = min(half_x / max(abs(c), 1e-6), half_y / max(abs(s), 1e-6))
    x, y = width_px / 2 + c * length, height_px / 2 + s * length
    barbs = [(x - 16 * c - 14 * k * s, y - 16 * s + 14 * k * c) for k in (1, -1)]
    line(image, [barbs[0], (x, y), barbs[1]], colour, 3)
    wide = text_width_px(words, 0.45) + 12
    left = x - c * (wide / 2 + 26) - wide / 2
    tag(image, words, (round(left), round(y - s * 42) - 10), colour=colour)


def _reticle(image: Image, at_px: Point, radius_px: float, colour: Colour) -> None:
    x, y = at_px
    line(image, circle(x, y, radius_px), colour, 2)
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        line(
            image,
            [
                (x + dx * (radius_px - 6), y + dy * (radius_px - 6)),
                (x + dx * (radius_px + 6), y + dy * (radius_px + 6)),
            ],
            colour,
            2,
        )


def draw_readings(readings: Readings, size_px: tuple[int, int]) -> Image:
    """Return the text pane: the active branch on the left, the numbers on the right."""
    image = empty_pane("", size_px)
    record = readings.record
    put(image, record.phase or "-", (18, 38), scale=0.85, colour=ACCENT, bold=True)
    clock = f"{readings.elapsed_s:.1f} s"
    right = size_px[0] - 18 - text_width_px(clock, 0.85)
    put(image, clock, (right, 38), scale=0.85)
    line(image, [(18, 52), (size_px[0] - 18, 52)], DIM)
    _draw_branch(image, record.active, (18, 76))
    draw_rows(image, _numbers(readings), (_BRANCH_WIDTH_PX + 8, 76))
    return image


def _draw_branch(image: Image, active: Sequence[str], at_px: tuple[int, int]) -> None:
    rows = max((image.shape[0] - at_px[1]) // _BRANCH_ROW_PX + 1, 1)
    shown = list(active[-rows:])
    if not shown:
        put(image, "tree idle", at_px, colour=DIM, scale=0.45)
    for depth, name in enumerate(shown):
        left, base = at_px[0] + depth * _BRANCH_INDENT_PX, at_px[1] + depth * _BRANCH_ROW_PX
        if depth:
            stem = left - _BRANCH_INDENT_PX + 4
            line(image, [(stem, base - 17), (stem, base - 5), (left - 3, base - 5)], DIM)
        is_leaf = depth == len(shown) - 1
        colour = ACCENT if is_leaf else INK
        words = shortened(name, _BRANCH_WIDTH_PX - left, 0.48, bold=is_leaf)
        put(image, words, (left, base), scale=0.48, colour=colour, bold=is_leaf)


def _numbers(readings: Readings) -> list[tuple[str, str, Colour]]:
    record = readings.record
    state = record.observation.state
    speed_mps = math.hypot(state.velocity.forward_mps, state.velocity.right_mps)
    rows = [
        ("command", describe_movement(record.command.movement), INK),
        ("drone", state.flying.value.replace("_", " "), INK),
        ("height", f"{state.height_above_ground_m:.2f} m above the ground", INK),
        ("speed", f"{speed_mps:.2f} m/s,  flown {readings.distance_m:.1f} m", INK),
        ("camera", f"{math.degrees(state.gimbal_pitch_rad):.0f} deg", INK),
        ("mark", describe_fix(readings.fix.value, readings.fix.age_s), INK),
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


def draw_rows(
    image: Image, rows: Sequence[tuple[str, str, Colour]], at_px: tuple[int, int]
) -> None:
    """Write rows of name and value in their colours, inside the image."""
    left = at_px[0] + 84
    for index, (name, value, colour) in enumerate(rows):
        base = at_px[1] + index * _BRANCH_ROW_PX
        put(image, name, (at_px[0], base), colour=DIM, scale=0.45)
        words = shortened(value, image.shape[1] - _MARGIN_PX - left, 0.45)
        put(image, words, (left, base), colour=colour, scale=0.45)
