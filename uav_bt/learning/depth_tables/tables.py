"""The paper's tables of metric depth.

All methods, masks and errors use the same pairs and points, so that rows are comparable.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.learning.depth_tables.images import Masks, SampleImage
from uav_bt.learning.depth_tables.methods import Error, Method, methods_for, metric_maps
from uav_bt.learning.depth_tables.pairs import (
    ErrorSummary,
    MeasuredPoints,
    PointPairs,
    draw_points,
    pair_distances,
    pick_pairs,
    ranges_at,
    summarise_errors,
)
from uav_bt.progress import Advance, silent
from uav_bt.types import DepthMap
from uav_bt.types.arrays import Floats

PATCHES_PX: Final = (1, 3, 5, 7, 9)


@dataclass(frozen=True, kw_only=True, eq=False)
class DepthQuestions:
    """Images with the point pairs and points to measure."""

    images: Sequence[SampleImage]
    pairs: Sequence[PointPairs]
    points: Sequence[MeasuredPoints]

    @classmethod
    def of(cls, images: Sequence[SampleImage], *, seed: int = 0) -> DepthQuestions:
        """Select pairs and points in each image."""
        chosen, drawn = [], []
        for number, image in enumerate(images):
            generator = np.random.default_rng((seed, number))
            exact, camera = image.exact, image.camera
            chosen.append(pick_pairs(exact, image.depth_m, camera, generator))
            drawn.append(draw_points(exact, image.depth_m, camera, generator))
        return cls(images=images, pairs=chosen, points=drawn)

    def edge_lengths(self) -> Floats:
        """Return the true lengths of all edges, metres."""
        return self._lengths([image.depth_m for image in self.images], across=False)

    def pair_errors(
        self, maps: Sequence[DepthMap], *, across: bool = False, patch_px: int = 1
    ) -> ErrorSummary:
        """Summarise the errors of the distances between the points of pairs.

        Args:
            maps: metric depth of each image.
            across: True: pairs on two faces; False: edges.
            patch_px: side of the square for the median depth; the truth uses single points.
        """
        truth = self._lengths([image.depth_m for image in self.images], across=across)
        estimated = self._lengths([map_.depth for map_ in maps], across=across, patch_px=patch_px)
        return summarise_errors(estimated, truth)

    def _lengths(
        self, depths: Sequence[NDArray[np.float32]], *, across: bool, patch_px: int = 1
    ) -> Floats:
        lengths = [
            pair_distances(depth, pairs, image.camera, patch_px)[pairs.across == across]
            for depth, pairs, image in zip(depths, self.pairs, self.images, strict=True)
        ]
        return np.concatenate(lengths)

    def distance_errors(
        self, maps: Sequence[DepthMap], *, obstacle: bool | None = None
    ) -> ErrorSummary:
        """Summarise the errors of distances from the camera: obstacles, ground, or both (None)."""
        estimated, truth = [], []
        for map_, points, image in zip(maps, self.points, self.images, strict=True):
            counts = np.full(points.range_m.shape, True)
            if obstacle is not None:
                counts = points.obstacle == obstacle
            estimated.append(ranges_at(map_.depth, points, image.camera)[counts])
            truth.append(points.range_m[counts])
        return summarise_errors(np.concatenate(estimated), np.concatenate(truth))


# --- point pairs and distances --------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class PairRow:
    """Errors of one method's distances between two points, for one patch size."""

    method: str
    patch_px: int
    across: bool  # True: pairs on two faces; False: edges, as in the paper
    error: ErrorSummary


def pair_table(
    questions: DepthQuestions, masks: Masks, *, advance: Advance = silent
) -> list[PairRow]:
    """Make the paper's table of point pairs; pairs across faces have no patch."""
    rows: list[PairRow] = []
    for method, maps in _all_maps(questions, masks, "pairs", advance):
        rows.extend(
            PairRow(
                method=method.name,
                patch_px=patch_px,
                across=across,
                error=questions.pair_errors(maps, across=across, patch_px=patch_px),
            )
            for across, patches in ((False, PATCHES_PX), (True, PATCHES_PX[:1]))
            for patch_px in patches
        )
    return sorted(rows, key=lambda row: (row.across, row.patch_px))


@dataclass(frozen=True, kw_only=True)
class DistanceRow:
    """Errors of one method's distances from the camera."""

    method: str
    what: str  # "obstacles", "ground" or "both"
    error: ErrorSummary


def distance_table(
    questions: DepthQuestions, masks: Masks, *, advance: Advance = silent
) -> list[DistanceRow]:
    """Make the paper's table of distances from the camera."""
    rows: list[DistanceRow] = []
    for method, maps in _all_maps(questions, masks, "distance", advance):
        rows.extend(
            DistanceRow(
                method=method.name,
                what=what,
                error=questions.distance_errors(maps, obstacle=obstacle),
            )
            for what, obstacle in (("both", None), ("obstacles", True), ("ground", False))
        )
    return sorted(rows, key=lambda row: ("both", "obstacles", "ground").index(row.what))


def _all_maps(
    questions: DepthQuestions, masks: Masks, stage: str, advance: Advance
) -> Iterator[tuple[Method, list[DepthMap]]]:
    methods = methods_for(questions.images)
    for done, method in enumerate(methods, start=1):
        yield method, metric_maps(method, questions.images, masks)
        advance(stage, done, len(methods))


# --- sensitivity ----------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class SensitivityRow:
    """Effect of one error source on one method."""

    change: str
    method: str
    pairs: ErrorSummary
    distance: ErrorSummary


_HEIGHTS_M: Final = (0.05, -0.05, 0.10, -0.10)
_PITCHES_DEG: Final = (1.0, -1.0, 2.0, -2.0)


def sensitivity_table(
    questions: DepthQuestions, masks: Masks, *, advance: Advance = silent
) -> list[SensitivityRow]:
    """Measure the effects of wrong height, wrong pitch and other masks on methods for flights."""
    changes: list[tuple[str, Masks, Error]] = [
        ("exact masks", "exact", Error()),
        ("U-Net masks", "unet", Error()),
    ]
    changes += [(f"height {m:+.2f} m", masks, Error(height_m=m)) for m in _HEIGHTS_M]
    changes += [
        (f"pitch {deg:+.0f} deg", masks, Error(pitch_rad=math.radians(deg))) for deg in _PITCHES_DEG
    ]
    methods = [
        method
        for method in methods_for(questions.images)
        if method.name in ("adaptive", "fused", "contact")
    ]
    rows = []
    for done, (change, whose, error) in enumerate(changes, start=1):
        for method in methods:
            maps = metric_maps(method, questions.images, whose, error=error)
            rows.append(
                SensitivityRow(
                    change=change,
                    method=method.name,
                    pairs=questions.pair_errors(maps),
                    distance=questions.distance_errors(maps),
                )
            )
        advance("sensitivity", done, len(changes))
    return rows
