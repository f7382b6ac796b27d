"""Scores of segmentation networks on images of generated rooms, by roles."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.rooms.network import ROLES
from benchmarks.rooms.room_views import ROLE_IDS, RoomView, ViewKind, draw_views
from perception.segmentation.training.run import IGNORED
from sim_bridge.twin.scene_file import load_scene
from uav_bt.lab.classes import GROUND
from uav_bt.protocols import Segmenter
from uav_bt.types import Frame

SCALE_OFF: Final = 0.2
FEWEST: Final = 100  # ground pixels for a scale


@dataclass(frozen=True, kw_only=True)
class RoomScore:
    """Score of a network."""

    confusion: NDArray[np.int64]  # (3, 3) pixels of each role that were called each role
    scales: NDArray[np.float64]  # of relative depth, over the camera's height, where ground is seen
    milliseconds: float  # median time of an image

    def lines(self) -> list[str]:
        """Return the scores as text."""
        right = np.diag(self.confusion)
        recall, precision = right / self.confusion.sum(1), right / self.confusion.sum(0)
        union = self.confusion.sum(0) + self.confusion.sum(1) - right
        rows = ["role: recall, precision, IoU"]
        for role, *values in zip(ROLES, recall, precision, right / union, strict=True):
            rows.append(f"{role}: " + ", ".join(f"{value:.3f}" for value in values))
        if self.scales.size:
            near = np.abs(np.log(self.scales)) < np.log(1.0 + SCALE_OFF)
            share = f"{near.mean():.1%} of {near.size} images"
            rows.append(f"scale within {SCALE_OFF:.0%} of the height: {share}")
        return [*rows, f"{self.milliseconds:.1f} ms an image"]


def score_rooms(
    segmenter: Segmenter, scenes: Sequence[str], views: int, kind: ViewKind = ViewKind.LEVEL
) -> RoomScore:
    """Score a network on some views in each of the rooms."""
    confusion = np.zeros((3, 3), np.int64)
    scales: list[float] = []
    spent_s: list[float] = []
    for number, name in enumerate(scenes):
        for view in draw_views(load_scene(name), views, number, kind=kind):
            pitch_rad = view.pose.pitch_rad
            frame = Frame(image=view.rgb, index=0, captured_s=0.0, gimbal_pitch_rad=pitch_rad)
            began_s = time.perf_counter()
            roles = segmenter.segment(frame).roles
            spent_s.append(time.perf_counter() - began_s)
            _count(confusion, view, roles)
            depth = getattr(segmenter, "relative_depth", None)
            size = view.roles.shape[::-1]
            ground = cv2.resize(roles, size, interpolation=0) == GROUND
            if depth is not None and ground.sum() > FEWEST:
                relative = cv2.resize(depth.depth, size, interpolation=cv2.INTER_LINEAR)
                ratio = float(np.median(view.depth_m[ground] / relative[ground]))
                scales.append(ratio / view.pose.z_m)
    median_ms = 1e3 * float(np.median(spent_s))
    return RoomScore(confusion=confusion, scales=np.array(scales), milliseconds=median_ms)


def _count(confusion: NDArray[np.int64], view: RoomView, roles: NDArray[np.uint8]) -> None:
    """Count the pixels by true and called role; a mark has no role of these."""
    table = np.full(256, IGNORED, np.uint8)
    for role, number in ROLE_IDS.items():
        table[role] = number
    called = table[cv2.resize(roles, view.roles.shape[::-1], interpolation=cv2.INTER_NEAREST)]
    known = (view.roles != IGNORED) & (called != IGNORED)
    np.add.at(confusion, (view.roles[known], called[known]), 1)
