"""Training examples: three frames of a flight, the camera's motion, and labels if there are any."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import cv2
import numpy as np

from perception.depth.training.footage import EVERY, CameraTrack, Flight
from uav_bt.errors import ValueRangeError
from uav_bt.types import CameraModel
from uav_bt.types.arrays import Floats, Floats32, Indices

# Between a target and a reference; more leaves no overlap.
_MAX_MOVE_M: Final = 0.5
_MAX_TURN_RAD: Final = 0.35
# Limits of random rotations. Flights keep one gimbal angle, and a network would learn depth from
# the row. A gimbal leaves a little roll.
_PITCH_RAD: Final = 0.07
_ROLL_RAD: Final = 0.02
_FLIP: Final = 0.5  # share of mirrored clips
_BRIGHTNESS: Final = 0.2  # relative, in both directions; one sample for all frames of a clip
_TINT: Final = 0.05  # relative, in both directions, each colour independently


@dataclass(frozen=True, kw_only=True, eq=False)
class Clip:
    """A target frame and two reference frames, target first."""

    images: Floats32  # (3, H, W, 3), RGB, 0 to 1
    motions: Floats32  # (2, 3, 4), transforms from the target's camera to the references', metres
    camera: CameraModel  # of the images
    labels: Floats32 | None  # (3, h, w, 2), as `Flight.labels`


class ClipSource:
    """All clips of some flights, taken in flight; equal generators give equal clips."""

    def __init__(self, flights: Sequence[Flight]) -> None:
        self._flights = flights
        self._tracks = [CameraTrack(flight) for flight in flights]
        self._single: list[Indices] = []  # by flight
        # (flight, target) and the frames that may stand beside it.
        self._targets: list[tuple[int, int, Indices]] = []
        for number, track in enumerate(self._tracks):
            aloft = np.flatnonzero(track.aloft)
            self._single.append(aloft[aloft % EVERY == 0])
            for target in map(int, aloft):
                beside = track.near(target, _MAX_MOVE_M, _MAX_TURN_RAD)
                beside = beside[track.aloft[beside]]
                if len(beside) >= 2:
                    self._targets.append((number, target, beside))
        self.frame_count = sum(map(len, self._single))  # drawn for themselves
        if not self.frame_count:
            raise ValueRangeError(f"no frame of {len(flights)} flights was taken aloft; fly higher")

    def neighbours(self, rng: np.random.Generator) -> Clip:
        """Return a frame and two that were taken near it; the camera must have moved."""
        if not self._targets:
            raise ValueRangeError(
                f"no frame of {len(self._flights)} flights has two others from nearby places, at "
                f"most {_MAX_MOVE_M} m away; record flights in which the drone moves"
            )
        number, target, beside = self._targets[int(rng.integers(len(self._targets)))]
        others = [int(other) for other in rng.choice(beside, size=2, replace=False)]
        track, motions = self._tracks[number], []
        for other in others:
            measured = track.measured_motion(target, other)
            motions.append(track.motion(target, other) if measured is None else measured)
        return self._clip(number, [target, *others], np.stack(motions))

    def singles(self, rng: np.random.Generator) -> Clip:
        """Return three independent frames, for training on labels alone."""
        share = np.array([len(frames) for frames in self._single]) / self.frame_count
        number = int(rng.choice(len(share), p=share))
        chosen = [int(frame) for frame in rng.choice(self._single[number], size=3)]
        return self._clip(number, chosen, np.zeros((2, 3, 4)))

    def _clip(self, number: int, chosen: list[int], motions: Floats) -> Clip:
        flight = self._flights[number]
        images = np.stack([flight.frames[place].image for place in chosen]).astype(np.float32)
        labels = None
        if flight.labels is not None:
            labels = flight.labels[chosen].transpose(0, 2, 3, 1).astype(np.float32)
        camera, moved = flight.camera, motions.astype(np.float32)
        return Clip(images=images / 255.0, motions=moved, camera=camera, labels=labels)


def varied(clip: Clip, rng: np.random.Generator) -> Clip:
    """Return a clip of a camera at another angle, perhaps in a mirrored world, in another light."""
    pitch_rad = rng.uniform(-_PITCH_RAD, _PITCH_RAD)
    clip = turned(clip, pitch_rad, rng.uniform(-_ROLL_RAD, _ROLL_RAD))
    if rng.random() < _FLIP:
        clip = mirrored(clip)
    gain = 1.0 + rng.uniform(-_BRIGHTNESS, _BRIGHTNESS)
    gains = gain * (1.0 + rng.uniform(-_TINT, _TINT, size=3))
    return replace(clip, images=np.clip(clip.images * gains.astype(np.float32), 0.0, 1.0))


def turned(clip: Clip, pitch_rad: float, roll_rad: float) -> Clip:
    """Return the clip of a camera rotated about its lens, up and then right side down.

    Outside the original frames, images are mirrored and labels are unknown.
    """
    c, s = math.cos(pitch_rad), math.sin(pitch_rad)
    up = np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
    c, s = math.cos(roll_rad), math.sin(roll_rad)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ up
    matrix, size = clip.camera.matrix, (clip.camera.width_px, clip.camera.height_px)
    homography = matrix @ turn @ np.linalg.inv(matrix)
    images = [
        cv2.warpPerspective(image, homography, size, borderMode=cv2.BORDER_REFLECT)
        for image in clip.images
    ]
    labels = None if clip.labels is None else _turned_labels(clip.labels, clip.camera, turn)
    return replace(clip, images=np.stack(images), motions=_seen_by(turn, clip), labels=labels)


def _seen_by(turn: Floats, clip: Clip) -> Floats32:
    """Return the motions of a clip whose cameras are turned or mirrored, (3, 3)."""
    rotations, translations = turn @ clip.motions[:, :, :3] @ turn.T, turn @ clip.motions[:, :, 3:]
    return np.concatenate([rotations, translations], axis=2).astype(np.float32)


def _turned_labels(labels: Floats32, camera: CameraModel, turn: Floats) -> Floats32:
    """Rotate depth maps: pixels move, and depths change to the new optical axis."""
    height, width = labels.shape[1:3]
    camera = camera.resized(width, height)
    pixels = np.stack([*np.meshgrid(np.arange(width), np.arange(height)), np.ones((height, width))])
    rays = np.tensordot(turn.T @ np.linalg.inv(camera.matrix), pixels, axes=1)
    nearer = np.maximum(rays[2], 1e-3)  # depth along the old axis for one along the new
    columns = np.asarray(camera.fx_px * rays[0] / nearer + camera.cx_px, dtype=np.float32)
    rows = np.asarray(camera.fy_px * rays[1] / nearer + camera.cy_px, dtype=np.float32)
    beyond = (math.nan, math.inf)
    moved = [
        cv2.remap(each, columns, rows, cv2.INTER_NEAREST, None, cv2.BORDER_CONSTANT, beyond)
        for each in labels
    ]
    return np.asarray(np.stack(moved) / nearer[..., None], dtype=np.float32)


def mirrored(clip: Clip) -> Clip:
    """Return the clip of a camera in a mirrored world."""
    camera, labels = clip.camera, clip.labels
    return Clip(
        images=np.ascontiguousarray(clip.images[:, :, ::-1]),
        motions=_seen_by(np.diag([-1.0, 1.0, 1.0]), clip),
        camera=replace(camera, cx_px=camera.width_px - 1 - camera.cx_px),
        labels=None if labels is None else np.ascontiguousarray(labels[:, :, ::-1]),
    )
