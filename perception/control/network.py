"""The control student: a U-Net's encoder, and dense layers in the place of its decoder.

Each view goes through the same encoder; what it comes down to is joined with the movements between
the views. Importing this module imports torch: only training and export do so.
"""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor, nn

from perception.control.config import OUTPUTS, ControlNetConfig
from perception.control.situation import situation_size
from perception.segmentation.training.unet import UNet, UNetConfig

__all__ = ["ControlNet", "parameter_count"]


class ControlNet(nn.Module):
    """Views and situation in, the next movement out."""

    def __init__(self, config: ControlNetConfig, *, dropout: float = 0.0) -> None:
        """Make a network of random weights.

        Args:
            config: its shape.
            dropout: share of each view's numbers left out while training.
        """
        super().__init__()
        self.config = config
        whole = UNet(
            UNetConfig(
                width_px=config.width_px, height_px=config.height_px, channels=config.channels
            )
        )
        self.down = whole.down
        self.pool = nn.MaxPool2d(2)
        self.narrow = nn.Conv2d(config.channels[-1], config.narrow, 1)
        height, width = config.places
        self.embed = nn.Linear(config.narrow * height * width, config.embedding)
        self.drop = nn.Dropout(dropout)
        joined = config.views * config.embedding + situation_size(config.views)
        self.join = nn.Linear(joined, config.hidden)
        self.think = nn.Linear(config.hidden, config.hidden)
        self.say = nn.Linear(config.hidden, len(OUTPUTS[config.learns]))

    def forward(self, frames: Tensor, situation: Tensor) -> Tensor:
        """Return what `config.OUTPUTS` names.

        Args:
            frames: (N, V, 3, H, W) float RGB in [0, 1], the present view first.
            situation: (N, S) float: `situation.situation`.

        Returns:
            (N, 5) float.
        """
        count, views = frames.shape[:2]
        # Zero is what the convolutions pad with: make it mid-grey, not black.
        features = frames.flatten(0, 1) - 0.5
        features = features.contiguous(memory_format=torch.channels_last)
        for level, block in enumerate(self.down):
            features = block(features if level == 0 else self.pool(features))
        seen = self.embed(self.narrow(features).relu().flatten(1)).relu()
        seen = self.drop(seen).reshape(count, views * self.config.embedding)
        joined = self.join(torch.cat([seen, situation], dim=1)).relu()
        return cast("Tensor", self.say(self.think(joined).relu()))


def parameter_count(net: nn.Module) -> int:
    """Return how many numbers a network learns."""
    return sum(parameter.numel() for parameter in net.parameters())
