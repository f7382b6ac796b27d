"""Random changes of images of rooms and their labels, on whole batches and any device."""

from __future__ import annotations

import math
from typing import Final

import torch
from torch import Tensor
from torch.nn import functional

ZOOM: Final = 1.35  # greatest magnification; the part that is kept is at a random place
# Standard deviations of logarithms: of the exposure, of each colour's gain, of the exponent, and
# of slow changes of light over the image.
GAIN, TINT, GAMMA, SHADING = 0.3, 0.08, 0.2, 0.25
HUE_RAD: Final = 0.6  # greatest rotation of the hue
SATURATION: Final = (0.2, 1.6)
NOISE: Final = 0.05  # greatest standard deviation of the noise, of a range of 1
BLURRED: Final = 0.35  # share of images that lose detail
_LUMA: Final = (0.299, 0.587, 0.114)


def augment_rooms(rgb: Tensor, labels: Tensor, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Return changed images, (N, 3, H, W) float from 0 to 1, and their labels, (N, K, H, W) float.

    Labels follow the images' geometry, nearest value. The generator is on the images' device.
    """
    rgb, labels = zoomed(rgb, labels, generator)
    return _relit(rgb, generator), labels


def _uniform(count: int, low: float, high: float, generator: torch.Generator) -> Tensor:
    values = torch.rand(count, generator=generator, device=generator.device)
    return low + (high - low) * values


def zoomed(rgb: Tensor, labels: Tensor, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Return parts of images and labels, half of them mirrored, at the size of the whole."""
    count = len(rgb)
    zoom = 1.0 / _uniform(count, 1.0, ZOOM, generator)
    mirror = torch.where(_uniform(count, 0.0, 1.0, generator) < 0.5, -1.0, 1.0)
    shift_x = _uniform(count, -1.0, 1.0, generator) * (1.0 - zoom)
    shift_y = _uniform(count, -1.0, 1.0, generator) * (1.0 - zoom)
    zero = torch.zeros_like(zoom)
    rows = torch.stack(
        [torch.stack([mirror * zoom, zero, shift_x], 1), torch.stack([zero, zoom, shift_y], 1)], 1
    )
    grid = functional.affine_grid(rows, list(rgb.shape), align_corners=False)
    return (
        functional.grid_sample(rgb, grid, "bilinear", "border", align_corners=False),
        functional.grid_sample(labels, grid, "nearest", "border", align_corners=False),
    )


def _relit(rgb: Tensor, generator: torch.Generator) -> Tensor:
    """Return images in other light, through another camera."""
    count, device = len(rgb), rgb.device

    def normal(*shape: int) -> Tensor:
        return torch.randn(*shape, generator=generator, device=device)

    rgb = _turned_hue(rgb, _uniform(count, -HUE_RAD, HUE_RAD, generator))
    grey = sum(share * rgb[:, each : each + 1] for each, share in enumerate(_LUMA))
    saturation = _uniform(count, *SATURATION, generator).view(-1, 1, 1, 1)
    rgb = grey + saturation * (rgb - grey)
    size = rgb.shape[-2:]
    slow = functional.interpolate(normal(count, 1, 3, 4), size, mode="bicubic")
    slow = slow + 0.5 * functional.interpolate(normal(count, 1, 8, 14), size, mode="bicubic")
    gain = GAIN * normal(count, 1, 1, 1) + TINT * normal(count, 3, 1, 1)
    light = torch.exp(gain + SHADING * torch.rand(count, 1, 1, 1, device=device) * slow)
    gamma = torch.exp(GAMMA * normal(count, 1, 1, 1))
    rgb = (rgb * light).clamp(1e-4, 1.0) ** gamma
    small = functional.interpolate(functional.avg_pool2d(rgb, 2), size, mode="bilinear")
    share = (_uniform(count, 0.0, 1.0, generator) < BLURRED).float()
    share = (share * _uniform(count, 0.3, 1.0, generator)).view(-1, 1, 1, 1)
    rgb = rgb + share * (small - rgb)
    strength = (NOISE * _uniform(count, 0.0, 1.0, generator) ** 2).view(-1, 1, 1, 1)
    return (rgb + strength * normal(*rgb.shape)).clamp(0.0, 1.0)


def _turned_hue(rgb: Tensor, angle_rad: Tensor) -> Tensor:
    """Return images whose colours are rotated about the grey axis, by an angle each, (N,)."""
    cos, sin = torch.cos(angle_rad), torch.sin(angle_rad)
    third, root = (1.0 - cos) / 3.0, sin / math.sqrt(3.0)
    same, one, other = cos + third, third - root, third + root
    rows = [
        torch.stack(row, 1) for row in ((same, one, other), (other, same, one), (one, other, same))
    ]
    return torch.einsum("nij,njhw->nihw", torch.stack(rows, 1), rgb)
