"""Perceive every image of a source."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from perception.camera.image_files import IMAGE_SUFFIXES
from uav_bt.app.option_values import as_file
from uav_bt.app.perceive.inputs import PerceiveInput, PerceiveOptions
from uav_bt.app.perceive.pipeline import STAGES, Perceived
from uav_bt.app.sources.shots import Shot
from uav_bt.display.video.panes import PerceptionPanes
from uav_bt.display.video.video_file import FILM, VideoFile
from uav_bt.errors import FileError, InputError
from uav_bt.files import check_empty_folder, write_whole, writing
from uav_bt.inputs import refuse_inputs, same_file
from uav_bt.mission.flight_report import Percentiles
from uav_bt.progress import Advance, silent
from uav_bt.record.images import encode_bytes
from uav_bt.tree.loading.lookup import shipped_trees
from uav_bt.types import CameraModel

_MAX_RATE: Final = 60.0  # images a second of a video that is written
_DECIMALS: Final = 6  # of the numbers in the lines
_CORRIDOR: Final = (
    *("free_distance_m", "nearest_m", "nearest_side", "nearest_left_m", "nearest_right_m"),
    *("time_to_impact_s", "unknown_px"),
)
_MARK: Final = ("forward_m", "right_m", "detected", "confidence")

_Write = Callable[[Shot, Perceived], None]
_Row = tuple[Mapping[str, float], str, bool, bool]
"""Of a frame: time by stage in s, refusal, whether it has depth, and a mark."""


@dataclass(frozen=True, kw_only=True)
class PerceiveSummary:
    """Result of a run of perception."""

    frames: int
    unrelated: bool  # whether each image was perceived without the others
    camera: str  # whose intrinsics, in words
    telemetry: str  # whose pose, in words
    stage_ms: Mapping[str, Percentiles]  # wall time by stage, "all" their sum
    without_depth: Mapping[str, int]  # frames without metric depth, by reason
    in_part: Mapping[str, int]  # frames with partial depth, by reason
    with_mark: int  # frames that show it
    skipped: tuple[str, ...]  # images that could not be used, and why
    warnings: tuple[str, ...]  # what may be wrong with all images
    interrupted: bool


def perceive(
    source: str | Path,
    options: PerceiveOptions | None = None,
    *,
    out: str | Path | None = None,
    lines: str | Path | None = None,
    masks: str | Path | None = None,
    advance: Advance = silent,
) -> PerceiveSummary:
    """Perceive every image of a source. Ctrl-C ends it and keeps the outputs.

    Args:
        source: a video file, a folder of images, an image, `camera:N`, or a flight record.
        options: Facts about the images, and the networks.
        out: an mp4 file with the overlays.
        lines: a file with one JSON object for each frame.
        masks: a folder, new or empty, for the class map of each frame (ids, as PNG).
        advance: called with the progress.

    Raises:
        InputError: source, camera, telemetry or network cannot be used, or nothing is readable.
        FileError: a file cannot be written, or the folder of the masks has files.
    """
    options = options or PerceiveOptions()
    out, lines = as_file("out", out), as_file("lines", lines)
    folder = as_file("masks", masks, "a folder")
    _check_outputs([path for path in (out, lines) if path is not None], folder, (source, options))
    given = PerceiveInput(str(source), options)
    longest_s, total = options.longest_s, given.source.total or 0
    if longest_s is not None:
        total = min(total, math.ceil(longest_s * given.source.rate_per_s))
    rows: list[_Row] = []
    interrupted = False
    with ExitStack() as stack:
        pipeline, images = given.begin(stack.enter_context(closing(given.images())))
        writers: list[_Write] = []
        if out is not None:
            rate = given.source.rate_per_s / options.every
            writers.append(stack.enter_context(_overlay_video(out, pipeline.camera, rate)))
        if folder is not None:
            writers.append(partial(_write_mask, folder))
        if lines is not None:
            writers.append(stack.enter_context(_json_lines(lines)))
        try:
            for image in images:
                if given.unrelated:
                    pipeline.restart()
                frame = given.telemetry.frame(image.image, image.index, image.time_s)
                seen = pipeline.perceive(frame, given.telemetry.states(image.time_s))
                has_mark = seen.mark is not None and seen.mark.detected
                rows.append((seen.stage_s, seen.refusal, seen.depth is not None, has_mark))
                for write in writers:
                    write(image, seen)
                done = image.index + 1
                advance(f"frames, {image.name}", done, max(done, total))
        except KeyboardInterrupt:
            interrupted = True
    return _summary(rows, given, interrupted=interrupted)


def _check_outputs(files: list[Path], masks: Path | None, given: tuple[object, ...]) -> None:
    for file in files:
        refuse_inputs(file, given, shipped_trees())
        if masks is not None and same_file(file.parent, masks):
            raise InputError(f"{file} lies in the folder of the masks; name another place for it")
    if masks is not None:
        check_empty_folder(masks, "net perceive --masks")


def _summary(rows: list[_Row], given: PerceiveInput, *, interrupted: bool) -> PerceiveSummary:
    spent = {name: [row[0][name] for row in rows if name in row[0]] for name in STAGES}
    spent["all"] = [sum(row[0].values()) for row in rows]
    stages = {name: Percentiles.of_seconds(values) for name, values in spent.items()}
    without = Counter(why for _, why, has_depth, _ in rows if why and not has_depth)
    in_part = Counter(why for _, why, has_depth, _ in rows if why and has_depth)
    return PerceiveSummary(
        frames=len(rows),
        unrelated=given.unrelated,
        camera=given.camera_words,
        telemetry=given.telemetry_words,
        stage_ms={name: figures for name, figures in stages.items() if figures is not None},
        without_depth=dict(without.most_common()),
        in_part=dict(in_part.most_common()),
        with_mark=sum(has_mark for *_, has_mark in rows),
        skipped=tuple(given.source.skipped),
        warnings=tuple(given.source.warnings),
        interrupted=interrupted,
    )


def _write_mask(folder: Path, image: Shot, seen: Perceived) -> None:
    """Write the class map of an image; the first one makes the folder and lists the classes.

    It is a grey PNG, (h, w), whose values are class ids.
    `IMG_1.jpg` of a folder becomes `IMG_1.png`, frame 12 of a video `000012.png`.
    """
    classes = folder / "classes.json"
    if not classes.exists():
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
        rows = [
            {"id": number, "name": each.name, "role": each.role, "rgb": list(each.colour)}
            for number, each in enumerate(seen.class_map.classes)
        ]
        write_whole(classes, json.dumps({"classes": rows}, indent=2) + "\n")
    name = Path(image.name)
    in_folder = name.suffix.lower() in IMAGE_SUFFIXES
    path = folder / (f"{name.stem}.png" if in_folder else f"{image.index:06d}.png")
    with writing(path):
        if in_folder and path.exists():  # IMG_1.jpg and IMG_1.png of one folder have two masks
            path = folder / f"{name.name}.png"
        if path.exists() or path.is_symlink():
            raise FileError(path, "exists already, and is not replaced")
    write_whole(path, encode_bytes(seen.class_map.ids))


@contextmanager
def _json_lines(path: Path) -> Iterator[_Write]:
    with writing(path), path.open("w", encoding="utf-8") as file:

        def write(image: Shot, seen: Perceived) -> None:
            file.write(json.dumps(_rounded(_values(image, seen)), allow_nan=False) + "\n")

        yield write


@contextmanager
def _overlay_video(path: Path, camera: CameraModel, rate_per_s: float) -> Iterator[_Write]:
    """Write the mp4 file with the overlays, which appears at the end."""
    panes = PerceptionPanes(camera)
    rate = Fraction(min(rate_per_s, _MAX_RATE)).limit_denominator(1001)
    file = VideoFile(path, size_px=panes.size_px, frames_per_s=rate, comment=FILM)
    begin_s, slot = math.nan, -1

    def write(_: Shot, seen: Perceived) -> None:
        nonlocal begin_s, slot
        begin_s = seen.frame.captured_s if math.isnan(begin_s) else begin_s
        slot = max(slot + 1, round((seen.frame.captured_s - begin_s) * float(rate)))
        file.write(panes.draw(seen), slot)

    try:
        yield write
    finally:
        file.close()


def _values(image: Shot, seen: Perceived) -> dict[str, Any]:
    """Return one frame's line of values. Unknown ones are None."""
    depth, scale, corridor, mark = seen.depth, seen.scale, seen.corridor, seen.mark
    return {
        "image": image.name,
        "index": image.index,
        "time_s": image.time_s,
        "depth": depth
        and {
            "confidence": depth.confidence,
            "scale": scale and {"factor": scale.factor, "shift_m": scale.shift_m},
            "known_share": float(np.isfinite(depth.depth).mean()),
        },
        "confidence": {
            name: {
                "value": each.value,
                "reason": each.reason or None,
                **({"measures": _measures(each.measures)} if each.measures else {}),
            }
            for name, each in seen.confidences.items()
        },
        "refusal": seen.refusal or None,
        "corridor": corridor and {name: getattr(corridor, name) for name in _CORRIDOR},
        "mark": mark
        and {**{name: getattr(mark, name) for name in _MARK}, "seen_s": mark.captured_s},
        "ms": {stage: 1000.0 * spent_s for stage, spent_s in seen.stage_s.items()},
    }


def _measures(measures: Mapping[str, tuple[float, str | None]]) -> dict[str, Any]:
    return {name: {"value": value, "reason": reason} for name, (value, reason) in measures.items()}


def _rounded(value: Any) -> Any:
    """Return plain values with rounded numbers; None for infinity."""
    if isinstance(value, dict):
        return {name: _rounded(each) for name, each in value.items()}
    if isinstance(value, float):
        return round(value, _DECIMALS) if math.isfinite(value) else None
    return value
