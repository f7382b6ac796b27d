"""Dead reckoning in flight, corrected by every frame with enough ground."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import cv2
import numpy as np

from perception.odometry import visual
from perception.odometry.filters import Heading, Stretch, VelocityError
from uav_bt.types import (
    BodyVelocity,
    CameraModel,
    ClassMap,
    DroneState,
    Frame,
    Pose2D,
    rotate,
    rotate_points,
)
from uav_bt.types.arrays import Floats, Image
from uav_bt.types.dead_reckoning import MotionEstimate, Odometry, OdometryPose
from uav_bt.types.projection import ground_range_to_row

# Numbers are chosen.
_WIDTH_PX: Final = 320  # width of the images in which points are tracked
_BORDER_PX: Final = 2  # ground this near to other classes is left out, to avoid their corners
_MAX_GAP_S: Final = 0.5  # between two frames; after a longer gap only telemetry is used
_MIN_HEIGHT_M: Final = 0.5  # of the camera; lower, points move too far between frames
_SPREAD_M: Final = 1.0  # of the points of a measurement that does not state it; usual in flight


# The last frame, for comparison with the next. Not of frames that `measure` compares: its view, and
# the ground near enough to be followed is 1, (H, W).
_Sight = tuple[Frame, tuple[visual.GroundView, Image] | None]


class GroundOdometry:
    """Integrates telemetry, and corrects it by every frame with enough ground.

    The pose at a frame is first extrapolated from the last velocity. When a later one is known, it
    is recomputed, and the measured displacement compared with telemetry's. `measure` may return the
    pose of the second frame's lens in the level frame of the first, instead of tracked points.
    """

    def __init__(self, measure: Callable[[Frame, Frame], Pose2D | None] | None = None) -> None:
        self._measure = measure
        self._odometry = Odometry()  # telemetry alone
        self._heading = Heading()
        self._error = VelocityError()
        self._stretch = Stretch()
        self._last: _Sight | None = None
        # Poses at the capture of the last frame: by telemetry alone, and corrected.
        self._seen: tuple[OdometryPose, OdometryPose] | None = None
        self._unflown_s = 0.0  # of telemetry when that frame came
        self._tracked_s = -math.inf  # capture time of the last frame with tracked ground
        self._ground_share: float | None = None  # of the last image in which points were selected
        self._turn_radps = 0.0  # last measured on the ground
        # Displacements that await comparison with telemetry's velocity, oldest first: begin and
        # end, s; (2,) m in the odometry's frame; spread of the points, m.
        self._steps: deque[tuple[float, float, Floats, float]] = deque()

    @property
    def now(self) -> OdometryPose | None:
        """The newest pose; None before the first telemetry."""
        return self._corrected(self._odometry.now)

    def at(self, time_s: float) -> OdometryPose | None:
        """Return the pose at a time in the last seconds; None before the first telemetry."""
        if self._seen is not None and time_s == self._seen[1].time_s:
            return self._seen[1]
        return self._corrected(self._odometry.at(time_s))

    @property
    def estimate(self) -> MotionEstimate | None:
        """Motion of the drone over the ground; None before the first frame and telemetry."""
        pose = self.now
        if pose is None or self._seen is None:
            return None
        reported, (x_mps, y_mps) = self._odometry.velocity, self._error.mps(pose.yaw_rad).tolist()
        forward_mps, right_mps = rotate(x_mps, y_mps, -pose.yaw_rad)
        bias_mps = self._error.bias_mps(pose.yaw_rad).tolist()
        return MotionEstimate(
            pose=pose,
            seen=self._seen[1],
            velocity=BodyVelocity(
                forward_mps=reported.forward_mps + forward_mps,
                right_mps=reported.right_mps + right_mps,
                down_mps=reported.down_mps,
            ),
            error=BodyVelocity(forward_mps=forward_mps, right_mps=right_mps),
            bias=BodyVelocity(forward_mps=bias_mps[0], right_mps=bias_mps[1]),
            tracked_s=self._tracked_s,
            turn_rad=self._heading.correction_rad,
            velocity_s=self._odometry.velocity_s,
            stretch=self._stretch.factor,
            ground_share=self._ground_share,
        )

    def predict(self, state: DroneState, now_s: float | None = None) -> OdometryPose | None:
        """Integrate telemetry and return the pose at `now_s`, or at its newest time."""
        known_s = self._odometry.velocity_s
        self._odometry.update(state, now_s)
        velocity_s = self._odometry.velocity_s
        if velocity_s > known_s:
            # Telemetry's pose at the last frame is recomputed with the later velocity. If the
            # frame's corrected pose came from telemetry, both have the same error and stay.
            at_s = math.nan if self._seen is None else self._seen[1].time_s
            if self._seen and at_s == self._tracked_s and velocity_s - at_s <= _MAX_GAP_S:
                self._seen = self._raw(at_s), self._seen[1]
            self._compare()
        return self.now

    def see(self, class_map: ClassMap, frame: Frame, camera: CameraModel) -> None:
        """Correct the pose by the ground in the newest frame; the camera is of any size."""
        if self._odometry.now is None:
            return
        self._odometry.add_heading(frame.captured_s, frame.attitude.yaw_rad)
        raw = self._raw(frame.captured_s)
        before, self._last = self._last, self._sight(class_map, frame, camera)
        if self._seen is None:
            self._heading.see(raw.yaw_rad, None, 0.0)
            self._seen, self._unflown_s = (raw, raw), self._odometry.unflown_s
            return
        then, seen = self._seen
        passed_s = max(0.0, frame.captured_s - seen.time_s)
        self._error.predict(passed_s)
        flown_m = then.to_body(raw.x_m, raw.y_m)  # by telemetry, forward and right
        flown_rad = math.remainder(raw.yaw_rad - then.yaw_rad, 2.0 * math.pi)
        missed_m = self._missed_m(seen.yaw_rad, raw.time_s)
        x_m, y_m = (np.array(flown_m) + rotate_points(missed_m, -seen.yaw_rad)).tolist()
        expected = Pose2D(x_m=x_m, y_m=y_m, yaw_rad=flown_rad)
        shown = self._shown(before, expected, passed_s, camera.forward_offset_m)
        turned_rad = None
        if shown is not None:
            self._tracked_s = frame.captured_s
            (x_m, y_m), turned_rad = (shown.motion.x_m, shown.motion.y_m), shown.motion.yaw_rad
            missed_m = np.array(rotate(x_m - flown_m[0], y_m - flown_m[1], seen.yaw_rad))
            way_m = np.array(rotate(x_m, y_m, seen.yaw_rad))
            self._steps.append((seen.time_s, frame.captured_s, way_m, shown.spread_m))
        self._heading.see(raw.yaw_rad, turned_rad, passed_s)
        x_m, y_m = (np.array(seen.to_world(*flown_m)) + missed_m).tolist()
        here = replace(raw, x_m=x_m, y_m=y_m, yaw_rad=self._heading.yaw_rad)
        self._seen, self._unflown_s = (raw, here), self._odometry.unflown_s
        self._compare()

    def _missed_m(self, yaw_rad: float, time_s: float) -> Floats:
        """Return what telemetry misses from the last frame to a time, (2,) in the odometry's frame.

        Gaps of telemetry in which no velocity counts have no error of the velocity either.
        """
        if self._seen is None:
            return np.zeros(2)
        unflown_s = self._odometry.unflown_s - self._unflown_s
        return self._error.mps(yaw_rad) * max(0.0, time_s - self._seen[1].time_s - unflown_s)

    def _raw(self, time_s: float) -> OdometryPose:
        """Return telemetry's pose at a time; the origin before the first telemetry."""
        pose = self._odometry.at(time_s)
        origin = OdometryPose(time_s=time_s, x_m=0.0, y_m=0.0, yaw_rad=0.0)
        return origin if pose is None else replace(pose, time_s=time_s)

    def _compare(self) -> None:
        """Correct telemetry's velocity by the displacements that it now covers in time."""
        while self._steps and self._steps[0][1] <= self._odometry.velocity_s:
            begin_s, end_s, way_m, spread_m = self._steps.popleft()
            begin, end = self._raw(begin_s), self._raw(end_s)
            turn_rad, passed_s = self._heading.correction_rad, end_s - begin_s
            reported_m = np.array(rotate(end.x_m - begin.x_m, end.y_m - begin.y_m, turn_rad))
            seen_mps, yaw_rad = (way_m - reported_m) / passed_s, begin.yaw_rad + turn_rad
            self._error.correct(seen_mps, passed_s, spread_m, yaw_rad)
            both_m = rotate_points(np.stack([way_m, reported_m]), -yaw_rad)
            seen, reported = (both_m / passed_s).tolist()
            self._stretch.add(complex(*seen), complex(*reported), passed_s)

    def _shown(
        self, before: _Sight | None, expected: Pose2D, passed_s: float, offset_m: float
    ) -> visual.GroundMotion | None:
        """Return the body's motion since the frame before, measured on the ground.

        Telemetry expects it; the lens is `offset_m` ahead of the body's centre.
        """
        now, self._ground_share = self._last, None
        if before is None or now is None or not 0.0 < passed_s <= _MAX_GAP_S:
            return None
        if self._measure is not None:
            found = self._measure(before[0], now[0])
            if found is None:
                return None
            return visual.GroundMotion(_of_lens(found, -offset_m), _SPREAD_M)
        if before[1] is None or now[1] is None:
            return None
        (first, ground), (second, _) = before[1], now[1]
        self._ground_share = float(ground.mean())
        held = replace(expected, yaw_rad=self._turn_radps * passed_s)
        leaps = abs(held.yaw_rad - expected.yaw_rad) > visual.MAX_YAW_RAD
        for guess in (expected, held) if leaps else (expected,):
            lens = visual.ground_motion(first, second, _of_lens(guess, offset_m), ground)
            if lens is not None:
                self._turn_radps = lens.motion.yaw_rad / passed_s
                return lens._replace(motion=_of_lens(lens.motion, -offset_m))
        return None

    def _sight(self, class_map: ClassMap, frame: Frame, camera: CameraModel) -> _Sight | None:
        height_m = frame.height_above_ground_m
        if not height_m >= _MIN_HEIGHT_M:
            return None
        if self._measure is not None:
            return frame, None
        height_px, width_px = frame.image.shape[:2]
        small_px = min(width_px, _WIDTH_PX)
        size = (small_px, round(height_px * small_px / width_px))
        # Converting to grey after shrinking is faster.
        small = cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA)
        grey = np.asarray(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        whole = class_map.is_ground.astype(np.uint8)
        ground = cv2.resize(whole, size, interpolation=cv2.INTER_NEAREST_EXACT)
        around = np.ones((2 * _BORDER_PX + 1,) * 2, dtype=np.uint8)
        near = np.asarray(cv2.erode(ground, around), dtype=np.uint8)
        pitch_rad = frame.gimbal_pitch_rad
        view = visual.GroundView(grey, camera.resized(*size), pitch_rad, height_m)
        farthest = ground_range_to_row(visual.TRACKED_RANGE_M, view.camera, pitch_rad, height_m)
        near[: max(0, math.ceil(farthest))] = 0
        return frame, (view, near)

    def _corrected(self, raw: OdometryPose | None) -> OdometryPose | None:
        if raw is None or self._seen is None:
            return raw
        then, seen = self._seen
        turn_rad = self._heading.correction_rad
        way_m = rotate(raw.x_m - then.x_m, raw.y_m - then.y_m, turn_rad)
        yaw_rad = raw.yaw_rad + turn_rad
        missed_m = self._missed_m(yaw_rad, raw.time_s)
        x_m, y_m = (np.array([seen.x_m, seen.y_m]) + way_m + missed_m).tolist()
        return replace(raw, x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)


def _of_lens(motion: Pose2D, offset_m: float) -> Pose2D:
    """Return the motion of the point `offset_m` ahead, from the motion of a point."""
    x_m, y_m = motion.to_world(offset_m, 0.0)
    return Pose2D(x_m=x_m - offset_m, y_m=y_m, yaw_rad=motion.yaw_rad)
