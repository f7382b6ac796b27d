"""Images of many rooms, and training and export of the network `any` on them.

Roles have a cross-entropy. Depth has the absolute error of its logarithm, with and without the
median offset of each image (Eigen et al., arXiv 1406.2283), and the error of its steps between
neighbours, which keeps edges sharp (Li and Snavely, arXiv 1804.00607).
"""

from __future__ import annotations

import copy
import multiprocessing
import os
import time
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from benchmarks.rooms.augment import augment_rooms
from benchmarks.rooms.network import ROOM_FILES, RoomNet
from benchmarks.rooms.room_views import TRUTH_PX, ViewKind, draw_views
from perception.networks.onnx_runtime import shrunk
from perception.networks.training.loop import (
    LoopConfig,
    Progress,
    channels_last,
    train,
)
from perception.segmentation.training.run import IGNORED
from perception.segmentation.training.unet import UNetConfig
from sim_bridge.twin.scene_file import load_scene
from uav_bt.learning.exporting import CALIBRATION_VIEWS
from uav_bt.learning.views import twin_views

SCENES: Final = "*/scenes/*[0-9].yaml"
"""Scenes of rooms with a landing mark, in a folder of rooms."""

SHAPE: Final = UNetConfig(outputs=3, channels=(24, 48, 96, 192), context=True)
DEPTH: Final = 0.7  # weight of the depth's loss beside the roles'
EDGES: Final = 0.5  # weight of the steps between neighbours within it
NEAREST, FARTHEST = 0.05, 12.0  # depth that is learned, in heights of the camera
KEPT_FARTHEST: Final = 60_000.0  # within the range of half-precision floats
REPORTED: Final = 200  # steps
KEPT: Final = 500  # steps


@dataclass(frozen=True, kw_only=True)
class RoomJob:
    """Images of one scene; without labels they teach depth only."""

    scene: str
    views: int
    seed: int
    labelled: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class RoomImages:
    """Images of rooms with roles and depth, at the network's size."""

    rgb: NDArray[np.uint8]  # (N, H, W, 3)
    roles: NDArray[np.uint8]  # (N, H, W); 0 outside, 1 ground, 2 obstacle, 255 without a label
    depth: NDArray[np.float16]  # (N, H, W), along the optical axis, in heights of the camera


def render_rooms(jobs: Sequence[RoomJob], workers: int) -> RoomImages:
    """Render the images of many scenes in some processes, one for each core if `workers` is 0."""
    spawned = multiprocessing.get_context("spawn")  # OpenGL does not survive a fork
    with ProcessPoolExecutor(workers or os.cpu_count(), mp_context=spawned) as pool:
        parts = list(pool.map(_render, jobs))
    return RoomImages(
        rgb=np.concatenate([part.rgb for part in parts]),
        roles=np.concatenate([part.roles for part in parts]),
        depth=np.concatenate([part.depth for part in parts]),
    )


def _render(job: RoomJob) -> RoomImages:
    shape = (job.views, TRUTH_PX[1], TRUTH_PX[0])
    rgb, roles = np.empty((*shape, 3), np.uint8), np.full(shape, IGNORED, np.uint8)
    depth = np.empty(shape, np.float16)
    for index, view in enumerate(draw_views(load_scene(job.scene), job.views, job.seed)):
        rgb[index] = shrunk(view.rgb, TRUTH_PX)
        if job.labelled:
            roles[index] = view.roles
        depth[index] = np.minimum(view.depth_m / view.pose.z_m, KEPT_FARTHEST)
    return RoomImages(rgb=rgb, roles=roles, depth=depth)


def train_room_net(
    images: RoomImages,
    config: LoopConfig,
    *,
    augment: Callable[[Tensor, Tensor, torch.Generator], tuple[Tensor, Tensor]] = augment_rooms,
    progress: Callable[[Progress, RoomNet], None] | None = None,
) -> RoomNet:
    """Train the network; `progress` is called after every step with the averaged network."""
    torch.manual_seed(config.seed)
    net = channels_last(RoomNet(SHAPE))
    stored = [
        torch.from_numpy(each).to(config.device)
        for each in (images.rgb, images.roles, images.depth)
    ]

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

    jobs = [
        RoomJob(scene=str(scene), views=run.views, seed=number)
        for number, scene in enumerate(sorted(run.rooms.glob(SCENES)))
    ] + [
        RoomJob(scene=name, views=run.views, seed=1000 + 50 * part + number, labelled=False)
        for number, name in enumerate(run.depth_scenes)
        for part in range(run.depth_parts)
    ]
    images = render_rooms(jobs, run.workers)
    report(f"{len(images.rgb)} images of {len(jobs)} scenes")
    config = LoopConfig(steps=run.steps, batch=run.batch, average=0.999, device=run.device)
    net = train_room_net(images, config, progress=progress)
    notes = {"scenes": len(jobs), "images": len(images.rgb), "steps": config.steps}
    ROOM_FILES.save(run.out, net, notes=notes)
    report(f"network: {run.out}")


def export_any(weights: Path, rooms: Path, out: Path) -> None:
    """Write the ONNX file of a network in 8-bit integers, calibrated on images of rooms and lab."""
    images = [
        view.rgb
        for number, scene in enumerate(sorted(rooms.glob(SCENES))[:24])
        for kind, count in ((ViewKind.LEVEL, 4), (ViewKind.DOWN, 2))
        for view in draw_views(load_scene(str(scene)), count, number, kind=kind)
    ]
    images += [rgb for _, rgb, _ in twin_views(replace(CALIBRATION_VIEWS, views=12))]
    ROOM_FILES.export(weights, out, calibration=images)
