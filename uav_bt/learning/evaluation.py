"""Evaluation of networks: metric depth by the twin's truth, the student by its rule."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from behaviours.perceive.depth import NETWORK_AHEAD_M
from perception.control.runtime import ControlEstimate, OnnxControlStudent
from perception.control.training.samples import (
    Batch,
    ControlFlight,
    ControlSamples,
    ControlScore,
    score_control,
)
from perception.depth.metric import LEAST_CONFIDENCE, MAX_DEPTH_M, MetricDepthMaker
from perception.depth.scale import GroundSample, Scale
from uav_bt.learning.depth_images import (
    MAP_CAMERA,
    MAP_SIZE_PX,
    VIDEO,
    Masks,
    SampleImage,
    take_images,
)
from uav_bt.learning.depth_questions import (
    draw_points,
    edge_lengths,
    pick_edges,
    ranges_at,
    summarise_errors,
)
from uav_bt.learning.views import DepthViewPlan
from uav_bt.progress import Advance, silent
from uav_bt.protocols import DepthEstimator, Segmenter
from uav_bt.types import DepthMap, Frame


def evaluate_student(
    flights: Sequence[ControlFlight], student: OnnxControlStudent, *, max_windows: int = 2000
) -> ControlScore:
    """Score a control student on windows of advised flights, spread evenly over all."""

    def estimates(batch: Batch) -> list[ControlEstimate]:
        windows = zip(batch.frames, batch.state, strict=True)
        return [student.estimate(list(frames), state) for frames, state in windows]

    samples = ControlSamples(flights, student.config)
    return score_control(estimates, samples, max_windows=max_windows)


# --- depth ----------------------------------------------------------------------------------------

_Collects = Literal["constant", "least_squares"]

# By name: the source of `MetricDepthMaker`, and the scale that is fitted to all images first. The
# scales are the paper's; `flown` is what the leaves fly with.
METHODS: Final[dict[str, tuple[str, _Collects | None]]] = {
    "constant": ("network", "constant"),
    "least_squares": ("network", "least_squares"),
    "adaptive": ("network", None),
    "flown": ("fused", None),
    "contact": ("contact", None),
}


def evaluate_depth(
    plan: DepthViewPlan,
    masks: Masks,
    segmenter: Segmenter,
    network: DepthEstimator | None,
    *,
    advance: Advance = silent,
) -> dict[str, Any]:
    """Render images of the twin, and measure edges of obstacles and distances by each method.

    Args:
        plan: the images.
        masks: source of the class maps.
        segmenter: source of the masks in flight, at 224x112.
        network: source of relative depth; None: only ground contact is measured.
        advance: called at each step.

    Returns:
        The test data, and a row for each method: errors in metres, None instead of NaN.
    """
    images = list(take_images(plan, masks, segmenter, network, advance=advance))
    edges, points = [], []
    for number, image in enumerate(images):
        generator = np.random.default_rng((plan.seed, number))
        edges.append(pick_edges(image.exact, image.depth_m, MAP_CAMERA, generator))
        points.append(draw_points(image.exact, image.depth_m, MAP_CAMERA, generator))

    def lengths_m(maps: Sequence[NDArray[np.float32]]) -> NDArray[np.float64]:
        pairs = zip(maps, edges, strict=True)
        return np.concatenate([edge_lengths(depth, mine, MAP_CAMERA) for depth, mine in pairs])

    true_m = lengths_m([image.depth_m for image in images])
    true_ranges_m = np.concatenate([mine.range_m for mine in points])
    obstacle = np.concatenate([mine.obstacle for mine in points])
    names = [name for name, (source, _) in METHODS.items() if network or source == "contact"]
    rows = []
    for done, name in enumerate(names, start=1):
        maps = list(_maps(name, images))
        ranges_m = np.concatenate(
            [ranges_at(depth, mine, MAP_CAMERA) for depth, mine in zip(maps, points, strict=True)]
        )
        errors = {
            "edges": summarise_errors(lengths_m(maps), true_m),
            "distances": summarise_errors(ranges_m, true_ranges_m),
            "obstacles": summarise_errors(ranges_m[obstacle], true_ranges_m[obstacle]),
        }
        rows.append({"method": name, **{what: _plain(asdict(it)) for what, it in errors.items()}})
        advance("methods", done, len(names))
    return {
        "scenes": list(plan.scenes),
        "views": plan.views,
        "seed": plan.seed,
        "profile": plan.profile,
        "masks": masks,
        "images": len(images),
        "edges": len(true_m),
        "points": len(true_ranges_m),
        "rows": rows,
    }


def _plain(figures: dict[str, Any]) -> dict[str, Any]:
    return {
        name: None if math.isnan(each) else round(each, 5) if isinstance(each, float) else each
        for name, each in figures.items()
    }


def _maps(name: str, images: Sequence[SampleImage]) -> Iterator[NDArray[np.float32]]:
    """Yield a method's metric depth of each image, metres; all NaN without depth."""
    source, collects = METHODS[name]
    flown = name == "flown"
    maker = MetricDepthMaker(
        _Estimated(images),
        source=source,
        scale=None if collects is None else _CollectedScale(collects),
        generator=np.random.default_rng(0),
        network_ahead_m=NETWORK_AHEAD_M if flown else MAX_DEPTH_M,
        least_confidence=LEAST_CONFIDENCE if flown else 0.0,
    )
    if collects is not None:
        for image in images:
            maker.make(image.frame, image.seen, VIDEO)
    for image in images:
        metric = maker.make(image.frame, image.seen, VIDEO)
        nowhere = np.full(MAP_SIZE_PX[::-1], np.nan, dtype=np.float32)
        yield nowhere if metric.depth is None else metric.depth.depth


class _Estimated:
    """The relative depth that a network gave for images."""

    def __init__(self, images: Sequence[SampleImage]) -> None:
        self._depths = {each.frame.index: each.relative for each in images if each.relative}

    def estimate(self, frame: Frame) -> DepthMap:
        """Return the relative depth of a frame; without a network nobody asks."""
        return self._depths[frame.index]


class _CollectedScale:
    """The two constant scales of the paper, from the medians of all frames until now.

    "constant" is the median ratio of known to predicted depth; "least_squares" solves
    ``scale * predicted + shift = known`` (equation 1).
    """

    def __init__(self, method: _Collects) -> None:
        self._method = method
        self._known: list[float] = []
        self._predicted: list[float] = []

    def __call__(
        self,
        sample: GroundSample | None,
        captured_s: float,
        height_m: float | None = None,  # noqa: ARG002  (the protocol's)
    ) -> Scale | None:
        """Add a frame and return the scale of all frames; None before the first sample."""
        del captured_s  # a constant has no age
        if sample is not None:
            self._known.append(float(np.median(sample.known_m)))
            self._predicted.append(float(np.median(sample.predicted)))
        if not self._known:
            return None
        known, predicted = np.array(self._known), np.array(self._predicted)
        # Similar frames cannot separate scale from shift; the plain ratio is used instead.
        if self._method == "least_squares" and predicted.std() > 1e-3 * predicted.mean():
            factor, shift_m = (float(part) for part in np.polyfit(predicted, known, 1))
            return Scale(factor=factor, shift_m=shift_m) if factor > 0.0 else None
        return Scale(factor=float(np.median(known / predicted)))
