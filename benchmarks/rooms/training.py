"""Images of many rooms, and training and export of the network `any` on them."""

from __future__ import annotations

import copy
import multiprocessing
import os
import time
from argparse import Namespace
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.rooms.room_views import TRUTH_PX, ViewKind, draw_views
from perception.networks.onnx_runtime import shrunk
from perception.networks.training.room_net import ROOM_FILES, RoomNet
from perception.networks.training.room_run import (
    Progress,
    RoomImages,
    RoomTrainingConfig,
    train_room_net,
)
from perception.segmentation.training.run import IGNORED
from sim_bridge.twin.scene_file import load_scene
from uav_bt.learning.exporting import CALIBRATION_VIEWS
from uav_bt.learning.views import twin_views

SCENES: Final = "*/scenes/*[0-9].yaml"
"""Scenes of rooms with a landing mark, in a folder of rooms."""

FARTHEST: Final = 60_000.0  # within the range of half-precision floats
REPORTED: Final = 200  # steps
KEPT: Final = 500  # steps


@dataclass(frozen=True, kw_only=True)
class RoomJob:
    """Images of one scene; without labels they teach depth only."""

    scene: str
    views: int
    seed: int
    labelled: bool = True


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
    scene = load_scene(job.scene)
    for index, view in enumerate(draw_views(scene, job.views, job.seed)):
        rgb[index] = shrunk(view.rgb, TRUTH_PX)
        if job.labelled:
            roles[index] = view.roles
        depth[index] = np.minimum(view.depth_m / view.pose.z_m, FARTHEST)
    return RoomImages(rgb=rgb, roles=roles, depth=depth)


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
    config = RoomTrainingConfig(
        steps=run.steps, batch=run.batch, learning_rate=3e-3, average=0.999, device=run.device
    )
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
