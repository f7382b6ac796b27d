"""Evaluation of networks: segmentation and depth by the twin's truth, the student by its rule."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from perception.control.runtime import ControlEstimate, OnnxControlStudent
from perception.control.training.samples import (
    Batch,
    ControlFlight,
    ControlSamples,
    ControlScore,
    score_control,
)
from uav_bt.errors import UnknownNameError, ValueRangeError
from uav_bt.learning.depth_tables.corridors import corridor_table
from uav_bt.learning.depth_tables.images import ImagePlan, Masks, take_images
from uav_bt.learning.depth_tables.tables import (
    DepthQuestions,
    distance_table,
    pair_table,
    sensitivity_table,
)
from uav_bt.progress import Advance, silent
from uav_bt.protocols import DepthEstimator, Segmenter


def evaluate_student(
    flights: Sequence[ControlFlight], student: OnnxControlStudent, *, max_windows: int = 2000
) -> ControlScore:
    """Score a control student on advised flights.

    Args:
        flights: views of the flights, at the size of the network.
        student: the exported network.
        max_windows: largest number of windows, spread evenly over all.

    Raises:
        ValueRangeError: no view can be scored.
        AnswerError: an output of the network is not a number.
    """

    def estimates(batch: Batch) -> list[ControlEstimate]:
        windows = zip(batch.frames, batch.state, strict=True)
        return [student.estimate(list(frames), state) for frames, state in windows]

    samples = ControlSamples(flights, student.config)
    return score_control(estimates, samples, max_windows=max_windows)


# --- depth ----------------------------------------------------------------------------------------

_Rows = Sequence[Any]
_MAKERS: Final[Mapping[str, Callable[[DepthQuestions, Masks, Advance], _Rows]]] = {
    "pairs": lambda questions, masks, advance: pair_table(questions, masks, advance=advance),
    "distance": lambda questions, masks, advance: distance_table(questions, masks, advance=advance),
    "sensitivity": lambda questions, masks, advance: sensitivity_table(
        questions, masks, advance=advance
    ),
    "corridor": lambda questions, masks, advance: corridor_table(
        questions.images, masks, advance=advance
    ),
}
TABLES: Final = tuple(_MAKERS)


def evaluate_depth(
    plan: ImagePlan,
    segmenter: Segmenter,
    network: DepthEstimator | None,
    *,
    tables: Sequence[str] = TABLES,
    advance: Advance = silent,
) -> dict[str, Any]:
    """Render images of the twin and make tables.

    Args:
        plan: the images.
        segmenter: source of the masks in flight, at 224x112.
        network: source of relative depth; None: only methods without a network.
        tables: names of tables from `TABLES`.
        advance: called at each step.

    Returns:
        The test data, and the rows by table: names, numbers, and None instead of NaN.

    Raises:
        UnknownNameError: a table does not exist.
        ValueRangeError: no table is named.
        SceneError: a scene is missing or malformed.
        MissingDependencyError: OpenGL does not work here.
    """
    if not tables:
        raise ValueRangeError(f"there is no table to make; name some of {', '.join(TABLES)}")
    for table in tables:
        if table not in _MAKERS:
            raise UnknownNameError("table", table, TABLES)
    images = list(take_images(plan, segmenter, network, advance=advance))
    questions = DepthQuestions.of(images, seed=plan.views.seed)
    edges = [int(np.count_nonzero(~pairs.across)) for pairs in questions.pairs]
    lengths_m = questions.edge_lengths()
    return {
        "scenes": list(plan.views.scenes),
        "views": plan.views.views,
        "seed": plan.views.seed,
        "profile": plan.views.profile,
        "masks": plan.masks,
        "images": len(images),
        "images_with_edges": sum(count > 0 for count in edges),
        "edges": sum(edges),
        "median_edge_m": _plain(float(np.median(lengths_m)) if lengths_m.size else math.nan),
        "points": sum(len(points.range_m) for points in questions.points),
        "tables": {
            table: [_plain(asdict(row)) for row in _MAKERS[table](questions, plan.masks, advance)]
            for table in tables
        },
    }


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, float):
        return round(value, 5) if math.isfinite(value) else None
    return value
