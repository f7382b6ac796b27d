"""Training of the U-Net on labelled images, with the augmentation and the losses of the paper.

Mocanu et al. (arXiv 2510.16624, experiments on the first level) change hue by up to 5 degrees,
saturation by 2 %, value by 6 %, and translate and rotate at random. Stronger colour changes are
worse, because the patterns differ by colour. Images are not mirrored, because the patterns are not
symmetric. The paper found categorical cross-entropy better than binary cross-entropy with Dice.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from perception.networks.training import loop
from perception.segmentation.training.unet import UNet, UNetConfig
from uav_bt.errors import UnknownNameError
from uav_bt.types.arrays import Floats, Floats32, Ids, Image

_SMOOTHING: Final = 1.0  # pixels; avoids 0 / 0 in the Dice term of an absent class


def cross_entropy(
    logits: Tensor, ids: Tensor, ignored: int, weights: Tensor | None = None
) -> Tensor:
    """Return the mean categorical cross-entropy; arguments as of `bce_dice`."""
    return functional.cross_entropy(logits, ids, weight=weights, ignore_index=ignored)


def bce_dice(logits: Tensor, ids: Tensor, ignored: int, weights: Tensor | None = None) -> Tensor:
    """Return binary cross-entropy over one mask per class, plus the classes' mean Dice loss.

    Logits are (N, C, H, W), ids (N, H, W) int64, weights of the classes in the cross-entropy (C,).
    """
    classes = logits.shape[1]
    counts = (ids != ignored).unsqueeze(1).to(logits.dtype)
    masks = functional.one_hot(ids.where(ids != ignored, 0), classes).permute(0, 3, 1, 2)
    target = masks.to(logits.dtype) * counts
    bce = functional.binary_cross_entropy_with_logits(logits, target, reduction="none")
    if weights is not None:
        bce = bce * weights[:, None, None]
    mean_bce = (bce * counts).sum() / (counts.sum() * classes).clamp(min=1.0)
    probability = logits.sigmoid() * counts
    overlap = (probability * target).sum(dim=(0, 2, 3))
    total = probability.sum(dim=(0, 2, 3)) + target.sum(dim=(0, 2, 3))
    dice = (2.0 * overlap + _SMOOTHING) / (total + _SMOOTHING)
    return mean_bce + (1.0 - dice).mean()


LOSSES: Final = {"cross_entropy": cross_entropy, "bce_dice": bce_dice}

_SHOWN: Final = 0.002  # least share of an image's pixels with which it shows a class
_WEIGHT_LIMITS: Final = (0.3, 6.0)


def balance_classes(ids: Ids, classes: int) -> tuple[Floats, Floats32]:
    """Return the probability of drawing each image, (N,), and the weights of the C classes.

    Rare classes are drawn more often and weigh more. The weights' mean over all pixels is one,
    apart from the limits. Ids of C and more do not count.
    """
    counts = np.stack([np.bincount(each.ravel(), minlength=256)[:classes] for each in ids])
    shown = counts >= _SHOWN * ids[0].size
    images = np.maximum(shown.sum(axis=0), 1)
    # Half of the draws take a class first and then an image that shows it, the others any image.
    by_class = np.where(shown, 1.0 / images, 0.0).sum(axis=1)
    even = np.full(len(ids), 1.0 / len(ids))
    total = by_class.sum()
    shares = 0.5 * even + 0.5 * by_class / total if total > 0.0 else even
    frequency = counts.sum(axis=0) / max(int(counts.sum()), 1)
    weights = np.where(frequency > 0.0, 1.0 / np.sqrt(np.maximum(frequency, 1e-9)), 0.0)
    mean = float((frequency * weights).sum())
    weights = np.clip(weights / (mean or 1.0), *_WEIGHT_LIMITS)
    return shares, weights.astype(np.float32)


_HUE_LEVEL_DEG: Final = 2.0  # step of OpenCV's 8-bit hue


@dataclass(frozen=True, kw_only=True)
class AugmentConfig:
    """Limits of the augmentation; each sample is uniform within plus and minus a limit.

    Blur and noise are uniform between 0 and the limit.
    """

    hue_deg: float = 5.0  # the paper's
    saturation: float = 0.02  # relative, the paper's
    value: float = 0.06  # relative, the paper's
    rotation_deg: float = 8.0  # the paper gives none; a stabilised camera rolls little
    shift: float = 0.1  # of the image's sides; the paper gives none
    blur_px: float = 0.0  # standard deviation of a Gaussian, pixels of the network's image
    noise: float = 0.0  # standard deviation of a pixel's noise, grey levels


def augmented(
    rgb: Image, ids: Ids, rng: np.random.Generator, config: AugmentConfig
) -> tuple[Image, Ids]:
    """Return an augmented image, (H, W, 3), and its class ids, (H, W), moved in the same way.

    Outside the original, image and class ids are mirrored.
    """
    height, width = rgb.shape[:2]
    hue, saturation, value, angle, across, down = rng.uniform(-1.0, 1.0, size=6).tolist()
    hsv = cv2.cvtColor(rgb, cv2.COLOR_RGB2HSV)
    levels = np.arange(256)
    factors = (1.0 + saturation * config.saturation, 1.0 + value * config.value)
    hues = np.round(levels + hue * config.hue_deg / _HUE_LEVEL_DEG) % 180
    others = [np.clip(np.round(levels * factor), 0, 255) for factor in factors]
    table = np.stack([hues, *others], axis=1).astype(np.uint8)[None]
    coloured = _degraded(cv2.cvtColor(cv2.LUT(hsv, table), cv2.COLOR_HSV2RGB), rng, config)
    middle = ((width - 1) / 2.0, (height - 1) / 2.0)
    turn = cv2.getRotationMatrix2D(middle, angle * config.rotation_deg, 1.0)
    turn[:, 2] += (across * config.shift * width, down * config.shift * height)
    size, border = (width, height), cv2.BORDER_REFLECT_101
    moved = cv2.warpAffine(coloured, turn, size, flags=cv2.INTER_LINEAR, borderMode=border)
    moved_ids = cv2.warpAffine(ids, turn, size, flags=cv2.INTER_NEAREST, borderMode=border)
    return np.asarray(moved, dtype=np.uint8), np.asarray(moved_ids, dtype=np.uint8)


def _degraded(rgb: NDArray[Any], rng: np.random.Generator, config: AugmentConfig) -> Image:
    if config.blur_px > 0.0:
        sigma_px = rng.uniform(0.1, max(config.blur_px, 0.1))
        rgb = cv2.GaussianBlur(rgb, (0, 0), sigma_px)
    if config.noise > 0.0:
        spread = rng.normal(0.0, rng.uniform(0.0, config.noise), rgb.shape)
        rgb = np.clip(np.round(rgb + spread), 0, 255)
    return rgb.astype(np.uint8)


# For images of another camera than the drone's: exposure, focus and noise differ (chosen).
FLIGHT_AUGMENT: Final = AugmentConfig(saturation=0.1, value=0.2, blur_px=1.0, noise=6.0)
IGNORED: Final = 255  # label of an unknown pixel, which the loss leaves out


@dataclass(frozen=True, kw_only=True)
class TrainingConfig(loop.LoopConfig):
    """How the U-Net is trained."""

    loss: Literal["cross_entropy", "bce_dice"] = "cross_entropy"  # the paper's best comes first
    augment: AugmentConfig = field(default_factory=AugmentConfig)
    balanced: bool = False  # rare classes are drawn more often and weigh more

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.loss not in LOSSES:
            raise UnknownNameError("loss", self.loss, LOSSES)


@dataclass(frozen=True, kw_only=True, eq=False)
class LabelledImages:
    """A training set in memory, at the network's size."""

    rgb: Image  # (N, H, W, 3)
    ids: Ids  # (N, H, W); `IGNORED` where unknown
    classes: tuple[str, ...]  # names by id


def train_unet(
    images: LabelledImages,
    config: TrainingConfig,
    net_config: UNetConfig,
    *,
    start: UNet | None = None,
    checkpoint: Path | None = None,
    progress: Callable[[loop.Progress, UNet], None] | None = None,
) -> UNet:
    """Train the network on images of its size, or continue from the checkpoint if there is one.

    It begins with the weights of `start`, without the head if its classes are others. Returned is
    the network with the running mean of its weights, in evaluation mode.
    """
    torch.manual_seed(config.seed)
    net = loop.channels_last(UNet(net_config, images.classes))
    if start is not None:
        taken = start.state_dict()
        if start.classes != images.classes:
            taken = {name: each for name, each in taken.items() if not name.startswith("head.")}
        net.load_state_dict(taken, strict=False)
    shares: Floats | None = None
    weights: Tensor | None = None
    if config.balanced:
        shares, of_classes = balance_classes(images.ids, len(images.classes))
        weights = torch.from_numpy(of_classes).to(config.device)

    def objective(rng: np.random.Generator) -> tuple[Tensor, Mapping[str, Tensor]]:
        chosen = rng.choice(len(images.rgb), size=config.batch, p=shares)
        pairs = [augmented(images.rgb[i], images.ids[i], rng, config.augment) for i in chosen]
        rgb, ids = (np.stack(each) for each in zip(*pairs, strict=True))
        logits = net(_to_input(rgb).to(config.device))
        known = torch.from_numpy(ids.astype(np.int64)).to(config.device)
        return LOSSES[config.loss](logits, known, IGNORED, weights), {}

    about = {"training": asdict(config), "net": asdict(net_config)}
    return loop.train(
        net, objective, config, "unet", about, checkpoint=checkpoint, progress=progress
    )


def predict(net: UNet, rgb: Image) -> Image:
    """Return the class ids, (N, H, W), of images of the network's size, (N, H, W, 3)."""
    with torch.inference_mode():
        logits = net(_to_input(rgb))
    return np.asarray(logits.argmax(dim=1).to(torch.uint8).numpy(), dtype=np.uint8)


def _to_input(rgb: Image) -> Tensor:
    batch = torch.from_numpy(rgb).permute(0, 3, 1, 2).float().div_(255.0)
    return batch.contiguous(memory_format=torch.channels_last)
