"""Dead reckoning corrected by the ground, in pictures of the twin with telemetry that drifts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from perception.odometry.ground import GroundOdometry
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import Helipad
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.views import render_views
from tests.paper_lab import CARPET, paper_map
from tests.worlds import values
from uav_bt.types import Attitude, BodyVelocity, DroneState, FlyingState, Frame, Pose2D
from uav_bt.types.arrays import Image

SIZE_PX = (320, 180)
CAMERA = anafi_camera(*SIZE_PX)
PITCH_RAD = math.radians(-30)
HEIGHT_M = 1.5
STEP_S = 0.1
STILL = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0)
LAB = Scene(name="empty", helipad=Helipad(position_m=(-2.2, -1.7)), boxes=())
BLACK = np.zeros((9, 16, 3), np.uint8)
ALL_GROUND = np.full((9, 16), CARPET, np.uint8)


def tell(
    odometry: GroundOdometry, time_s: float, velocity: BodyVelocity, yaw_rad: float = 0.0
) -> None:
    attitude = Attitude(yaw_rad=yaw_rad)
    odometry.predict(
        DroneState(
            captured_s=time_s, flying=FlyingState.FLYING, attitude=attitude, velocity=velocity
        )
    )


def show(
    odometry: GroundOdometry,
    index: int,
    image: Image = BLACK,
    ids: Image = ALL_GROUND,
    height_m: float = HEIGHT_M,
) -> None:
    time_s = index * STEP_S
    frame = values.frame(image, PITCH_RAD, height_m, captured_s=time_s, index=index)
    odometry.see(paper_map(ids=ids, captured_s=time_s), frame, CAMERA)


def pose(x_m: float, y_m: float, yaw_rad: float = 0.0) -> CameraPose:
    return CameraPose(x_m=x_m, y_m=y_m, z_m=HEIGHT_M, yaw_rad=yaw_rad, pitch_rad=PITCH_RAD)


def fly(
    poses: Sequence[CameraPose],
    told: BodyVelocity,
    *,
    blind: bool = False,
    yaw_off_rad: Callable[[int], float] = lambda _: 0.0,
    height_off_m: Callable[[int], float] = lambda _: 0.0,
) -> GroundOdometry:
    """Show the images of poses, 0.1 s apart, with the reported velocity and errors."""
    odometry = GroundOdometry()
    views = render_views(LAB, poses, size_px=SIZE_PX, profile=Profile.named("lab"))
    for index, view in enumerate(views):
        tell(odometry, index * STEP_S, told, -view.pose.yaw_rad + yaw_off_rad(index))
        image = np.zeros_like(view.image) if blind else view.image
        show(odometry, index, image, view.ids, HEIGHT_M + height_off_m(index))
    return odometry


def test_a_drone_that_stands_still_stays_where_it_is() -> None:
    """Telemetry says it drifts by 0.15 m; the ground says it does not."""
    odometry = fly([pose(-1.0, 0.0)] * 16, BodyVelocity(forward_mps=0.06, right_mps=-0.08))

    assert math.hypot(odometry.now.x_m, odometry.now.y_m) < 0.02


def test_a_height_that_is_wrong_does_not_pass_for_a_way_ahead() -> None:
    """By half a percent too low: the ground would have come nearer by half a centimetre."""
    odometry = fly([pose(-1.0, 0.0)] * 2, BodyVelocity(), height_off_m=lambda index: -0.008 * index)

    assert math.hypot(odometry.now.x_m, odometry.now.y_m) < 0.002


def test_the_noise_of_telemetry_s_heading_is_not_the_pose_s() -> None:
    noise_rad = np.random.default_rng(1).normal(0.0, 0.015, 31)
    noise_rad[0] = 0.0
    turn = [pose(-1.0, 0.0, -0.03 * step) for step in range(31)]
    odometry = fly(turn, BodyVelocity(), yaw_off_rad=lambda index: float(noise_rad[index]))

    assert odometry.estimate.seen.yaw_rad == pytest.approx(0.9, abs=0.01)


@pytest.mark.parametrize("leapt_rad", [0.15, 0.3, -1.57])
def test_a_leap_of_telemetry_s_heading_turns_nothing(leapt_rad: float) -> None:
    slide = [pose(-1.0, 0.015 * step) for step in range(21)]
    estimate = fly(
        slide,
        BodyVelocity(right_mps=-0.15),
        yaw_off_rad=lambda index: leapt_rad if index >= 10 else 0.0,
    ).estimate

    assert estimate.seen.yaw_rad == pytest.approx(0.0, abs=0.02)
    assert estimate.pose.yaw_rad == pytest.approx(0.0, abs=0.02)
    assert (estimate.pose.x_m, estimate.pose.y_m) == pytest.approx((0.0, -0.3), abs=0.03)


def test_turning_about_the_camera_moves_nothing() -> None:
    """A turn of 60 degrees with the lens in one place moves the body's centre only."""
    turns = [pose(-1.0, 0.0, -math.radians(4 * step)) for step in range(16)]
    offset_m = CAMERA.forward_offset_m
    odometry = fly(turns, BodyVelocity())

    lens = odometry.now.to_world(offset_m, 0.0)
    assert math.hypot(lens[0] - offset_m, lens[1]) < 0.03


def test_the_border_of_the_ground_is_left_out() -> None:
    """A corner of a box that touches ground in the image moves otherwise than the ground does."""
    (view,) = render_views(LAB, [pose(-1.0, 0.0)], size_px=SIZE_PX, profile=Profile.named("lab"))
    ids = np.zeros_like(view.ids)
    ids[100:103] = CARPET  # a strip that is all border
    odometry = GroundOdometry()
    for index in range(6):
        tell(odometry, index * STEP_S, BodyVelocity(forward_mps=0.1))
        show(odometry, index, view.image, ids)
    assert odometry.estimate.tracked_s < 0.0  # never


def test_before_the_first_telemetry_there_is_no_pose() -> None:
    odometry = GroundOdometry()
    show(odometry, 0)
    assert (odometry.now, odometry.at(1.0), odometry.estimate) == (None, None, None)


def test_the_velocity_over_the_ground_is_estimated_and_goes_on_without_frames() -> None:
    """Telemetry says that it stands still, heading to the right of the slide's direction."""
    slide = [pose(-1.0, 0.015 * step, yaw_rad=-0.5) for step in range(31)]
    odometry = fly(slide, BodyVelocity())
    before = odometry.estimate

    forward_mps, right_mps = before.velocity.forward_mps, before.velocity.right_mps
    assert (before.pose.x_m, before.pose.y_m) == pytest.approx((0.0, -0.45), abs=0.02)
    assert forward_mps == pytest.approx(-0.15 * math.sin(0.5), abs=0.03)
    assert right_mps == pytest.approx(-0.15 * math.cos(0.5), abs=0.03)
    assert before.error == BodyVelocity(forward_mps=forward_mps, right_mps=right_mps)
    assert before.seen.time_s == before.tracked_s == pytest.approx(3.0)
    assert before.ground_share is not None
    assert before.ground_share > 0.2

    tell(odometry, 3.5, BodyVelocity(), 0.5)
    after = odometry.estimate
    assert after.pose.y_m - before.pose.y_m == pytest.approx(-0.075, abs=0.015)
    assert (after.seen, after.untracked_s) == (before.seen, pytest.approx(0.5))


def test_without_texture_telemetry_stays_and_the_share_of_ground_is_stated() -> None:
    odometry = fly([pose(-1.0, 0.0)] * 6, BodyVelocity(forward_mps=0.2), blind=True)
    motion = odometry.estimate

    assert motion.pose.x_m == pytest.approx(0.1)
    assert motion.tracked_s < 0.0
    assert motion.ground_share is not None
    assert motion.ground_share > 0.2


def test_a_velocity_that_is_only_late_is_no_error_of_telemetry() -> None:
    """From 0.6 s on it slides at 0.3 m/s after 1.2 m/s2; reports every 0.2 s, 0.2 s late."""
    times_s = [STEP_S * step for step in range(26)]
    slides_s = [max(0.0, time_s - 0.6) for time_s in times_s]
    mps = [min(0.3, 1.2 * slid_s) for slid_s in slides_s]
    slid_m = [0.6 * min(slid_s, 0.25) ** 2 + 0.3 * max(0.0, slid_s - 0.25) for slid_s in slides_s]
    odometry, errors_mps = GroundOdometry(), []
    views = render_views(LAB, [pose(-1.0, -place_m) for place_m in slid_m], size_px=SIZE_PX)
    for index, view in enumerate(views):
        measured = max(0, index // 2 * 2 - 2)
        state = DroneState(
            captured_s=times_s[measured],
            flying=FlyingState.FLYING,
            velocity=BodyVelocity(right_mps=mps[measured]),
        )
        odometry.predict(state, times_s[index])
        show(odometry, index, view.image, view.ids)
        error = odometry.estimate.error
        errors_mps.append(math.hypot(error.forward_mps, error.right_mps))
        assert odometry.estimate.seen.y_m == pytest.approx(slid_m[index], abs=0.01)
    assert max(errors_mps) < 0.03
    assert odometry.now.y_m == pytest.approx(slid_m[-1], abs=0.01)


# --- motions that are measured elsewhere ----------------------------------------------------------


@pytest.mark.parametrize("telemetry", [True, False])
def test_without_frames_the_known_error_of_the_velocity_is_still_corrected(
    *, telemetry: bool
) -> None:
    """The drone stands and reports 0.1 m/s. In a gap of telemetry both count for a second."""
    odometry = GroundOdometry(measure=lambda _first, _second: STILL)
    for index in range(400):
        lost = 200 <= index < 300
        if telemetry or not lost:
            tell(odometry, index * STEP_S, BodyVelocity(forward_mps=0.1))
        if not lost:
            show(odometry, index)
    assert abs(odometry.now.x_m) < 0.4


def test_the_error_of_a_wrong_velocity_turns_with_the_drone() -> None:
    """It stands, reports 0.2 m/s ahead, and loses the ground halfway in a turn to the back.

    The error of the heading before the turn would be wrong by 0.4 m/s.
    """
    turned_rad = [math.radians(3) * max(0, min(index - 50, 60)) for index in range(141)]

    def measure(first: Frame, second: Frame) -> Pose2D | None:
        # Of a lens that the turn carries on a circle about the body's centre.
        yaw_rad = turned_rad[second.index] - turned_rad[first.index]
        turn = replace(STILL, yaw_rad=yaw_rad)
        x_m, y_m = turn.to_world(CAMERA.forward_offset_m, 0.0)
        moved = replace(turn, x_m=x_m - CAMERA.forward_offset_m, y_m=y_m)
        return None if second.index > 80 else moved

    odometry = GroundOdometry(measure=measure)
    for index, yaw_rad in enumerate(turned_rad):
        tell(odometry, index * STEP_S, BodyVelocity(forward_mps=0.2), yaw_rad)
        show(odometry, index)
    assert math.hypot(odometry.now.x_m, odometry.now.y_m) < 0.7


def test_the_factor_of_a_wrong_height_is_stated() -> None:
    """The ground passes 1.5 times as far between two frames as telemetry says."""

    def measure(first: Frame, second: Frame) -> Pose2D:
        begin, end = (0.4 - 0.4 * math.cos(frame.captured_s) for frame in (first, second))
        return replace(STILL, x_m=1.5 * (end - begin))

    odometry = GroundOdometry(measure=measure)
    for index in range(100):
        tell(odometry, index * STEP_S, BodyVelocity(forward_mps=0.4 * math.sin(index * STEP_S)))
        show(odometry, index)
        if index == 2:
            assert odometry.estimate.stretch is None
    assert odometry.estimate.stretch == pytest.approx(1.5, abs=0.03)
