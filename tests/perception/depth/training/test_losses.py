"""The loss terms: known values, masks, and invariances."""

import numpy as np
import pytest
import torch

from perception.depth.training import run
from perception.depth.training.network import motion_matrix
from perception.depth.training.run import invert_motion, photometric_error, pixel_rays, warp
from tests.perception.depth.depth_flight import KnownFlight, known_flight

SMALL = torch.tensor([[20.0, 18.0, 7.5, 5.5]], dtype=torch.float64)  # of 16x12 pixels
STAY = torch.eye(3, 4, dtype=torch.float64)[None]


@pytest.fixture(scope="module")
def flight() -> KnownFlight:
    return known_flight()


def _pictures(flight: KnownFlight) -> torch.Tensor:
    shown = np.stack([frame.image for frame in flight.footage.frames])
    return torch.from_numpy(shown).permute(0, 3, 1, 2).float() / 255.0


def _error(flight: KnownFlight, origin: int, target: int, *, shift_px: float = 0.0) -> float:
    """How unlike a frame is to another one warped onto it with the exact depth and movement."""
    camera, pictures = flight.footage.camera, _pictures(flight)
    intrinsics = torch.tensor(
        [[camera.fx_px, camera.fy_px, camera.cx_px + shift_px, camera.cy_px]], dtype=torch.float32
    )
    values, _, valid = warp(
        pictures[target : target + 1],
        torch.from_numpy(flight.depth_m[origin])[None, None],
        torch.from_numpy(flight.motion(origin, target)).float()[None],
        intrinsics,
    )
    things = torch.from_numpy(flight.ids[origin] > 0)[None, None]
    counts = (valid & things).float()
    error = photometric_error(pictures[origin : origin + 1], values)
    return float((error * counts).sum() / counts.sum())


def test_exact_depth_and_pose_make_one_frame_into_the_other(flight: KnownFlight) -> None:
    pictures = _pictures(flight)
    still = float(photometric_error(pictures[2:3], pictures[6:7]).mean())
    assert _error(flight, 2, 6) < 0.06
    assert still > 0.2
    # A principal point that is off by some pixels is noticed.
    assert _error(flight, 2, 6, shift_px=12.0) > _error(flight, 2, 6)


def test_no_movement_gives_every_pixel_back() -> None:
    source = torch.rand(1, 2, 12, 16, dtype=torch.float64)
    depth = 1.0 + torch.rand(1, 1, 12, 16, dtype=torch.float64)
    values, seen_m, valid = warp(source, depth, STAY, SMALL)
    torch.testing.assert_close(values, source)
    torch.testing.assert_close(seen_m, depth)
    # Rounding may put the outermost pixels' points a hair outside.
    assert valid[..., 1:-1, 1:-1].all()


def test_a_step_to_the_right_moves_the_picture_by_focal_length_over_depth() -> None:
    source = torch.arange(16.0, dtype=torch.float64).expand(1, 1, 12, 16).contiguous()
    motion = STAY.clone()
    motion[0, 0, 3] = -0.2  # the second camera stands 0.2 m to the right: points move left
    depth = torch.full((1, 1, 12, 16), 2.0, dtype=torch.float64)
    values, _, valid = warp(source, depth, motion, SMALL)
    # 20 px * 0.2 m / 2 m = 2 px.
    torch.testing.assert_close(values[..., 2:], source[..., :-2])
    assert not valid[..., :2].any()
    assert valid[..., 1:-1, 3:-1].all()
    motion[0, 2, 3] = -3.0  # all points are behind it
    assert not warp(source, depth, motion, SMALL)[2].any()


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
        values, _, valid = warp(source, depth, motion_matrix(numbers), intrinsics)
        return values * valid

    assert torch.autograd.gradcheck(seen, (depth, numbers), eps=1e-7, atol=1e-4)


def _picture(seed: int = 0) -> torch.Tensor:
    return torch.rand(1, 3, 12, 16, generator=torch.Generator().manual_seed(seed))


def _maps(
    target: torch.Tensor, source: torch.Tensor, *, source_m: float = 2.0, step_m: float = 0.0
) -> run.Maps:
    """Maps of pictures at 2 m; the source camera stands a step to the right."""
    depths = torch.full((1, 1, 12, 16), 2.0), torch.full((1, 1, 12, 16), source_m)
    motion = STAY.float().clone()
    motion[0, 0, 3] = -step_m
    return run.consistency_maps(target, source, depths, motion, SMALL.float())


def test_the_photometric_error_is_nought_for_equals_and_greatest_for_black_and_white() -> None:
    assert run.photometric_error(_picture(), _picture()).max() < 1e-5
    error = run.photometric_error(torch.zeros(1, 3, 12, 16), torch.ones(1, 3, 12, 16))
    # SSIM of two flat pictures is C1 / (1 + C1): nearly zero.
    torch.testing.assert_close(error, torch.full_like(error, 0.15 + 0.85 / 2.0), atol=1e-4, rtol=0)


def test_pixels_that_no_movement_explains_better_do_not_count() -> None:
    assert _maps(_picture(), _picture(), step_m=0.2)[2].sum() == 0
    _, _, mask = _maps(_picture(), _picture().roll(-2, dims=3), step_m=0.2)  # by two pixels
    assert mask[..., 1:-1, 4:-4].all()
    assert not mask[..., :2].any()  # they fall out of the other picture


def test_where_depths_disagree_the_photometric_error_counts_less() -> None:
    agreeing, _, _ = _maps(_picture(0), _picture(1))
    opposed, geometric, _ = _maps(_picture(0), _picture(1), source_m=6.0)
    # The difference over the sum of depths.
    torch.testing.assert_close(geometric, torch.full_like(geometric, 0.5))
    torch.testing.assert_close(opposed, 0.5 * agreeing)


def test_the_better_source_is_kept_pixel_by_pixel() -> None:
    def maps(rows: list[list[float]]) -> torch.Tensor:
        return torch.tensor(rows).reshape(-1, 1, 1, 3)

    # One target with two sources, and a map that is kept as it is.
    error = maps([[0.1, 0.4, 0.1], [0.3, 0.2, 0.5], [0.7, 0.8, 0.9]])
    mask = maps([[1, 1, 0], [1, 1, 1], [1, 0, 1]])
    best, difference, counts = run.best_of((error, 2.0 * error, mask), 1)
    torch.testing.assert_close(best, maps([[0.1, 0.2, 0.5], [0.7, 0.8, 0.9]]))
    torch.testing.assert_close(difference, 2.0 * best)
    torch.testing.assert_close(counts, maps([[1, 1, 1], [1, 0, 1]]))


def test_an_empty_mask_gives_nought_and_no_nan() -> None:
    values = torch.rand(1, 1, 12, 16, requires_grad=True)
    mean = run.masked_mean(values, torch.zeros(1, 1, 12, 16))
    mean.backward()
    assert mean.item() == 0.0
    assert values.grad is not None
    assert torch.isfinite(values.grad).all()


def test_flat_depth_is_smooth_and_its_unit_does_not_matter() -> None:
    depth = 1.0 + torch.rand(1, 1, 12, 16)
    image = _picture()
    assert run.smoothness_loss(torch.full_like(depth, 3.0), image).item() == 0.0
    torch.testing.assert_close(
        run.smoothness_loss(depth, image), run.smoothness_loss(10.0 * depth, image)
    )


def test_an_edge_of_depth_costs_less_at_an_edge_of_the_picture() -> None:
    depth = torch.ones(1, 1, 12, 16)
    depth[..., 8:] = 2.0
    edge = torch.zeros(1, 3, 12, 16)
    edge[..., 8:] = 1.0
    flat = torch.zeros(1, 3, 12, 16)
    there = run.smoothness_loss(depth, edge)
    torch.testing.assert_close(
        there, run.smoothness_loss(depth, flat) * torch.exp(torch.tensor(-1.0))
    )


def test_labels_count_in_log_depth_where_they_are_known() -> None:
    depth = torch.full((1, 1, 20, 20), 2.0, requires_grad=True)
    label = torch.full((1, 1, 20, 20), float("nan"))
    label[..., :10] = 4.0
    loss = run.label_loss(depth, label, torch.full_like(label, torch.inf))
    loss.backward()
    assert loss.item() == pytest.approx(torch.log(torch.tensor(2.0)).item())
    assert depth.grad is not None
    assert torch.isfinite(depth.grad).all()
    assert (depth.grad[..., :10] < 0.0).all()
    assert (depth.grad[..., 10:] == 0.0).all()


def test_a_bound_pulls_only_what_exceeds_it_and_has_no_label() -> None:
    depth = torch.full((1, 1, 20, 20), 4.0, requires_grad=True)
    label = torch.full((1, 1, 20, 20), float("nan"))
    label[..., :5] = 4.0
    at_most = torch.full((1, 1, 20, 20), float("inf"))
    at_most[..., :10] = 2.0  # half of it under labels
    at_most[..., 10:15] = 5.0
    loss = run.label_loss(depth, label, at_most)
    loss.backward()
    assert depth.grad is not None
    assert torch.isfinite(depth.grad).all()
    pulled = depth.grad[0, 0, 0] > 0.0
    assert pulled.nonzero().flatten().tolist() == [5, 6, 7, 8, 9]
