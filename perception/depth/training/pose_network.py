"""The pose network: two pictures in, the camera's movement between them out.

As in SC-Depth (Bian et al., arXiv 1908.10553): six channels in, six numbers out, times 0.01, so
that an untrained network says almost no movement. It only serves training; nothing of it flies.

Importing this module imports torch.
"""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor, nn

_WIDTHS: Final = (16, 32, 64, 128, 128)  # by level, from half size downwards
_GAIN: Final = 0.01


class PoseNet(nn.Module):
    """Two pictures, (N, 3, H, W) each, to the movement from the first camera to the second."""

    def __init__(self) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for inputs, outputs in zip((6, *_WIDTHS[:-1]), _WIDTHS, strict=True):
            kernel = 7 if inputs == 6 else 3
            layers += [
                nn.Conv2d(inputs, outputs, kernel, stride=2, padding=kernel // 2, bias=False),
                nn.BatchNorm2d(outputs),
                nn.ReLU(inplace=True),
            ]
        self.features = nn.Sequential(*layers)
        self.head = nn.Conv2d(_WIDTHS[-1], 6, 1)

    def forward(self, first: Tensor, second: Tensor) -> Tensor:
        """Return how points move from the first camera's frame to the second's, (N, 3, 4)."""
        features = self.features(torch.cat([first, second], dim=1) - 0.5)
        return motion_matrix(_GAIN * self.head(features).mean(dim=(2, 3)))


def motion_matrix(numbers: Tensor) -> Tensor:
    """Return rigid movements from six numbers each.

    Args:
        numbers: (N, 6): translation x, y, z, and a rotation vector (axis times angle, radians).

    Returns:
        (N, 3, 4): rotation and translation.
    """
    translation, vector = numbers[:, :3], numbers[:, 3:]
    x, y, z = vector.unbind(dim=1)
    zero = torch.zeros_like(x)
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], dim=1).reshape(-1, 3, 3)
    rotation = torch.linalg.matrix_exp(cross)
    return torch.cat([rotation, translation.unsqueeze(2)], dim=2)
