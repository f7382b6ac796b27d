"""The linear head: is a pixel ground? From the features of a frozen network and its own opinion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from sklearn.linear_model import LogisticRegression

from perception.segmentation.adaptation.role_network import ROLES, RoleView
from perception.segmentation.geometry.labels import GROUND, NOT_GROUND, GroundLabels
from uav_bt.errors import InputError, ShapeError
from uav_bt.types.arrays import Floats

_OUTSIDE, _GROUND, _OBSTACLE = range(len(ROLES))
MOST_SURE: Final = 20.0  # logits beyond this are equally sure


@dataclass(frozen=True, kw_only=True)
class HeadConfig:
    """How the head is fitted. Numbers are chosen on training scenes.

    Attributes:
        pixels: Largest number of pixels of each label in one frame.
        least: Least number of pixels of each label in all frames.
        strength: Inverse of the regularisation, C of scikit-learn.
        kept: Share of the labels from which on a network is left as it is. The labels leave out the
            borders, which such a network places better than a new head.
        seed: Of the choice of the pixels.
    """

    pixels: int = 250
    least: int = 500
    strength: float = 0.02
    kept: float = 0.95
    seed: int = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundHead:
    """Score of ground of a pixel: weights * features + margin_weight * margin + bias.

    Attributes:
        weights: (C,) float64.
        margin_weight: Of the network's score of ground above the best other role.
        bias: Added.
    """

    weights: Floats
    margin_weight: float
    bias: float

    @staticmethod
    def unchanged(channels: int) -> GroundHead:
        """Return the head that leaves the decisions of a network as they are.

        Args:
            channels: Number of the network's features.
        """
        return GroundHead(weights=np.zeros(channels), margin_weight=1.0, bias=0.0)

    def scores(self, view: RoleView) -> NDArray[np.float32]:
        """Return adapted scores of the roles, (3, H, W) float32.

        The score of ground is the head's, and the better other role has zero. So ground is chosen
        where the head's probability exceeds one half.
        """
        if len(view.features) != len(self.weights):
            raise ShapeError(
                "features of the adapted network",
                expected=f"{len(self.weights)}xhxw",
                actual=view.features.shape,
            )
        height, width = view.scores.shape[1:]
        small = np.tensordot(self.weights, view.features, axes=1).astype(np.float32)
        ground = cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
        best = np.maximum(view.scores[_OUTSIDE], view.scores[_OBSTACLE])
        made = np.asarray(view.scores - best, np.float32)
        made[_GROUND] = ground + self.margin_weight * ground_margin(view) + self.bias
        return made


def ground_margin(view: RoleView) -> NDArray[np.float32]:
    """Return the score of ground above the best other role, bounded, (H, W)."""
    best = np.maximum(view.scores[_OUTSIDE], view.scores[_OBSTACLE])
    return np.asarray(np.clip(view.scores[_GROUND] - best, -MOST_SURE, MOST_SURE), np.float32)


def fit_head(
    views: Sequence[RoleView], labels: Sequence[GroundLabels], config: HeadConfig | None = None
) -> GroundHead:
    """Fit a head to the labels of some frames, unless the network agrees with them already.

    Args:
        views: what the network gives for the frames.
        labels: their labels, at the size of the scores.
        config: how it is fitted.

    Raises:
        InputError: the labels show too little ground, or nothing else.
    """
    config = config or HeadConfig()
    generator = np.random.default_rng(config.seed)
    rows, kinds, weights = [], [], []
    for view, each in zip(views, labels, strict=True):
        for label in (GROUND, NOT_GROUND):
            places = np.flatnonzero((each.labels == label).ravel())
            count = min(config.pixels, len(places))
            chosen = generator.choice(places, count, replace=False)
            rows.append(_columns(view, chosen))
            kinds.append(np.full(count, label == GROUND))
            weights.append(each.confidence.ravel()[chosen])
    known, ground = np.concatenate(rows), np.concatenate(kinds)
    least = min(int(ground.sum()), int((~ground).sum()))
    if least < config.least:
        raise InputError(
            f"the flight shows too little to learn from: {int(ground.sum())} pixels of ground and "
            f"{int((~ground).sum())} of other surfaces, at least {config.least} of each are needed "
            "(texture on the ground, steps to the side, and light help)"
        )
    unchanged = GroundHead.unchanged(len(views[0].features))
    if agreement(unchanged, views, labels) >= config.kept:
        return unchanged
    mean, deviation = known.mean(axis=0), known.std(axis=0) + 1e-6
    model = LogisticRegression(C=config.strength, class_weight="balanced", max_iter=500)
    model.fit((known - mean) / deviation, ground, sample_weight=np.concatenate(weights))
    slope = model.coef_[0] / deviation
    return GroundHead(
        weights=slope[:-1],
        margin_weight=float(slope[-1]),
        bias=float(model.intercept_[0] - slope @ mean),
    )


def _columns(view: RoleView, places: NDArray[np.intp]) -> Floats:
    """Return features and margin of pixels, (N, C + 1)."""
    height, width = view.scores.shape[1:]
    columns = [
        cv2.resize(plane, (width, height), interpolation=cv2.INTER_LINEAR).ravel()[places]
        for plane in view.features
    ]
    return np.stack([*columns, ground_margin(view).ravel()[places]], axis=1).astype(np.float64)


def agreement(head: GroundHead, views: Sequence[RoleView], labels: Sequence[GroundLabels]) -> float:
    """Return the share of the labels that the head gives, the mean of both kinds of label."""
    right, known = np.zeros(2), np.zeros(2)
    for view, each in zip(views, labels, strict=True):
        ground = head.scores(view).argmax(axis=0) == _GROUND
        for kind, label in enumerate((GROUND, NOT_GROUND)):
            places = each.labels == label
            known[kind] += np.count_nonzero(places)
            right[kind] += np.count_nonzero(places & (ground == (label == GROUND)))
    return float(np.mean(right / np.maximum(known, 1.0)))
