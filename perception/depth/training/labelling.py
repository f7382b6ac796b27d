"""Depth labels for a flight's frames without ground truth, from masks, telemetry and geometry.

Two sources are combined. Obstacles are as far away as their contact with the ground, seen now or
earlier (`perception.depth.contact.depth`). Near obstacles with the base out of the image move most
between frames with precisely known camera motion (`perception.odometry.visual`), and the flow of a
pixel gives its depth:

    flowed pixel = (ray d + t) projected

with t the translation along the axes of the frame's camera. The equation is linear in the depth d,
once for columns and once for rows. Several frames are combined by least squares. Pixels with large
residuals or too little parallax stay unknown.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import GroundPlane, view_of
from perception.depth.contact.depth import ContactEstimation
from perception.depth.metric import remembered_bases
from perception.depth.training.footage import EVERY, LABEL_SIZE_PX, CameraTrack, Flight, grey
from perception.mapping.recent import RecentLayer
from perception.mapping.view import View
from perception.odometry.ground import GroundOdometry
from uav_bt.errors import FileError
from uav_bt.files import whole_file
from uav_bt.protocols import Advance, Segmenter, silent
from uav_bt.types import CameraModel
from uav_bt.types.arrays import Flags, Floats, Floats32, Image

_OTHERS: Final = 4  # number of other frames for parallax
_MAX_MOVE_M: Final = 0.3  # largest distance of the camera to such a frame
_MAX_TURN_RAD: Final = 0.45  # at this angle half of the image's width still overlaps
# A depth from flow above this multiple of the bound from masks is wrong. The slack allows for the
# error of the height.
_BOUND_SLACK: Final = 1.1

_MIN_VIEWS: Final = 2  # besides the frame, so that a wrong flow is detected
_MIN_PARALLAX_PX: Final = 6.0  # root sum square; an error of half a pixel is 8 % of it
_MAX_MISFIT_PX: Final = 0.7  # root mean square residual
_MAX_LOOP_PX: Final = 0.8  # sum of forward and backward flow
_MIN_DEPTH_M: Final = 0.2
_MAX_DEPTH_M: Final = 4.0  # further away parallax is too small, and ground contact is in view
_OUTSIDE: Final = 1e3  # px, flow outside the image, which fails the loop test


def contact_labels(
    flight: Flight, segmenter: Segmenter, *, advance: Advance = silent
) -> NDArray[np.float16]:
    """Return labels, as `Flight.labels`, from a network's masks and ground contact."""
    width, height = LABEL_SIZE_PX
    labels = np.empty((len(flight.frames), 2, height, width), dtype=np.float16)
    labels[:, 0], labels[:, 1] = np.nan, np.inf
    recent, odometry, aloft = RecentLayer(), GroundOdometry(), CameraTrack(flight).aloft
    states = iter(flight.states)
    state = next(states)
    odometry.predict(state)
    for place, frame in enumerate(flight.frames):
        while state.captured_s < frame.captured_s and (later := next(states, None)) is not None:
            state = later
            odometry.predict(state)
        if aloft[place]:
            class_map = segmenter.segment(frame)
            view = view_of(frame, flight.camera, class_map.ids.shape[::-1])
            # The base of an obstacle too near to show it was seen from further away.
            remembered = None
            now, then = odometry.now, odometry.at(frame.captured_s)
            if now is not None and then is not None:
                recent.expire(now.time_s)
                remembered = remembered_bases(recent.near(now), now, then, frame, flight.camera)
            odometry.see(class_map, frame, view.camera)
            seen = odometry.at(frame.captured_s)
            placed = None if seen is None else View.of(class_map, frame, view.camera, seen)
            if placed is not None:
                recent.add(placed)
            if place % EVERY == 0:
                known = ContactEstimation(class_map, GroundPlane.of(view), remembered).result()
                labels[place] = _small(known.depth), _small(known.at_most)
        advance("contact", place + 1, len(flight.frames))
    return labels


def add_parallax(
    flight: Flight, labels: NDArray[np.float16], *, advance: Advance = silent
) -> NDArray[np.float16]:
    """Return a flight's labels, with pixels without depth labelled from parallax."""
    labels, track = labels.copy(), CameraTrack(flight)
    for place, (depth, bound) in enumerate(labels):
        if track.aloft[place] and place % EVERY == 0:
            others = _others(flight, track, place)
            found = _small(parallax_depth(grey(flight.frames[place]), flight.camera, others))
            wanted = np.isnan(depth) & (found <= _BOUND_SLACK * bound)
            depth[wanted] = found[wanted]
        advance("parallax", place + 1, len(flight.frames))
    return labels


def _others(flight: Flight, track: CameraTrack, place: int) -> list[tuple[Image, Floats]]:
    """Return other frames for parallax, evenly spread over the suitable ones, with motions."""
    fit = track.near(place, _MAX_MOVE_M, _MAX_TURN_RAD)
    if len(fit) > _OTHERS:
        fit = fit[np.linspace(0, len(fit) - 1, _OTHERS).astype(np.intp)]
    motions = {int(other): track.measured_motion(place, int(other)) for other in fit}
    # Telemetry alone is not accurate enough.
    return [
        (grey(flight.frames[at]), motion) for at, motion in motions.items() if motion is not None
    ]


def parallax_depth(
    grey: Image, camera: CameraModel, others: Iterable[tuple[Image, Floats]]
) -> Floats32:
    """Return a grey frame's depth from its flow to others, (H, W) metres; NaN where unknown.

    Other images, (H, W), come with the transform of points from the frame's
    camera to theirs, (3, 4), metres.
    """
    terms = [_term(grey, camera, other, motion) for other, motion in others]
    # Sums over views of the least-squares problem slope * depth = shift, in pixels.
    slope_sq, product, misfit, parallax = np.zeros((4, *grey.shape))
    views = np.zeros(grey.shape, np.intp)
    for good, slope, shift in terms:
        slope_sq += good * (slope**2).sum(axis=0)
        product += good * (slope * shift).sum(axis=0)
    solvable = slope_sq > 0.0
    depth = product / np.where(solvable, slope_sq, 1.0)
    within = solvable & (depth >= _MIN_DEPTH_M) & (depth <= _MAX_DEPTH_M)
    depth = np.where(within, depth, _MAX_DEPTH_M)  # avoids division by zero
    for good, slope, shift in terms:
        views += good
        # Pixels, to first order: the depth in the other frame is nearly the same.
        misfit += good * ((slope - shift / depth) ** 2).sum(axis=0)
        parallax += good * ((shift / depth) ** 2).sum(axis=0)
    known = (
        within
        & (views >= _MIN_VIEWS)
        & (parallax >= _MIN_PARALLAX_PX**2)
        & (misfit <= np.maximum(views, 1) * _MAX_MISFIT_PX**2)
    )
    return np.where(known, depth, np.nan).astype(np.float32)


def _term(
    grey: Image, camera: CameraModel, other: Image, motion: Floats
) -> tuple[Flags, Floats, Floats]:
    """Return where the flow to another frame is good, (H, W), and slope and shift, (2, H, W)."""
    # With the rotation removed only parallax remains, so flows are short.
    turn, size = motion[:, :3], grey.shape[::-1]
    homography = camera.matrix @ turn @ np.linalg.inv(camera.matrix)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    seen = cv2.warpPerspective(np.full_like(other, 255), homography, size, flags=flags) == 255
    other = np.asarray(cv2.warpPerspective(other, homography, size, flags=flags), np.uint8)
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    there = flow.calc(grey, other, np.zeros((*grey.shape, 2), np.float32))
    back = flow.calc(other, grey, np.zeros((*grey.shape, 2), np.float32))
    columns, rows = np.meshgrid(*(np.arange(side, dtype=np.float32) for side in size))
    x_px, y_px = columns + there[..., 0], rows + there[..., 1]
    returned = cv2.remap(
        back, x_px, y_px, cv2.INTER_LINEAR, None, cv2.BORDER_CONSTANT, (_OUTSIDE, _OUTSIDE)
    )
    inside = cv2.remap(seen.astype(np.uint8), x_px, y_px, cv2.INTER_NEAREST)
    loop = np.hypot(*np.moveaxis(there + returned, 2, 0))
    fx, fy, cx, cy = camera.pinhole_px
    x, y = (x_px - cx) / fx, (y_px - cy) / fy
    t = turn.T @ motion[:, 3]
    # Divided by the depth, these are in pixels of the other frame.
    slope = np.stack([fx * ((columns - cx) / fx - x), fy * ((rows - cy) / fy - y)])
    shift = np.stack([fx * (x * t[2] - t[0]), fy * (y * t[2] - t[1])])
    return (loop < _MAX_LOOP_PX) & (inside > 0), slope, shift


def write_labels(path: Path, labels: NDArray[np.float16]) -> None:
    """Write a flight's labels, compressed; the file is replaced in one step."""
    with whole_file(path) as partial, partial.open("wb") as file:
        np.savez_compressed(file, depth_m=labels[:, 0], at_most_m=labels[:, 1])


def read_labels(path: Path) -> NDArray[np.float16]:
    """Read a flight's labels; FileError if it is absent, damaged or of another kind."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            # Opened by ourselves: numpy leaves a damaged file open.
            return np.stack([arrays["depth_m"], arrays["at_most_m"]], axis=1)
    except Exception as error:  # numpy raises various errors of zip, zlib and its parser
        remedy = "delete the file to have it made anew"
        raise FileError(path, f"holds no whole labels ({error}); {remedy}") from error


def _small(map_: Floats32) -> Floats32:
    small = cv2.resize(map_, LABEL_SIZE_PX, interpolation=cv2.INTER_NEAREST_EXACT)
    return np.asarray(small, dtype=np.float32)
