"""Faults of images: their content and their delay."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from uav_bt.testing.faults.kind import FaultMoment, Observe
from uav_bt.types import Frame, Observation
from uav_bt.types.arrays import Image


def image(change: Callable[[Frame, FaultMoment], Image]) -> Observe:
    """Return an effect that replaces the image and keeps the rest of the frame."""

    def observe(seen: Observation, at: FaultMoment) -> Observation:
        if seen.frame is None:
            return seen
        return replace(seen, frame=replace(seen.frame, image=change(seen.frame, at)))

    return observe


def frozen(frame: Frame, at: FaultMoment) -> Image:
    """Return the last image from before the fault, or else the first one."""
    return frame.image if at.still is None else at.still.image


def noisy(frame: Frame, at: FaultMoment) -> Image:
    """Return the image with white noise, the same for the same frame."""
    noise = np.random.default_rng(frame.index).normal(0.0, at.level, frame.image.shape)
    return np.clip(frame.image + noise, 0, 255).astype(np.uint8)


def covered(frame: Frame, at: FaultMoment) -> Image:
    """Return the image dark and blurred."""
    import cv2  # noqa: PLC0415 - few faults need it

    height_px, width_px = frame.image.shape[:2]
    # Blurred over a tenth of its width, an image has no details for more pixels than these.
    small = cv2.resize(frame.image, (64, 36), interpolation=cv2.INTER_AREA)
    blurred = cv2.GaussianBlur(small, (0, 0), 6.4)
    large = cv2.resize(blurred, (width_px, height_px), interpolation=cv2.INTER_LINEAR)
    return (at.level * large).astype(np.uint8)


def _newest(seen: Observation, at: FaultMoment, limit_s: float) -> Observation:
    frames = [past.frame for past in at.past if past.frame is not None]
    old = [frame for frame in frames if frame.captured_s <= limit_s + 1e-6]
    return replace(seen, frame=(old or frames)[-1 if old else 0])


def late(seen: Observation, at: FaultMoment) -> Observation:
    """Show the newest frame that is old enough, or else the oldest of those kept."""
    return seen if seen.frame is None else _newest(seen, at, seen.frame.captured_s - at.level)


def slow(seen: Observation, at: FaultMoment) -> Observation:
    """Show `level` frames per second."""
    if seen.frame is None:
        return seen
    return _newest(seen, at, math.floor(seen.frame.captured_s * at.level) / at.level)
