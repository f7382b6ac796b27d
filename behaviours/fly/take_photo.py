"""A leaf that hovers until the camera is steady, and takes a photograph."""

from __future__ import annotations

import json
import logging
import math
import re
from collections import deque
from dataclasses import asdict, replace
from typing import Final, NamedTuple

import numpy as np

from behaviours.fly.moving_leaf import LeafClock, camera_points_at
from behaviours.path.movers import raised_m
from behaviours.ports import number
from uav_bt.board import (
    CLASS_MAP,
    ELAPSED,
    FLIGHT_HEIGHT,
    FRAME,
    ODOMETRY,
    PHASE,
    SITE_MAP,
    STATE,
)
from uav_bt.board.context import FlightFolder, MissionContext
from uav_bt.errors import InputError
from uav_bt.protocols import StillState
from uav_bt.tree import Leaf, Port, Status
from uav_bt.tree.script.parser import fill_text, parse_text
from uav_bt.types import ClassMap, DroneState, Frame, GimbalTo, Hover, MissionPhase, wrap_angle
from uav_bt.types.dead_reckoning import MotionEstimate
from uav_bt.types.flight_results import FRAME_OF_RESULTS, EventKind, Photo, reported_pose
from uav_bt.types.site_map import SiteMap

_LOG: Final = logging.getLogger(__name__)

_NO_FOLDER: Final = "the flight has no output folder: fly with --out DIR"
_KEEP: Final = "keep"
_LABEL: Final = "text in report and file names; {variable} and {@board_key} become their values"
_PITCH: Final = "camera pitch, 0 level, -90 straight down, degrees, restored afterwards; or keep"
_WAIT: Final = "longest wait for a steady drone and a new frame, s; and for the drone's camera"
_RESTORE_S: Final = 2.0  # longest wait for the camera's former pitch; chosen
_LABEL_LENGTH: Final = 40  # characters of a label in a file's name
_SAME_S: Final = 1e-6  # ticks are a tenth of a second, and floats add up
# When the drone is steady. Chosen by the telemetry of a hovering drone: with the twin's profile
# `harsh` the noise of one sample reaches 0.31 m/s and 18 degrees a second, over half a second 0.21
# m/s and 5.
_SPAN_S: Final = 0.5  # velocity and heading are averaged over this time
_HIGHER_M: Final = 0.1  # smaller differences in height are errors of control
_STEADY_MPS: Final = 0.2
_STEADY_RADPS: Final = math.radians(8)


def _pitch_rad(text: str) -> float | None:
    """Return the pitch that a port's text states; None for `keep`: the camera stays as it is."""
    if text == _KEEP:
        return None
    try:
        pitch_deg = float(text)
    except ValueError:
        pitch_deg = math.nan
    if not -90.0 <= pitch_deg <= 90.0:
        raise ValueError(f"expected '{_KEEP}' or -90 to 90 degrees, got '{text}'")
    return math.radians(pitch_deg)


class Steadiness:
    """Follows telemetry until the drone keeps place and heading; the camera levels itself."""

    def __init__(self) -> None:
        # Telemetry, and its velocity forward, right and down.
        self._samples: deque[tuple[DroneState, tuple[float, float, float]]] = deque()
        self.since_s = math.inf  # capture of the telemetry since which it is steady; inf: it is not

    def update(self, state: DroneState, motion: MotionEstimate | None) -> None:
        """Add telemetry, whose velocity the motion over the ground corrects."""
        samples = self._samples
        if samples and state.captured_s <= samples[-1][0].captured_s:
            return
        velocity = (state if motion is None else motion.over_ground(state)).velocity
        samples.append((state, (velocity.forward_mps, velocity.right_mps, velocity.down_mps)))
        # The oldest sample lies at least the span back, once there are such old ones.
        while len(samples) > 2 and samples[1][0].captured_s <= state.captured_s - _SPAN_S:
            samples.popleft()
        steady = self._is_steady(samples[0][0], state)
        self.since_s = min(self.since_s, state.captured_s) if steady else math.inf

    def _is_steady(self, oldest: DroneState, newest: DroneState) -> bool:
        if newest.captured_s - oldest.captured_s < _SPAN_S - _SAME_S:
            return False
        mean_mps = np.mean([speeds for _, speeds in self._samples], axis=0)
        passed_s = newest.times.attitude_s - oldest.times.attitude_s
        turned_rad = abs(wrap_angle(newest.attitude.yaw_rad - oldest.attitude.yaw_rad))
        turns = passed_s <= 0.0 or turned_rad / passed_s > _STEADY_RADPS
        return not turns and float(np.linalg.norm(mean_mps)) <= _STEADY_MPS


class _Shot(NamedTuple):
    """What is to be stored, and the name of its files without suffix."""

    name: str
    photo: Photo
    frame: Frame
    class_map: ClassMap | None


class TakePhoto(Leaf):
    """Hover until the drone is steady and store the newest frame; FAILURE if it cannot be stored.

    A drone whose camera takes photographs takes one at the same place, which is fetched after the
    landing. When the camera fails (the memory card is full or absent), the frame is stored and the
    answer is FAILURE.

    Time in which frame or telemetry is stale, or a pilot flies, does not count. A drone without
    images stores pose and class map. A halted leaf leaves the camera where it is.
    """

    group = "Looking"
    moves = True
    points = True
    ports = (
        Port("label", str, "", _LABEL, check=parse_text),
        Port("pitch_deg", str, _KEEP, _PITCH, check=_pitch_rad),
        number("timeout_s", 5.0, 0.1, 600, _WAIT),
        Port("camera_photo", bool, True, "whether the drone's own camera takes one, too (ANAFI)"),
    )
    reads = (STATE, FRAME, ELAPSED, CLASS_MAP, ODOMETRY, SITE_MAP, FLIGHT_HEIGHT)
    writes = (PHASE,)

    def on_setup(self, mission: MissionContext) -> None:
        """Import the encoders; warn if the flight has no output folder."""
        # Late: OpenCV takes long to import, and `uav-bt check` must answer at once.
        from uav_bt.record.images import encode_bytes, encode_image  # noqa: PLC0415

        self._encode_ids, self._encode_image = encode_bytes, encode_image
        self._imageless = mission.sight is not None
        if mission.outputs is None:
            _LOG.warning("Warning: %s will fail: %s", self.path, _NO_FOLDER)

    def initialise(self) -> None:
        """Begin to wait."""
        self.write(PHASE, MissionPhase.LOOK)
        self._leaf_clock = LeafClock(self.clock)
        self._label = fill_text(self.port_value("label"), self.environment)
        self._steady, self._wanted_rad = Steadiness(), _pitch_rad(self.port_value("pitch_deg"))
        self._former_rad: float | None = None  # the camera's pitch to restore
        self._answer: Status | None = None  # known once the photograph is stored or given up
        self._last_s: float | None = None  # leaf time of the last tick that counted
        self._shot: _Shot | None = None  # waits for the drone's camera
        self._waited_s, self._answered_s = 0.0, 0.0
        self._number, self._asked_s = 0, 0.0  # of that camera's photograph

    def update(self) -> Status:
        """Hover and point the camera until the photograph is stored and the camera restored."""
        self._leaf_clock.tick()
        frame, wanted_rad, now_s = self.read(FRAME).value, self._wanted_rad, self._leaf_clock.now()
        if self._answer is None:
            self._answer, self._answered_s = self._take(frame), now_s
        if self._answer is not None:
            wanted_rad, late = self._former_rad, now_s - self._answered_s > _RESTORE_S
            if wanted_rad is None or late or camera_points_at(frame, wanted_rad):
                return self._answer
        if wanted_rad is not None:
            self.point(GimbalTo(pitch_rad=wanted_rad))
        self.propose(Hover())
        return Status.RUNNING

    def _take(self, frame: Frame | None) -> Status | None:
        """Store the photograph when the frame fits. None: not yet."""
        folder, state = self.mission.outputs, self.read(STATE).value
        if folder is None:
            return self._gives_up(_NO_FOLDER)
        if self._shot is not None:
            return self._await_camera(folder, self._shot)
        if state is not None and frame is not None:
            return self._look(folder, state, frame)
        self._last_s = None
        return None

    def _look(self, folder: FlightFolder, state: DroneState, frame: Frame) -> Status | None:
        """Store the frame, or ask the drone's camera first, if the frame fits. None: not yet."""
        now_s = self._leaf_clock.now()
        self._waited_s += 0.0 if self._last_s is None else now_s - self._last_s
        self._last_s = now_s
        if self._wanted_rad is not None and self._former_rad is None:
            self._former_rad = state.gimbal_pitch_rad
        self._steady.update(state, self.read(ODOMETRY).value)
        seen = self.read(CLASS_MAP).value
        class_map = seen if seen is not None and seen.captured_s == frame.captured_s else None
        if missing := self._missing(frame, class_map):
            self.feedback_message, limit_s = missing, self.port_value("timeout_s")
            late = self._waited_s >= limit_s - _SAME_S
            return self._gives_up(f"no image within {limit_s:g} s: {missing}") if late else None
        shot = self._shot_of(frame, class_map)
        camera = self.mission.stills if self.port_value("camera_photo") else None
        if camera is None:
            return self._store(folder, shot)
        self._shot, self._number, self._asked_s = shot, camera.take_still(), now_s
        self.feedback_message = "the drone's camera takes a photograph"
        return None

    def _missing(self, frame: Frame, class_map: ClassMap | None) -> str:
        """Return what keeps the frame from being stored; empty when nothing does."""
        if self._wanted_rad is not None and not camera_points_at(frame, self._wanted_rad):
            return f"the camera is at {math.degrees(frame.gimbal_pitch_rad):.0f} degrees"
        if math.isinf(self._steady.since_s):
            return "the drone is not steady"
        if frame.captured_s < self._steady.since_s:
            return "no frame since the drone is steady"
        if self._imageless and class_map is None:
            return "the drone has no images, and no leaf makes a class map: add Segment"
        return ""

    def _await_camera(self, folder: FlightFolder, shot: _Shot) -> Status | None:
        """Store the frame once the drone's camera has ended. None: it is at work."""
        camera, limit_s = self.mission.stills, self.port_value("timeout_s")
        still = None if camera is None else camera.still(self._number)
        if still is None or still.state is StillState.TAKING:
            if self._leaf_clock.now() - self._asked_s < limit_s - _SAME_S:
                return None
            reason = f"the camera has not confirmed it within {limit_s:g} s"
        elif still.state is StillState.SAVED:
            file = f"{shot.name}-camera.jpg"
            photo = replace(shot.photo, camera_file=file, camera_media=still.media)
            return self._store(folder, shot._replace(photo=photo))
        else:
            reason = still.reason
        stored = self._store(folder, shot) is Status.SUCCESS
        failure = f"the drone's camera took no photograph: {reason}"
        return self._gives_up(failure) if stored else Status.FAILURE

    def _shot_of(self, frame: Frame, class_map: ClassMap | None) -> _Shot:
        name = f"photo-{self.mission.notes.next_photo():03d}"
        if label := re.sub(r"[^A-Za-z0-9_-]+", "-", self._label)[:_LABEL_LENGTH].strip("-"):
            name = f"{name}-{label}"
        elapsed_s, site_map = self.read(ELAPSED).value or 0.0, self.read(SITE_MAP).value
        photo = Photo(
            label=self._label,
            file=None if self._imageless else f"{name}.jpg",
            class_map=None if class_map is None else f"{name}-classes.png",
            time_s=round(elapsed_s - (self.clock.now() - frame.captured_s), 3),
            pose=None if site_map is None else reported_pose(site_map.pose, site_map.start),
            height_m=round(frame.height_above_ground_m, 3),
            raised_m=self._raised_m(frame, site_map),
            gimbal_pitch_deg=round(math.degrees(frame.gimbal_pitch_rad), 1),
        )
        return _Shot(name, photo, frame, class_map)

    def _raised_m(self, frame: Frame, site_map: SiteMap | None) -> float:
        """Return by how much the drone flies above the flight height because of a mover."""
        flight_m, most_m = self.read(FLIGHT_HEIGHT).value, raised_m(site_map)
        higher_m = 0.0 if flight_m is None else frame.height_above_ground_m - flight_m
        return round(min(higher_m, most_m), 2) if higher_m > _HIGHER_M else 0.0

    def _store(self, folder: FlightFolder, shot: _Shot) -> Status:
        """Write the files of a photograph: `NAME.jpg`, `NAME-classes.png` and `NAME.json`."""
        photo, content = shot.photo, {"frame": FRAME_OF_RESULTS, **asdict(shot.photo)}
        try:
            if photo.file is not None:
                folder.write(photo.file, self._encode_image(shot.frame.image, "high")[0])
            if shot.class_map is not None and photo.class_map is not None:
                folder.write(photo.class_map, self._encode_ids(shot.class_map.ids))
            folder.write(f"{shot.name}.json", json.dumps(content, indent=2) + "\n")
        except InputError as error:
            return self._gives_up(str(error))
        self.mission.notes.photos.append(photo)
        self.feedback_message = shot.name
        self.mission.add_event(EventKind.PHOTO, shot.name, self.path)
        return Status.SUCCESS

    def _gives_up(self, reason: str) -> Status:
        self.feedback_message = reason
        text = f"'{self._label}': {reason}" if self._label else reason
        self.mission.add_event(EventKind.NO_PHOTO, text, self.path)
        return Status.FAILURE
