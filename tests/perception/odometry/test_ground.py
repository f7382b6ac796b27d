"""The motion over the ground, from telemetry and images."""

import math
from collections.abc import Sequence
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
from sim_bridge.twin.views import View, render_views
from tests.paper_lab import CARPET, paper_map
from tests.uav_bt.types.circle_flight import state
from tests.worlds import values
from uav_bt.types import BodyVelocity, Frame, Pose2D, rotate_points
from uav_bt.types.arrays import Floats, Image

SIZE_PX = (320, 180)
CAMERA = anafi_camera(*SIZE_PX)
PITCH_RAD = math.radians(-30)
HEIGHT_M = 1.5
STEP_S = 0.1
# --- the motion of the ground between two images --------------------------------------------------

STILL = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0)
LAB = Scene(name="empty", helipad=Helipad(position_m=(-2.2, -1.7)), objects=())
BLACK = np.zeros((9, 16, 3), np.uint8)
ALL_GROUND = np.full((9, 16), CARPET, np.uint8)


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


def views(*places: tuple[float, float]) -> Sequence[View]:
    """Return images from a metre behind the origin, each some metres aside and turned."""
    poses = [
        CameraPose(x_m=-1.0, y_m=y_m, z_m=HEIGHT_M, yaw_rad=yaw_rad, pitch_rad=PITCH_RAD)
        for y_m, yaw_rad in places
    ]
    return render_views(LAB, poses, size_px=SIZE_PX, profile=Profile.named("lab"))


def fly(
    *places: tuple[float, float],
    yaw_off_rad: Sequence[float] = (0.0,) * 40,
    low_m: float = 0.0,
    **told: float,
) -> GroundOdometry:
    """Show the images of places, 0.1 s apart, with the reported velocity and errors."""
    odometry = GroundOdometry()
    for index, view in enumerate(views(*places)):
        yaw_rad = -view.pose.yaw_rad + yaw_off_rad[index]
        odometry.predict(state(index * STEP_S, yaw_rad, **told))
        show(odometry, index, view.image, view.ids, HEIGHT_M - low_m * index)
    return odometry


HERE = (0.0, 0.0)


def test_a_drone_that_stands_still_stays_where_it_is() -> None:
    """Telemetry says it drifts by 0.15 m; the ground says it does not."""
    now = fly(*[HERE] * 16, forward_mps=0.06, right_mps=-0.08).now
    assert math.hypot(now.x_m, now.y_m) < 0.02
    # Half a percent too low, the ground would have come nearer by half a centimetre.
    now = fly(HERE, HERE, low_m=0.008).now
    assert math.hypot(now.x_m, now.y_m) < 0.002


@pytest.mark.parametrize("leapt_rad", [0.15, 0.3, -1.57])
def test_a_leap_of_telemetry_s_heading_turns_nothing(leapt_rad: float) -> None:
    slide = [(0.015 * step, 0.0) for step in range(21)]
    leap = [0.0] * 10 + [leapt_rad] * 11
    estimate = fly(*slide, yaw_off_rad=leap, right_mps=-0.15).estimate
    assert estimate.seen.yaw_rad == pytest.approx(0.0, abs=0.02)
    assert estimate.pose.yaw_rad == pytest.approx(0.0, abs=0.02)
    assert (estimate.pose.x_m, estimate.pose.y_m) == pytest.approx((0.0, -0.3), abs=0.03)


def test_turning_about_the_camera_moves_nothing() -> None:
    """A turn of 60 degrees with the lens in one place moves the body's centre only."""
    odometry = fly(*[(0.0, -math.radians(4 * step)) for step in range(16)])
    offset_m = CAMERA.forward_offset_m
    lens = odometry.now.to_world(offset_m, 0.0)
    assert math.hypot(lens[0] - offset_m, lens[1]) < 0.03


def test_the_border_of_the_ground_and_ground_without_texture_are_left_out() -> None:
    """A corner of a box that touches ground in the image moves otherwise than the ground does."""
    (view,) = views(HERE)
    border = np.zeros_like(view.ids)
    border[100:103] = CARPET  # a strip that is all border
    for image, ids in ((view.image, border), (np.zeros_like(view.image), view.ids)):
        odometry = GroundOdometry()
        assert (odometry.now, odometry.at(1.0), odometry.estimate) == (None, None, None)
        show(odometry, 0, image, ids)  # before the first telemetry
        assert odometry.now is None
        for index in range(6):
            odometry.predict(state(index * STEP_S, forward_mps=0.2))
            show(odometry, index, image, ids)
        assert odometry.estimate.pose.x_m == pytest.approx(0.1)
        assert odometry.estimate.tracked_s < 0.0  # never
    assert odometry.estimate.ground_share > 0.2


def test_the_velocity_over_the_ground_is_estimated_and_goes_on_without_frames() -> None:
    """Telemetry says that it stands still, heading to the right of the slide's direction."""
    odometry = fly(*[(0.015 * step, -0.5) for step in range(31)])
    before = odometry.estimate
    forward_mps, right_mps = before.velocity.forward_mps, before.velocity.right_mps
    assert (before.pose.x_m, before.pose.y_m) == pytest.approx((0.0, -0.45), abs=0.02)
    assert forward_mps == pytest.approx(-0.15 * math.sin(0.5), abs=0.03)
    assert right_mps == pytest.approx(-0.15 * math.cos(0.5), abs=0.03)
    assert before.error == BodyVelocity(forward_mps=forward_mps, right_mps=right_mps)
    assert before.seen.time_s == before.tracked_s == pytest.approx(3.0)
    assert before.ground_share > 0.2
    odometry.predict(state(3.5, 0.5))
    after = odometry.estimate
    assert after.pose.y_m - before.pose.y_m == pytest.approx(-0.075, abs=0.015)
    assert (after.seen, after.untracked_s) == (before.seen, pytest.approx(0.5))


def test_a_velocity_that_is_only_late_is_no_error_of_telemetry() -> None:
    """From 0.6 s on it slides at 0.3 m/s after 1.2 m/s2; reports every 0.2 s, 0.2 s late."""
    times_s = [STEP_S * step for step in range(26)]
    slides_s = [max(0.0, time_s - 0.6) for time_s in times_s]
    mps = [min(0.3, 1.2 * slid_s) for slid_s in slides_s]
    slid_m = [0.6 * min(slid_s, 0.25) ** 2 + 0.3 * max(0.0, slid_s - 0.25) for slid_s in slides_s]
    odometry = GroundOdometry()
    for index, view in enumerate(views(*[(-place_m, 0.0) for place_m in slid_m])):
        measured = max(0, index // 2 * 2 - 2)
        odometry.predict(state(times_s[measured], right_mps=mps[measured]), times_s[index])
        show(odometry, index, view.image, view.ids)
        error = odometry.estimate.error
        assert math.hypot(error.forward_mps, error.right_mps) < 0.03
        assert odometry.estimate.seen.y_m == pytest.approx(slid_m[index], abs=0.01)
    assert odometry.now.y_m == pytest.approx(slid_m[-1], abs=0.01)


def test_without_frames_the_known_error_of_the_velocity_is_still_corrected() -> None:
    """The drone stands and reports 0.1 m/s. In a gap of telemetry both count for a second."""
    for telemetry in (True, False):
        odometry = GroundOdometry(measure=lambda _first, _second: STILL)
        for index in range(400):
            lost = 200 <= index < 300
            if telemetry or not lost:
                odometry.predict(state(index * STEP_S, forward_mps=0.1))
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
        odometry.predict(state(index * STEP_S, yaw_rad, forward_mps=0.2))
        show(odometry, index)
    assert math.hypot(odometry.now.x_m, odometry.now.y_m) < 0.7


def test_the_factor_of_a_wrong_height_is_stated() -> None:
    """The ground passes 1.5 times as far between two frames as telemetry says."""

    def measure(first: Frame, second: Frame) -> Pose2D:
        begin, end = (0.4 - 0.4 * math.cos(frame.captured_s) for frame in (first, second))
        return replace(STILL, x_m=1.5 * (end - begin))

    odometry = GroundOdometry(measure=measure)
    for index in range(100):
        time_s = index * STEP_S
        odometry.predict(state(time_s, forward_mps=0.4 * math.sin(time_s)))
        show(odometry, index)
        assert index != 2 or odometry.estimate.stretch is None
    assert odometry.estimate.stretch == pytest.approx(1.5, abs=0.03)


SMALL = anafi_camera(320, 180)


GROUND = np.ones((180, 320), np.uint8)


def _textured() -> Image:
    rng = np.random.default_rng(3)
    blurred = cv2.GaussianBlur(rng.integers(0, 255, (180, 320), dtype=np.uint8), (0, 0), 2)
    return np.asarray(cv2.normalize(blurred, None, 0, 255, cv2.NORM_MINMAX), np.uint8)


def _views(*images: Floats | Image) -> list[GroundView]:
    level = {"camera": SMALL, "gimbal_pitch_rad": math.radians(-30), "height_m": 1.5}
    return [GroundView(grey=np.asarray(image, np.uint8), **level) for image in images]


def test_points_close_together_or_that_move_in_two_ways_tell_no_motion() -> None:
    """Nearly half of the image is shifted: it may be the top of an object that counts as ground."""
    first, patch = _textured(), np.zeros((180, 320), dtype=np.uint8)
    patch[130:170, 130:190] = 1
    second = first.copy()
    second[:, 180:] = np.roll(first[:, 180:], 6, axis=0)
    assert ground_motion(*_views(first, first), STILL, patch) is None
    assert ground_motion(*_views(first, second), STILL, GROUND) is None
    assert ground_motion(*_views(first, first), STILL, GROUND) is not None


@pytest.mark.parametrize("contrast", [0.0, 1.6])
def test_the_noise_of_a_plain_floor_tells_no_motion_and_weak_texture_does(contrast: float) -> None:
    """Noise has corners, and tracked from where they are expected they agree with telemetry."""
    rng = np.random.default_rng(3)
    floor = 143.0 + contrast * (_textured() - 128.0) / np.std(_textured())
    noisy = [np.clip(floor + rng.normal(0.0, 2.0, floor.shape), 0, 255) for _ in range(2)]
    shown = ground_motion(*_views(*noisy), STILL, GROUND)
    assert (shown is None) == (contrast == 0.0)
    assert shown is None or math.hypot(shown.motion.x_m, shown.motion.y_m) < 0.005


def test_an_object_that_counts_as_ground_hides_no_weak_texture() -> None:
    """The corners of a chequered box are many times as strong as those of the floor."""
    image = np.asarray(128 + (_textured().astype(float) - 128) / 8, np.uint8)
    image[110:134, 30:54] = 255 * (np.indices((24, 24)).sum(axis=0) // 8 % 2)
    assert ground_motion(*_views(image, image), STILL, GROUND) is not None


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
