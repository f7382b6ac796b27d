"""Dead reckoning corrected by the ground, in pictures of the twin with telemetry that drifts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest

from perception.odometry.ground import GroundOdometry
from perception.odometry.visual import GroundView, _reweighted, ground_motion
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import Helipad
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.views import render_views
from tests.paper_lab import CARPET, paper_map
from tests.worlds import values
from uav_bt.testing import pinhole
from uav_bt.types import (
    Attitude,
    BodyVelocity,
    DroneState,
    FlyingState,
    Frame,
    Pose2D,
    rotate_points,
)
from uav_bt.types.arrays import Floats, Image

SIZE_PX = (320, 180)
CAMERA = anafi_camera(*SIZE_PX)
PITCH_RAD = math.radians(-30)
HEIGHT_M = 1.5
STEP_S = 0.1
STILL = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0)
LAB = Scene(name="empty", helipad=Helipad(position_m=(-2.2, -1.7)), boxes=())


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
    for index, view in enumerate(
        render_views(LAB, poses, size_px=SIZE_PX, profile=Profile.named("lab"))
    ):
        time_s = index * STEP_S
        odometry.predict(
            DroneState(
                captured_s=time_s,
                flying=FlyingState.FLYING,
                attitude=Attitude(yaw_rad=-view.pose.yaw_rad + yaw_off_rad(index)),
                velocity=told,
            )
        )
        frame = values.frame(
            np.zeros_like(view.image) if blind else view.image,
            PITCH_RAD,
            HEIGHT_M + height_off_m(index),
            captured_s=time_s,
            index=index,
        )
        odometry.see(paper_map(ids=view.ids, captured_s=time_s), frame, CAMERA)
    return odometry


def pose(x_m: float, y_m: float, yaw_rad: float = 0.0) -> CameraPose:
    return CameraPose(x_m=x_m, y_m=y_m, z_m=HEIGHT_M, yaw_rad=yaw_rad, pitch_rad=PITCH_RAD)


def test_a_drone_that_stands_still_stays_where_it_is() -> None:
    """Telemetry says it drifts by 0.15 m; the ground says it does not."""
    odometry = fly([pose(-1.0, 0.0)] * 16, BodyVelocity(forward_mps=0.06, right_mps=-0.08))

    assert odometry.now is not None
    assert math.hypot(odometry.now.x_m, odometry.now.y_m) < 0.02


def test_a_drift_that_telemetry_does_not_feel_is_found() -> None:
    """The camera slides to the left, telemetry says that it stands still."""
    odometry = fly([pose(-1.0, 0.015 * step) for step in range(16)], BodyVelocity())

    assert odometry.now is not None
    assert odometry.now.x_m == pytest.approx(0.0, abs=0.02)
    assert odometry.now.y_m == pytest.approx(-0.225, abs=0.02)


def test_a_height_that_is_wrong_does_not_pass_for_a_way_ahead() -> None:
    """By half a percent too low: the ground would have come nearer by half a centimetre."""
    odometry = fly([pose(-1.0, 0.0)] * 2, BodyVelocity(), height_off_m=lambda index: -0.008 * index)

    assert odometry.now is not None
    assert math.hypot(odometry.now.x_m, odometry.now.y_m) < 0.002


def test_points_close_together_tell_no_turn_from_a_shift() -> None:
    (shown,) = render_views(LAB, [pose(-1.0, 0.0)], size_px=SIZE_PX, profile=Profile.named("lab"))
    view = GroundView(
        grey=np.asarray(cv2.cvtColor(shown.image, cv2.COLOR_RGB2GRAY), dtype=np.uint8),
        camera=CAMERA,
        gimbal_pitch_rad=PITCH_RAD,
        height_m=HEIGHT_M,
    )
    patch = np.zeros(view.grey.shape, dtype=np.uint8)
    patch[130:170, 130:190] = 1
    still = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    assert ground_motion(view, view, still, patch) is None


def test_ground_that_moves_in_two_ways_tells_no_motion() -> None:
    """Nearly half of the image is shifted: it may be the top of an object that counts as ground."""
    first = _textured()
    second = first.copy()
    second[:, 180:] = np.roll(first[:, 180:], 6, axis=0)
    ground = np.ones(first.shape, np.uint8)
    assert ground_motion(*_views(first, second), STILL, ground) is None
    assert ground_motion(*_views(first, first), STILL, ground) is not None


def test_the_noise_of_a_plain_floor_tells_no_motion() -> None:
    """Noise has corners, and tracked from where they are expected they agree with telemetry."""
    rng = np.random.default_rng(3)
    plain = np.full((180, 320), 143.0)
    noisy = [np.clip(plain + rng.normal(0.0, 2.0, plain.shape), 0, 255) for _ in range(2)]
    ground = np.ones(plain.shape, np.uint8)
    assert ground_motion(*_views(*noisy), STILL, ground) is None


def test_texture_weaker_than_the_noise_tells_the_motion() -> None:
    rng = np.random.default_rng(3)
    texture = 143.0 + 1.6 * (_textured() - 128.0) / np.std(_textured())
    noisy = [np.clip(texture + rng.normal(0.0, 2.0, texture.shape), 0, 255) for _ in range(2)]
    ground = np.ones(texture.shape, np.uint8)
    shown = ground_motion(*_views(*noisy), STILL, ground)
    assert shown is not None
    assert math.hypot(shown.motion.x_m, shown.motion.y_m) < 0.005


def test_an_object_that_counts_as_ground_hides_no_weak_texture() -> None:
    """The corners of a chequered box are many times as strong as those of the floor."""
    image = np.asarray(128 + (_textured().astype(float) - 128) / 8, np.uint8)
    image[110:134, 30:54] = 255 * (np.indices((24, 24)).sum(axis=0) // 8 % 2)
    ground = np.ones(image.shape, np.uint8)
    assert ground_motion(*_views(image, image), STILL, ground) is not None


def _textured() -> Image:
    rng = np.random.default_rng(3)
    blurred = cv2.GaussianBlur(rng.integers(0, 255, (180, 320), dtype=np.uint8), (0, 0), 2)
    return np.asarray(cv2.normalize(blurred, None, 0, 255, cv2.NORM_MINMAX), np.uint8)


def _views(*images: Floats | Image) -> list[GroundView]:
    return [
        GroundView(
            grey=np.asarray(image, np.uint8),
            camera=CAMERA,
            gimbal_pitch_rad=PITCH_RAD,
            height_m=HEIGHT_M,
        )
        for image in images
    ]


def test_the_noise_of_telemetry_s_heading_is_not_the_pose_s() -> None:
    noise_rad = np.random.default_rng(1).normal(0.0, 0.015, 31)
    noise_rad[0] = 0.0
    turn = [pose(-1.0, 0.0, -0.03 * step) for step in range(31)]
    odometry = fly(turn, BodyVelocity(), yaw_off_rad=lambda index: float(noise_rad[index]))

    assert odometry.estimate is not None
    assert odometry.estimate.seen.yaw_rad == pytest.approx(0.9, abs=0.01)


@pytest.mark.parametrize("leapt_rad", [0.15, 0.2, 0.3, 0.8, -1.57])
def test_a_leap_of_telemetry_s_heading_turns_nothing(leapt_rad: float) -> None:
    def leap_rad(index: int) -> float:
        return leapt_rad if index >= 10 else 0.0

    slide = [pose(-1.0, 0.015 * step) for step in range(21)]
    estimate = fly(slide, BodyVelocity(right_mps=-0.15), yaw_off_rad=leap_rad).estimate

    assert estimate is not None
    assert estimate.seen.yaw_rad == pytest.approx(0.0, abs=0.02)
    assert estimate.pose.yaw_rad == pytest.approx(0.0, abs=0.02)
    assert (estimate.pose.x_m, estimate.pose.y_m) == pytest.approx((0.0, -0.3), abs=0.03)


def test_turning_about_the_camera_moves_nothing() -> None:
    """A turn of 60 degrees with the lens in one place moves the body's centre only."""
    turns = [pose(-1.0, 0.0, -math.radians(4 * step)) for step in range(16)]
    offset_m = CAMERA.forward_offset_m
    odometry = fly(turns, BodyVelocity())

    assert odometry.now is not None
    lens = odometry.now.to_world(offset_m, 0.0)
    assert math.hypot(lens[0] - offset_m, lens[1]) < 0.03


def test_without_a_view_of_the_ground_telemetry_stays() -> None:
    odometry = fly([pose(-1.0, 0.0)] * 6, BodyVelocity(forward_mps=0.2), blind=True)

    assert odometry.now is not None
    assert odometry.now.x_m == pytest.approx(0.1)


def test_the_border_of_the_ground_is_left_out() -> None:
    """A corner of a box that touches ground in the image moves otherwise than the ground does."""
    here = pose(-1.0, 0.0)
    (view,) = render_views(LAB, [here], size_px=SIZE_PX, profile=Profile.named("lab"))
    ids = np.zeros_like(view.ids)
    ids[100:103] = CARPET  # a strip that is all border
    odometry = GroundOdometry()
    told = BodyVelocity(forward_mps=0.1)
    for index in range(6):
        time_s = index * STEP_S
        odometry.predict(DroneState(captured_s=time_s, flying=FlyingState.FLYING, velocity=told))
        frame = values.frame(view.image, PITCH_RAD, HEIGHT_M, captured_s=time_s, index=index)
        odometry.see(paper_map(ids=ids, captured_s=time_s), frame, CAMERA)
    assert odometry.estimate is not None
    assert odometry.estimate.tracked_s < 0.0  # never


def test_before_the_first_telemetry_there_is_no_pose() -> None:
    odometry = GroundOdometry()

    assert odometry.now is None
    assert odometry.at(1.0) is None
    assert odometry.estimate is None


def test_the_velocity_over_the_ground_is_estimated() -> None:
    """Telemetry says that it stands still, heading to the right of the slide's direction."""
    slide = [pose(-1.0, 0.015 * step, yaw_rad=-0.5) for step in range(31)]
    estimate = fly(slide, BodyVelocity()).estimate

    assert estimate is not None
    right_mps = estimate.velocity.right_mps
    assert estimate.velocity.forward_mps == pytest.approx(-0.15 * math.sin(0.5), abs=0.03)
    assert right_mps == pytest.approx(-0.15 * math.cos(0.5), abs=0.03)
    assert estimate.error == BodyVelocity(
        forward_mps=estimate.velocity.forward_mps, right_mps=right_mps
    )
    assert estimate.seen.time_s == estimate.tracked_s == pytest.approx(3.0)


def test_what_telemetry_misses_goes_on_while_the_ground_is_out_of_view() -> None:
    """After three seconds of sliding with the ground in view, half a second without frames."""
    odometry = fly([pose(-1.0, 0.015 * step) for step in range(31)], BodyVelocity())
    before = odometry.estimate
    odometry.predict(DroneState(captured_s=3.5, flying=FlyingState.FLYING))
    after = odometry.estimate

    assert before is not None
    assert after is not None
    assert after.pose.y_m - before.pose.y_m == pytest.approx(-0.075, abs=0.015)
    assert (after.seen, after.untracked_s) == (before.seen, pytest.approx(0.5))


# --- telemetry that comes later and more rarely than frames ---------------------------------------


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
        frame = values.frame(
            view.image, PITCH_RAD, HEIGHT_M, captured_s=times_s[index], index=index
        )
        odometry.see(paper_map(ids=view.ids, captured_s=times_s[index]), frame, CAMERA)
        assert odometry.estimate is not None
        errors_mps.append(math.hypot(*_horizontal(odometry.estimate.error)))
        assert odometry.estimate.seen.y_m == pytest.approx(slid_m[index], abs=0.01)
    assert max(errors_mps) < 0.03
    assert odometry.now is not None
    assert odometry.now.y_m == pytest.approx(slid_m[-1], abs=0.01)


def _horizontal(velocity: BodyVelocity) -> tuple[float, float]:
    return velocity.forward_mps, velocity.right_mps


@pytest.mark.parametrize("max_scale", [0.0, 0.02])
def test_the_fit_is_that_of_reweighted_least_squares(max_scale: float) -> None:
    rng = np.random.default_rng(4)
    there = rng.uniform((0.5, -1.5), (3.5, 1.5), (80, 2))
    noise_m = rng.normal(0.0, 0.01, (80, 2))
    here = rotate_points(there, 0.05) + np.array([0.12, -0.03]) + noise_m
    here[:15] += 0.2  # points that do not lie on the ground
    residual_m = there - rotate_points(here - (0.1, 0.0), -0.04)

    trust, scale_m, off_m = 1.0 / (1.0 + (there**2).sum(axis=1)) ** 2, 0.12, residual_m.copy()
    for _ in range(6):
        share = trust / (1.0 + ((off_m / scale_m) ** 2).sum(axis=1)) ** 2
        share = share / share.sum()
        a, b = here - share @ here, there - share @ there
        across, along = share @ (a[:, 1] * b[:, 0] - a[:, 0] * b[:, 1]), share @ (a * b).sum(axis=1)
        spread_m2, yaw_rad = share @ (b**2).sum(axis=1), math.atan2(across, along)
        scale = np.clip(math.hypot(across, along) / spread_m2, 1.0 - max_scale, 1.0 + max_scale)
        place_m = share @ here - scale * rotate_points(share @ there, yaw_rad)
        off_m = scale * there - rotate_points(here - place_m, -yaw_rad)
        scale_m = max(0.03, 0.6 * scale_m)

    x_m, y_m, turn_rad, spread_m, inliers = _reweighted(here, there, residual_m, max_scale)
    assert (x_m, y_m, turn_rad) == pytest.approx((*place_m, yaw_rad), rel=1e-9)
    assert (x_m, y_m, turn_rad) == pytest.approx((0.12, -0.03, 0.05), abs=0.01)
    assert spread_m == pytest.approx(math.sqrt(spread_m2), rel=1e-9)
    assert inliers == np.count_nonzero(np.hypot(*off_m.T) < 0.03) > 55


def test_the_share_of_ground_is_stated_with_and_without_texture() -> None:
    poses, still = [pose(-1.0, 0.0)] * 4, BodyVelocity()
    for blind in (False, True):
        motion = fly(poses, still, blind=blind).estimate
        assert motion is not None
        assert motion.ground_share is not None
        assert motion.ground_share > 0.2
        assert (motion.tracked_s == motion.seen.time_s) is not blind


@pytest.mark.parametrize("telemetry", [True, False])
def test_without_frames_the_known_error_of_the_velocity_is_still_corrected(
    *, telemetry: bool
) -> None:
    """The drone stands and reports 0.1 m/s. In a gap of telemetry both count for a second."""
    odometry = GroundOdometry(measure=lambda _first, _second: STILL)
    for index in range(400):
        time_s, lost = index * STEP_S, 200 <= index < 300
        if telemetry or not lost:
            velocity = BodyVelocity(forward_mps=0.1)
            odometry.predict(
                DroneState(captured_s=time_s, flying=FlyingState.FLYING, velocity=velocity)
            )
        if not lost:
            frame = values.frame((9, 16), PITCH_RAD, HEIGHT_M, captured_s=time_s, index=index)
            odometry.see(paper_map(ids=np.full((9, 16), CARPET), captured_s=time_s), frame, CAMERA)
    assert odometry.now is not None
    assert abs(odometry.now.x_m) < 0.4


def test_the_error_of_a_wrong_velocity_turns_with_the_drone() -> None:
    """It stands, reports 0.2 m/s ahead, and loses the ground halfway in a turn to the back.

    The error of the heading before the turn would be wrong by 0.4 m/s.
    """
    turned_rad = [math.radians(3) * max(0, min(index - 50, 60)) for index in range(141)]

    def measure(first: Frame, second: Frame) -> Pose2D | None:
        yaw_rad = turned_rad[second.index] - turned_rad[first.index]
        return None if second.index > 80 else replace(STILL, yaw_rad=yaw_rad)

    odometry, camera = GroundOdometry(measure=measure), replace(CAMERA, forward_offset_m=0.0)
    for index, yaw_rad in enumerate(turned_rad):
        time_s, attitude = index * STEP_S, Attitude(yaw_rad=yaw_rad)
        odometry.predict(
            DroneState(
                captured_s=time_s,
                flying=FlyingState.FLYING,
                attitude=attitude,
                velocity=BodyVelocity(forward_mps=0.2),
            )
        )
        frame = Frame(
            image=np.zeros((9, 16, 3), dtype=np.uint8),
            index=index,
            captured_s=time_s,
            gimbal_pitch_rad=PITCH_RAD,
            height_above_ground_m=HEIGHT_M,
            attitude=attitude,
        )
        odometry.see(paper_map(ids=np.full((9, 16), CARPET), captured_s=time_s), frame, camera)
    assert odometry.now is not None
    assert math.hypot(odometry.now.x_m, odometry.now.y_m) < 0.7


def test_the_odometry_states_the_factor_of_a_wrong_height() -> None:
    """The ground passes 1.5 times as far between two frames as telemetry says."""

    def way_m(time_s: float) -> float:
        return 0.4 - 0.4 * math.cos(time_s)

    def measured(first: Frame, second: Frame) -> Pose2D:
        passed_m = way_m(second.captured_s) - way_m(first.captured_s)
        return Pose2D(x_m=1.5 * passed_m, y_m=0.0, yaw_rad=0.0)

    odometry, camera = GroundOdometry(measure=measured), pinhole(64, 36)
    ids = np.full((18, 32), CARPET, np.uint8)
    image = np.zeros((36, 64, 3), np.uint8)
    for index in range(100):
        time_s = index * STEP_S
        velocity = BodyVelocity(forward_mps=0.4 * math.sin(time_s))
        odometry.predict(
            DroneState(captured_s=time_s, flying=FlyingState.FLYING, velocity=velocity)
        )
        frame = values.frame(image, captured_s=time_s, index=index)
        odometry.see(paper_map(ids=ids, captured_s=time_s), frame, camera)
        if index == 2:
            assert odometry.estimate is not None
            assert odometry.estimate.stretch is None
    assert odometry.estimate is not None
    assert odometry.estimate.stretch == pytest.approx(1.5, abs=0.03)
