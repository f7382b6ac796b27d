"""The networks: shapes, size, untrained output, and exported files."""

import hashlib
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch

from perception.depth.runtime import OnnxDepthEstimator, load_depth_estimator
from perception.depth.training import network, run
from perception.depth.training.network import DEPTH_FILES
from perception.networks.weights_file import SHIPPED_WEIGHTS

NET = network.DepthNetConfig(width_px=64, height_px=32, channels=(8, 12, 16))


def _shaken(config: network.DepthNetConfig = NET) -> network.DepthNet:
    """A network whose norms have seen something: folding them must be right."""
    torch.manual_seed(1)
    net = network.DepthNet(config)
    for module in net.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            torch.nn.init.normal_(module.running_mean, 0.0, 0.3)
            torch.nn.init.uniform_(module.running_var, 0.5, 2.0)
            torch.nn.init.normal_(module.weight, 1.0, 0.2)
            torch.nn.init.normal_(module.bias, 0.0, 0.2)
    return net.eval()


@pytest.fixture
def weights(tmp_path: Path) -> Path:
    path = tmp_path / "depth.safetensors"
    DEPTH_FILES.save(path, _shaken(), notes={"why": "a test"})
    return path


def _picture(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 255, (32, 64, 3), dtype=np.uint8)


def test_every_half_size_pixel_gets_a_positive_depth() -> None:
    with torch.inference_mode():
        depth = network.DepthNet(NET).eval()(torch.rand(2, 3, 32, 64))
    assert depth.shape == (2, 1, 16, 32)
    assert depth.min() > 0.0


def test_the_shipped_shape_is_small() -> None:
    net = network.DepthNet(network.DepthNetConfig())
    assert sum(parameter.numel() for parameter in net.parameters()) < 5e6


def test_an_untrained_network_returns_about_two_metres() -> None:
    torch.manual_seed(0)
    with torch.inference_mode():
        said = network.DepthNet(NET).eval()(torch.rand(1, 3, 32, 64)).median().item()
    assert said == pytest.approx(2.0, rel=0.4)


def test_depth_lies_within_a_tenth_and_a_hundred() -> None:
    net = network.DepthNet(NET).eval()
    for extreme, bound in ((60.0, 1.0 / 10.01), (-60.0, 100.0)):
        with torch.no_grad():
            net.head.bias.fill_(extreme)
            net.head.weight.zero_()
            said = net(torch.zeros(1, 3, 32, 64))
        torch.testing.assert_close(said, torch.full_like(said, bound))


def test_every_parameter_of_both_networks_learns() -> None:
    net, pose = network.DepthNet(NET), network.PoseNet()
    pictures = torch.rand(2, 3, 32, 64)
    loss = net(pictures).mean() + pose(pictures, pictures.flip(3)).square().sum()
    loss.backward()
    for part in (net, pose):
        assert all(p.grad is not None and p.grad.abs().sum() > 0.0 for p in part.parameters())


# --- the pose network -----------------------------------------------------------------------------


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


# --- files ----------------------------------------------------------------------------------------


def test_the_onnx_file_says_what_the_network_says(weights: Path, tmp_path: Path) -> None:
    DEPTH_FILES.export(weights, tmp_path / "depth.onnx")
    estimator = OnnxDepthEstimator(tmp_path / "depth.onnx")
    pictures = np.stack([_picture(seed) for seed in range(4)])
    expected = run.predict_depth(_shaken(), pictures)
    for picture, depth in zip(pictures, expected, strict=True):
        np.testing.assert_allclose(estimator.depth(picture), depth, rtol=1e-5)


def test_the_onnx_file_names_the_weights_it_was_made_from(weights: Path, tmp_path: Path) -> None:
    for name in ("one.onnx", "two.onnx"):
        DEPTH_FILES.export(weights, tmp_path / name)
    assert (tmp_path / "one.onnx").read_bytes() == (tmp_path / "two.onnx").read_bytes()
    properties = {p.key: p.value for p in onnx.load(tmp_path / "one.onnx").metadata_props}
    assert len(properties["weights_sha256"]) == 64
    assert DEPTH_FILES.load(weights)[1] == {"why": "a test"}


# --- what ships -----------------------------------------------------------------------------------


def test_the_shipped_onnx_file_was_made_from_the_shipped_weights() -> None:
    weights = SHIPPED_WEIGHTS / "depth.safetensors"
    model = onnx.load(SHIPPED_WEIGHTS / "depth.onnx")
    properties = {p.key: p.value for p in model.metadata_props}
    assert properties["weights_sha256"] == hashlib.sha256(weights.read_bytes()).hexdigest()
    assert weights.stat().st_size < 6e6


def test_the_shipped_network_returns_the_same_in_flight_and_in_training(tmp_path: Path) -> None:
    weights = SHIPPED_WEIGHTS / "depth.safetensors"
    net, _ = DEPTH_FILES.load(weights)
    picture = np.random.default_rng(0).integers(0, 255, (256, 320, 3), dtype=np.uint8)
    trained = run.predict_depth(net, picture[None])[0]
    DEPTH_FILES.export(weights, tmp_path / "depth.onnx")
    flies = load_depth_estimator(tmp_path / "depth.onnx")
    np.testing.assert_allclose(flies.depth(picture), trained, rtol=1e-5)
