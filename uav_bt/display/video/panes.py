"""Panes of films: camera image, readings, class map, depth, corridor."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.display import canvas
from uav_bt.display.canvas import ACCENT, ALARM, BACKDROP, DIM, INK, Colour, Size
from uav_bt.display.phrases import describe_corridor, describe_fix, describe_free, describe_movement
from uav_bt.display.shown import Shown
from uav_bt.types import CameraModel, ClassMap, Corridor, DepthMap, Frame, MarkFix
from uav_bt.types.arrays import Image
from uav_bt.types.projection import camera_axes

_PAD_RADIUS_M: Final = 0.3
_NEAR_M: Final = 0.3  # distance from the pad below which it is not marked
_ROW_PX: Final = 22
_INDENT_PX: Final = 14  # of the active branch, by level
_BRANCH_WIDTH_PX: Final = 300
_MARGIN_PX: Final = 18
FARTHEST_M: Final = 5.0  # end of the depth's scale: the length of the paper's carpet
_UNKNOWN: Final[Colour] = (70, 74, 84)  # grey, which is not in the scale
_BAR_WIDTH_PX: Final = 10
_OPACITY: Final = 0.6  # opacity of the mark on intruding pixels
_LEAST_SHARE: Final = 0.001  # of the pixels; smaller ones would flicker in the legend
_ROOMY_PX: Final = 400  # panes from this width on show more numbers
_WIDTH_PX: Final = 1280  # of the video
_GAP_PX: Final = 2
_FLATTEST: Final = 4.0  # largest aspect ratio of the video's panes, wide or high

Row = tuple[str, str, Colour]  # name, value and its colour


def project_fix(fix: MarkFix, frame: Frame, camera: CameraModel) -> tuple[float, float, float]:
    """Return a fix in the camera frame: metres right, down and along the optical axis.

    The gimbal keeps the horizon level.
    """
    forward_m = fix.forward_m - camera.forward_offset_m
    below_m = frame.height_above_ground_m - fix.height_m
    level_m = np.array([forward_m, fix.right_m, below_m])
    right_m, down_m, depth_m = (level_m @ camera_axes(frame.gimbal_pitch_rad)).tolist()
    return right_m, down_m, depth_m


def draw_camera(shown: Shown, camera: CameraModel, size_px: Size) -> Image:
    """Return the camera's image with a ring around the mark and the policy's reason."""
    record, frame = shown.record, shown.frame
    if frame is None:
        return canvas.empty_pane("no image yet", size_px)
    image = draw_frame(frame, shown.fix.value, camera, size_px)
    age_ms = 1000.0 * (record.time_s - frame.captured_s)
    canvas.tag(image, f"camera  {age_ms:.0f} ms old", (10, 10), colour=DIM)
    if record.feedback:
        leaf = record.active[-1] if record.active else ""
        words = f"{leaf}: {record.feedback}"
        canvas.tag(image, words, (10, size_px[1] - 36), scale=0.6, colour=ACCENT)
    return image


def draw_frame(frame: Frame, fix: MarkFix | None, camera: CameraModel, size_px: Size) -> Image:
    """Return a frame with a ring around the mark, or an arrow to it beyond the border."""
    # Strong shrinking needs averaging, which takes four times as long.
    shrinks = frame.image.shape[1] > 1.5 * size_px[0]
    image = canvas.resized(frame.image, size_px, cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
    if fix is None or frame.height_above_ground_m < fix.height_m + _NEAR_M:
        return image  # on or just above the pad, it fills the view
    colour, words = ACCENT if fix.detected else INK, f"mark {fix.range_m:.2f} m"
    right_m, down_m, depth_m = project_fix(fix, frame, camera)
    lens, ahead_m = camera.resized(*size_px), max(depth_m, _NEAR_M)
    x = lens.cx_px + lens.fx_px * right_m / ahead_m
    y = lens.cy_px + lens.fy_px * down_m / ahead_m
    if depth_m <= _NEAR_M or not (0 <= x < size_px[0] and 0 <= y < size_px[1]):
        _arrow(image, math.atan2(down_m, right_m), words, colour)
        return image
    radius_px = min(max(lens.fx_px * _PAD_RADIUS_M / ahead_m, 10.0), 150.0)
    canvas.line(image, canvas.circle((x, y), radius_px), colour, 2)
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


def draw_readings(shown: Shown, size_px: Size) -> Image:
    """Return the text pane: the active branch on the left, the numbers on the right."""
    record = shown.record
    image = canvas.empty_pane("", size_px)
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


def draw_class_map(class_map: ClassMap | None, size_px: Size) -> Image:
    """Return the class map in the colours of its classes, with a legend."""
    if class_map is None:
        return canvas.empty_pane("no class map", size_px)
    ids = class_map.ids
    image = canvas.resized(class_map.classes.colourise(ids), size_px)
    title = "class map"
    if size_px[0] >= _ROOMY_PX:
        title += f"  {ids.shape[1]} x {ids.shape[0]}"
    image[:50] //= 4  # a plate for the words
    canvas.put(image, title, (16, 24), colour=INK, scale=0.45)
    left = 34 + canvas.text_width_px(title, 0.45)
    canvas.draw_legend(image, legend_of(class_map), (left, 24))
    return image


def legend_of(class_map: ClassMap) -> list[tuple[str, Colour]]:
    """Return name and colour of the visible classes, in the order of their ids."""
    counts = np.bincount(class_map.ids.ravel())
    found = np.flatnonzero(counts >= _LEAST_SHARE * class_map.ids.size).tolist()
    listed = list(class_map.classes)
    return [(listed[each].name.replace("_", " "), listed[each].colour) for each in found]


@functools.cache
def _scale_colours() -> NDArray[np.uint8]:
    """Return (256, 3) RGB from near (red) to far (blue)."""
    ramp = np.arange(255, -1, -1, dtype=np.uint8).reshape(-1, 1)
    return np.asarray(cv2.applyColorMap(ramp, cv2.COLORMAP_TURBO)[:, 0, ::-1], dtype=np.uint8)


def draw_depth(depth: DepthMap | None, size_px: Size, *, why_none: str = "") -> Image:
    """Return depth from near (red) to far (blue), and why it is missing."""
    if depth is None:
        return canvas.empty_pane(f"no depth: {why_none}" if why_none else "no depth", size_px)
    known = np.isfinite(depth.depth)
    metres = np.where(known, depth.depth, 0.0)
    colours = _scale_colours()[np.clip(metres * (255.0 / FARTHEST_M), 0.0, 255.0).astype(np.uint8)]
    colours[~known] = _UNKNOWN
    image = canvas.resized(colours, size_px)
    words = "depth  nowhere known"
    if known.any():
        near_m, far_m = float(metres[known].min()), float(metres[known].max())
        words = f"depth  {near_m:.2f} to {far_m:.1f} m"
    if size_px[0] >= _ROOMY_PX:
        words += f",  confidence {depth.confidence:.2f}"
    canvas.tag(image, words, (10, 10), colour=DIM)
    if why_none:
        canvas.tag(image, why_none, (10, size_px[1] - 30), colour=ALARM)
    _draw_bar(image)
    return image


def _draw_bar(image: Image) -> None:
    height_px, width_px = image.shape[:2]
    top, bottom = 34, height_px - 14
    left = width_px - _BAR_WIDTH_PX - 34
    image[top - 10 : bottom + 10, left - 6 :] //= 4
    ramp = _scale_colours()[np.linspace(255, 0, bottom - top).astype(np.uint8)]
    image[top:bottom, left : left + _BAR_WIDTH_PX] = ramp[:, None, :]
    for metres in range(math.floor(FARTHEST_M) + 1):
        row = round(bottom - (bottom - top) * metres / FARTHEST_M)
        right = left + _BAR_WIDTH_PX
        canvas.line(image, [(right, row), (right + 3, row)], INK)
        canvas.put(image, f"{metres} m", (right + 5, row + 4), scale=0.32)


def draw_corridor(
    frame: Frame | None,
    corridor: Corridor | None,
    intruding: NDArray[np.bool_] | None,
    size_px: Size,
) -> Image:
    """Return the darkened image, in which pixels inside the corridor are marked."""
    if frame is None or corridor is None:
        return canvas.empty_pane("no corridor", size_px)
    # Nearest neighbour takes a tenth of the time, and a darkened image looks the same.
    image = canvas.resized(frame.image, size_px) // 2
    if intruding is not None and intruding.any():
        whole = canvas.resized(intruding.view(np.uint8), size_px) > 0
        blended = (1.0 - _OPACITY) * image[whole] + _OPACITY * np.array(ALARM)
        image[whole] = blended.astype(np.uint8)
    colour = DIM if corridor.nearest_side is None else ALARM
    canvas.tag(image, describe_corridor(corridor), (10, 10), colour=colour)
    canvas.tag(image, describe_free(corridor), (10, size_px[1] - 30), colour=ACCENT)
    row = size_px[1] // 2 - 10
    if math.isfinite(corridor.nearest_left_m):
        canvas.tag(image, f"< {corridor.nearest_left_m:.2f} m", (10, row), colour=ALARM)
    if math.isfinite(corridor.nearest_right_m):
        words = f"{corridor.nearest_right_m:.2f} m >"
        canvas.tag(image, words, (size_px[0], row), colour=ALARM)
    return image


def corridor_rows(shown: Shown) -> list[Row]:
    """Return what the panes of depth and corridor do not tell, as rows."""
    depth, corridor = shown.depth, shown.corridor
    rows = []
    if depth.value is not None:
        words = f"{depth.age_s:.1f} s old, confidence {depth.value.confidence:.2f}"
        rows.append(("depth", words, INK))
    if corridor is not None:
        rows.append(("unknown", f"{corridor.unknown_px} pixels of objects", INK))
    return rows


@dataclass(frozen=True, kw_only=True, eq=False)
class Seen:
    """Data of one image of the video."""

    frame: Frame
    class_map: ClassMap
    depth: DepthMap | None  # metric depth
    refusal: str  # reason why depth is missing or reduced
    corridor: Corridor | None
    intruding: NDArray[np.bool_] | None  # (H, W) pixels inside the corridor
    mark: MarkFix | None


class PerceptionPanes:
    """Composes the four panes; the intrinsics give the true aspect of resized images."""

    def __init__(self, camera: CameraModel) -> None:
        self._camera = camera
        aspect = (camera.width_px / camera.fx_px) / (camera.height_px / camera.fy_px)
        aspect = min(max(aspect, 1.0 / _FLATTEST), _FLATTEST)
        self.size_px = (_WIDTH_PX, round(_WIDTH_PX / aspect / 2) * 2)
        self._pane_px = ((_WIDTH_PX - _GAP_PX) // 2, (self.size_px[1] - _GAP_PX) // 2)

    def draw(self, seen: Seen) -> Image:
        """Return one image of the video, (H, W, 3) RGB."""
        wide, high = size = self._pane_px
        image = canvas.blank(self.size_px, BACKDROP)
        image[:high, :wide] = self._draw_frame(seen)
        image[-high:, :wide] = draw_class_map(seen.class_map, size)
        image[:high, -wide:] = draw_depth(seen.depth, size, why_none=seen.refusal)
        image[-high:, -wide:] = draw_corridor(seen.frame, seen.corridor, seen.intruding, size)
        return image

    def _draw_frame(self, seen: Seen) -> Image:
        frame, fix = seen.frame, seen.mark
        image = draw_frame(frame, fix, self._camera, self._pane_px)
        canvas.tag(image, f"{frame.captured_s:.1f} s", (10, 10), colour=DIM)
        age_s = math.inf if fix is None else frame.captured_s - fix.captured_s
        words = f"mark: {describe_fix(fix, age_s)}"
        canvas.tag(image, words, (10, self._pane_px[1] - 30), colour=DIM if fix is None else ACCENT)
        return image
