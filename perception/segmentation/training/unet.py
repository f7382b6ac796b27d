"""The segmentation network: a small U-Net (Ronneberger et al., arXiv 1505.04597), 224x112 pixels.

Its first convolution halves the image, and its head gives every half-size pixel the scores of its
four pixels (Shi et al., arXiv 1609.05158). Full-size convolutions take most of a small U-Net's time
on a CPU. Without them it is twice as fast at the same number of parameters.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, cast

import torch
from torch import Tensor, nn

from perception.networks.training.network_files import NetworkFiles, OnnxPorts
from uav_bt.errors import ValueRangeError


@dataclass(frozen=True, kw_only=True)
class UNetConfig:
    """The network's shape."""

    width_px: int = 224  # the paper's input size
    height_px: int = 112
    channels: tuple[int, ...] = (24, 48, 96, 160)  # by level, from half size downwards
    outputs: int  # number of classes
    context: bool = False  # whether the lowest level sees the mean of the whole image

    def __post_init__(self) -> None:
        halvings = 2 ** len(self.channels)
        if len(self.channels) < 2 or self.width_px % halvings or self.height_px % halvings:
            raise ValueRangeError(
                f"{len(self.channels)} levels need sides divisible by {halvings}, "
                f"got {self.width_px}x{self.height_px}"
            )


class _Block(nn.Sequential):
    """Two convolutions with batch norm and ReLU; the first of the network halves the image."""

    def __init__(self, inputs: int, outputs: int, *, halve: bool = False) -> None:
        kernel, stride, padding = (6, 2, 2) if halve else (3, 1, 1)
        super().__init__(
            nn.Conv2d(inputs, outputs, kernel, stride=stride, padding=padding, bias=False),
            nn.BatchNorm2d(outputs),
            nn.ReLU(inplace=True),
            nn.Conv2d(outputs, outputs, 3, padding=1, bias=False),
            nn.BatchNorm2d(outputs),
            nn.ReLU(inplace=True),
        )


class UNet(nn.Module):
    """RGB in [0, 1], (N, 3, H, W), to scores (logits) of the C classes, (N, C, H, W)."""

    def __init__(self, config: UNetConfig, classes: Sequence[str]) -> None:
        super().__init__()
        self.config, self.classes = config, tuple(classes)
        widths = config.channels
        self.down = nn.ModuleList(
            _Block(inputs, outputs, halve=level == 0)
            for level, (inputs, outputs) in enumerate(zip((3, *widths[:-1]), widths, strict=True))
        )
        self.pool = nn.MaxPool2d(2)
        self.up = nn.ModuleList(
            nn.ConvTranspose2d(below, here, 2, stride=2)
            for below, here in zip(widths[:0:-1], widths[-2::-1], strict=True)
        )
        self.merge = nn.ModuleList(_Block(2 * here, here) for here in widths[-2::-1])
        self.context: nn.Sequential | None = None
        if config.context:
            mean, mixed = nn.AdaptiveAvgPool2d(1), nn.Conv2d(widths[-1], widths[-1], 1)
            self.context = nn.Sequential(mean, mixed, nn.ReLU())
        self.head = nn.Conv2d(widths[0], 4 * config.outputs, 1)
        self.spread = nn.PixelShuffle(2)

    def forward(self, rgb: Tensor) -> Tensor:
        """Return the logits of each pixel, (N, C, H, W)."""
        return cast("Tensor", self.spread(self.head(self.features(rgb))))

    def features(self, rgb: Tensor) -> Tensor:
        """Return the features from which the head makes the logits, (N, F, H / 2, W / 2)."""
        skips: list[Tensor] = []
        features = rgb - 0.5  # so that the convolutions' zero padding is mid-grey, not black
        for level, block in enumerate(self.down):
            features = block(features if level == 0 else self.pool(features))
            skips.append(features)
        skips.pop()
        if self.context is not None:
            features = features + self.context(features)
        for grow, merge in zip(self.up, self.merge, strict=True):
            features = merge(torch.cat([grow(features), skips.pop()], dim=1))
        return features


def _build(details: dict[str, Any]) -> UNet:
    config = details["config"]
    shape = UNetConfig(**{**config, "channels": tuple(config["channels"])})
    return UNet(shape, details["classes"])


UNET_FILES: Final = NetworkFiles(
    kind="segmentation-unet",
    remedy="`uav-bt lab train` makes one",
    build=_build,
    ports=lambda net: OnnxPorts(
        inputs={"image": (1, 3, net.config.height_px, net.config.width_px)},
        outputs=("logits",),
        metadata={"classes": json.dumps(net.classes)},
    ),
    details=lambda net: {"classes": net.classes},
)
"""Input `image`: (1, 3, H, W) float32 RGB in [0, 1]. Output `logits`: (1, C, H, W) float32."""
