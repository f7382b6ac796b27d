"""The terms of the loss: known values, masks, and what they must not be moved by."""

import pytest
import torch

from perception.depth.training import losses

FX = torch.tensor([[20.0, 20.0, 7.5, 5.5]])
STAY = torch.eye(3, 4)[None]


def _picture(seed: int = 0) -> torch.Tensor:
    return torch.rand(1, 3, 12, 16, generator=torch.Generator().manual_seed(seed))


def _maps(target: torch.Tensor, source: torch.Tensor) -> losses.ConsistencyMaps:
    depth = torch.full((1, 1, 12, 16), 2.0)
    return losses.consistency_maps(target, source, (depth, depth), STAY, FX)


def test_the_same_picture_has_no_photometric_error() -> None:
    assert losses.photometric_error(_picture(), _picture()).max() < 1e-5


def test_flat_black_and_flat_white_are_as_unlike_as_can_be() -> None:
    black, white = torch.zeros(1, 3, 12, 16), torch.ones(1, 3, 12, 16)
    error = losses.photometric_error(black, white)
    # SSIM of two flat pictures is C1 / (1 + C1): nearly nought.
    torch.testing.assert_close(error, torch.full_like(error, 0.15 + 0.85 / 2.0), atol=1e-4, rtol=0)


def test_pixels_that_no_movement_explains_better_do_not_count() -> None:
    depth = torch.full((1, 1, 12, 16), 2.0)
    moved = STAY.clone()
    moved[0, 0, 3] = -0.2  # two pixels to the left
    still = losses.consistency_maps(_picture(), _picture(), (depth, depth), moved, FX)
    assert still.mask.sum() == 0
    shifted = losses.consistency_maps(
        _picture(), _picture().roll(-2, dims=3), (depth, depth), moved, FX
    )
    assert shifted.mask[..., 1:-1, 4:-4].all()
    assert not shifted.mask[..., :2].any()  # they fall out of the other picture


def test_the_geometric_error_is_the_difference_over_the_sum_of_depths() -> None:
    two, six = torch.full((1, 1, 12, 16), 2.0), torch.full((1, 1, 12, 16), 6.0)
    maps = losses.consistency_maps(_picture(), _picture(), (two, six), STAY, FX)
    torch.testing.assert_close(maps.geometric, torch.full_like(maps.geometric, 0.5))


def test_the_photometric_error_counts_less_where_depths_disagree() -> None:
    two, six = torch.full((1, 1, 12, 16), 2.0), torch.full((1, 1, 12, 16), 6.0)
    target, source = _picture(0), _picture(1)
    agreeing = losses.consistency_maps(target, source, (two, two), STAY, FX)
    opposed = losses.consistency_maps(target, source, (two, six), STAY, FX)
    torch.testing.assert_close(opposed.photometric, 0.5 * agreeing.photometric)


def test_the_better_source_is_kept_pixel_by_pixel() -> None:
    shape = (1, 1, 1, 3)

    def maps(photometric: list[float], mask: list[float]) -> losses.ConsistencyMaps:
        values = torch.tensor(photometric).reshape(shape)
        return losses.ConsistencyMaps(
            photometric=values, geometric=2.0 * values, mask=torch.tensor(mask).reshape(shape)
        )

    best = losses.best_of([maps([0.1, 0.4, 0.1], [1, 1, 0]), maps([0.3, 0.2, 0.5], [1, 1, 1])])
    torch.testing.assert_close(best.photometric.flatten(), torch.tensor([0.1, 0.2, 0.5]))
    torch.testing.assert_close(best.geometric.flatten(), torch.tensor([0.2, 0.4, 1.0]))
    assert best.mask.all()


def test_an_empty_mask_gives_nought_and_no_nan() -> None:
    values = torch.rand(1, 1, 12, 16, requires_grad=True)
    mean = losses.masked_mean(values, torch.zeros(1, 1, 12, 16))
    mean.backward()
    assert mean.item() == 0.0
    assert values.grad is not None
    assert torch.isfinite(values.grad).all()


def test_flat_depth_is_smooth_and_its_unit_does_not_matter() -> None:
    depth = 1.0 + torch.rand(1, 1, 12, 16)
    image = _picture()
    assert losses.smoothness_loss(torch.full_like(depth, 3.0), image).item() == 0.0
    torch.testing.assert_close(
        losses.smoothness_loss(depth, image), losses.smoothness_loss(10.0 * depth, image)
    )


def test_an_edge_of_depth_costs_less_at_an_edge_of_the_picture() -> None:
    depth = torch.ones(1, 1, 12, 16)
    depth[..., 8:] = 2.0
    edge = torch.zeros(1, 3, 12, 16)
    edge[..., 8:] = 1.0
    flat = torch.zeros(1, 3, 12, 16)
    there = losses.smoothness_loss(depth, edge)
    torch.testing.assert_close(
        there, losses.smoothness_loss(depth, flat) * torch.exp(torch.tensor(-1.0))
    )


def test_labels_count_in_log_depth_where_they_are_known() -> None:
    depth = torch.full((1, 1, 20, 20), 2.0, requires_grad=True)
    label = torch.full((1, 1, 20, 20), float("nan"))
    label[..., :10] = 4.0
    loss = losses.label_loss(depth, label)
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
    loss = losses.label_loss(depth, label, at_most)
    loss.backward()
    assert depth.grad is not None
    assert torch.isfinite(depth.grad).all()
    pulled = depth.grad[0, 0, 0] > 0.0
    assert pulled.nonzero().flatten().tolist() == [5, 6, 7, 8, 9]
