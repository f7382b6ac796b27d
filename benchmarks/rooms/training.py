"""Training and export of the network `any` on images of rooms."""

from __future__ import annotations

import copy
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from benchmarks.rooms.collection import RoomJob, render_rooms
from benchmarks.rooms.room_views import ViewKind, draw_views
from perception.networks.training.room_net import ROOM_FILES, RoomNet
from perception.networks.training.room_run import Progress, RoomTrainingConfig, train_room_net
from sim_bridge.twin.scene_file import load_scene
from uav_bt.learning.exporting import CALIBRATION_VIEWS
from uav_bt.learning.views import twin_views

SCENES: Final = "*/scenes/*[0-9].yaml"
"""Scenes of rooms with a landing mark, in a folder of rooms."""

REPORTED: Final = 200  # steps
KEPT: Final = 500  # steps
NEVER: Final = 10**9


@dataclass(frozen=True, kw_only=True)
class RoomTraining:
    """A training run.

    Attributes:
        rooms: Folder of rooms.
        views: Images of each room.
        depth_scenes: Scenes that teach depth and no roles, so that their roles stay unseen.
        depth_parts: Sets of images of each of those scenes.
        workers: Processes that render; 0: one for each core.
        start: Weights to begin with; None: random ones.
        checkpoint: File of the run's state, to go on from; None: none.
        out: The weights.
    """

    rooms: Path
    views: int
    depth_scenes: Sequence[str]
    depth_parts: int
    workers: int
    start: Path | None
    checkpoint: Path | None
    out: Path


def train_any(run: RoomTraining, config: RoomTrainingConfig) -> None:
    """Render the images of rooms, train the network on them, and write its weights.

    Args:
        run: Rooms and files.
        config: How to train.
    """
    began_s = time.monotonic()

    def report(text: str) -> None:
        print(f"{time.monotonic() - began_s:7.1f} s  {text}", flush=True)

    def advance(_stage: str, done: int, total: int) -> None:
        if done % 25 == 0:
            report(f"{done} of {total} scenes")

    def progress(now: Progress, net: RoomNet) -> None:
        if now.step % REPORTED == 0:
            report(f"step {now.step}: {now.loss:.4f} {dict(now.terms)}")
        if now.step % KEPT == 0:
            ROOM_FILES.save(run.out, copy.deepcopy(net).cpu(), notes={"steps": now.step})

    jobs = _jobs(run)
    images = render_rooms(jobs, run.workers, advance=advance)
    report(f"{len(images.rgb)} images of {len(jobs)} scenes")
    net = train_room_net(
        images,
        replace(config, checkpoint_every=REPORTED if run.checkpoint else NEVER),
        start=None if run.start is None else ROOM_FILES.load(run.start)[0],
        checkpoint=run.checkpoint,
        progress=progress,
    )
    notes = {"scenes": len(jobs), "images": len(images.rgb), "steps": config.steps}
    ROOM_FILES.save(run.out, net, notes=notes)
    report(f"network: {run.out}")


def _jobs(run: RoomTraining) -> list[RoomJob]:
    rooms = [
        RoomJob(scene=str(scene), views=run.views, seed=number)
        for number, scene in enumerate(sorted(run.rooms.glob(SCENES)))
    ]
    depth = [
        RoomJob(scene=name, views=run.views, seed=1000 + 50 * part + number, labelled=False)
        for number, name in enumerate(run.depth_scenes)
        for part in range(run.depth_parts)
    ]
    return rooms + depth


def export_any(weights: Path, rooms: Path, out: Path) -> None:
    """Write the ONNX file of a network in 8-bit integers, calibrated on images of rooms and lab.

    Args:
        weights: The weights.
        rooms: Folder of rooms.
        out: The ONNX file.
    """
    images = [
        view.rgb
        for number, scene in enumerate(sorted(rooms.glob(SCENES))[:24])
        for kind, count in ((ViewKind.LEVEL, 4), (ViewKind.DOWN, 2))
        for view in draw_views(load_scene(str(scene)), count, number, kind=kind)
    ]
    images += [rgb for _, rgb, _ in twin_views(replace(CALIBRATION_VIEWS, views=12))]
    ROOM_FILES.export(weights, out, calibration=images)
