"""The networks: shapes, size, untrained output, and exported files."""

from pathlib import Path

import numpy as np
import pytest
import torch

from perception.depth.runtime import load_depth_estimator
from perception.depth.training import network, run
from perception.depth.training.network import DEPTH_FILES
from perception.networks.weights_file import SHIPPED_WEIGHTS

NET = network.DepthNetConfig(width_px=64, height_px=32, channels=(8, 12, 16))


def test_untrained_it_returns_about_two_metres_for_every_half_size_pixel() -> None:
    torch.manual_seed(0)
    with torch.inference_mode():
        depth = network.DepthNet(NET).eval()(torch.rand(2, 3, 32, 64))
    assert depth.shape == (2, 1, 16, 32)
    assert depth.min() > 0.0
    assert depth.median().item() == pytest.approx(2.0, rel=0.4)
    shipped = network.DepthNet(network.DepthNetConfig())
    assert sum(parameter.numel() for parameter in shipped.parameters()) < 5e6


def test_depth_lies_within_a_tenth_and_a_hundred() -> None:
    net = network.DepthNet(NET).eval()
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
