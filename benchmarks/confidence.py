"""Fit the confidence of the scale of depth, and compare it with the scale's error.

    python -m benchmarks.confidence train --rooms runs/rooms/val/*  # coefficients to ship
    python -m benchmarks.confidence test --rooms runs/rooms/flown/*  # counts to report

A scale comes from one image, with right or with wrong inputs, as on a drone that has just taken
off. Each lab is judged with the networks that it is flown with. The exact scale is the median ratio
of exact to predicted depth on the ground in view or, with little ground, up to 6 m.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.optimize import minimize

from benchmarks.segmentation import load_network, scenes_of
from perception.camera.ground_plane import ground_depth, view_of
from perception.depth.runtime import load_depth_estimator
from perception.depth.scale import AdaptiveScale, resized, sample_ground
from perception.networks.weights_file import SHIPPED_DEPTHS, SHIPPED_UNET
from uav_bt.app.site import network_of
from uav_bt.lab.classes import GROUND, MARK, OUTSIDE
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import load_lab
from uav_bt.learning.views import MAP_SIZE_PX, VIDEO, DepthViewPlan, SampleImage, take_images
from uav_bt.types.arrays import Flags

WRONG_WEIGHT: Final = 20.0  # right scales that a wrong one counts as; chosen on validation scenes
_PENALTY: Final = 1e-4  # of the squared coefficients
_SEED: Final = 31
_ENOUGH_PX: Final = 200  # of exact depth, for an exact scale
Wrong = tuple[Flags, float, float]  # what is taken for the ground, errors of pitch and height


class JudgedScale(NamedTuple):
    """The scale of one image."""

    condition: str  # with the lab's name
    right: bool  # within a fifth of the exact scale
    confidence: float
    measures: dict[str, float]  # of the ground, 0 to 1


def judged_scales(split: str, views: int, rooms: Sequence[str]) -> Iterator[JudgedScale]:
    """Judge the scales of views of rooms and of both labs."""
    paper, depot = load_lab(), load_lab("depot")
    labs = [("room", load_lab(room), depot, max(1, views // 6)) for room in rooms]
    labs += [(paper.name, paper, depot, views), (depot.name, depot, paper, views)]
    for name, lab, other, count in labs:
        scenes = scenes_of(lab, lab.folder.name if name == "room" else f"*{split}-*")
        plan = DepthViewPlan(scenes=scenes, views=count, seed=_SEED)
        network = load_depth_estimator(network_of(lab).get("depth", SHIPPED_DEPTHS[0]))
        for flown in (lab, other):
            rng = np.random.default_rng(_SEED)
            segmenter = load_network(network_of(flown).get("model", SHIPPED_UNET), flown.classes)
            for image in take_images(plan, "unet", segmenter, network):
                cases = {"other lab's network": (image.seen.is_ground, 0.0, 0.0)}
                for case, wrong in (planted(image, lab, rng) if flown is lab else cases).items():
                    if judged := judge(f"{name}, {case}", image, lab, wrong, rng):
                        yield judged


def planted(image: SampleImage, lab: Lab, rng: np.random.Generator) -> dict[str, Wrong]:
    """Return the inputs of a lab's own network, right and with planted errors."""
    own, roles = image.seen.is_ground, lab.classes.roles(image.exact.ids)
    (up, higher), (height_px, width_px) = rng.choice((-1.0, 1.0), 2), roles.shape
    top, left = rng.integers(30, height_px - 30), rng.integers(0, width_px - 40)
    patch = np.zeros_like(own)
    patch[top : top + rng.integers(12, 40), left : left + rng.integers(20, 60)] = True
    return {
        "own network": (own, 0.0, 0.0),
        "pitch wrong": (own, up * math.radians(rng.uniform(2.0, 7.0)), 0.0),
        "height wrong": (own, 0.0, higher * rng.uniform(0.03, 0.1)),
        "outside as ground": (roles == OUTSIDE, 0.0, 0.0),
        "obstacles as ground": (roles >= MARK, 0.0, 0.0),
        "a patch as ground": (patch, 0.0, 0.0),
        "everything as ground": (np.ones_like(own), 0.0, 0.0),
    }


def judge(
    condition: str, image: SampleImage, lab: Lab, wrong: Wrong, rng: np.random.Generator
) -> JudgedScale | None:
    """Judge the scale of an image from wrong inputs by the exact one; None without a scale."""
    (taken, off_rad, off), true = wrong, view_of(image.frame, VIDEO, MAP_SIZE_PX)
    pitch_rad = max(-math.pi / 2, true.pitch_rad + off_rad)
    view = replace(true, pitch_rad=pitch_rad, height_m=(1.0 + off) * true.height_m)
    near = (image.depth_m > 0.3) & (image.depth_m < 6.0)
    ground = near & (lab.classes.roles(image.exact.ids) == GROUND)
    near = ground if ground.sum() > _ENOUGH_PX else near
    if image.relative is None or near.sum() <= _ENOUGH_PX:
        return None
    depth, known_m = resized(image.relative.depth, near.shape), view.height_m
    sample = sample_ground(depth, taken, ground_depth(view), rng)
    found = AdaptiveScale()(sample, 0.0, known_m if image.relative.in_heights else None)
    if found is None:
        return None
    over_exact = found.factor / float(np.median(image.depth_m[near] / depth[near]))
    measures = {key: of for key, (of, _) in found.confidence.measures.items()}
    is_right = abs(math.log(over_exact)) <= math.log(1.2)
    return JudgedScale(condition, is_right, found.confidence.value or 0.0, measures)


def fitted(judged: Sequence[JudgedScale], wrong_weight: float = WRONG_WEIGHT) -> dict[str, float]:
    """Return the intercept and the coefficients, none negative, of a logistic regression."""
    values = np.array([list(each.measures.values()) for each in judged])
    right = np.array([each.right for each in judged])

    def loss(given: np.ndarray) -> float:
        logits = np.where(right, 1.0, -1.0) * (given[0] + values @ given[1:])
        fits = np.average(np.logaddexp(0.0, -logits), weights=np.where(right, 1.0, wrong_weight))
        return float(fits + _PENALTY * (given[1:] ** 2).sum())

    limits: Any = [(None, None)] + [(0.0, None)] * values.shape[1]
    begin = np.r_[0.0, np.ones(values.shape[1])]
    found = minimize(loss, begin, bounds=limits, method="L-BFGS-B", options={"ftol": 1e-14})
    return dict(zip(("intercept", *judged[0].measures), found.x.tolist(), strict=True))


def table(judged: Sequence[JudgedScale]) -> str:
    """Return counts of right and of wrong scales, and of those with a confidence over 0.5."""
    lines = []
    for name in (*dict.fromkeys(each.condition for each in judged), "all"):
        part = [each for each in judged if name in (each.condition, "all")]
        counts = Counter((each.right, each.confidence > 0.5) for each in part)
        right = f"{counts[True, True]} right scales trusted, {counts[True, False]} doubted"
        lines.append(f"{name}: {right}; {counts[False, True]} wrong, {counts[False, False]}")
    return "\n".join(lines)


def main() -> None:
    """Print the table, and the coefficients that fit these scenes."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("split", choices=("train", "val", "test"))
    parser.add_argument("--views", type=int, default=100, help="images of a scene")
    parser.add_argument("--rooms", nargs="*", default=[], help="folders of generated rooms")
    given = parser.parse_args()
    judged = list(judged_scales(given.split, given.views, given.rooms))
    print(table(judged))
    for part in (False, True):  # without and with depth in heights
        fit = fitted([each for each in judged if ("height" in each.measures) is part])
        print(", ".join(f"{name}: {value:.2f}" for name, value in fit.items()))


if __name__ == "__main__":
    main()
