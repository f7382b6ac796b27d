"""Loss terms of self-supervised depth: those of SC-Depth, and labels.

Bian et al., "Unsupervised scale-consistent depth and ego-motion learning from monocular video"
(arXiv 1908.10553) and its successors: photometric and geometric consistency between frames, masks
for pixels that violate the assumptions, and smoothness where the image is smooth. In addition: the
distance to labels from masks and geometry (`perception.depth.contact.depth`).

Pixel centres are at integer coordinates, as in OpenCV and in `CameraModel`. So the sampling grid is
normalised by the size less one and sampled with aligned corners; otherwise the image shifts by up
to half a pixel. kornia's `warp_frame_depth` gives the same values (to 4e-6) in twice the time, but
not depth and mask for the losses; its SSIM has a Gaussian window instead of SC-Depth's mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from perception.depth.training.clips import Clip
from perception.depth.training.network import DepthNet, PoseNet
from uav_bt.types.arrays import Floats32

_NEAREST_M: Final = 1e-3  # depth below which a point counts as behind the camera
_SSIM_SHARE: Final = 0.85
_C1, _C2 = 0.01**2, 0.03**2  # Wang et al. (2004), for values from 0 to 1
_MIN_PIXELS: Final = 100.0  # with fewer pixels in a mask the mean is reduced towards zero


def loss_terms(
    clips: Sequence[Clip], net: DepthNet, pose: PoseNet | None, *, compare: bool, device: str
) -> dict[str, Tensor]:
    """Return the terms of a batch: `smoothness`, and `labels` where all clips have them.

    To compare frames adds `photometric` and `geometry`, without `pose` by the clips' motions.
    """
    # Ordered by frame, so that all targets come first.
    images = _planes([clip.images for clip in clips], device)
    depth: Tensor = net(images)
    # Compared at the size of the depth, which is four times faster and loses no detail.
    small = functional.avg_pool2d(images, 2)
    terms: dict[str, Tensor] = {}
    if compare:
        count = len(clips)

        def pairs(each: Tensor) -> tuple[Tensor, Tensor]:
            target, others = each[:count].repeat(2, 1, 1, 1), each[count:]
            return torch.cat([target, others]), torch.cat([others, target])

        if pose is None:
            there = torch.from_numpy(np.stack([clip.motions for clip in clips], axis=1))
            there = there.flatten(0, 1).to(device)
            motions = torch.cat([there, invert_motion(there)])
        else:
            motions = pose(*pairs(small))
        half = [clip.camera.resized(*small.shape[:1:-1]).pinhole_px for clip in clips]
        intrinsics = torch.tensor(half, device=device).repeat(4, 1)
        # All pairs in both directions at once.
        maps = consistency_maps(*pairs(small), pairs(depth), motions, intrinsics)
        photometric, geometric, mask = best_of(maps, count)
        terms["photometric"] = masked_mean(photometric, mask)
        terms["geometry"] = masked_mean(geometric, mask)
    terms["smoothness"] = smoothness_loss(depth, small)
    labels = [clip.labels for clip in clips if clip.labels is not None]
    if labels:
        label, bound = _planes(labels, device).chunk(2, dim=1)
        terms["labels"] = label_loss(depth, label, bound)
    return terms


def _planes(arrays: Sequence[Floats32], device: str) -> Tensor:
    """Return arrays, (3, H, W, C) each, as (3 N, C, H, W), ordered by frame and channels-last."""
    stacked = torch.from_numpy(np.stack(arrays, axis=1)).to(device)
    return stacked.flatten(0, 1).permute(0, 3, 1, 2)


def warp(
    source: Tensor, depth: Tensor, motion: Tensor, intrinsics: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Sample a source image, (N, C, H, W), at the points of a target's depth, (N, 1, H, W).

    Motions, (N, 3, 4), are from the target's camera to the source's; intrinsics, (N, 4), are fx,
    fy, cx, cy of both. Returned are the source's values at the points, their depth along its
    optical axis, and whether they lie in its image.
    """
    count, _, height, width = source.shape
    points = motion[:, :, :3] @ pixel_rays(intrinsics, height, width)
    points = points * depth.reshape(count, 1, -1) + motion[:, :, 3:]
    far = points[:, 2].clamp(min=_NEAREST_M)
    fx, fy, cx, cy = (value[:, None] for value in intrinsics.unbind(dim=1))
    column = fx * points[:, 0] / far + cx
    row = fy * points[:, 1] / far + cy
    grid = torch.stack([2.0 * column / (width - 1) - 1.0, 2.0 * row / (height - 1) - 1.0], dim=2)
    inside = (grid.abs().amax(dim=2) <= 1.0) & (points[:, 2] > _NEAREST_M)
    grid = grid.reshape(count, height, width, 2)
    values = functional.grid_sample(source, grid, padding_mode="border", align_corners=True)
    return values, far.reshape(depth.shape), inside.reshape(depth.shape)


def pixel_rays(intrinsics: Tensor, height: int, width: int) -> Tensor:
    """Return rays of unit depth in the camera frame (x right, y down, z forward), (N, 3, H W)."""
    fx, fy, cx, cy = (value[:, None] for value in intrinsics.unbind(dim=1))
    rows, columns = torch.meshgrid(*map(torch.arange, (height, width)), indexing="ij")
    rows, columns = rows.to(intrinsics), columns.to(intrinsics)
    x = (columns.reshape(1, -1) - cx) / fx
    y = (rows.reshape(1, -1) - cy) / fy
    return torch.stack([x, y, torch.ones_like(x)], dim=1)


def invert_motion(motion: Tensor) -> Tensor:
    """Return the inverse of rigid motions, (N, 3, 4)."""
    back = motion[:, :, :3].transpose(1, 2)
    return torch.cat([back, -back @ motion[:, :, 3:]], dim=2)


def photometric_error(first: Tensor, second: Tensor) -> Tensor:
    """Return 0.15 L1 + 0.85 (1 - SSIM) / 2 of images, 0 to 1: channel mean, (N, 1, H, W)."""
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
    unlike = ((1.0 - above / below) / 2.0).clamp(0.0, 1.0)
    difference = (first - second).abs().clamp(max=1.0)
    error = (1.0 - _SSIM_SHARE) * difference + _SSIM_SHARE * unlike
    return error.mean(dim=1, keepdim=True)


Maps = tuple[Tensor, Tensor, Tensor]
"""By pixel of the targets, (N, 1, H, W): photometric error, weighted by the geometric agreement;
difference of the depths, 0 to 1; and 1 where the pixel counts."""


def consistency_maps(
    target: Tensor, source: Tensor, depths: tuple[Tensor, Tensor], motion: Tensor, lens: Tensor
) -> Maps:
    """Compare targets with warped sources, (N, 3, H, W), whose depths are (N, 1, H, W) each.

    A pixel counts if its point lies in the source's image and if warping explains it better than no
    motion. The latter excludes objects that move with the camera, and uniform colour. Motion and
    lens (the intrinsics) are those of `warp`.
    """
    target_depth, source_depth = depths
    values, depth, valid = warp(
        torch.cat([source, source_depth], dim=1), target_depth, motion, lens
    )
    seen, projected = values[:, :3], values[:, 3:]
    geometric = (depth - projected).abs() / (depth + projected)
    error = photometric_error(target, seen)
    with torch.no_grad():
        mask = (valid & (error < photometric_error(target, source))).to(error.dtype)
        agreement = 1.0 - geometric
    return error * agreement, geometric, mask


def best_of(maps: Maps, count: int) -> Maps:
    """Keep, for each target's pixel, the values of the source that explains it best.

    The first 2 `count` maps are those of `count` targets with their first, then with their second
    source. Further maps are kept as they are.
    """
    with torch.no_grad():
        score = maps[0] + 2.0 * (1.0 - maps[2])
        first_is_best = score[:count] <= score[count : 2 * count]

    def kept(each: Tensor) -> Tensor:
        best = each[:count].where(first_is_best, each[count : 2 * count])
        return torch.cat([best, each[2 * count :]])

    photometric, geometric, mask = map(kept, maps)
    return photometric, geometric, mask


def masked_mean(values: Tensor, mask: Tensor) -> Tensor:
    """Return the mean where the mask is 1; a nearly empty mask gives nearly zero."""
    return (values * mask).sum() / mask.sum().clamp(min=_MIN_PIXELS)


def smoothness_loss(depth: Tensor, image: Tensor) -> Tensor:
    """Return the mean gradient of the mean-normalised depth, less where the image has edges."""
    level = depth / depth.mean(dim=(2, 3), keepdim=True).clamp(min=1e-7)
    loss = depth.new_zeros(())
    for axis in (2, 3):
        edges = image.diff(dim=axis).abs().mean(dim=1, keepdim=True)
        loss = loss + (level.diff(dim=axis).abs() * torch.exp(-edges)).mean()
    return loss


def label_loss(depth: Tensor, label: Tensor, at_most: Tensor) -> Tensor:
    """Return the mean distance of log depth to the labels, robust to wrong ones (L1).

    All are (N, 1, H, W). Labels are NaN where unknown; the upper bound is inf without one.
    """
    known = torch.isfinite(label)
    log_depth = depth.log()
    distance = (log_depth - label.where(known, depth.detach()).log()).abs()
    # Only for pixels without a label, because a label is more precise.
    bounded = torch.isfinite(at_most) & ~known
    excess = functional.relu(log_depth - at_most.where(bounded, depth.detach()).log())
    return masked_mean(distance, known.float()) + masked_mean(excess, bounded.float())
