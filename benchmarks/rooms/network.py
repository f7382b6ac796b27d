"""One network with two heads: the roles of pixels, and their depth.

Both heads read the features of a U-Net at half size, so a frame costs one inference. Depth is along
the optical axis, in heights of the camera above the ground.
"""

from __future__ import annotations

import json
from typing import Any, Final, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from perception.networks.training.network_files import NetworkFiles, OnnxPorts
from perception.segmentation.training.unet import UNet, UNetConfig

ROLES: Final = ("outside", "ground", "obstacle")  # in the order of their scores
_DEPTH_RANGE: Final = 4.0  # of the logarithm of relative depth: 0.02 to 55 heights


class RoomNet(nn.Module):
    """RGB in [0, 1], (N, 3, H, W), to scores of the roles and relative depth."""

    def __init__(self, config: UNetConfig) -> None:
        super().__init__()
        self.config = config
        self.trunk = UNet(config, ROLES)
        width = config.channels[0]
        self.depth = nn.Sequential(
            nn.Conv2d(width, width, 3, padding=1, bias=False),
            nn.BatchNorm2d(width),
            nn.ReLU(inplace=True),
            nn.Conv2d(width, 1, 1),
        )

    def forward(self, rgb: Tensor) -> tuple[Tensor, Tensor]:
        """Return logits of the roles, (N, 3, H, W), and depth in heights, (N, 1, H / 2, W / 2)."""
        logits, log_depth = self.heads(rgb)
        return logits, torch.exp(log_depth)

    def heads(self, rgb: Tensor) -> tuple[Tensor, Tensor]:
        """Return logits and the logarithm of depth."""
        features = self.trunk.features(rgb)
        logits = cast("Tensor", self.trunk.spread(self.trunk.head(features)))
        return logits, self.depth(features).clamp(-_DEPTH_RANGE, _DEPTH_RANGE)

    def predict_roles(self, rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the numbers of the roles, (H, W) uint8, of an image, (H, W, 3) uint8 RGB."""
        planes = torch.from_numpy(rgb).permute(2, 0, 1)[None].float() / 255.0
        with torch.inference_mode():
            logits, _ = self(planes)
        return np.asarray(logits[0].argmax(dim=0).to(torch.uint8).numpy(), np.uint8)


def _build(details: dict[str, Any]) -> RoomNet:
    config = details["config"]
    return RoomNet(UNetConfig(**{**config, "channels": tuple(config["channels"])}))


def _ports(net: RoomNet) -> OnnxPorts:
    return OnnxPorts(
        inputs={"image": (1, 3, net.config.height_px, net.config.width_px)},
        outputs=("logits", "depth"),
        metadata={"roles": json.dumps(ROLES), "depth": "relative to the height above the ground"},
    )


ROOM_FILES: Final = NetworkFiles(
    kind="room-network",
    remedy="perception/weights/any.md says how it is made",
    build=_build,
    ports=_ports,
)
