"""Images of many rooms, and training and export of the network `any` on them.

Roles have a cross-entropy. Depth has the absolute error of its logarithm, with and without the
median offset of each image (Eigen et al., arXiv 1406.2283), and the error of its steps between
neighbours, which keeps edges sharp (Li and Snavely, arXiv 1804.00607).
"""

from __future__ import annotations

import copy
import math
import multiprocessing
import os
import time
from argparse import Namespace
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from benchmarks.rooms.network import ROOM_FILES, RoomNet
from benchmarks.rooms.views import SCENES, TRUTH_PX, ViewKind, draw_views
from perception.networks.onnx_runtime import shrunk
from perception.networks.training.loop import LoopConfig, Progress, channels_last, train
from perception.segmentation.training.run import IGNORED
from perception.segmentation.training.unet import UNetConfig
from sim_bridge.twin.scene_file import load_scene
from uav_bt.learning.training import CALIBRATION_VIEWS
from uav_bt.learning.views import twin_views

SHAPE: Final = UNetConfig(outputs=3, channels=(24, 48, 96, 192), context=True)
DEPTH: Final = 0.7  # weight of the depth's loss beside the roles'
EDGES: Final = 0.5  # weight of the steps between neighbours within it
NEAREST, FARTHEST = 0.05, 12.0  # depth that is learned, in heights of the camera
KEPT_FARTHEST: Final = 60_000.0  # within the range of half-precision floats
REPORTED: Final = 200  # steps
KEPT: Final = 500  # steps


class RoomImages(NamedTuple):
    """Images of rooms with roles and depth, at the network's size."""

    rgb: NDArray[np.uint8]  # (N, H, W, 3)
    roles: NDArray[np.uint8]  # (N, H, W); 0 outside, 1 ground, 2 obstacle, 255 without a label
    depth: NDArray[np.float16]  # (N, H, W), along the optical axis, in heights of the camera


def render_room(scene: str, views: int, seed: int, kind: str) -> RoomImages:
    """Render images of one scene; those of kind `depth` have no labels."""
    shape = (views, TRUTH_PX[1], TRUTH_PX[0])
    rgb, roles = np.empty((*shape, 3), np.uint8), np.full(shape, IGNORED, np.uint8)
    depth = np.empty(shape, np.float16)
    for index, view in enumerate(draw_views(load_scene(scene), views, seed)):
        rgb[index] = shrunk(view.image, TRUTH_PX)
        if kind != "depth":
            roles[index] = view.ids
        depth[index] = np.minimum(view.depth / view.pose.z_m, KEPT_FARTHEST)
    return RoomImages(rgb, roles, depth)


def train_room_net(
    images: RoomImages,
    config: LoopConfig,
    augment: Callable[[Tensor, Tensor, torch.Generator], tuple[Tensor, Tensor]],
    progress: Callable[[Progress, RoomNet], None],
) -> RoomNet:
    """Train the network; `progress` is called after every step with the averaged network."""
    torch.manual_seed(config.seed)
    net = channels_last(RoomNet(SHAPE))
    stored = [torch.from_numpy(each).to(config.device) for each in images]

    def objective(rng: np.random.Generator) -> tuple[Tensor, Mapping[str, Tensor]]:
        generator = torch.Generator(config.device).manual_seed(int(rng.integers(2**62)))
        chosen = torch.from_numpy(rng.integers(0, len(images.rgb), config.batch)).to(config.device)
        rgb, roles, depth = (each[chosen] for each in stored)
        labels = torch.stack([roles.float(), depth.float()], dim=1)
        pixels, labels = augment(rgb.permute(0, 3, 1, 2).float() / 255.0, labels, generator)
        logits, log_depth = net.heads(pixels.contiguous(memory_format=torch.channels_last))
        known = labels[:, 0].round().long()
        terms = {
            "roles": functional.cross_entropy(logits, known, ignore_index=IGNORED),
            "depth": depth_loss(log_depth, labels[:, 1:]),
        }
        return terms["roles"] + DEPTH * terms["depth"], terms

    return train(net, objective, config, kind="room", about={}, progress=progress)


def depth_loss(log_depth: Tensor, truth: Tensor) -> Tensor:
    """Return the error of the logarithm of depth, (N, 1, h, w), against depth, (N, 1, H, W)."""
    truth = functional.interpolate(truth, log_depth.shape[-2:], mode="nearest")
    known = ((truth > NEAREST) & (truth < FARTHEST)).float()
    error = (log_depth - torch.log(truth.clamp(NEAREST, FARTHEST))) * known
    count = known.sum(dim=(1, 2, 3)).clamp(min=1.0)
    offset = (error.sum(dim=(1, 2, 3)) / count).view(-1, 1, 1, 1)
    shape = (error - offset).abs() * known
    steps = [
        (error[..., 1:, :] - error[..., :-1, :]).abs() * known[..., 1:, :] * known[..., :-1, :],
        (error[..., 1:] - error[..., :-1]).abs() * known[..., 1:] * known[..., :-1],
    ]
    whole = 0.5 * error.abs().sum() + shape.sum() + EDGES * sum(each.sum() for each in steps)
    return whole / known.sum().clamp(min=1.0)


def train_any(run: Namespace) -> None:
    """Render the images of rooms, train the network on them, and write its weights."""
    began_s = time.monotonic()

    def report(text: str) -> None:
        print(f"{time.monotonic() - began_s:7.1f} s  {text}", flush=True)

    def progress(now: Progress, net: RoomNet) -> None:
        if now.step % REPORTED == 0:
            report(f"step {now.step}: {now.loss:.4f} {dict(now.terms)}")
        if now.step % KEPT == 0:
            ROOM_FILES.save(run.out, copy.deepcopy(net).cpu(), notes={"steps": now.step})

    rooms = [str(scene) for scene in sorted(run.rooms.glob(SCENES))]
    jobs = [(scene, run.views, number, "all") for number, scene in enumerate(rooms)] + [
        (name, run.views, 1000 + 50 * part + number, "depth")
        for number, name in enumerate(run.depth_scenes)
        for part in range(run.depth_parts)
    ]
    spawned = multiprocessing.get_context("spawn")  # OpenGL does not survive a fork
    with ProcessPoolExecutor(run.workers or os.cpu_count(), mp_context=spawned) as pool:
        parts = list(pool.map(render_room, *zip(*jobs, strict=True)))
    images = RoomImages(*map(np.concatenate, zip(*parts, strict=True)))
    report(f"{len(images.rgb)} images of {len(jobs)} scenes")
    config = LoopConfig(steps=run.steps, batch=run.batch, average=0.999, device=run.device)
    net = train_room_net(images, config, augment_rooms, progress)
    notes = {"scenes": len(jobs), "images": len(images.rgb), "steps": config.steps}
    ROOM_FILES.save(run.out, net, notes=notes)
    report(f"network: {run.out}")


def export_any(weights: Path, rooms: Path, out: Path) -> None:
    """Write the ONNX file of a network in 8-bit integers, calibrated on images of rooms and lab."""
    images = [
        view.image
        for number, scene in enumerate(sorted(rooms.glob(SCENES))[:24])
        for kind, count in ((ViewKind.LEVEL, 4), (ViewKind.DOWN, 2))
        for view in draw_views(load_scene(str(scene)), count, number, kind=kind)
    ]
    images += [rgb for _, rgb, _ in twin_views(replace(CALIBRATION_VIEWS, views=12))]
    ROOM_FILES.export(weights, out, calibration=images)


# --- random changes of images and their labels, on whole batches and any device -------------------

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
    """Return changed images, (N, 3, H, W) float from 0 to 1, and their labels, (N, K, H, W)."""
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
    rows = torch.stack([mirror * zoom, zero, shift_x, zero, zoom, shift_y], 1).view(-1, 2, 3)
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
    rows = torch.stack([same, one, other, other, same, one, one, other, same], 1)
    return torch.einsum("nij,njhw->nihw", rows.view(-1, 3, 3), rgb)
