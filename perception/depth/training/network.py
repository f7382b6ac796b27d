"""The depth network: a small encoder-decoder for 320x256 images that flies on a CPU.

It follows SC-Depth (Bian et al., arXiv 1908.10553): skips, ELU and reflection padding in the
decoder, and depth = 1 / (10 sigmoid + 0.01). It is much smaller: residual blocks on thin layers,
skips that are added instead of joined, and a head that gives every quarter-size pixel the values of
its four half-size pixels (Shi et al., arXiv 1609.05158). Full-size convolutions would take most of
the time and add no detail beyond the masks.

`PoseNet`, SC-Depth's estimator of the camera's motion between two images, is used only in training.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final, cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from perception.networks.training.network_files import NetworkFiles, OnnxPorts

_DISPARITY_RANGE: Final = 10.0  # SC-Depth's: depth lies within 0.1 and 100
_DISPARITY_FLOOR: Final = 0.01
# The prediction of an untrained network: labels and telemetry need metres from the start.
_INITIAL_DEPTH_M: Final = 2.0
_POSE_WIDTHS: Final = (16, 32, 64, 128, 128)  # by level, from half size downwards
_POSE_GAIN: Final = 0.01  # movements of an untrained network are small


@dataclass(frozen=True, kw_only=True)
class DepthNetConfig:
    """The network's shape."""

    width_px: int = 320  # SC-Depth's size for indoor video
    height_px: int = 256
    # By level, from half size downwards. More of them, or two residual blocks a level, cost more
    # milliseconds than a flight's pipeline has.
    channels: tuple[int, ...] = (16, 32, 48, 96, 160)


class _Halve(nn.Sequential):
    """A convolution that halves the image, with batch norm and ReLU."""

    def __init__(self, inputs: int, outputs: int, kernel: int) -> None:
        super().__init__(
            nn.Conv2d(inputs, outputs, kernel, stride=2, padding=kernel // 2, bias=False),
            nn.BatchNorm2d(outputs),
            nn.ReLU(inplace=True),
        )


class _Residual(nn.Module):
    """Two convolutions whose result is added to their input (He et al., arXiv 1512.03385)."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.inner = nn.Sequential(
            nn.Conv2d(width, width, 3, padding=1, bias=False),
            nn.BatchNorm2d(width),
            nn.ReLU(inplace=True),
            nn.Conv2d(width, width, 3, padding=1, bias=False),
            nn.BatchNorm2d(width),
        )

    def forward(self, features: Tensor) -> Tensor:
        return functional.relu(features + self.inner(features))


class _Merge(nn.Module):
    """Enlarge, add the encoder's features of that size, convolve."""

    def __init__(self, below: int, here: int) -> None:
        super().__init__()
        self.narrow = nn.Conv2d(below, here, 1)
        self.conv = nn.Conv2d(here, here, 3, padding=1, padding_mode="reflect")

    def forward(self, features: Tensor, skip: Tensor) -> Tensor:
        grown = functional.interpolate(self.narrow(features), scale_factor=2, mode="nearest")
        return functional.elu(self.conv(grown + skip))


class DepthNet(nn.Module):
    """RGB in [0, 1], (N, 3, H, W), to depth at half the size, (N, 1, H/2, W/2)."""

    def __init__(self, config: DepthNetConfig) -> None:
        super().__init__()
        self.config = config
        widths = config.channels
        self.stem = _Halve(3, widths[0], 5)
        self.down = nn.ModuleList(
            nn.Sequential(_Halve(inputs, outputs, 3), _Residual(outputs))
            for inputs, outputs in pairwise(widths)
        )
        self.up = nn.ModuleList(
            _Merge(below, here) for below, here in zip(widths[:1:-1], widths[-2:0:-1], strict=True)
        )
        self.head = nn.Conv2d(widths[1], 4, 3, padding=1, padding_mode="reflect")
        self.spread = nn.PixelShuffle(2)
        share = (1.0 / _INITIAL_DEPTH_M - _DISPARITY_FLOOR) / _DISPARITY_RANGE
        nn.init.constant_(cast("Tensor", self.head.bias), math.log(share / (1.0 - share)))

    def forward(self, rgb: Tensor) -> Tensor:
        """Return the depth along the optical axis: metres if it was trained on metres."""
        features = self.stem(rgb - 0.5)  # so that the encoder's zero padding is mid-grey
        skips: list[Tensor] = []
        for level in self.down:
            features = level(features)
            skips.append(features)
        skips.pop()
        for merge in self.up:
            features = merge(features, skips.pop())
        disparity = torch.sigmoid(self.spread(self.head(features)))
        return 1.0 / (_DISPARITY_RANGE * disparity + _DISPARITY_FLOOR)


def _build(details: dict[str, Any]) -> DepthNet:
    config = details["config"]
    names = ("width_px", "height_px", "channels")
    return DepthNet(DepthNetConfig(**{name: config[name] for name in names}))


DEPTH_FILES: Final = NetworkFiles(
    kind="depth-network",
    remedy="`uav-bt net train depth` makes one",
    build=_build,
    ports=lambda net: OnnxPorts(
        inputs={"image": (1, 3, net.config.height_px, net.config.width_px)}, outputs=("depth",)
    ),
)
"""Input `image`: (1, 3, H, W) float32 RGB in [0, 1]. Output `depth`: (1, 1, H/2, W/2) float32."""


class PoseNet(nn.Module):
    """Two images, (N, 3, H, W) each, to the motion from the first camera to the second."""

    def __init__(self) -> None:
        super().__init__()
        sides = [(6, _POSE_WIDTHS[0], 7), *((*each, 3) for each in pairwise(_POSE_WIDTHS))]
        self.features = nn.Sequential(*(_Halve(*each) for each in sides))
        self.head = nn.Conv2d(_POSE_WIDTHS[-1], 6, 1)

    def forward(self, first: Tensor, second: Tensor) -> Tensor:
        """Return the transform of points from the first camera to the second, (N, 3, 4)."""
        features = self.features(torch.cat([first, second], dim=1) - 0.5)
        return motion_matrix(_POSE_GAIN * self.head(features).mean(dim=(2, 3)))


def motion_matrix(numbers: Tensor) -> Tensor:
    """Return rigid motions, (N, 3, 4): rotation and translation.

    The numbers, (N, 6), are a translation and a rotation vector (axis times angle, radians).
    """
    translation, vector = numbers[:, :3], numbers[:, 3:]
    x, y, z = vector.unbind(dim=1)
    zero = torch.zeros_like(x)
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], dim=1).reshape(-1, 3, 3)
    return torch.cat([torch.linalg.matrix_exp(cross), translation.unsqueeze(2)], dim=2)
