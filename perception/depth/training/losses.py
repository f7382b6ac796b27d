"""Loss terms of self-supervised depth: those of SC-Depth, implemented from its papers, and labels.

Bian et al., "Unsupervised scale-consistent depth and ego-motion learning from monocular video"
(arXiv 1908.10553) and its successors: photometric and geometric consistency between frames, masks
for pixels that violate the assumptions, and smoothness where the image is smooth. In addition: the
distance to labels.

`warp` shows one image from another camera by depth, motion and intrinsics. Pixel centres are at
integer coordinates, as in OpenCV and in `CameraModel`. So the sampling grid is normalised by the
size less one and sampled with aligned corners. Both must be used together; otherwise the image
shifts by up to half a pixel. kornia's `warp_frame_depth` gives the same values (to 4e-6) in twice
the time, but not the depth and the mask for the losses; its SSIM has a Gaussian window instead of
SC-Depth's mean.

Importing this module imports torch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor
from torch.nn import functional

from uav_bt.errors import ShapeError

_NEAREST = 1e-3  # depth below which a point counts as behind the camera


@dataclass(frozen=True, kw_only=True)
class Warped:
    """The source sampled at the target's pixels."""

    values: Tensor  # (N, C, H, W): values of the source at the target's points
    depth: Tensor  # (N, 1, H, W): depth of these points along the source camera's optical axis
    valid: Tensor  # (N, 1, H, W) bool: whether the point lies in the source's image


def pixel_rays(intrinsics: Tensor, height: int, width: int) -> Tensor:
    """Return rays of unit depth in the camera frame (x right, y down, z forward).

    Args:
        intrinsics: (N, 4): fx, fy, cx, cy in pixels of that size.
        height: in pixels.
        width: in pixels.

    Returns:
        (N, 3, H * W).
    """
    rows, columns = torch.meshgrid(
        torch.arange(height, dtype=intrinsics.dtype, device=intrinsics.device),
        torch.arange(width, dtype=intrinsics.dtype, device=intrinsics.device),
        indexing="ij",
    )
    fx, fy, cx, cy = (value[:, None] for value in intrinsics.unbind(dim=1))
    x = (columns.reshape(1, -1) - cx) / fx
    y = (rows.reshape(1, -1) - cy) / fy
    return torch.stack([x, y, torch.ones_like(x)], dim=1)


def warp(source: Tensor, depth: Tensor, motion: Tensor, intrinsics: Tensor) -> Warped:
    """Sample the source at the target's points.

    Args:
        source: (N, C, H, W), values per pixel of the source camera.
        depth: (N, 1, H, W) of the target's pixels along its optical axis.
        motion: (N, 3, 4), from the target camera's frame to the source camera's.
        intrinsics: (N, 4): fx, fy, cx, cy of both, in pixels of that size.

    Raises:
        ShapeError: depth, motion or intrinsics do not belong to the source.
    """
    count, _, height, width = source.shape
    _check("warping", depth, (count, 1, height, width))
    _check("warping", motion, (count, 3, 4))
    _check("warping", intrinsics, (count, 4))
    rays = pixel_rays(intrinsics, height, width)
    rotated = motion[:, :, :3] @ rays
    points = rotated * depth.reshape(count, 1, -1) + motion[:, :, 3:]
    far = points[:, 2:].clamp(min=_NEAREST)
    fx, fy, cx, cy = (value[:, None] for value in intrinsics.unbind(dim=1))
    column = fx * points[:, 0] / far[:, 0] + cx
    row = fy * points[:, 1] / far[:, 0] + cy
    grid = torch.stack([2.0 * column / (width - 1) - 1.0, 2.0 * row / (height - 1) - 1.0], dim=2)
    grid = grid.reshape(count, height, width, 2)
    inside = (grid.abs().amax(dim=3) <= 1.0) & (points[:, 2] > _NEAREST).reshape(
        count, height, width
    )
    values = functional.grid_sample(
        source, grid, mode="bilinear", padding_mode="border", align_corners=True
    )
    return Warped(
        values=values, depth=far.reshape(count, 1, height, width), valid=inside.unsqueeze(1)
    )


def invert_motion(motion: Tensor) -> Tensor:
    """Return the inverse of rigid motions, (N, 3, 4)."""
    back = motion[:, :, :3].transpose(1, 2)
    return torch.cat([back, -back @ motion[:, :, 3:]], dim=2)


_SSIM_SHARE: Final = 0.85
_C1, _C2 = 0.01**2, 0.03**2  # Wang et al. (2004), for values from 0 to 1
_MIN_PIXELS: Final = 100.0  # with fewer pixels in a mask the mean is reduced towards zero


def _check(name: str, tensor: Tensor, shape: Sequence[int]) -> None:
    if tensor.shape != torch.Size(shape):
        raise ShapeError(name, expected="x".join(map(str, shape)), actual=tensor.shape)


def photometric_error(first: Tensor, second: Tensor) -> Tensor:
    """Return 0.15 L1 + 0.85 (1 - SSIM) / 2, channel mean.

    Args:
        first: (N, 3, H, W), 0 to 1.
        second: (N, 3, H, W), 0 to 1.

    Returns:
        (N, 1, H, W), 0 to 1.
    """
    _check("the second image", second, first.shape)
    difference = (first - second).abs().clamp(max=1.0)
    error = (1.0 - _SSIM_SHARE) * difference + _SSIM_SHARE * _dissimilarity(first, second)
    return error.mean(dim=1, keepdim=True)


def _dissimilarity(first: Tensor, second: Tensor) -> Tensor:
    # One pooling of the stacked images is faster than five.
    stacked = torch.cat([first, second, first * first, second * second, first * second], dim=1)
    padded = functional.pad(stacked, (1, 1, 1, 1), mode="reflect")
    means = functional.avg_pool2d(padded, 3, stride=1)
    mean_1, mean_2, square_1, square_2, product = means.chunk(5, dim=1)
    variance_1 = square_1 - mean_1 * mean_1
    variance_2 = square_2 - mean_2 * mean_2
    covariance = product - mean_1 * mean_2
    above = (2.0 * mean_1 * mean_2 + _C1) * (2.0 * covariance + _C2)
    below = (mean_1**2 + mean_2**2 + _C1) * (variance_1 + variance_2 + _C2)
    return ((1.0 - above / below) / 2.0).clamp(0.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class ConsistencyMaps:
    """Consistency of a source image with a target image, by pixel of the target."""

    photometric: Tensor  # (N, 1, H, W), weighted by the geometric agreement
    geometric: Tensor  # (N, 1, H, W), 0 (depths agree) to 1
    mask: Tensor  # (N, 1, H, W) float, 1 where the pixel counts


def consistency_maps(
    target: Tensor,
    source: Tensor,
    depths: tuple[Tensor, Tensor],
    motion: Tensor,
    intrinsics: Tensor,
) -> ConsistencyMaps:
    """Compare a target with the warped source.

    A pixel counts if its point lies in the source's image and if warping explains it better than no
    motion. The latter excludes objects that move with the camera, and uniform colour.

    Args:
        target: (N, 3, H, W), 0 to 1.
        source: (N, 3, H, W), 0 to 1.
        depths: of target and source, (N, 1, H, W) each.
        motion: (N, 3, 4), from the target camera's frame to the source camera's.
        intrinsics: (N, 4): fx, fy, cx, cy.
    """
    target_depth, source_depth = depths
    warped = warp(torch.cat([source, source_depth], dim=1), target_depth, motion, intrinsics)
    seen, projected = warped.values[:, :3], warped.values[:, 3:]
    geometric = (warped.depth - projected).abs() / (warped.depth + projected)
    error = photometric_error(target, seen)
    with torch.no_grad():
        identity = photometric_error(target, source)
        mask = (warped.valid & (error < identity)).to(error.dtype)
        agreement = 1.0 - geometric
    return ConsistencyMaps(photometric=error * agreement, geometric=geometric, mask=mask)


def best_of(maps: Sequence[ConsistencyMaps]) -> ConsistencyMaps:
    """Return, for each pixel, the values of the source that explains the target best.

    Args:
        maps: maps of the same target and several sources.
    """
    photometric = torch.stack([each.photometric for each in maps])
    mask = torch.stack([each.mask for each in maps])
    with torch.no_grad():
        choice = (photometric + 2.0 * (1.0 - mask)).argmin(dim=0, keepdim=True)
    geometric = torch.stack([each.geometric for each in maps])
    return ConsistencyMaps(
        photometric=photometric.gather(0, choice)[0],
        geometric=geometric.gather(0, choice)[0],
        mask=mask.gather(0, choice)[0],
    )


def masked_mean(values: Tensor, mask: Tensor) -> Tensor:
    """Return the mean where the mask is 1; a nearly empty mask gives nearly zero."""
    return (values * mask).sum() / mask.sum().clamp(min=_MIN_PIXELS)


def smoothness_loss(depth: Tensor, image: Tensor) -> Tensor:
    """Return the mean gradient of the mean-normalised depth, less where the image has edges.

    Args:
        depth: (N, 1, H, W).
        image: (N, 3, H, W), 0 to 1.
    """
    _check("depth to smooth", depth, (len(image), 1, *image.shape[2:]))
    level = depth / depth.mean(dim=(2, 3), keepdim=True).clamp(min=1e-7)
    loss = depth.new_zeros(())
    for axis in (2, 3):
        edges = image.diff(dim=axis).abs().mean(dim=1, keepdim=True)
        loss = loss + (level.diff(dim=axis).abs() * torch.exp(-edges)).mean()
    return loss


def label_loss(depth: Tensor, label: Tensor, at_most: Tensor | None = None) -> Tensor:
    """Return the mean distance of log depth to the labels, robust to wrong ones (L1).

    Args:
        depth: (N, 1, H, W), positive.
        label: (N, 1, H, W); NaN where unknown.
        at_most: (N, 1, H, W) upper bound, inf without one; None if no pixel has a bound.
    """
    _check("depth labels", label, depth.shape)
    known = torch.isfinite(label)
    log_depth = depth.log()
    distance = (log_depth - label.where(known, depth.detach()).log()).abs()
    loss = masked_mean(distance, known.to(depth.dtype))
    if at_most is not None:
        _check("depth bounds", at_most, depth.shape)
        # Only for pixels without a label, because a label is more precise.
        bounded = torch.isfinite(at_most) & ~known
        excess = functional.relu(log_depth - at_most.where(bounded, depth.detach()).log())
        loss = loss + masked_mean(excess, bounded.to(depth.dtype))
    return loss
