"""Images of generated rooms with roles and depth, and scores of segmentation networks on them."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from enum import Enum
from typing import Final

import cv2
import numpy as np

from benchmarks.lab_views import frame_of
from benchmarks.rooms.network import ROLES
from perception.segmentation.training.run import IGNORED
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import View, render_views
from uav_bt.errors import ValueRangeError
from uav_bt.lab.classes import GROUND, OBSTACLE, OUTSIDE
from uav_bt.protocols import Segmenter
from uav_bt.types.arrays import Image

SCENES: Final = "*/scenes/*[0-9].yaml"  # of rooms with a landing mark, in a folder of rooms
IMAGE_PX: Final = (448, 252)
TRUTH_PX: Final = (224, 112)
# Heights in metres and pitches in degrees: as in a flight, others, those of a landing, which is
# looked for from above and flown down to 0.2 m, and those of the views that `LandHere` uses.
FLIGHT: Final = (1.0, 1.7), (-35.0, -20.0)
WIDE: Final = (0.5, 2.3), (-60.0, 5.0)
STEEP: Final = (0.3, 2.3), (-90.0, -60.0)
STRAIGHT: Final = (0.3, 2.3), (-90.0, -85.0)
ABOVE: Final = (0.3, 1.0), (-90.0, -50.0)  # above the top of furniture that fills the view
FURNITURE_M: Final = (0.3, 1.3)  # height of such furniture
CLEAR_M: Final = 0.25  # between the camera and any surface
TRIES: Final = 20_000
SCALE_OFF: Final = 0.2
FEWEST: Final = 100  # ground pixels for a scale


class ViewKind(Enum):
    """Where the camera is and where it points."""

    MIXED = "mixed"  # half as in a flight, the others wide, steep, and close above furniture
    LEVEL = "level"  # as in a flight
    DOWN = "down"  # within 5 degrees of straight down, as before a landing


def draw_poses(
    scene: Scene, rng: np.random.Generator, count: int, kind: ViewKind = ViewKind.MIXED
) -> list[CameraPose]:
    """Return camera poses that keep clear of walls and objects."""
    low, high = FURNITURE_M
    tops = [each for each in scene.ground_plan.standing if low <= each.height_m <= high]
    half = np.array(scene.ground.size_m) / 2 - CLEAR_M
    poses: list[CameraPose] = []
    for _ in range(TRIES):
        if len(poses) == count:
            return poses
        ranges, over_m = _ranges(rng, kind), 0.0
        if ranges == ABOVE and not tops:
            ranges = STEEP
        if ranges == ABOVE:
            top = tops[int(rng.integers(len(tops)))]
            ahead, side = rng.uniform(-0.9, 0.9, 2).tolist()
            outline, over_m = top.footprint, top.height_m
            x_m, y_m = outline.to_world(ahead * outline.half_x_m, side * outline.half_y_m)
        else:
            x_m, y_m = rng.uniform(-half, half).tolist()
        z_m, pitch_deg = (float(rng.uniform(*each)) for each in ranges)
        z_m += over_m
        if all(
            z_m > block.top_m + CLEAR_M
            or z_m < block.base_m - CLEAR_M
            or block.footprint.distance_m(x_m, y_m) > CLEAR_M
            for standing in scene.ground_plan.standing
            for block in standing.blocks
        ):
            yaw_rad, pitch_rad = float(rng.uniform(-math.pi, math.pi)), math.radians(pitch_deg)
            poses.append(
                CameraPose(x_m=x_m, y_m=y_m, z_m=z_m, yaw_rad=yaw_rad, pitch_rad=pitch_rad)
            )
    raise ValueRangeError(f"scene '{scene.name}': the objects leave no room for a camera")


_Range = tuple[float, float]


def _ranges(rng: np.random.Generator, kind: ViewKind) -> tuple[_Range, _Range]:
    if kind is ViewKind.DOWN:
        return STRAIGHT
    share = rng.random()
    if share < 0.5:
        return FLIGHT
    if share < 0.72 or kind is ViewKind.LEVEL:
        return WIDE
    if share < 0.9:
        return STRAIGHT if rng.random() < 0.5 else STEEP
    return ABOVE


def role_numbers(roles: Image) -> Image:
    """Return the network's numbers of roles: 0 outside, 1 ground, 2 obstacle; a mark has none."""
    table = np.full(256, IGNORED, np.uint8)
    table[[OUTSIDE, GROUND, OBSTACLE]] = range(3)
    return table[roles]


def draw_views(
    scene: Scene, count: int, seed: int, *, kind: ViewKind = ViewKind.MIXED
) -> Iterator[View]:
    """Render a room from random poses, with the numbers of roles as ids; a seed repeats them."""
    rng = np.random.default_rng(seed)
    poses = draw_poses(scene, rng, count, kind)
    if kind is ViewKind.LEVEL:
        flown = [math.radians(float(rng.uniform(-32.0, -22.0))) for _ in poses]
        poses = [
            replace(pose, z_m=max(pose.z_m, 1.0), pitch_rad=pitch_rad)
            for pose, pitch_rad in zip(poses, flown, strict=True)
        ]
    for view in render_views(
        scene,
        poses,
        size_px=IMAGE_PX,
        truth_size_px=TRUTH_PX,
        profile=Profile.named("lab"),
        vary_light=True,
        seed=seed,
    ):
        yield replace(view, ids=role_numbers(scene.classes.roles(view.ids)))


def score_rooms(
    segmenter: Segmenter, scenes: Sequence[str], views: int, kind: ViewKind = ViewKind.LEVEL
) -> list[str]:
    """Return the scores of a network by role, on some views in each of the rooms, as text."""
    confusion = np.zeros((3, 3), np.int64)  # pixels of each role that were called each role
    scales: list[float] = []  # of relative depth, over the camera's height, where ground is seen
    spent_s: list[float] = []
    for number, name in enumerate(scenes):
        for view in draw_views(load_scene(name), views, number, kind=kind):
            began_s = time.perf_counter()
            roles = segmenter.segment(frame_of(view)).roles
            spent_s.append(time.perf_counter() - began_s)
            small = cv2.resize(roles, TRUTH_PX, interpolation=cv2.INTER_NEAREST)
            called, ground = role_numbers(np.asarray(small, np.uint8)), small == GROUND
            known = (view.ids != IGNORED) & (called != IGNORED)
            np.add.at(confusion, (view.ids[known], called[known]), 1)
            depth = getattr(segmenter, "relative_depth", None)
            if depth is not None and ground.sum() > FEWEST:
                relative = cv2.resize(depth.depth, TRUTH_PX, interpolation=cv2.INTER_LINEAR)
                ratio = float(np.median(view.depth[ground] / relative[ground]))
                scales.append(ratio / view.pose.z_m)
    right = np.diag(confusion)
    recall, precision = right / confusion.sum(1), right / confusion.sum(0)
    union = confusion.sum(0) + confusion.sum(1) - right
    rows = ["role: recall, precision, IoU"]
    for role, *values in zip(ROLES, recall, precision, right / union, strict=True):
        rows.append(f"{role}: " + ", ".join(f"{value:.3f}" for value in values))
    if scales:
        near = np.abs(np.log(scales)) < np.log(1.0 + SCALE_OFF)
        share = f"{near.mean():.1%} of {near.size} images"
        rows.append(f"scale within {SCALE_OFF:.0%} of the height: {share}")
    return [*rows, f"{1e3 * float(np.median(spent_s)):.1f} ms an image"]
