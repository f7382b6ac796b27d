"""Warping: exact with the twin's depth and poses, differentiable, and right about what it sees."""

import numpy as np
import pytest
import torch

from perception.depth.training.losses import photometric_error
from perception.depth.training.pose_network import motion_matrix
from perception.depth.training.warping import invert_motion, pixel_rays, warp
from tests.perception.depth.depth_flight import KnownFlight, known_flight
from uav_bt.errors import ShapeError

SMALL = torch.tensor([[20.0, 18.0, 7.5, 5.5]], dtype=torch.float64)  # of 16x12 pixels
STAY = torch.eye(3, 4, dtype=torch.float64)[None]


@pytest.fixture(scope="module")
def flight() -> KnownFlight:
    return known_flight()


def _error(flight: KnownFlight, origin: int, target: int, *, shift_px: float = 0.0) -> float:
    """How unlike a frame is to another one warped onto it with the exact depth and movement."""
    camera = flight.footage.camera
    pictures = torch.from_numpy(flight.footage.frames).permute(0, 3, 1, 2).float() / 255.0
    intrinsics = torch.tensor(
        [[camera.fx_px, camera.fy_px, camera.cx_px + shift_px, camera.cy_px]], dtype=torch.float32
    )
    warped = warp(
        pictures[target : target + 1],
        torch.from_numpy(flight.depth_m[origin])[None, None],
        torch.from_numpy(flight.motion(origin, target)).float()[None],
        intrinsics,
    )
    things = torch.from_numpy(flight.ids[origin] > 0)[None, None]
    counts = (warped.valid & things).float()
    error = photometric_error(pictures[origin : origin + 1], warped.values)
    return float((error * counts).sum() / counts.sum())


def test_exact_depth_and_pose_make_one_frame_into_the_other(flight: KnownFlight) -> None:
    pictures = torch.from_numpy(flight.footage.frames).permute(0, 3, 1, 2).float() / 255.0
    still = float(photometric_error(pictures[2:3], pictures[6:7]).mean())
    assert _error(flight, 2, 6) < 0.06
    assert still > 0.2


def test_a_principal_point_that_is_off_by_some_pixels_is_noticed(flight: KnownFlight) -> None:
    assert _error(flight, 2, 6, shift_px=12.0) > _error(flight, 2, 6)


def test_no_movement_gives_every_pixel_back() -> None:
    source = torch.rand(1, 2, 12, 16, dtype=torch.float64)
    depth = 1.0 + torch.rand(1, 1, 12, 16, dtype=torch.float64)
    warped = warp(source, depth, STAY, SMALL)
    torch.testing.assert_close(warped.values, source)
    torch.testing.assert_close(warped.depth, depth)
    # Rounding may put the outermost pixels' points a hair outside.
    assert warped.valid[..., 1:-1, 1:-1].all()


def test_a_step_to_the_right_moves_the_picture_by_focal_length_over_depth() -> None:
    source = torch.arange(16.0, dtype=torch.float64).expand(1, 1, 12, 16).contiguous()
    motion = STAY.clone()
    motion[0, 0, 3] = -0.2  # the second camera stands 0.2 m to the right: points move left
    warped = warp(source, torch.full((1, 1, 12, 16), 2.0, dtype=torch.float64), motion, SMALL)
    # 20 px * 0.2 m / 2 m = 2 px.
    torch.testing.assert_close(warped.values[..., 2:], source[..., :-2])
    assert not warped.valid[..., :2].any()
    assert warped.valid[..., 1:-1, 3:-1].all()


def test_a_point_behind_the_camera_is_not_valid() -> None:
    motion = STAY.clone()
    motion[0, 2, 3] = -3.0
    depth = torch.full((1, 1, 12, 16), 2.0, dtype=torch.float64)
    assert not warp(torch.rand_like(depth), depth, motion, SMALL).valid.any()


def test_there_and_back_is_no_movement() -> None:
    motion = motion_matrix(torch.tensor([[0.3, -0.1, 0.5, 0.1, 0.2, -0.3]], dtype=torch.float64))
    back = invert_motion(motion)
    whole = back[:, :, :3] @ motion[:, :, :3]
    torch.testing.assert_close(whole[0], torch.eye(3, dtype=torch.float64))
    translation = back[:, :, :3] @ motion[:, :, 3:] + back[:, :, 3:]
    torch.testing.assert_close(translation, torch.zeros_like(translation))


def test_the_ray_of_the_principal_point_is_the_optical_axis() -> None:
    intrinsics = torch.tensor([[20.0, 18.0, 7.0, 5.0]])
    rays = pixel_rays(intrinsics, 12, 16).reshape(3, 12, 16)
    np.testing.assert_allclose(rays[:, 5, 7], [0.0, 0.0, 1.0])
    np.testing.assert_allclose(rays[:, 5, 11], [0.2, 0.0, 1.0])


def test_gradients_of_depth_and_movement_are_right() -> None:
    torch.manual_seed(0)
    source = torch.rand(1, 1, 6, 8, dtype=torch.float64)
    # Off the grid's corners, where bilinear sampling has kinks.
    depth = (2.0 + 0.1 * torch.rand(1, 1, 6, 8, dtype=torch.float64)).requires_grad_()
    intrinsics = torch.tensor([[10.0, 9.0, 3.4, 2.6]], dtype=torch.float64)
    numbers = torch.tensor([[0.05, 0.03, -0.02, 0.01, -0.02, 0.03]], dtype=torch.float64)
    numbers.requires_grad_()

    def seen(depth: torch.Tensor, numbers: torch.Tensor) -> torch.Tensor:
        warped = warp(source, depth, motion_matrix(numbers), intrinsics)
        return warped.values * warped.valid

    assert torch.autograd.gradcheck(seen, (depth, numbers), eps=1e-7, atol=1e-4)


def test_a_depth_of_another_size_than_the_image_is_refused() -> None:
    source = torch.rand(1, 2, 12, 16, dtype=torch.float64)
    with pytest.raises(ShapeError, match="warping must be 1x1x12x16, got 1x1x6x8"):
        warp(source, torch.ones(1, 1, 6, 8, dtype=torch.float64), STAY, SMALL)
