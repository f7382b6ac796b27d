"""Depth labels for a flight's frames without ground truth, from masks, telemetry and geometry.

Two sources are combined. Obstacles are as far away as their contact with the ground, seen now or
earlier (`perception.depth.contact.depth`). Near obstacles with the base out of the image have the
largest parallax between frames (`perception.depth.training.parallax`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import GroundPlane, view_of
from perception.depth.contact.depth import ContactEstimation
from perception.depth.metric import remembered_bases
from perception.depth.training.clips import DepthLabels
from perception.depth.training.footage import (
    FOOTAGE_SIZE_PX,
    CameraTrack,
    Footage,
    camera_track,
    measured_motion,
)
from perception.depth.training.parallax import Parallax, ParallaxConfig
from perception.mapping.recent import RecentLayer
from perception.mapping.view import View
from perception.odometry.ground import GroundOdometry
from uav_bt.errors import FileError, ShapeError, ValueRangeError
from uav_bt.files import whole_file
from uav_bt.progress import Advance, silent
from uav_bt.protocols import Segmenter
from uav_bt.types import Attitude, BodyVelocity, DroneState, FlyingState, Frame
from uav_bt.types.arrays import Image

LABEL_SIZE_PX: Final = (FOOTAGE_SIZE_PX[0] // 2, FOOTAGE_SIZE_PX[1] // 2)  # the network's output


@dataclass(frozen=True, kw_only=True)
class LabelConfig:
    """Which frames are labelled, and from which other frames."""

    min_height_m: float = 0.8  # above the ground; frames before take-off are left out
    every: int = 3  # every third frame is labelled: neighbours look alike, and dense flow is slow
    others: int = 4  # number of other frames for parallax
    min_move_m: float = 0.04  # least distance of the camera to such a frame
    max_move_m: float = 0.3  # largest distance of the camera to such a frame
    max_turn_rad: float = 0.45  # at this angle half of the image's width still overlaps
    max_apart_s: float = 2.0  # integrated velocity drifts
    # A depth from flow above this multiple of the bound from masks is wrong. The slack allows for
    # the error of the height.
    bound_slack: float = 1.1
    parallax: ParallaxConfig = field(default_factory=ParallaxConfig)

    def __post_init__(self) -> None:
        if self.every < 1 or self.others < 1:
            raise ValueRangeError(
                f"every and others must be positive, got {self.every} and {self.others}"
            )


def frames_of(footage: Footage) -> Iterator[Frame]:
    """Yield the footage's frames as the drone sent them, at the footage's size."""
    for place in range(len(footage)):
        roll, pitch, yaw = (float(angle) for angle in footage.attitude_rad[place])
        yield Frame(
            image=footage.frames[place],
            index=int(footage.index[place]),
            captured_s=float(footage.captured_s[place]),
            gimbal_pitch_rad=float(footage.gimbal_pitch_rad[place]),
            attitude=Attitude(roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw),
            height_above_ground_m=float(footage.height_above_ground_m[place]),
        )


def _states_of(footage: Footage) -> Iterator[DroneState]:
    """Yield the telemetry as the drone sent it."""
    for place in range(len(footage.state_s)):
        roll, pitch, yaw = (float(angle) for angle in footage.state_attitude_rad[place])
        forward, right, down = (float(speed) for speed in footage.velocity_mps[place])
        yield DroneState(
            captured_s=float(footage.state_s[place]),
            flying=FlyingState.FLYING,
            attitude=Attitude(roll_rad=roll, pitch_rad=pitch, yaw_rad=yaw),
            velocity=BodyVelocity(forward_mps=forward, right_mps=right, down_mps=down),
        )


def contact_labels(
    footage: Footage,
    segmenter: Segmenter,
    config: LabelConfig | None = None,
    *,
    advance: Advance = silent,
) -> DepthLabels:
    """Label a flight from a network's masks and ground contact.

    Args:
        footage: one flight.
        segmenter: gives the masks.
        config: which frames are labelled.
        advance: called with the progress after every frame.
    """
    config = config or LabelConfig()
    width, height = LABEL_SIZE_PX
    depth = np.full((len(footage), height, width), np.nan, dtype=np.float16)
    bound = np.full((len(footage), height, width), np.inf, dtype=np.float16)
    recent, odometry = RecentLayer(), GroundOdometry()
    states = _states_of(footage)
    state = next(states)
    odometry.predict(state)
    for place, frame in enumerate(frames_of(footage)):
        while state.captured_s < frame.captured_s and (later := next(states, None)) is not None:
            state = later
            odometry.predict(state)
        if frame.height_above_ground_m >= config.min_height_m:
            class_map = segmenter.segment(frame)
            view = view_of(frame, footage.camera, class_map.ids.shape[::-1])
            # The base of an obstacle too near to show it was seen from further away.
            remembered = None
            now, then = odometry.now, odometry.at(frame.captured_s)
            if now is not None and then is not None:
                recent.expire(now.time_s)
                near = recent.near(now)
                remembered = remembered_bases(near, now, then, frame, footage.camera)
            odometry.see(class_map, frame, view.camera)
            seen = odometry.at(frame.captured_s)
            if seen is not None:
                placed = View.of(class_map, frame, view.camera, seen)
                if placed is not None:
                    recent.add(placed)
            if place % config.every == 0:
                known = ContactEstimation(class_map, GroundPlane.of(view), remembered).result()
                depth[place], bound[place] = _small(known.depth), _small(known.at_most)
        advance("contact", place + 1, len(footage))
    return DepthLabels(depth_m=depth, at_most_m=bound)


def add_parallax(
    footage: Footage,
    labels: DepthLabels,
    config: LabelConfig | None = None,
    *,
    advance: Advance = silent,
) -> DepthLabels:
    """Label the remaining pixels from parallax between frames.

    Args:
        footage: one flight.
        labels: its existing labels; they are kept.
        config: which frames are labelled, and from which other frames.
        advance: called with the progress after every frame.

    Raises:
        ShapeError: the labels are of another flight.
    """
    if len(labels.depth_m) != len(footage):
        raise ShapeError(
            "depth labels", expected=f"{len(footage)}xHxW", actual=labels.depth_m.shape
        )
    config = config or LabelConfig()
    track = camera_track(footage)
    depth = labels.depth_m.copy()
    aloft = footage.height_above_ground_m >= config.min_height_m
    for place in range(len(footage)):
        if aloft[place] and place % config.every == 0:
            found = _small(_parallax_of(footage, track, place, config))
            wanted = np.isnan(depth[place]) & np.isfinite(found)
            if labels.at_most_m is not None:
                wanted &= found <= config.bound_slack * labels.at_most_m[place]
            depth[place][wanted] = found[wanted]
        advance("parallax", place + 1, len(footage))
    return DepthLabels(depth_m=depth, at_most_m=labels.at_most_m)


def write_labels(path: Path, labels: DepthLabels) -> None:
    """Write a flight's labels, compressed; the file is replaced in one step."""
    arrays = {"depth_m": labels.depth_m}
    if labels.at_most_m is not None:
        arrays["at_most_m"] = labels.at_most_m
    with whole_file(path) as partial, partial.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]  # numpy's stub


def read_labels(path: Path) -> DepthLabels:
    """Read a flight's labels.

    Raises:
        FileError: the file is absent, damaged or of another kind.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            # Opened by ourselves: numpy leaves a damaged file open.
            return DepthLabels(depth_m=arrays["depth_m"], at_most_m=arrays.get("at_most_m"))
    except Exception as error:  # numpy raises various errors of zip, zlib and its parser
        remedy = "delete the file to have it made anew"
        raise FileError(path, f"holds no whole labels ({error}); {remedy}") from error


def _parallax_of(
    footage: Footage, track: CameraTrack, place: int, config: LabelConfig
) -> NDArray[np.float32]:
    work = Parallax(_grey(footage, place), footage.camera, config.parallax)
    for other in _beside(footage, track, place, config):
        motion = measured_motion(footage, track, place, int(other))
        if motion is not None:  # telemetry alone is not accurate enough
            work.add(_grey(footage, int(other)), motion)
    return work.depth()


def _beside(
    footage: Footage, track: CameraTrack, place: int, config: LabelConfig
) -> NDArray[np.intp]:
    """Return other frames for parallax, evenly spread over the suitable ones."""
    moved_m = np.linalg.norm(track.position_m - track.position_m[place], axis=1)
    cosine = track.rotation[:, :, 2] @ track.rotation[place, :, 2]
    apart_s = np.abs(footage.captured_s - footage.captured_s[place])
    fit = np.flatnonzero(
        (moved_m >= config.min_move_m)
        & (moved_m <= config.max_move_m)
        & (cosine >= np.cos(config.max_turn_rad))
        & (apart_s <= config.max_apart_s)
    )
    if len(fit) <= config.others:
        return fit
    spread = np.linspace(0, len(fit) - 1, config.others).astype(np.intp)
    return np.asarray(fit[spread], dtype=np.intp)


def _grey(footage: Footage, place: int) -> Image:
    return np.asarray(cv2.cvtColor(footage.frames[place], cv2.COLOR_RGB2GRAY), dtype=np.uint8)


def _small(map_: NDArray[np.float32]) -> NDArray[np.float32]:
    small = cv2.resize(
        np.asarray(map_, dtype=np.float32), LABEL_SIZE_PX, interpolation=cv2.INTER_NEAREST_EXACT
    )
    return np.asarray(small, dtype=np.float32)
