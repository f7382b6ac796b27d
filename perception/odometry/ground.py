"""Dead reckoning in flight, corrected by every frame with enough ground."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.odometry.heading import Heading, HeadingConfig
from perception.odometry.stretch import Stretch
from perception.odometry.velocity_error import VelocityError, VelocityErrorConfig
from perception.odometry.visual import (
    GroundMotion,
    GroundView,
    OdometryConfig,
    ground_motion,
)
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
from uav_bt.types.dead_reckoning import MotionEstimate, Odometry, OdometryPose
from uav_bt.types.projection import ground_range_to_row

_SPREAD_M: Final = 1.0  # of the points of a measurement that does not state it; usual in flight


@dataclass(frozen=True, kw_only=True)
class GroundOdometryConfig:
    """Which frames are compared, and how. Numbers without another origin are chosen."""

    width_px: int = 320  # width of the images in which points are tracked
    border_px: int = 2  # ground this near to other classes is left out, to avoid their corners
    max_gap_s: float = 0.5  # s between two frames; after a longer gap only telemetry is used
    min_height_m: float = 0.5  # m of the camera; lower, points move too far between frames
    # The strongest corner may be the edge of an object that the class map calls ground. With a low
    # quality the corners of the ground count beside it.
    following: OdometryConfig = field(default_factory=lambda: OdometryConfig(quality=0.001))
    heading: HeadingConfig = field(default_factory=HeadingConfig)
    error: VelocityErrorConfig = field(default_factory=VelocityErrorConfig)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Sight:
    """The last frame, for comparison with the next."""

    frame: Frame
    view: GroundView | None  # None if points are not tracked here
    ground: NDArray[np.uint8] | None = None  # (H, W), 1 where ground is near enough to be followed


@dataclass(frozen=True, kw_only=True, eq=False)
class _Step:
    """A measured displacement that awaits comparison with telemetry's velocity."""

    begin_s: float
    end_s: float
    way_m: NDArray[np.float64]  # (2,), displacement in the odometry's frame
    spread_m: float  # of the tracked points


class GroundOdometry:
    """Integrates telemetry, and corrects it by every frame with enough ground.

    Telemetry is later and less frequent than frames. The pose at a frame is first extrapolated from
    the last velocity, and recomputed when a later velocity is known. Only then is the measured
    displacement compared with telemetry's.

    Args:
        config: which frames are compared, and how.
        measure: returns the pose of the second frame's lens in the level frame of the first, or
            None; by default points of the ground are tracked.
    """

    def __init__(
        self,
        config: GroundOdometryConfig | None = None,
        measure: Callable[[Frame, Frame], Pose2D | None] | None = None,
    ) -> None:
        self._config = config or GroundOdometryConfig()
        self._measure = measure
        self._odometry = Odometry()  # telemetry alone
        self._heading = Heading(self._config.heading)
        self._error = VelocityError(self._config.error)
        self._stretch = Stretch()
        self._last: _Sight | None = None
        # Poses at the capture of the last frame: by telemetry alone, and corrected.
        self._seen: tuple[OdometryPose, OdometryPose] | None = None
        self._unflown_s = 0.0  # of telemetry when that frame came
        self._tracked_s = -math.inf  # capture time of the last frame with tracked ground
        self._ground_share: float | None = None  # of the last image in which points were selected
        self._turn_radps = 0.0  # last measured on the ground
        self._steps: deque[_Step] = deque()  # oldest first

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
        """Integrate telemetry and return the newest pose.

        Args:
            state: the telemetry.
            now_s: time to which the pose is extrapolated, s; None for the newest time of velocity
                and heading.
        """
        known_s = self._odometry.velocity_s
        self._odometry.update(state, now_s)
        if self._odometry.velocity_s > known_s:
            self._place_anew()
            self._compare()
        return self.now

    def see(self, class_map: ClassMap, frame: Frame, camera: CameraModel) -> None:
        """Correct the pose by the ground in a frame.

        Args:
            class_map: class map of `frame`.
            frame: the newest frame; its telemetry gives pitch and height of the camera.
            camera: intrinsics at any size of the same aspect ratio.
        """
        if self._odometry.now is None:
            return
        self._odometry.add_heading(frame.captured_s, frame.attitude.yaw_rad)
        raw = self._raw(frame.captured_s)
        before, self._last = self._last, self._sight(class_map, frame, camera)
        if self._seen is None:
            self._heading.see(raw.yaw_rad, None, 0.0)
            self._place(raw, raw)
            return
        then, seen = self._seen
        way, passed_s = _between(then, raw), max(0.0, frame.captured_s - seen.time_s)
        self._error.predict(passed_s)
        missed_m = self._missed_m(seen.yaw_rad, raw.time_s)
        x_m, y_m = np.array([way.x_m, way.y_m]) + rotate_points(missed_m, -seen.yaw_rad)
        expected = replace(way, x_m=float(x_m), y_m=float(y_m))
        shown = self._shown(before, expected, passed_s, camera.forward_offset_m)
        turned_rad = None
        if shown is not None:
            self._tracked_s = frame.captured_s
            (x_m, y_m), turned_rad = (shown.motion.x_m, shown.motion.y_m), shown.motion.yaw_rad
            missed_m = np.array(rotate(x_m - way.x_m, y_m - way.y_m, seen.yaw_rad))
            self._steps.append(
                _Step(
                    begin_s=seen.time_s,
                    end_s=frame.captured_s,
                    way_m=np.array(rotate(x_m, y_m, seen.yaw_rad)),
                    spread_m=shown.spread_m,
                )
            )
        self._heading.see(raw.yaw_rad, turned_rad, passed_s)
        x_m, y_m = np.array(seen.to_world(way.x_m, way.y_m)) + missed_m
        here = replace(raw, x_m=float(x_m), y_m=float(y_m), yaw_rad=self._heading.yaw_rad)
        self._place(raw, here)
        self._compare()

    def _place(self, raw: OdometryPose, here: OdometryPose) -> None:
        """Note the poses at the newest frame: by telemetry alone, and corrected."""
        self._seen, self._unflown_s = (raw, here), self._odometry.unflown_s

    def _missed_m(self, yaw_rad: float, time_s: float) -> NDArray[np.float64]:
        """Return what telemetry misses since the last frame, (2,) in the odometry's frame, metres.

        Gaps of telemetry in which no velocity counts have no error of the velocity either.

        Args:
            yaw_rad: heading of the drone.
            time_s: time of telemetry's pose.
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

    def _place_anew(self) -> None:
        """Recompute telemetry's pose at the last frame with a later velocity.

        If the frame's corrected pose came from telemetry, both poses have the same error and stay.
        """
        if self._seen is not None and self._seen[1].time_s == self._tracked_s:
            then_s = self._tracked_s
            if self._odometry.velocity_s - then_s <= self._config.max_gap_s:
                self._seen = self._raw(then_s), self._seen[1]

    def _compare(self) -> None:
        """Correct telemetry's velocity by the displacements that it now covers in time."""
        while self._steps and self._steps[0].end_s <= self._odometry.velocity_s:
            step = self._steps.popleft()
            begin, end = self._raw(step.begin_s), self._raw(step.end_s)
            turn_rad, passed_s = self._heading.correction_rad, step.end_s - step.begin_s
            reported_m = np.array(rotate(end.x_m - begin.x_m, end.y_m - begin.y_m, turn_rad))
            seen_mps, yaw_rad = (step.way_m - reported_m) / passed_s, begin.yaw_rad + turn_rad
            self._error.correct(seen_mps, passed_s, step.spread_m, yaw_rad)
            both_m = rotate_points(np.stack([step.way_m, reported_m]), -yaw_rad)
            seen, reported = (both_m / passed_s).tolist()
            self._stretch.add(tuple(seen), tuple(reported), passed_s)

    def _shown(
        self, before: _Sight | None, expected: Pose2D, passed_s: float, offset_m: float
    ) -> GroundMotion | None:
        """Return the body's motion since the previous frame, measured on the ground.

        Args:
            before: the previous frame.
            expected: the motion by telemetry.
            passed_s: time since the previous frame.
            offset_m: distance of the lens ahead of the body's centre.
        """
        cfg, self._ground_share = self._config, None
        if before is None or self._last is None or not 0.0 < passed_s <= cfg.max_gap_s:
            return None
        if self._measure is not None:
            found = self._measure(before.frame, self._last.frame)
            return None if found is None else GroundMotion(_of_lens(found, -offset_m), _SPREAD_M)
        if before.ground is not None:
            self._ground_share = float(before.ground.mean())
        held = replace(expected, yaw_rad=self._turn_radps * passed_s)
        leaps = abs(held.yaw_rad - expected.yaw_rad) > cfg.following.max_yaw_rad
        for each in (expected, held) if leaps else (expected,):
            guess = _of_lens(each, offset_m)
            if before.view is None or self._last.view is None:
                return None
            lens = ground_motion(before.view, self._last.view, guess, before.ground, cfg.following)
            if lens is not None:
                self._turn_radps = lens.motion.yaw_rad / passed_s
                return lens._replace(motion=_of_lens(lens.motion, -offset_m))
        return None

    def _sight(self, class_map: ClassMap, frame: Frame, camera: CameraModel) -> _Sight | None:
        height_m = frame.height_above_ground_m
        if not height_m >= self._config.min_height_m:
            return None
        if self._measure is not None:
            return _Sight(frame=frame, view=None)
        height_px, width_px = frame.image.shape[:2]
        small_px = min(width_px, self._config.width_px)
        size = (small_px, round(height_px * small_px / width_px))
        # Converting to grey after shrinking is faster.
        small = cv2.resize(frame.image, size, interpolation=cv2.INTER_AREA)
        ground = cv2.resize(
            class_map.is_ground.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST_EXACT
        )
        around = np.ones((2 * self._config.border_px + 1,) * 2, dtype=np.uint8)
        near = np.asarray(cv2.erode(ground, around), dtype=np.uint8)
        view = GroundView(
            grey=np.asarray(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY), dtype=np.uint8),
            camera=camera.resized(*size),
            gimbal_pitch_rad=frame.gimbal_pitch_rad,
            height_m=height_m,
        )
        range_m = self._config.following.max_range_m
        farthest = ground_range_to_row(range_m, view.camera, view.gimbal_pitch_rad, height_m)
        near[: max(0, math.ceil(farthest))] = 0
        return _Sight(frame=frame, view=view, ground=near)

    def _corrected(self, raw: OdometryPose | None) -> OdometryPose | None:
        if raw is None or self._seen is None:
            return raw
        then, seen = self._seen
        turn_rad = self._heading.correction_rad
        x_m, y_m = rotate(raw.x_m - then.x_m, raw.y_m - then.y_m, turn_rad)
        missed_m = self._missed_m(raw.yaw_rad + turn_rad, raw.time_s)
        return replace(
            raw,
            x_m=seen.x_m + x_m + float(missed_m[0]),
            y_m=seen.y_m + y_m + float(missed_m[1]),
            yaw_rad=raw.yaw_rad + turn_rad,
        )


def _of_lens(motion: Pose2D, offset_m: float) -> Pose2D:
    """Return the motion of the point `offset_m` ahead, from the motion of a point."""
    x_m, y_m = motion.to_world(offset_m, 0.0)
    return Pose2D(x_m=x_m - offset_m, y_m=y_m, yaw_rad=motion.yaw_rad)


def _between(first: Pose2D, second: Pose2D) -> Pose2D:
    """Return the second pose relative to the first."""
    forward_m, right_m = first.to_body(second.x_m, second.y_m)
    turn_rad = math.remainder(second.yaw_rad - first.yaw_rad, 2.0 * math.pi)
    return Pose2D(x_m=forward_m, y_m=right_m, yaw_rad=turn_rad)
