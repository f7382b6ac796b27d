"""Images of many rooms as arrays, rendered by several processes."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import Final

import numpy as np

from benchmarks.rooms.room_views import TRUTH_PX, draw_views
from perception.networks.onnx_runtime import shrunk
from perception.networks.training.room_run import RoomImages
from perception.segmentation.training.run import IGNORED
from sim_bridge.twin.scene_file import load_scene
from uav_bt.progress import Advance, silent

FARTHEST: Final = 60_000.0  # within the range of half-precision floats


@dataclass(frozen=True, kw_only=True)
class RoomJob:
    """Images of one scene.

    Attributes:
        scene: Name or file of the scene.
        views: Number of images.
        seed: Seed of poses, light and noise.
        labelled: Whether the roles are labels; otherwise only the depth is.
    """

    scene: str
    views: int
    seed: int
    labelled: bool = True


def render_rooms(
    jobs: Sequence[RoomJob], workers: int = 0, *, advance: Advance = silent
) -> RoomImages:
    """Render the images of many scenes; the same jobs give the same images.

    Args:
        jobs: The images.
        workers: Number of processes; 0: one for each core.
        advance: Called after each scene.
    """
    spawned = multiprocessing.get_context("spawn")  # OpenGL does not survive a fork
    parts = []
    with ProcessPoolExecutor(workers or os.cpu_count(), mp_context=spawned) as pool:
        for done, part in enumerate(pool.map(_render, jobs), start=1):
            parts.append(part)
            advance("rooms", done, len(jobs))
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
