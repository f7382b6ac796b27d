"""Land on the mark, or in an emergency on any surface that holds the drone."""

from __future__ import annotations

import math
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from behaviours.fly.moving_leaf import STRAIGHT_DOWN_RAD, MovingLeaf, Progress, camera_points_at
from behaviours.ports import number
from uav_bt.board import CAMERA, CLASS_MAP, FRAME, MARK, PHASE, STATE
from uav_bt.board.context import MissionContext
from uav_bt.lab.classes import GROUND
from uav_bt.lab.classes import MARK as MARK_ROLE
from uav_bt.tree import Status
from uav_bt.types import (
    MIN_VIEW_HEIGHT_M,
    CameraModel,
    ClassMap,
    DroneState,
    FlyingState,
    Frame,
    MissionPhase,
)
from uav_bt.types import Land as LandCommand
from uav_bt.types.projection import ground_points, project

# Without telemetry for longer the drone lands where it is. Chosen: ten periods of telemetry at
# 5 Hz; a shorter gap does not cancel the step to the spot.
_UNHEARD_S: Final = 2.0
# Without a frame for longer the step to the mark is left out. Chosen: without a frame the drone
# hovers, and drifts by about a decimetre in this time.
_UNSEEN_S: Final = 2.0
# Distance from the point below the lens within which the mark corrects the step before a landing.
# Chosen: three times the tolerance of `HelipadCenter`; a mark farther away is not landed on.
_NEAR_M: Final = 0.12
_PITCH_SLACK_RAD: Final = math.radians(5)  # of a view straight down; chosen
_TOLERANCE_M: Final = 0.05  # nearer to a spot no step is flown; chosen, within the margin
# Free distance around the hull. Chosen: the landing box of 0.5 m leaves no more around a hull with
# a half diagonal of 0.2 m.
MARGIN_M: Final = 0.05


class LandingLeaf(MovingLeaf):
    """Base of the leaves that land; a landing that has begun needs no telemetry."""

    lands = True

    def initialise(self) -> None:
        """Note that the descent has not begun."""
        self.descends = False

    def descend(self) -> Status:
        """Propose the landing."""
        self.descends = True
        self.propose(LandCommand())
        return Status.RUNNING

    def wait(self, state_age_s: float) -> Status:
        """Continue a landing, or begin one when telemetry has stopped for too long."""
        stopped = _UNHEARD_S < state_age_s < math.inf
        return self.descend() if self.descends or stopped else Status.RUNNING


class Land(LandingLeaf):
    """Move the body above the mark, descend, stop the motors; SUCCESS on the ground.

    The leaf expects the landing mark below the camera, as `HelipadCenter` leaves it, and does not
    check. It moves by the camera's offset, or, with a fix of the mark near there, by that fix,
    which corrects the remaining offset ahead and to the side. Without a frame for 2 s it lands
    where it is, because the drone drifts off the mark. After a pilot has taken over and handed
    back, it flies no step: it lands where the pilot left the drone, whatever the surface. A
    pilot who wants another place must not hand back.
    """

    answers = (Status.SUCCESS, Status.RUNNING)
    reads = (STATE, FRAME, CAMERA, MARK)
    writes = (PHASE,)

    def initialise(self) -> None:
        """Begin with the step above the mark."""
        super().initialise()
        self.write(PHASE, MissionPhase.LAND)
        self._moved = False

    def work(self, state: DroneState) -> Status:
        """Move above the mark, then ask for the landing until the motors are off."""
        if state.flying is FlyingState.LANDED:
            return Status.SUCCESS
        if self.descends:  # frames that return do not take a landing back
            return self.descend()
        camera = self.read(CAMERA).value
        self._moved |= state.flying is FlyingState.LANDING  # too late for a step
        if not self._moved and camera is not None and camera.forward_offset_m != 0.0:
            self._moved = True
            fix, ahead_m, right_m = self.read(MARK).value, camera.forward_offset_m, 0.0
            if fix is not None and math.hypot(fix.forward_m - ahead_m, fix.right_m) <= _NEAR_M:
                ahead_m, right_m = fix.forward_m, fix.right_m
            self.start_move(forward_m=ahead_m, right_m=right_m)
            return Status.RUNNING
        unseen = _UNSEEN_S < self.read(FRAME).age_s < math.inf
        if self.moving(state) and not unseen:
            return Status.RUNNING
        return self.descend()


_RADIUS: Final = number(
    "radius_m", 0.0, 0, 5, "radius of the free disc to land on, m; at least the hull and a margin"
)


class SpotLandingLeaf(LandingLeaf):
    """Base of the leaves that land on the nearest surface in view that holds the hull.

    The surface is the ground or the top of the landing box, under the whole hull and a margin.
    After a take-over a leaf looks for a place again, and the time to look begins anew.
    """

    points = True
    reads = (STATE, FRAME, CLASS_MAP, CAMERA)
    writes = (PHASE,)
    phase: ClassVar[MissionPhase]
    landed: ClassVar[Status]  # the answer on the ground
    planned: ClassVar[bool]  # whether it fails in the air where it cannot land as it should

    def on_setup(self, mission: MissionContext) -> None:
        """Note the radius of the hull and the height of the landing mark."""
        super().on_setup(mission)
        self._hull_m, self._mark_m = mission.airframe.radius_m, mission.mark.height_m

    def initialise(self) -> None:
        """Note the time; no spot is known."""
        super().initialise()
        self.write(PHASE, self.phase)
        self._look()

    def _look(self) -> None:
        """Begin to look for a place."""
        self._started_s, self._resumed_s = self.leaf_clock.now(), self.leaf_clock.resumed_s
        self._above_spot = self.descends = False

    def gimbal_pitch_rad(self) -> float:
        """Return the pitch straight down."""
        return STRAIGHT_DOWN_RAD

    def work(self, state: DroneState) -> Status:
        """Find a spot, move above it, descend."""
        if state.flying is FlyingState.LANDED:
            return self.landed
        if self.descends and state.flying is FlyingState.LANDING:
            return self.descend()  # telemetry that returns does not take a landing back
        if self.leaf_clock.resumed_s > self._resumed_s:
            self._look()  # a pilot moved the drone
        if self.moving(state):
            return Status.RUNNING
        if self.progress is Progress.INTERRUPTED:
            self._above_spot = False  # the step has not ended at the spot
        if self._above_spot and self.planned and self.progress is Progress.FAILED:
            return self.fails("the drone does not fly the step to free ground")
        return self.descend() if self._above_spot else self._go_above_spot()

    def _go_above_spot(self) -> Status:
        """Move above a place; late, fail, or land without a margin or where the drone is."""
        late = self.leaf_clock.now() - self._started_s > self.port_value("look_s")
        spot_m = self._spot_m(max(self.port_value("radius_m"), self._hull_m + MARGIN_M))
        if spot_m is None and late and self.planned:
            return self.fails("no free ground in view")
        if spot_m is None and late:
            spot_m = self._spot_m(self._hull_m) or (0.0, 0.0)
        self._above_spot = spot_m is not None
        if spot_m is not None and math.hypot(*spot_m) > _TOLERANCE_M:
            self.start_move(forward_m=spot_m[0], right_m=spot_m[1])
        return Status.RUNNING

    def _spot_m(self, radius_m: float) -> tuple[float, float] | None:
        """Return the nearest place in view that holds a disc; None without one."""
        frame, camera = self.read(FRAME).value, self.read(CAMERA).value
        seen = self.read(CLASS_MAP).value
        if frame is None or camera is None or seen is None:
            return None
        down = camera_points_at(frame, STRAIGHT_DOWN_RAD, slack_rad=_PITCH_SLACK_RAD)
        if not down or seen.captured_s != frame.captured_s:
            return None
        height_px, width_px = seen.ids.shape
        resized = camera.resized(width_px, height_px)
        return nearest_landing_spot(seen, resized, frame, radius_m=radius_m, mark_m=self._mark_m)


class EmergencyLand(SpotLandingLeaf):
    """Land on the nearest surface in view that holds the hull; FAILURE on the ground.

    The leaf waits up to `look_s` for a place with a margin. Then it accepts a place that holds the
    hull without a margin. Without one, or when the drone does not fly the step there, it lands
    where it is: unseen ground is not known to be safer, and the drone may not be able to fly any
    longer.
    """

    ports = (
        _RADIUS,
        number("look_s", 6.0, 0, 600, "seconds until it lands without a margin around the hull"),
    )
    answers = (Status.FAILURE, Status.RUNNING)
    phase = MissionPhase.EMERGENCY_LANDING
    landed = Status.FAILURE
    planned = False


class LandHere(SpotLandingLeaf):
    """Land on free ground near the drone as the mission plans it; SUCCESS on the ground.

    FAILURE in the air when no free ground was in view for `look_s`, and when the drone does not fly
    the step to it; the tree may fly elsewhere.
    """

    ports = (
        _RADIUS,
        number("look_s", 6.0, 0, 600, "seconds to look for such a place until it fails"),
    )
    phase = MissionPhase.LAND
    landed = Status.SUCCESS
    planned = True

    def wait(self, state_age_s: float) -> Status:
        """Continue a landing that has begun; an unheard drone begins none."""
        return super().wait(state_age_s) if self.descends else Status.RUNNING


# --- the nearest place that holds a disc ----------------------------------------------------------


def nearest_landing_spot(
    class_map: ClassMap, camera: CameraModel, frame: Frame, *, radius_m: float, mark_m: float
) -> tuple[float, float] | None:
    """Return the nearest disc, ahead and right of the body, that lies entirely on one surface.

    A surface is the ground, or the top of the landing box, `mark_m` above it. Each is measured in
    its own plane. Pixels outside the image count as occupied. The camera has the size of the map.
    """
    height_m = max(frame.height_above_ground_m, MIN_VIEW_HEIGHT_M)
    surfaces = [(class_map.roles == GROUND, height_m)]
    above_pad_m = height_m - mark_m
    if above_pad_m >= MIN_VIEW_HEIGHT_M:
        top = _pad_top(class_map.roles == MARK_ROLE, camera, frame, above_pad_m / height_m)
        surfaces.append((top, above_pad_m))
    spots_m = [_nearest(seen, camera, frame, below_m, radius_m) for seen, below_m in surfaces]
    found_m = [spot_m for spot_m in spots_m if spot_m is not None]
    return min(found_m, key=lambda spot_m: math.hypot(*spot_m), default=None)


def _pad_top(
    pad: NDArray[np.bool_], camera: CameraModel, frame: Frame, scale: float
) -> NDArray[np.bool_]:
    """Return the pixels, (H, W), that show the top of the landing box, without its visible sides.

    A point at the foot of the box appears nearer to the point straight below the camera than the
    same point of the top, by the ratio `scale` of the camera's heights above top and ground. A
    pixel that this ratio maps outside the box shows a side.
    """
    import cv2  # noqa: PLC0415 - `uav-bt check` imports this module and must answer at once

    column, row = project((0.0, 0.0, 1.0), camera, frame.gimbal_pitch_rad)
    to_foot = np.array([[scale, 0.0, (1.0 - scale) * column], [0.0, scale, (1.0 - scale) * row]])
    how = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
    foot = cv2.warpAffine(pad.astype(np.uint8), to_foot, pad.shape[::-1], flags=how)
    return np.asarray(pad & foot.astype(bool))


def _nearest(
    surface: NDArray[np.bool_], camera: CameraModel, frame: Frame, height_m: float, radius_m: float
) -> tuple[float, float] | None:
    """Return the nearest disc within a level surface, (H, W), `height_m` below the camera."""
    import cv2  # noqa: PLC0415 - see above

    clear_px = cv2.distanceTransform(np.pad(surface.astype(np.uint8), 1), cv2.DIST_L2, 5)
    px_per_m = max(camera.fx_px, camera.fy_px) / height_m
    # The distance counts to the middle of the next pixel; the surface ends half a pixel earlier.
    rows, columns = np.nonzero(clear_px[1:-1, 1:-1] - 0.5 >= radius_m * px_per_m)
    if rows.size == 0:
        return None
    pixels = np.stack([columns, rows], axis=-1)
    spots = ground_points(pixels, camera, frame.gimbal_pitch_rad, height_m)
    spots[:, 0] += camera.forward_offset_m
    forward_m, right_m = spots[np.argmin(np.hypot(spots[:, 0], spots[:, 1]))]
    return float(forward_m), float(right_m)
