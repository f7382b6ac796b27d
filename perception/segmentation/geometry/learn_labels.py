"""From one flight's footage to labels of ground and not ground, by geometry alone."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

import cv2
import numpy as np

from perception.camera.ground_plane import CameraView, ground_depth, level_rays
from perception.odometry.camera_track import CameraTrack, Footage, camera_track, measured_motion
from perception.odometry.track_fit import TrackFitConfig, fitted_track
from perception.segmentation.geometry.ground_limit import LimitConfig, Sighting, consistent
from perception.segmentation.geometry.labels import GROUND, UNKNOWN, GroundLabels
from perception.segmentation.geometry.plane_sweep import Map, OtherFrame, SweepConfig, sweep
from perception.segmentation.geometry.sightings import SightingConfig, sighted
from uav_bt.progress import Advance, silent
from uav_bt.types.arrays import Floats, Image

LABELLED_SIZE_PX: Final = (224, 112)  # width and height of the networks' input


@dataclass(frozen=True, kw_only=True)
class LabelConfig:
    """Which frames are labelled, and with which others each is compared. Numbers are chosen.

    Attributes:
        every_s: Time between two labelled frames.
        within_s: Largest time between a frame and another.
        baseline_m: Least and largest distance between their lenses.
        turn_rad: Largest turn between them.
        aside: Turn that one metre of baseline is worth, rad/m, in the choice of others.
        others: Number of other frames before, and after.
        tries: Number of them that are tried, before and after.
    """

    every_s: float = 0.8
    within_s: float = 2.8
    baseline_m: tuple[float, float] = (0.15, 0.6)
    turn_rad: float = math.radians(26.0)
    aside: float = 0.8
    others: int = 2
    tries: int = 6
    track: TrackFitConfig = field(default_factory=TrackFitConfig)
    planes: SweepConfig = field(default_factory=SweepConfig)
    sighting: SightingConfig = field(default_factory=SightingConfig)
    limit: LimitConfig = field(default_factory=LimitConfig)


def ground_labels(
    footage: Footage, config: LabelConfig | None = None, *, advance: Advance = silent
) -> list[GroundLabels]:
    """Label frames of a flight; a frame without another at a distance is left out.

    Args:
        footage: the flight, frames at least twice as wide as the labels; undistorted.
        config: which frames are labelled and how.
        advance: called after each labelled frame.

    Returns:
        Labels of 224x112 pixels, in the order of the frames.
    """
    config = config or LabelConfig()
    track = fitted_track(footage, camera_track(footage), config.track)
    grey = [_grey(frame) for frame in footage.frames]
    found: list[tuple[int, Sighting]] = []
    places: list[Floats] = []
    chosen = _spaced(footage, config.every_s)
    for done, frame in enumerate(chosen, start=1):
        if track.height_m[frame] > 0.0:
            sighting = _sighting(footage, track, grey, frame, config)
            if sighting is not None:
                found.append((frame, sighting))
                places.append(track.position_m[frame, :2])
        advance("labels from motion", done, len(chosen))
    if not found:
        return []
    made = consistent([each for _, each in found], np.mean(places, axis=0), config.limit)
    return [
        GroundLabels(frame=frame, labels=labels, confidence=confidence)
        for (frame, _), (labels, confidence) in zip(found, made, strict=True)
    ]


def _spaced(footage: Footage, every_s: float) -> list[int]:
    """Return frames with a spacing of about `every_s`."""
    chosen: list[int] = []
    for frame, time_s in enumerate(footage.captured_s):
        if not chosen or time_s - footage.captured_s[chosen[-1]] >= every_s - 1e-6:
            chosen.append(frame)
    return chosen


def _grey(rgb: Image) -> Map:
    small = cv2.resize(rgb, LABELLED_SIZE_PX, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY), np.float32)


def _sighting(
    footage: Footage, track: CameraTrack, grey: list[Map], frame: int, config: LabelConfig
) -> Sighting | None:
    view = CameraView(
        camera=footage.camera.resized(*LABELLED_SIZE_PX),
        pitch_rad=float(footage.gimbal_pitch_rad[frame]),
        height_m=float(track.height_m[frame]),
    )
    motions = _motions(footage, track, frame, config)
    if not motions:
        return None
    others = [
        OtherFrame(grey=grey[other], motion=motion, before=other < frame)
        for other, motion, _ in motions
    ]
    scores = sweep(grey[frame], view, others, config.planes)
    labels = sighted(scores, view, config.sighting, config.planes)
    if not motions[0][2]:
        # The error of telemetry's heading is as large as the parallax of low objects.
        labels[labels == GROUND] = UNKNOWN
    rays = level_rays(view)
    reached = rays[:2] * ground_depth(view, rays=rays)
    cos, sin = math.cos(track.yaw_rad[frame]), math.sin(track.yaw_rad[frame])
    x_m, y_m = track.position_m[frame, :2]
    points = np.stack(
        [x_m + cos * reached[0] - sin * reached[1], y_m + sin * reached[0] + cos * reached[1]],
        axis=2,
    )
    return Sighting(labels=labels, points_m=points)


def _motions(
    footage: Footage, track: CameraTrack, frame: int, config: LabelConfig
) -> list[tuple[int, Floats, bool]]:
    """Return other frames with their motion: measured ones, or else those of the track."""
    measured, reckoned = [], []
    for candidates in _candidates(footage, track, frame, config):
        found = 0
        for other in candidates:
            motion = measured_motion(footage, track, frame, other, config.track.following)
            if motion is not None:
                measured.append((other, motion, True))
                found += 1
            if found == config.others:
                break
        reckoned += [(other, track.motion(frame, other), False) for other in candidates[:1]]
    return measured or reckoned


def _candidates(
    footage: Footage, track: CameraTrack, frame: int, config: LabelConfig
) -> tuple[list[int], list[int]]:
    """Return the best other frames before and after a frame, the best first."""
    least_m, most_m = config.baseline_m
    passed_s = footage.captured_s - footage.captured_s[frame]
    apart_m = np.linalg.norm((track.position_m - track.position_m[frame])[:, :2], axis=1)
    turned = np.abs(track.yaw_rad - track.yaw_rad[frame])
    fits = (np.abs(passed_s) <= config.within_s + 1e-6) & (turned < config.turn_rad)
    fits &= (apart_m >= least_m) & (apart_m <= most_m)
    order = np.argsort(turned - config.aside * apart_m, kind="stable")
    sides = (passed_s < 0.0, passed_s > 0.0)
    before, after = ([int(at) for at in order if fits[at] and side[at]] for side in sides)
    return before[: config.tries], after[: config.tries]
