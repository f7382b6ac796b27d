"""Fit the confidence of the scale of depth, and compare it with the scale's error.

    python -m benchmarks.confidence fit --rooms runs/rooms/val     # coefficients, training scenes
    python -m benchmarks.confidence val --rooms runs/rooms/val2    # the table, validation scenes
    python -m benchmarks.confidence test --rooms runs/rooms/flown  # testing scenes

A pose is a sequence of three rendered frames, with right and with wrong inputs. Each lab is judged
with the networks that it is flown with. The exact scale is the median ratio of exact to predicted
depth on the ground in view or, with little ground, up to 6 m.
"""

from __future__ import annotations

import argparse
import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import cv2
import numpy as np
from scipy.optimize import minimize

from benchmarks.lab_views import frame_of
from benchmarks.segmentation import scenes_of
from perception.camera.ground_plane import CameraView, ground_depth
from perception.depth.runtime import load_depth_estimator
from perception.depth.scale import AdaptiveScale, sample_ground
from perception.networks.weights_file import SHIPPED_DEPTHS, SHIPPED_UNET, segmentation_file
from perception.segmentation.runtime import load_segmenter
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import View, render_views
from uav_bt.app.site import network_of
from uav_bt.lab.classes import GROUND, MARK, OUTSIDE
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import load_lab
from uav_bt.learning.views import DepthViewPlan, scene_seed
from uav_bt.protocols import DepthEstimator, Segmenter

WRONG_WEIGHT: Final = 20.0  # right scales that a wrong one counts as; chosen on validation scenes
_PENALTY: Final = 1e-4  # of the squared coefficients
_RIGHT: Final = ("own network", "pitch wrong", "height wrong")  # with that network's class map
_MAP_PX: Final = (224, 112)  # width and height of class maps, and so of the depth in flight
_TURN_RAD: Final = math.radians(4)  # from frame to frame
_ADVANCE_M, _APART_S = 0.06, 0.1
_ENOUGH_PX: Final = 200  # of exact depth, for an exact scale
Networks = tuple[DepthEstimator, Segmenter, Segmenter]
_CHANNELS: Final = ([2, 0, 1], [1, 2, 0], [0, 2, 1])  # other orders of red, green and blue


class JudgedScale(NamedTuple):
    """The scale of one frame, and its error."""

    lab: str
    condition: str
    over_exact: float  # the scale's factor over the exact one
    confidence: float
    measures: dict[str, float]  # of the ground, 0 to 1; empty where earlier frames gave the scale

    @property
    def right(self) -> bool:
        """Whether the scale is within a fifth of the exact one."""
        return abs(math.log(self.over_exact)) <= math.log(1.2)


def judged_scales(split: str, views: int, seed: int, rooms: Path | None) -> Iterator[JudgedScale]:
    """Judge the scales of views of rooms and of both labs."""
    paper, depot = load_lab(), load_lab("depot")
    furnished = [] if rooms is None else map(load_lab, sorted(rooms.iterdir()))
    for name, lab, other, count in (
        *(("room", room, depot, max(1, views // 6)) for room in furnished),
        *((paper.name, paper, depot, views), (depot.name, depot, paper, views)),
    ):
        depth = load_depth_estimator(network_of(lab).get("depth", SHIPPED_DEPTHS[0]))
        networks = depth, _segmenter(lab), _segmenter(other)
        for scene in scenes_of(lab, lab.folder.name if name == "room" else f"*{split}-*"):
            for number, sequence in enumerate(_sequences(scene, count, seed)):
                key = len(lab.folder.name) if name == "room" else number
                rng = np.random.default_rng((seed, key))
                yield from _scales(name, lab, networks, sequence, rng)


def _sequences(name: str, views: int, seed: int) -> Iterator[list[View]]:
    """Render sequences of a slowly turning and advancing camera."""
    scene = load_scene(name)
    mixed = scene_seed(seed, scene)
    rng, poses = np.random.default_rng(mixed), []
    for pose in DepthViewPlan(scenes=(name,), views=views).poses(scene, mixed):
        turn = _TURN_RAD if rng.random() < 0.5 else -_TURN_RAD
        for step in range(3):
            x_m = pose.x_m + step * _ADVANCE_M * math.cos(pose.yaw_rad)
            y_m = pose.y_m + step * _ADVANCE_M * math.sin(pose.yaw_rad)
            poses.append(replace(pose, x_m=x_m, y_m=y_m, yaw_rad=pose.yaw_rad + step * turn))
    profile = Profile.named("lab")
    drawn = render_views(scene, poses, truth_size_px=_MAP_PX, profile=profile, seed=mixed)
    yield from map(list, zip(drawn, drawn, drawn, strict=True))


def _segmenter(lab: Lab) -> Segmenter:
    if (file := segmentation_file(network_of(lab).get("model", SHIPPED_UNET))) is None:
        raise SystemExit(f"the lab {lab.name} is flown without a network")
    return load_segmenter(file, lab.classes, threads=2)


def _scales(
    name: str, lab: Lab, networks: Networks, views: Sequence[View], rng: Any
) -> Iterator[JudgedScale]:
    """Judge the scales of one sequence."""
    camera, (width_px, height_px) = anafi_camera(640, 360).resized(*_MAP_PX), _MAP_PX
    (up, higher), patch = rng.choice((-1.0, 1.0), 2), np.zeros((height_px, width_px), dtype=bool)
    top, left = rng.integers(30, height_px - 30), rng.integers(0, width_px - 40)
    rows, columns = rng.integers(12, 40), rng.integers(20, 60)
    patch[top : top + rows, left : left + columns] = True
    wrong_rad = up * math.radians(rng.uniform(2.0, 7.0))
    wrong_height = 1.0 + higher * rng.uniform(0.03, 0.1)
    for channels in (None, _CHANNELS[rng.integers(len(_CHANNELS))]):
        scales: defaultdict[str, AdaptiveScale] = defaultdict(AdaptiveScale)
        for step, view in enumerate(views):
            shown = view.image if channels is None else view.image[..., channels]
            frame = frame_of(replace(view, image=np.ascontiguousarray(shown)), step)
            depth, roles = networks[0].estimate(frame), lab.classes.roles(view.ids)
            relative = np.asarray(cv2.resize(depth.depth, _MAP_PX), dtype=np.float32)
            near = (view.depth > 0.3) & (view.depth < 6.0)
            near = ground if (ground := near & (roles == GROUND)).sum() > _ENOUGH_PX else near
            if near.sum() <= _ENOUGH_PX:
                continue
            exact = float(np.median(view.depth[near] / relative[near]))
            own, other = (
                cv2.resize(each.segment(frame).is_ground.astype(np.uint8), _MAP_PX, interpolation=0)
                for each in networks[1:]
            )
            above = roles >= MARK
            cases: dict[str, Any] = {"own network": own, "other lab's network": other}
            if channels is None:
                cases |= {"pitch wrong": own, "height wrong": own}
                cases |= {"outside as ground": roles == OUTSIDE, "obstacles as ground": above}
                cases |= {"a patch as ground": patch, "everything as ground": np.ones_like(own)}
            for condition, each in cases.items():
                off_rad = wrong_rad if condition == "pitch wrong" else 0.0
                factor = wrong_height if condition == "height wrong" else 1.0
                pitch_rad = max(-math.pi / 2, view.pose.pitch_rad + off_rad)
                height_m = factor * view.pose.z_m
                seen = CameraView(camera=camera, pitch_rad=pitch_rad, height_m=height_m)
                sample = sample_ground(relative, each.astype(bool), ground_depth(seen), rng)
                known_m = height_m if depth.in_heights else None
                found = scales[condition](sample, step * _APART_S, known_m)
                if found is not None:
                    measures = {key: of for key, (of, _) in found.confidence.measures.items()}
                    colours = "" if channels is None else ", other colours"
                    sure, off = found.confidence.value or 0.0, found.factor / exact
                    yield JudgedScale(name, condition + colours, off, sure, measures)


def fitted(judged: Sequence[JudgedScale], wrong_weight: float = WRONG_WEIGHT) -> dict[str, float]:
    """Return the intercept and the coefficients, none negative, of a logistic regression."""
    own = [each for each in judged if each.measures]
    names = list(own[0].measures)
    values = np.array([[each.measures[name] for name in names] for each in own])
    right = np.array([each.right for each in own], dtype=float)
    weights = np.where(right > 0.0, 1.0, wrong_weight)
    weights /= weights.sum()

    def loss(given: np.ndarray) -> float:
        logits = (2.0 * right - 1.0) * (given[0] + values @ given[1:])
        return float(weights @ np.logaddexp(0.0, -logits) + _PENALTY * (given[1:] ** 2).sum())

    limits = [(None, None), *[(0.0, None)] * len(names)]
    begin = np.r_[0.0, np.ones(len(names))]
    found = minimize(loss, begin, bounds=limits, method="L-BFGS-B", options={"ftol": 1e-14})
    return dict(zip(("intercept", *names), found.x.tolist(), strict=True))


def table(judged: Sequence[JudgedScale]) -> str:
    """Return shares of the scales by confidence, by lab and condition, and by lab."""
    tenths = [f"{tenth / 10:.1f} to {(tenth + 1) / 10:.1f}" for tenth in range(10)]
    parts: dict[str, list[JudgedScale]] = {tenth: [] for tenth in tenths}
    for each in judged:
        tenth = tenths[min(9, int(10.0 * each.confidence))]
        own = [f"{each.lab}, its own network"] * (each.condition in _RIGHT)
        for name in (tenth, f"{each.lab}, {each.condition}", *own, "all"):
            parts.setdefault(name, []).append(each)
    lines = []
    for name, part in parts.items():
        right = [each.right for each in part]
        sure = [each.right for each in part if each.confidence > 0.5]
        worst = math.exp(max((abs(math.log(each.over_exact)) for each in part), default=0.0))
        lines.append(
            f"{name}: {len(part)} scales, {sum(right)} right, worst factor {worst:.2f}; "
            f"over 0.5: {sum(sure)} of the right, {len(sure) - sum(sure)} wrong"
        )
    return "\n".join(lines)


def main() -> None:
    """Print coefficients or the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=("fit", "train", "val", "test"))
    parser.add_argument("--views", type=int, default=40, help="poses of a scene")
    parser.add_argument("--seed", type=int, default=31)
    parser.add_argument("--rooms", type=Path, help="folder of generated rooms")
    given = parser.parse_args()
    split = "train" if given.what == "fit" else given.what
    judged = list(judged_scales(split, given.views, given.seed, given.rooms))
    if given.what != "fit":
        print(table(judged))
        return
    for part in (False, True):  # without and with depth in heights
        for name, value in fitted([s for s in judged if ("height" in s.measures) is part]).items():
            print(f"{name}: {value:.2f}")


if __name__ == "__main__":
    main()
