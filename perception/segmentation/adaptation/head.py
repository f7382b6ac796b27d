"""The linear head: is a pixel ground? From the features and scores of a frozen network."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from sklearn.linear_model import LogisticRegression

from perception.networks.named import ROLES
from perception.segmentation.adaptation.role_network import RoleView
from perception.segmentation.geometry.labels import GROUND, NOT_GROUND, GroundLabels
from uav_bt.errors import InputError, ShapeError
from uav_bt.types.arrays import Floats

_OUTSIDE, _GROUND, _OBSTACLE = range(len(ROLES))
MAX_MARGIN: Final = 20.0  # of two logits, beyond which both roles are certain


@dataclass(frozen=True, kw_only=True)
class HeadConfig:
    """How the head is fitted. Numbers are chosen on training scenes.

    Attributes:
        pixels: Largest number of pixels of each label in one frame.
        least: Least number of pixels of each label in all frames.
        strength: Inverse of the regularisation, C of scikit-learn.
        parts: Number of parts of the turn. Each is judged by a head that was fitted to the others.
        gain: Least rise of the agreement with the labels of parts that a head was not fitted to;
            with less the network is left as it is. The labels leave out the borders, which such a
            network places better than a new head. In rooms of the validation set the network for
            any room rose by at most 0.06, and 10 of 11 new heads made it worse. Heads of a network
            that does not know such rooms had an IoU of ground of 0.77 and more where they rose by
            0.42 or more, and 0.60 or less where they rose by 0.23 or less.
        seed: Of the choice of the pixels.
    """

    pixels: int = 250
    least: int = 500
    strength: float = 0.02
    parts: int = 4
    gain: float = 0.3
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

    @property
    def is_new(self) -> bool:
        """Whether the decisions differ from those of the network."""
        return bool(self.weights.any())

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
    return np.asarray(np.clip(view.scores[_GROUND] - best, -MAX_MARGIN, MAX_MARGIN), np.float32)


def fit_head(
    views: Sequence[RoleView], labels: Sequence[GroundLabels], config: HeadConfig | None = None
) -> GroundHead:
    """Fit a head to the labels of some frames, unless it does no better on frames aside.

    Args:
        views: outputs of the network for the frames, in the order of the turn.
        labels: their labels, at the size of the scores.
        config: how it is fitted.

    Raises:
        InputError: the labels show too little ground, or nothing else.
    """
    config = config or HeadConfig()
    generator = np.random.default_rng(config.seed)
    samples = [
        _Sample.of(view, each, config.pixels, generator)
        for view, each in zip(views, labels, strict=True)
    ]
    ground = np.concatenate([each.ground for each in samples])
    least = min(int(ground.sum()), int((~ground).sum()))
    if least < config.least:
        raise InputError(
            f"the flight shows too little to learn from: {int(ground.sum())} pixels of ground and "
            f"{int((~ground).sum())} of other surfaces, at least {config.least} of each are needed "
            "(texture on the ground, steps to the side, and light help)"
        )
    unchanged = GroundHead.unchanged(len(views[0].features))
    if _gain(unchanged, views, labels, samples, config) < config.gain:
        return unchanged
    return _fitted(samples, config)


def _gain(
    unchanged: GroundHead,
    views: Sequence[RoleView],
    labels: Sequence[GroundLabels],
    samples: Sequence[_Sample],
    config: HeadConfig,
) -> float:
    """Return the rise of the agreement on parts of the turn that a head was not fitted to."""
    gains = []
    for part in np.array_split(np.arange(len(views)), min(config.parts, len(views))):
        others = [each for at, each in enumerate(samples) if at not in part]
        ground = np.concatenate([each.ground for each in others]) if others else np.zeros(0, bool)
        if ground.all() or not ground.any():
            return -1.0
        aside = [views[at] for at in part], [labels[at] for at in part]
        head = _fitted(others, config)
        gains.append(agreement(head, *aside) - agreement(unchanged, *aside))
    return float(np.mean(gains))


def _fitted(samples: Sequence[_Sample], config: HeadConfig) -> GroundHead:
    known = np.concatenate([each.columns for each in samples])
    ground = np.concatenate([each.ground for each in samples])
    weights = np.concatenate([each.weights for each in samples])
    mean, deviation = known.mean(axis=0), known.std(axis=0) + 1e-6
    model = LogisticRegression(C=config.strength, class_weight="balanced", max_iter=500)
    model.fit((known - mean) / deviation, ground, sample_weight=weights)
    slope = model.coef_[0] / deviation
    return GroundHead(
        weights=slope[:-1],
        margin_weight=float(slope[-1]),
        bias=float(model.intercept_[0] - slope @ mean),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Sample:
    """Labelled pixels of a frame: features and margin, (N, C + 1), label and weight, (N,)."""

    columns: Floats
    ground: NDArray[np.bool_]
    weights: NDArray[np.float32]

    @staticmethod
    def of(
        view: RoleView, labels: GroundLabels, pixels: int, generator: np.random.Generator
    ) -> _Sample:
        """Choose pixels of each label."""
        chosen, ground = [], []
        for label in (GROUND, NOT_GROUND):
            places = np.flatnonzero((labels.labels == label).ravel())
            count = min(pixels, len(places))
            chosen.append(generator.choice(places, count, replace=False))
            ground.append(np.full(count, label == GROUND))
        places = np.concatenate(chosen)
        return _Sample(
            columns=_columns(view, places),
            ground=np.concatenate(ground),
            weights=labels.confidence.ravel()[places],
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
