"""Metric depth against the twin's exact depth, beside the paper's table (`net evaluate depth`).

The paper (Mocanu et al.) evaluates depth by the dimensions of obstacles: a person picks two points
on the edges of an obstacle, and their distance in space is compared with a tape measure's. Here the
exact class map replaces the person: the outline of each visible face (a box's side, a roof) is
eroded by two pixels and simplified to a polygon, whose sides are the edges. Points drawn at random
have a distance from the camera.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any, Final, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from behaviours.perceive.depth import NETWORK_AHEAD_M
from perception.camera.ground_plane import ray_lengths
from perception.depth.metric import LEAST_CONFIDENCE, MAX_DEPTH_M, MetricDepthMaker
from perception.depth.scale import GroundSample, Scale, ScaleEstimator
from uav_bt.lab.classes import GROUND, OBSTACLE
from uav_bt.learning.views import MAP_SIZE_PX, VIDEO, DepthViewPlan, Masks, SampleImage, take_images
from uav_bt.protocols import Advance, DepthEstimator, Segmenter, silent
from uav_bt.types import ClassMap, DepthMap, Frame
from uav_bt.types.arrays import Floats, Floats32, Indices

MAP_CAMERA: Final = VIDEO.resized(*MAP_SIZE_PX)
_RAYS: Final = ray_lengths(MAP_CAMERA)  # (112, 224) metres along the ray for a metre of depth
_INSET_PX: Final = 2  # from an outline inwards, because the border itself is ambiguous
_SQUARE: Final = np.ones((2 * _INSET_PX + 1, 2 * _INSET_PX + 1), dtype=np.uint8)
_SIMPLIFY_PX: Final = 1.5  # largest distance of the polygon from the outline
_MIN_AREA_PX: Final = 60  # of a face; smaller ones are hard to click on
_MIN_CORNERS: Final = 3  # of a face; a line has no edges
_MIN_LENGTH_PX: Final = 6.0  # of an edge; an error of three pixels is half of this
_MIN_LENGTH_M: Final = 0.1  # of an edge, in space
_OCCLUDER_M: Final = 0.15  # an object so much nearer hides a corner of the face
_MAX_EDGES: Final = 8  # per image, so that crowded images do not dominate
_POINTS: Final = 40  # per image on obstacles, and as many on the ground
_MIN_RANGE_M, _MAX_RANGE_M = 0.3, 5.0  # of points, along the ray; the paper's

_FIGURES: Final = ("mean_m", "median_m", "rmse_m", "std_m", "max_m", "correlation")

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

    Without a network only ground contact is measured. Returns the test data, and a row for each
    method: errors in metres, None where nothing is known.
    """
    images = list(take_images(plan, masks, segmenter, network, advance=advance))
    edges, points = [], []
    for number, image in enumerate(images):
        generator = np.random.default_rng((plan.seed, number))
        edges.append(pick_edges(image.exact, image.depth_m, generator))
        points.append(draw_points(image.exact, image.depth_m, generator))

    def measured(maps: Sequence[Floats32]) -> tuple[Floats, Floats]:
        lengths_m = [edge_lengths(*each) for each in zip(maps, edges, strict=True)]
        ranges_m = [(depth * _RAYS)[at] for depth, at in zip(maps, points, strict=True)]
        return np.concatenate(lengths_m), np.concatenate(ranges_m)

    true_m, true_ranges_m = measured([image.depth_m for image in images])
    roles = [image.exact.roles[at] for image, at in zip(images, points, strict=True)]
    obstacle = np.concatenate(roles) == OBSTACLE
    names = list(METHODS) if network else ["contact"]
    rows = []
    for done, name in enumerate(names, start=1):
        lengths_m, ranges_m = measured(list(metric_maps(name, images)))
        rows.append(
            {
                "method": name,
                "edges": summarise_errors(lengths_m, true_m),
                "distances": summarise_errors(ranges_m, true_ranges_m),
                "obstacles": summarise_errors(ranges_m[obstacle], true_ranges_m[obstacle]),
            }
        )
        advance("methods", done, len(names))
    return {
        **asdict(plan),
        "masks": masks,
        "images": len(images),
        "edges": len(true_m),
        "points": len(true_ranges_m),
        "rows": rows,
    }


def metric_maps(name: str, images: Sequence[SampleImage]) -> Iterator[NDArray[np.float32]]:
    """Yield a method's metric depth of each image, metres; all NaN without depth."""
    source, collects = METHODS[name]
    flown = name == "flown"
    maker = MetricDepthMaker(
        _Estimated(images),
        source=source,
        scale=None if collects is None else collected_scale(collects),
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


def collected_scale(method: _Collects) -> ScaleEstimator:
    """Return an estimator of the paper's constant scales, by the medians of all frames so far.

    "constant" is the median ratio of known to predicted depth; "least_squares" solves
    ``scale * predicted + shift = known`` (equation 1). There is none before the first sample.
    """
    samples: list[tuple[float, float]] = []

    def scale(sample: GroundSample | None, _s: float, _height_m: float | None) -> Scale | None:
        if sample is not None:
            samples.append((float(np.median(sample.known_m)), float(np.median(sample.predicted))))
        if not samples:
            return None
        known, predicted = np.array(samples).T
        # Similar frames cannot separate scale from shift; the plain ratio is used instead.
        if method == "least_squares" and predicted.std() > 1e-3 * predicted.mean():
            factor, shift_m = np.polyfit(predicted, known, 1).tolist()
            return Scale(factor=factor, shift_m=shift_m) if factor > 0.0 else None
        return Scale(factor=float(np.median(known / predicted)))

    return scale


def pick_edges(class_map: ClassMap, depth_m: Floats32, generator: np.random.Generator) -> Indices:
    """Return edges of an image by exact classes and depth, (N, 2, 2): ends, column and row."""
    edges: list[Indices] = []
    for face in _faces(class_map):
        outlines, _ = cv2.findContours(face, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        if not outlines:
            continue
        polygon = cv2.approxPolyDP(max(outlines, key=len), _SIMPLIFY_PX, closed=True)
        corners = polygon.reshape(-1, 2).astype(np.intp)
        if len(corners) < _MIN_CORNERS:
            continue
        good = np.array([_picked(corner, face, class_map, depth_m) for corner in corners])
        spans = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
        edges.extend(spans[good & np.roll(good, -1)])
    found = np.array(edges, dtype=np.intp).reshape(-1, 2, 2)
    length_px = np.linalg.norm((found[:, 0] - found[:, 1]).astype(np.float64), axis=1)
    length_m = edge_lengths(depth_m, found)
    found = found[(length_px >= _MIN_LENGTH_PX) & (length_m >= _MIN_LENGTH_M)]
    return generator.permutation(found)[:_MAX_EDGES]


def _faces(class_map: ClassMap) -> Iterator[NDArray[np.uint8]]:
    """Yield every connected region of an obstacle's class, without its rim."""
    for obstacle in class_map.classes.of_role(OBSTACLE):
        mask = (class_map.ids == obstacle).astype(np.uint8)
        count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=4)
        for label in range(1, count):
            if stats[label, cv2.CC_STAT_AREA] >= _MIN_AREA_PX:
                face = (labels == label).astype(np.uint8)
                # The image's border is not a rim, because the face continues beyond it.
                padded = cv2.copyMakeBorder(face, *(4 * (_INSET_PX,)), cv2.BORDER_REPLICATE)
                core = cv2.erode(padded, _SQUARE)[_INSET_PX:-_INSET_PX, _INSET_PX:-_INSET_PX]
                yield np.asarray(core, dtype=np.uint8)


def _picked(
    corner: Indices, face: NDArray[np.uint8], class_map: ClassMap, depth_m: Floats32
) -> bool:
    """Return whether a corner belongs to the obstacle and not to an occluder."""
    column, row = int(corner[0]), int(corner[1])
    reach, ids = _INSET_PX + 1, class_map.ids
    height, width = ids.shape
    if not (reach <= column < width - reach and reach <= row < height - reach):
        return False
    reach += 1
    near = np.s_[max(0, row - reach) : row + reach + 1, max(0, column - reach) : column + reach + 1]
    # The ground before a base is nearer, but does not hide it.
    others = class_map.is_above_ground[near] & (ids[near] != ids[row, column]) & (face[near] == 0)
    return not bool(np.any(others & (depth_m[near] < depth_m[row, column] - _OCCLUDER_M)))


def edge_lengths(depth_m: Floats32, edges: Indices) -> Floats:
    """Return the lengths of edges by a depth map, (N,) metres; NaN where unknown."""
    columns, rows = edges[..., 0], edges[..., 1]
    depth = depth_m[rows, columns].astype(np.float64)
    x = (columns - MAP_CAMERA.cx_px) / MAP_CAMERA.fx_px * depth
    y = (rows - MAP_CAMERA.cy_px) / MAP_CAMERA.fy_px * depth
    ends = np.stack([x, y, depth], axis=-1)
    return np.asarray(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1))


def draw_points(
    class_map: ClassMap, depth_m: Floats32, generator: np.random.Generator
) -> tuple[Indices, Indices]:
    """Return rows and columns of random points on obstacles and ground."""
    ids, range_m = class_map.ids, depth_m * _RAYS
    inner = cv2.erode(ids, _SQUARE) == cv2.dilate(ids, _SQUARE)
    inner &= (range_m >= _MIN_RANGE_M) & (range_m <= _MAX_RANGE_M)
    chosen = []
    for role in (OBSTACLE, GROUND):
        places = np.flatnonzero(inner & (class_map.roles == role))
        chosen.append(generator.choice(places, size=min(_POINTS, places.size), replace=False))
    rows, columns = np.divmod(np.concatenate(chosen), ids.shape[1])
    return rows, columns


def summarise_errors(estimated_m: Floats, truth_m: Floats) -> dict[str, float | None]:
    """Summarise estimates of lengths, (N,) metres, NaN without an estimate.

    Returns:
        How many were wanted (`total`) and given (`valid`), and figures about the latter: mean,
        median, root mean square, standard deviation and maximum of the absolute error, and
        Pearson's correlation.
    """
    known = np.isfinite(estimated_m)
    estimated, truth = estimated_m[known].astype(np.float64), truth_m[known].astype(np.float64)
    error = np.abs(estimated - truth)
    figures: dict[str, float | None] = dict.fromkeys(_FIGURES)
    if error.size:
        rmse_m = math.sqrt(float(np.mean(error**2)))
        spread = (error.mean(), np.median(error), rmse_m, error.std(), error.max())
        figures |= zip(_FIGURES, (round(float(figure), 5) for figure in spread), strict=False)
    if error.size and estimated.std() > 0.0 and truth.std() > 0.0:
        figures["correlation"] = round(float(np.corrcoef(estimated, truth)[0, 1]), 5)
    return {"total": truth_m.size, "valid": error.size, **figures}
