"""Random changes of images of rooms and their labels, on whole batches and any device."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor
from torch.nn import functional

_LUMA: Final = (0.299, 0.587, 0.114)


@dataclass(frozen=True, kw_only=True)
class RoomAugmentation:
    """Strengths of the changes.

    Attributes:
        zoom: Greatest magnification; the part that is kept is at a random place.
        gain: Standard deviation of the logarithm of the exposure.
        tint: Standard deviation of the logarithm of each colour's gain.
        gamma: Standard deviation of the logarithm of the exponent.
        shading: Standard deviation of the logarithm of slow changes of light over the image.
        hue_rad: Greatest rotation of the hue.
        noise: Greatest standard deviation of the noise, of a range of 1.
        blurred: Share of images that lose detail.
    """

    zoom: float = 1.35
    gain: float = 0.3
    tint: float = 0.08
    gamma: float = 0.2
    shading: float = 0.25
    hue_rad: float = 0.6
    noise: float = 0.05
    blurred: float = 0.35


def augment_rooms(
    rgb: Tensor, labels: Tensor, generator: torch.Generator, config: RoomAugmentation
) -> tuple[Tensor, Tensor]:
    """Return changed images and their labels.

    Args:
        rgb: (N, 3, H, W) float, 0 to 1.
        labels: (N, K, H, W) float; they follow the images' geometry, nearest value.
        generator: source of the random numbers, on the device of the images.
        config: strengths.
    """
    rgb, labels = _zoomed(rgb, labels, generator, config)
    return _relit(rgb, generator, config), labels


def _uniform(count: int, low: float, high: float, generator: torch.Generator) -> Tensor:
    values = torch.rand(count, generator=generator, device=generator.device)
    return low + (high - low) * values


def _zoomed(
    rgb: Tensor, labels: Tensor, generator: torch.Generator, config: RoomAugmentation
) -> tuple[Tensor, Tensor]:
    count = len(rgb)
    zoom = 1.0 / _uniform(count, 1.0, config.zoom, generator)
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


def _relit(rgb: Tensor, generator: torch.Generator, config: RoomAugmentation) -> Tensor:
    """Return images in other light, through another camera."""
    count, device = len(rgb), rgb.device

    def normal(*shape: int) -> Tensor:
        return torch.randn(*shape, generator=generator, device=device)

    rgb = _turned_hue(rgb, _uniform(count, -config.hue_rad, config.hue_rad, generator))
    grey = sum(share * rgb[:, each : each + 1] for each, share in enumerate(_LUMA))
    saturation = _uniform(count, 0.2, 1.6, generator).view(-1, 1, 1, 1)
    rgb = grey + saturation * (rgb - grey)
    size = rgb.shape[-2:]
    slow = functional.interpolate(normal(count, 1, 3, 4), size, mode="bicubic")
    slow = slow + 0.5 * functional.interpolate(normal(count, 1, 8, 14), size, mode="bicubic")
    gain = config.gain * normal(count, 1, 1, 1) + config.tint * normal(count, 3, 1, 1)
    light = torch.exp(gain + config.shading * torch.rand(count, 1, 1, 1, device=device) * slow)
    gamma = torch.exp(config.gamma * normal(count, 1, 1, 1))
    rgb = (rgb * light).clamp(1e-4, 1.0) ** gamma
    small = functional.interpolate(functional.avg_pool2d(rgb, 2), rgb.shape[-2:], mode="bilinear")
    share = (_uniform(count, 0.0, 1.0, generator) < config.blurred).float()
    share = (share * _uniform(count, 0.3, 1.0, generator)).view(-1, 1, 1, 1)
    rgb = rgb + share * (small - rgb)
    strength = (config.noise * _uniform(count, 0.0, 1.0, generator) ** 2).view(-1, 1, 1, 1)
    return (rgb + strength * normal(*rgb.shape)).clamp(0.0, 1.0)


def _turned_hue(rgb: Tensor, angle_rad: Tensor) -> Tensor:
    """Return images whose colours are rotated about the grey axis, by an angle each, (N,)."""
    cos, sin = torch.cos(angle_rad), torch.sin(angle_rad)
    third, root = (1.0 - cos) / 3.0, sin / math.sqrt(3.0)
    rows = torch.stack(
        [
            torch.stack([cos + third, third - root, third + root], 1),
            torch.stack([third + root, cos + third, third - root], 1),
            torch.stack([third - root, third + root, cos + third], 1),
        ],
        1,
    )
    return torch.einsum("nij,njhw->nihw", rows, rgb)
