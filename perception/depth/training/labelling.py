"""Depth labels for a flight's frames without ground truth, from masks, telemetry and geometry.

Two sources are combined. Obstacles are as far away as their contact with the ground, seen now or
earlier (`perception.depth.contact.depth`). Near obstacles with the base out of the image have the
largest parallax between frames (`perception.depth.training.parallax`).
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import GroundPlane, view_of
from perception.depth.contact.depth import ContactEstimation
from perception.depth.metric import remembered_bases
from perception.depth.training.footage import EVERY, LABEL_SIZE_PX, CameraTrack, Flight, grey
from perception.depth.training.parallax import parallax_depth
from perception.mapping.recent import RecentLayer
from perception.mapping.view import View
from perception.odometry.ground import GroundOdometry
from uav_bt.errors import FileError
from uav_bt.files import whole_file
from uav_bt.progress import Advance, silent
from uav_bt.protocols import Segmenter
from uav_bt.types.arrays import Floats, Floats32, Image

_OTHERS: Final = 4  # number of other frames for parallax
_MAX_MOVE_M: Final = 0.3  # largest distance of the camera to such a frame
_MAX_TURN_RAD: Final = 0.45  # at this angle half of the image's width still overlaps
# A depth from flow above this multiple of the bound from masks is wrong. The slack allows for the
# error of the height.
_BOUND_SLACK: Final = 1.1


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
                near = recent.near(now)
                remembered = remembered_bases(near, now, then, frame, flight.camera)
            odometry.see(class_map, frame, view.camera)
            seen = odometry.at(frame.captured_s)
            if seen is not None:
                placed = View.of(class_map, frame, view.camera, seen)
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


def write_labels(path: Path, labels: NDArray[np.float16]) -> None:
    """Write a flight's labels, compressed; the file is replaced in one step."""
    with whole_file(path) as partial, partial.open("wb") as file:
        np.savez_compressed(file, depth_m=labels[:, 0], at_most_m=labels[:, 1])


def read_labels(path: Path) -> NDArray[np.float16]:
    """Read a flight's labels.

    Raises:
        FileError: the file is absent, damaged or of another kind.
    """
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
