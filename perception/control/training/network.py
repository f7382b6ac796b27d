"""The control student: a U-Net's encoder with dense layers instead of the decoder.

Each view goes through the same encoder; its embedding is joined with the motion between the views.
Importing this module imports torch.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Final, cast

import torch
from torch import Tensor, nn

from perception.control.ego_state import OUTPUTS, VERSION, ControlNetConfig, state_size
from perception.networks.training.network_files import NetworkFiles, OnnxPorts
from perception.segmentation.training.unet import UNet, UNetConfig


class ControlNet(nn.Module):
    """Views and ego state in, the next movement out; training drops a share of each embedding."""

    def __init__(self, config: ControlNetConfig, *, dropout: float = 0.0) -> None:
        super().__init__()
        self.config = config
        unet = UNetConfig(
            width_px=config.width_px,
            height_px=config.height_px,
            channels=config.channels,
            outputs=17,  # unused, but the draws of the initial weights depend on it
        )
        self.down = UNet(unet, classes=()).down
        self.pool = nn.MaxPool2d(2)
        self.bottleneck = nn.Conv2d(config.channels[-1], config.bottleneck, 1)
        places = (config.height_px * config.width_px) // 4 ** len(config.channels)
        self.embed = nn.Linear(config.bottleneck * places, config.embedding)
        self.drop = nn.Dropout(dropout)
        joined = config.views * config.embedding + state_size(config.views)
        self.fusion = nn.Linear(joined, config.hidden)
        self.hidden = nn.Linear(config.hidden, config.hidden)
        self.head = nn.Linear(config.hidden, len(OUTPUTS))

    def forward(self, frames: Tensor, state: Tensor) -> Tensor:
        """Return the values of `ego_state.OUTPUTS`, (N, 5).

        Frames are (N, V, 3, H, W) float RGB in [0, 1], the present view first, states (N, S).
        """
        count, views = frames.shape[:2]
        # So that the convolutions' zero padding is mid-grey, not black.
        features = frames.flatten(0, 1) - 0.5
        features = features.contiguous(memory_format=torch.channels_last)
        for level, block in enumerate(self.down):
            features = block(features if level == 0 else self.pool(features))
        embedded = self.embed(self.bottleneck(features).relu().flatten(1)).relu()
        embedded = self.drop(embedded).reshape(count, views * self.config.embedding)
        joined = self.fusion(torch.cat([embedded, state], dim=1)).relu()
        return cast("Tensor", self.head(self.hidden(joined).relu()))


def _ports(net: ControlNet) -> OnnxPorts:
    config = net.config
    about = {"version": VERSION, "outputs": OUTPUTS, "config": asdict(config)}
    return OnnxPorts(
        inputs={
            "frames": (1, config.views, 3, config.height_px, config.width_px),
            "state": (1, state_size(config.views)),
        },
        outputs=("prediction",),
        metadata={"control": json.dumps(about, sort_keys=True)},
    )


STUDENT_FILES: Final = NetworkFiles(
    kind="control-student",
    remedy="`uav-bt net train student` makes one",
    build=lambda details: ControlNet(ControlNetConfig.from_json(details["config"])),
    ports=_ports,
    version=VERSION,
)
"""Inputs `frames`: (1, V, 3, H, W) float32 RGB in [0, 1], the present view first, and `state`:
(1, S) float32. Output `prediction`: (1, 5) float32. The metadata's `control` (JSON) names them."""
