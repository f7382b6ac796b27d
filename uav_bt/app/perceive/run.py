"""Perceive every image of a source: a video with overlays, a line a frame, a summary."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
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
from uav_bt.inputs import same_file
from uav_bt.mission.flight_report import Percentiles
from uav_bt.progress import Advance, silent
from uav_bt.record.images import encode_bytes
from uav_bt.types import CameraModel, ClassMap

_MAX_RATE: Final = 60.0  # images a second of a video that is written
_ALL: Final = "all"  # the stages of a frame together

_Write = Callable[[Shot, Perceived], None]


@dataclass(frozen=True, kw_only=True)
class PerceiveSummary:
    """Result of a run of perception."""

    frames: int
    unrelated: bool  # whether each image was perceived without the others
    camera: str  # whose intrinsics, in words
    telemetry: str  # whose pose, in words
    stage_ms: Mapping[str, Percentiles]  # wall time by stage, "all" their sum
    without_depth: Mapping[str, int]  # frames without metric depth, by reason
    in_part: Mapping[str, int]  # frames whose depth is not all that was asked for, by reason
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
    _check_outputs([path for path in (out, lines) if path is not None], folder, source, options)
    mask_folder = None if folder is None else _MaskFolder(folder)
    given = PerceiveInput(str(source), options)
    pipeline, images = given.begin()
    counts = _Counts()
    with ExitStack() as stack:
        stack.enter_context(closing(images))
        writers: list[_Write] = []
        if out is not None:
            rate = given.source.rate_per_s / options.every
            writers.append(stack.enter_context(_overlay_video(out, pipeline.camera, rate)))
        if mask_folder is not None:
            writers.append(lambda image, seen: mask_folder.write(image, seen.class_map))
        if lines is not None:
            writers.append(stack.enter_context(_json_lines(lines)))
        try:
            for image in images:
                if given.unrelated:
                    pipeline.restart()
                frame = given.telemetry.frame(image.image, image.index, image.time_s)
                seen = pipeline.perceive(frame, given.telemetry.states(image.time_s))
                counts.add(seen)
                for write in writers:
                    write(image, seen)
                advance(f"frames, {image.name}", *given.progress(image))
        except KeyboardInterrupt:
            counts.interrupted = True
    return counts.summary(given)


def _check_outputs(
    files: list[Path], masks: Path | None, source: str | Path, options: PerceiveOptions
) -> None:
    texts = (options.telemetry, options.camera, options.segmentation, options.model)
    read = [Path(each) for each in (source, *texts, options.classes) if each is not None]
    for file in files:
        if masks is not None and same_file(file.parent, masks):
            raise InputError(f"{file} lies in the folder of the masks; name another place for it")
        if any(other.exists() and file.exists() and file.samefile(other) for other in read):
            raise InputError(f"{file} would overwrite an input; name another file")


class _MaskFolder:
    """A new or empty folder with the class map of each frame, and the classes.

    A class map is a grey PNG of 8 bits, (h, w), whose values are class ids, at the size of the map.
    `IMG_1.jpg` of a folder becomes `IMG_1.png`, frame 12 of a video `000012.png`.
    """

    def __init__(self, folder: Path) -> None:
        check_empty_folder(folder, "net perceive --masks")
        self._folder = folder

    def write(self, image: Shot, class_map: ClassMap) -> None:
        """Write the class map of an image; the first one makes the folder."""
        classes = self._folder / "classes.json"
        if not classes.exists():
            with writing(self._folder):
                self._folder.mkdir(parents=True, exist_ok=True)
            rows = [
                {"id": number, "name": each.name, "role": each.role, "rgb": list(each.colour)}
                for number, each in enumerate(class_map.classes)
            ]
            write_whole(classes, json.dumps({"classes": rows}, indent=2) + "\n")
        path = self._path(image)
        with writing(path):
            if path.exists() or path.is_symlink():
                raise FileError(path, "exists already, and is not replaced")
        write_whole(path, encode_bytes(class_map.ids))

    def _path(self, image: Shot) -> Path:
        name = Path(image.name)
        if name.suffix.lower() not in IMAGE_SUFFIXES:
            return self._folder / f"{image.index:06d}.png"
        path = self._folder / f"{name.stem}.png"
        # IMG_1.jpg and IMG_1.png of one folder have two masks.
        return self._folder / f"{name.name}.png" if path.exists() else path


@contextmanager
def _json_lines(path: Path) -> Iterator[_Write]:
    with writing(path), path.open("w", encoding="utf-8") as file:

        def write(image: Shot, seen: Perceived) -> None:
            file.write(json.dumps(_as_json(image, seen), allow_nan=False) + "\n")

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


@dataclass
class _Counts:
    """Sums over the images so far."""

    frames: int = 0
    stage_s: dict[str, list[float]] = field(default_factory=dict)
    without_depth: Counter[str] = field(default_factory=Counter)
    in_part: Counter[str] = field(default_factory=Counter)
    with_mark: int = 0
    interrupted: bool = False

    def add(self, seen: Perceived) -> None:
        self.frames += 1
        for stage, spent_s in (*seen.stage_s.items(), (_ALL, sum(seen.stage_s.values()))):
            self.stage_s.setdefault(stage, []).append(spent_s)
        if seen.refusal:
            (self.without_depth if seen.depth is None else self.in_part)[seen.refusal] += 1
        self.with_mark += seen.mark is not None and seen.mark.detected

    def summary(self, given: PerceiveInput) -> PerceiveSummary:
        names = (*STAGES, _ALL)
        stages = ((name, Percentiles.of_seconds(self.stage_s.get(name, []))) for name in names)
        return PerceiveSummary(
            frames=self.frames,
            unrelated=given.unrelated,
            camera=given.camera_words,
            telemetry=given.telemetry_words,
            stage_ms={name: figures for name, figures in stages if figures is not None},
            without_depth=dict(self.without_depth.most_common()),
            in_part=dict(self.in_part.most_common()),
            with_mark=self.with_mark,
            skipped=tuple(given.source.skipped),
            warnings=tuple(given.source.warnings),
            interrupted=self.interrupted,
        )


def _as_json(image: Shot, seen: Perceived) -> dict[str, Any]:
    """Return one frame as a JSON object. Unknown values are null."""
    depth, scale, corridor, mark = seen.depth, seen.scale, seen.corridor, seen.mark
    return {
        "image": image.name,
        "index": image.index,
        "time_s": round(image.time_s, 4),
        "depth": depth
        and {
            "confidence": round(depth.confidence, 4),
            "scale": scale
            and {"factor": round(scale.factor, 6), "shift_m": round(scale.shift_m, 6)},
            "known_share": round(float(np.isfinite(depth.depth).mean()), 4),
        },
        "confidence": {
            name: {
                "value": None if each.value is None else round(each.value, 4),
                "reason": each.reason or None,
                **({"measures": _measures(each.measures)} if each.measures else {}),
            }
            for name, each in seen.confidences.items()
        },
        "refusal": seen.refusal or None,
        "corridor": corridor
        and {
            "free_distance_m": _metres(corridor.free_distance_m),
            "nearest_m": _metres(corridor.nearest_m),
            "nearest_side": corridor.nearest_side,
            "nearest_left_m": _metres(corridor.nearest_left_m),
            "nearest_right_m": _metres(corridor.nearest_right_m),
            "time_to_impact_s": _metres(corridor.time_to_impact_s),
            "unknown_px": corridor.unknown_px,
        },
        "mark": mark
        and {
            "forward_m": _metres(mark.forward_m),
            "right_m": _metres(mark.right_m),
            "detected": mark.detected,
            "confidence": round(mark.confidence, 4),
            "seen_s": _metres(mark.captured_s),
        },
        "ms": {stage: round(1000.0 * spent_s, 3) for stage, spent_s in seen.stage_s.items()},
    }


def _measures(measures: Mapping[str, tuple[float, str | None]]) -> dict[str, Any]:
    return {
        name: {"value": round(value, 4), "reason": reason}
        for name, (value, reason) in measures.items()
    }


def _metres(value: float) -> float | None:
    return round(value, 4) if math.isfinite(value) else None  # JSON knows no infinity
