"""Perceive every image of a source."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any, Final, TextIO

import numpy as np
from pydantic_core import to_json

from perception.camera.image_files import IMAGE_SUFFIXES
from perception.depth.confidence import Confidence
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
from uav_bt.protocols import Advance, silent
from uav_bt.record.images import encode_bytes
from uav_bt.tree.loading.lookup import shipped_trees
from uav_bt.types import CameraModel

_MAX_RATE: Final = 60.0  # images a second of a video that is written
_CORRIDOR: Final = (
    *("free_distance_m", "nearest_m", "nearest_side", "nearest_left_m", "nearest_right_m"),
    *("time_to_impact_s", "unknown_px"),
)
_MARK: Final = ("forward_m", "right_m", "detected", "confidence")
_ALL: Final = "all"  # stages together

_Write = Callable[[Shot, Perceived], None]


@dataclass(kw_only=True)
class PerceiveSummary:
    """Result of a run of perception."""

    camera: str  # whose intrinsics, in words
    telemetry: str  # whose pose, in words
    unrelated: bool  # whether each image was perceived without the others
    frames: int = 0
    # Frames without metric depth, and those with partial depth, by reason.
    without_depth: Counter[str] = field(default_factory=Counter)
    in_part: Counter[str] = field(default_factory=Counter)
    with_mark: int = 0  # frames that show it
    skipped: Sequence[str] = ()  # images that could not be used, and why
    warnings: Sequence[str] = ()  # what may be wrong with all images
    interrupted: bool = False
    stage_s: dict[str, list[float]] = field(
        default_factory=lambda: {stage: [] for stage in (*STAGES, _ALL)}
    )  # wall time of the frames

    def add(self, seen: Perceived) -> None:
        """Count a frame."""
        self.frames += 1
        if seen.refusal:
            (self.without_depth if seen.depth is None else self.in_part)[seen.refusal] += 1
        self.with_mark += seen.mark is not None and seen.mark.detected
        for stage, spent_s in {**seen.stage_s, _ALL: sum(seen.stage_s.values())}.items():
            self.stage_s[stage].append(spent_s)

    @property
    def stage_ms(self) -> dict[str, Percentiles]:
        """Wall time by stage, "all" their sum."""
        found = {stage: Percentiles.of_seconds(spent) for stage, spent in self.stage_s.items()}
        return {stage: figures for stage, figures in found.items() if figures is not None}


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
    with ExitStack() as stack:
        pipeline, images = given.begin(stack.enter_context(closing(given.images())))
        summary = PerceiveSummary(
            camera=given.camera_words, telemetry=given.telemetry_words, unrelated=given.unrelated
        )
        writers: list[_Write] = []
        if out is not None:
            rate = given.source.rate_per_s / options.every
            writers.append(stack.enter_context(_overlay_video(out, pipeline.camera, rate)))
        if folder is not None:
            writers.append(partial(_write_mask, folder))
        if lines is not None:
            stack.enter_context(writing(lines))
            file = stack.enter_context(lines.open("w", encoding="utf-8"))
            writers.append(partial(_write_line, file))
        try:
            for image in images:
                if given.unrelated:
                    pipeline.restart()
                frame = given.telemetry.frame(image.pixels(), image.index, image.time_s)
                seen = pipeline.perceive(frame, given.telemetry.states(image.time_s))
                summary.add(seen)
                for write in writers:
                    write(image, seen)
                done = image.index + 1
                advance(f"frames, {image.name}", done, max(done, total))
        except KeyboardInterrupt:
            summary.interrupted = True
    skipped, warnings = tuple(given.source.skipped), tuple(given.source.warnings)
    return replace(summary, skipped=skipped, warnings=warnings)


def _check_outputs(files: list[Path], masks: Path | None, given: tuple[object, ...]) -> None:
    for file in files:
        refuse_inputs(file, given, shipped_trees())
        if masks is not None and same_file(file.parent, masks):
            raise InputError(f"{file} lies in the folder of the masks; name another place for it")
    if masks is not None:
        check_empty_folder(masks, "net perceive --masks")


def _write_mask(folder: Path, image: Shot, seen: Perceived) -> None:
    """Write the class map of an image, and once the folder and the list of classes.

    It is a grey PNG, (h, w), whose values are class ids.
    `IMG_1.jpg` of a folder becomes `IMG_1.png`, frame 12 of a video `000012.png`.
    """
    name, classes = Path(image.name), folder / "classes.json"
    in_folder = name.suffix.lower() in IMAGE_SUFFIXES
    path = folder / (f"{name.stem}.png" if in_folder else f"{image.index:06d}.png")
    with writing(path):
        folder.mkdir(parents=True, exist_ok=True)
        if in_folder and path.exists():  # IMG_1.jpg and IMG_1.png of one folder have two masks
            path = folder / f"{name.name}.png"
        if path.exists():
            raise FileError(path, "exists already, and is not replaced")
    write_whole(path, encode_bytes(seen.class_map.ids))
    if not classes.exists():
        rows = [
            {"id": number, "name": each.name, "role": each.role, "rgb": list(each.colour)}
            for number, each in enumerate(seen.class_map.classes)
        ]
        write_whole(classes, json.dumps({"classes": rows}, indent=2) + "\n")


def _write_line(file: TextIO, image: Shot, seen: Perceived) -> None:
    file.write(to_json(_values(image, seen), inf_nan_mode="null").decode() + "\n")


@contextmanager
def _overlay_video(path: Path, camera: CameraModel, rate_per_s: float) -> Iterator[_Write]:
    """Write the mp4 file with the overlays, which appears at the end."""
    panes = PerceptionPanes(camera)
    rate = Fraction(min(rate_per_s, _MAX_RATE)).limit_denominator(1001)
    file = VideoFile(path, size_px=panes.size_px, frames_per_s=rate, comment=FILM)
    slot = -1

    def write(image: Shot, seen: Perceived) -> None:
        nonlocal slot
        slot = max(slot + 1, round(image.time_s * float(rate)))
        file.write(panes.draw(seen), slot)

    with closing(file):
        yield write


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
            name: {"value": each.value, "reason": each.reason or None, **_measures(each)}
            for name, each in seen.confidences.items()
        },
        "refusal": seen.refusal or None,
        "corridor": corridor and {name: getattr(corridor, name) for name in _CORRIDOR},
        "mark": mark
        and {**{name: getattr(mark, name) for name in _MARK}, "seen_s": mark.captured_s},
        "ms": {stage: 1000.0 * spent_s for stage, spent_s in seen.stage_s.items()},
    }


def _measures(confidence: Confidence) -> dict[str, Any]:
    measures = {
        name: {"value": value, "reason": why} for name, (value, why) in confidence.measures.items()
    }
    return {"measures": measures} if measures else {}
