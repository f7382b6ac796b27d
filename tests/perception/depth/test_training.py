"""The depth network: losses, shapes, training."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from perception.depth.runtime import load_depth_estimator
from perception.depth.training import losses, network, run
from perception.depth.training.clips import ClipSource
from perception.depth.training.losses import invert_motion, photometric_error, pixel_rays, warp
from perception.depth.training.network import DEPTH_FILES, motion_matrix
from perception.networks.weights_file import SHIPPED_WEIGHTS
from tests.perception.depth.depth_flight import known_flight, small_flight
from uav_bt.errors import WeightsError

SMALL = torch.tensor([[20.0, 18.0, 7.5, 5.5]], dtype=torch.float64)  # of 16x12 pixels
STAY = torch.eye(3, 4, dtype=torch.float64)[None]


def test_a_step_to_the_right_moves_the_picture_by_focal_length_over_depth() -> None:
    source = torch.arange(16.0, dtype=torch.float64).expand(1, 1, 12, 16).contiguous()
    motion = STAY.clone()
    motion[0, 0, 3] = -0.2  # the second camera stands 0.2 m to the right: points move left
    depth = torch.full((1, 1, 12, 16), 2.0, dtype=torch.float64)
    values, seen_m, valid = warp(source, depth, motion, SMALL)
    torch.testing.assert_close(seen_m, depth)
    # 20 px * 0.2 m / 2 m = 2 px.
    torch.testing.assert_close(values[..., 2:], source[..., :-2])
    assert not valid[..., :2].any()
    assert valid[..., 1:-1, 3:-1].all()
    motion[0, 2, 3] = -3.0  # all points are behind it
    assert not warp(source, depth, motion, SMALL)[2].any()


def test_exact_depth_and_pose_make_one_frame_into_the_other() -> None:
    flight = known_flight()
    shown = np.stack([frame.image for frame in flight.footage.frames])
    pictures = torch.from_numpy(shown).permute(0, 3, 1, 2).float() / 255.0
    camera, things = flight.footage.camera, torch.from_numpy(flight.ids[2] > 0)[None, None]

    def error(shift_px: float) -> float:
        """How unlike frame 2 is to frame 6, warped with a principal point that is off."""
        lens = [camera.fx_px, camera.fy_px, camera.cx_px + shift_px, camera.cy_px]
        values, _, valid = warp(
            pictures[6:7],
            torch.from_numpy(flight.depth_m[2])[None, None],
            torch.from_numpy(flight.motion(2, 6)).float()[None],
            torch.tensor([lens], dtype=torch.float32),
        )
        counts = (valid & things).float()
        return float((photometric_error(pictures[2:3], values) * counts).sum() / counts.sum())

    assert error(0.0) < min(0.06, error(12.0))
    assert float(photometric_error(pictures[2:3], pictures[6:7]).mean()) > 0.2


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


def _picture(seed: int = 0) -> torch.Tensor:
    return torch.rand(1, 3, 12, 16, generator=torch.Generator().manual_seed(seed))


def _maps(
    target: torch.Tensor, source: torch.Tensor, *, source_m: float = 2.0, step_m: float = 0.0
) -> losses.Maps:
    """Maps of pictures at 2 m; the source camera stands a step to the right."""
    depths = torch.full((1, 1, 12, 16), 2.0), torch.full((1, 1, 12, 16), source_m)
    motion = STAY.float().clone()
    motion[0, 0, 3] = -step_m
    return losses.consistency_maps(target, source, depths, motion, SMALL.float())


def test_the_photometric_error_is_nought_for_equals_and_greatest_for_black_and_white() -> None:
    assert losses.photometric_error(_picture(), _picture()).max() < 1e-5
    error = losses.photometric_error(torch.zeros(1, 3, 12, 16), torch.ones(1, 3, 12, 16))
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
    best, difference, counts = losses.best_of((error, 2.0 * error, mask), 1)
    torch.testing.assert_close(best, maps([[0.1, 0.2, 0.5], [0.7, 0.8, 0.9]]))
    torch.testing.assert_close(difference, 2.0 * best)
    torch.testing.assert_close(counts, maps([[1, 1, 1], [1, 0, 1]]))


def test_an_empty_mask_gives_nought_and_no_nan() -> None:
    values = torch.rand(1, 1, 12, 16, requires_grad=True)
    mean = losses.masked_mean(values, torch.zeros(1, 1, 12, 16))
    mean.backward()
    assert mean.item() == 0.0
    assert values.grad is not None
    assert torch.isfinite(values.grad).all()


def test_depth_is_smooth_in_any_unit_where_the_picture_has_no_edge() -> None:
    depth, image = 1.0 + torch.rand(1, 1, 12, 16), _picture()
    assert losses.smoothness_loss(torch.full_like(depth, 3.0), image).item() == 0.0
    torch.testing.assert_close(
        losses.smoothness_loss(depth, image), losses.smoothness_loss(10.0 * depth, image)
    )
    # An edge of depth costs less at an edge of the picture.
    depth, (edge, flat) = torch.ones(1, 1, 12, 16), torch.zeros(2, 1, 3, 12, 16)
    depth[..., 8:], edge[..., 8:] = 2.0, 1.0
    there, anywhere = (losses.smoothness_loss(depth, shown) for shown in (edge, flat))
    torch.testing.assert_close(there, anywhere * torch.exp(torch.tensor(-1.0)))


def test_labels_count_in_log_depth_where_they_are_known() -> None:
    depth = torch.full((1, 1, 20, 20), 2.0, requires_grad=True)
    label = torch.full((1, 1, 20, 20), float("nan"))
    label[..., :10] = 4.0
    loss = losses.label_loss(depth, label, torch.full_like(label, torch.inf))
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


# --- the networks ---------------------------------------------------------------------------------

WIDE = network.DepthNetConfig(width_px=64, height_px=32, channels=(8, 12, 16))


def test_untrained_it_returns_about_two_metres_for_every_half_size_pixel() -> None:
    torch.manual_seed(0)
    with torch.inference_mode():
        depth = network.DepthNet(WIDE).eval()(torch.rand(2, 3, 32, 64))
    assert depth.shape == (2, 1, 16, 32)
    assert depth.min() > 0.0
    assert depth.median().item() == pytest.approx(2.0, rel=0.4)
    shipped = network.DepthNet(network.DepthNetConfig())
    assert sum(parameter.numel() for parameter in shipped.parameters()) < 5e6


def test_depth_lies_within_a_tenth_and_a_hundred() -> None:
    net = network.DepthNet(WIDE).eval()
    for extreme, bound in ((60.0, 1.0 / 10.01), (-60.0, 100.0)):
        with torch.no_grad():
            net.head.bias.fill_(extreme)
            net.head.weight.zero_()
            said = net(torch.zeros(1, 3, 32, 64))
        torch.testing.assert_close(said, torch.full_like(said, bound))


def test_an_untrained_pose_network_says_almost_no_movement() -> None:
    torch.manual_seed(0)
    with torch.inference_mode():
        motion = network.PoseNet().eval()(torch.rand(2, 3, 64, 64), torch.rand(2, 3, 64, 64))
    assert motion.shape == (2, 3, 4)
    torch.testing.assert_close(motion[:, :, :3], torch.eye(3).expand(2, 3, 3), atol=0.05, rtol=0)
    assert motion[:, :, 3].abs().max() < 0.05


def test_six_numbers_are_a_translation_and_a_rotation_vector() -> None:
    quarter = torch.pi / 2.0
    motion = network.motion_matrix(torch.tensor([[1.0, 2.0, 3.0, 0.0, quarter, 0.0]]))
    wanted = torch.tensor([[[0.0, 0.0, 1.0, 1.0], [0.0, 1.0, 0.0, 2.0], [-1.0, 0.0, 0.0, 3.0]]])
    torch.testing.assert_close(motion, wanted, atol=1e-6, rtol=0)


def test_the_shipped_network_returns_the_same_in_flight_and_in_training(tmp_path: Path) -> None:
    weights = SHIPPED_WEIGHTS / "depth.safetensors"
    net, _ = DEPTH_FILES.load(weights)
    picture = np.random.default_rng(0).integers(0, 255, (256, 320, 3), dtype=np.uint8)
    trained = run.predict_depth(net, picture[None])[0]
    DEPTH_FILES.export(weights, tmp_path / "depth.onnx")
    flies = load_depth_estimator(tmp_path / "depth.onnx")
    np.testing.assert_allclose(flies.depth(picture), trained, rtol=1e-5)


# --- training the depth network -------------------------------------------------------------------

NET = network.DepthNetConfig(width_px=64, height_px=64, channels=(8, 12, 16))
SHORT = run.DepthTrainingConfig(steps=4, batch=1, checkpoint_every=2, warm_up_steps=2)
LABELS_ONLY = replace(SHORT, photometric=False)


@pytest.fixture(scope="module")
def source() -> ClipSource:
    return ClipSource([small_flight()])


@pytest.fixture(scope="module")
def bare() -> ClipSource:
    return ClipSource([replace(small_flight(), labels=None)])


def test_labels_teach_depth(source: ClipSource) -> None:
    told: list[float] = []
    config = replace(LABELS_ONLY, steps=50, batch=2, learning_rate=5e-3)
    run.train_depth(
        source, config, NET, progress=lambda now, _net: told.append(now.terms["labels"])
    )
    assert len(told) == 50
    assert np.mean(told[-5:]) < 0.6 * np.mean(told[:5])


def test_neighbouring_frames_teach_without_labels(bare: ClipSource) -> None:
    terms: list[dict[str, float]] = []
    config = replace(SHORT, steps=30, batch=2, learning_rate=5e-3)
    run.train_depth(bare, config, NET, progress=lambda now, _net: terms.append(dict(now.terms)))
    assert set(terms[0]) == {"photometric", "geometry", "smoothness"}
    total = [sum(term.values()) for term in terms]
    assert np.mean(total[-6:]) < np.mean(total[:6])


def test_a_run_may_begin_with_weights_of_its_shape(source: ClipSource, tmp_path: Path) -> None:
    path, first = tmp_path / "depth.safetensors", network.DepthNet(NET)
    network.DEPTH_FILES.save(path, first, notes={})
    slow = replace(LABELS_ONLY, steps=1, learning_rate=1e-6, seed=7)
    net = run.train_depth(source, slow, NET, start=path)
    pairs = zip(first.parameters(), net.parameters(), strict=True)
    assert max(float((one - two).detach().abs().max()) for one, two in pairs) < 1e-4
    network.DEPTH_FILES.save(path, network.DepthNet(replace(NET, channels=(8, 12, 20))), notes={})
    with pytest.raises(WeightsError, match="another shape"):
        run.train_depth(source, slow, NET, start=path)
