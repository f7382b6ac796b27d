"""What perception of a source leaves behind: a film, a line for each frame, a summary."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

import numpy as np

from perception.depth.scale import Scale
from uav_bt.app.perceive.pipeline import STAGES, Perceived
from uav_bt.app.perceive.streams import TimedImage
from uav_bt.classes import CLASS_COLOURS
from uav_bt.display.video.perception_video import PerceptionPanes, Seen
from uav_bt.display.video.video_file import VideoFile
from uav_bt.mission.flight_report import Percentiles
from uav_bt.types import CameraModel, Corridor, HelipadFix

_FASTEST: Final = 60.0  # images a second of a video that is written
_ALL: Final = "all"  # the stages of a frame together


@dataclass(frozen=True, kw_only=True)
class PerceiveSummary:
    """What was perceived."""

    frames: int
    camera: str  # whose intrinsics, in words
    telemetry: str  # whose pose, in words
    stage_ms: Mapping[str, Percentiles]  # wall time by stage, "all" their sum
    without_depth: Mapping[str, int]  # frames without metric depth, by reason
    in_part: Mapping[str, int]  # frames whose depth is not all that was asked for, by reason
    with_helipad: int  # frames that show it
    skipped: tuple[str, ...]  # images that could not be used, and why
    interrupted: bool


class Film:
    """The mp4 file with the overlays; it appears when it is closed.

    Args:
        path: the file.
        camera: intrinsics of the undistorted images.
        rate_per_s: images a second.

    Raises:
        FileError: the file cannot be written.
    """

    def __init__(self, path: Path, camera: CameraModel, rate_per_s: float) -> None:
        self._panes = PerceptionPanes(camera, class_colours=CLASS_COLOURS)
        self._rate = Fraction(min(rate_per_s, _FASTEST)).limit_denominator(1001)
        self._file = VideoFile(path, size_px=self._panes.size_px, frames_per_s=self._rate)
        self._begin_s: float | None = None
        self._slot = -1

    def write(self, seen: Perceived) -> None:
        """Append what an image shows, at its time."""
        frame = seen.frame
        self._begin_s = frame.captured_s if self._begin_s is None else self._begin_s
        image = self._panes.draw(
            Seen(
                frame=frame,
                class_map=seen.class_map,
                depth=seen.depth,
                refusal=seen.refusal,
                corridor=seen.corridor,
                intruding=seen.intruding,
                helipad=seen.helipad,
            )
        )
        due = round((frame.captured_s - self._begin_s) * float(self._rate))
        self._slot = max(self._slot + 1, due)
        self._file.write(image, self._slot)

    def close(self) -> None:
        """Finish the file."""
        self._file.close()


@dataclass
class Tally:
    """Counts while images go by."""

    frames: int = 0
    stage_s: dict[str, list[float]] = field(default_factory=dict)
    without_depth: Counter[str] = field(default_factory=Counter)
    in_part: Counter[str] = field(default_factory=Counter)
    with_helipad: int = 0
    interrupted: bool = False

    def add(self, seen: Perceived) -> None:
        """Count a frame."""
        self.frames += 1
        for stage, spent_s in seen.stage_s.items():
            self.stage_s.setdefault(stage, []).append(spent_s)
        self.stage_s.setdefault(_ALL, []).append(sum(seen.stage_s.values()))
        if seen.refusal:
            (self.without_depth if seen.depth is None else self.in_part)[seen.refusal] += 1
        self.with_helipad += seen.helipad is not None and seen.helipad.detected

    def summary(self, *, camera: str, telemetry: str, skipped: Sequence[str]) -> PerceiveSummary:
        """Return what was counted; the words say whose camera and pose it was."""
        names = (*STAGES, _ALL)
        stages = ((name, Percentiles.of_seconds(self.stage_s.get(name, []))) for name in names)
        return PerceiveSummary(
            frames=self.frames,
            camera=camera,
            telemetry=telemetry,
            stage_ms={name: figures for name, figures in stages if figures is not None},
            without_depth=dict(self.without_depth.most_common()),
            in_part=dict(self.in_part.most_common()),
            with_helipad=self.with_helipad,
            skipped=tuple(skipped),
            interrupted=self.interrupted,
        )


def as_json(image: TimedImage, seen: Perceived) -> dict[str, Any]:
    """Return one frame as a JSON object: what is not known is null."""
    depth = seen.depth
    return {
        "image": image.name,
        "index": image.index,
        "time_s": round(image.time_s, 4),
        "depth": None
        if depth is None
        else {
            "confidence": round(depth.confidence, 4),
            "scale": None if seen.scale is None else _scale_json(seen.scale),
            "known_share": round(float(np.isfinite(depth.depth).mean()), 4),
        },
        "refusal": seen.refusal or None,
        "corridor": None if seen.corridor is None else _corridor_json(seen.corridor),
        "helipad": None if seen.helipad is None else _helipad_json(seen.helipad),
        "ms": {stage: round(1000.0 * spent_s, 3) for stage, spent_s in seen.stage_s.items()},
    }


def _scale_json(scale: Scale) -> dict[str, float]:
    return {"factor": round(scale.factor, 6), "shift_m": round(scale.shift_m, 6)}


def _metres(value: float) -> float | None:
    return round(value, 4) if math.isfinite(value) else None  # JSON knows no infinity


def _corridor_json(corridor: Corridor) -> dict[str, Any]:
    return {
        "free_distance_m": _metres(corridor.free_distance_m),
        "nearest_m": _metres(corridor.nearest_m),
        "nearest_side": corridor.nearest_side,
        "nearest_left_m": _metres(corridor.nearest_left_m),
        "nearest_right_m": _metres(corridor.nearest_right_m),
        "time_to_impact_s": _metres(corridor.time_to_impact_s),
        "unknown_px": corridor.unknown_px,
    }


def _helipad_json(fix: HelipadFix) -> dict[str, Any]:
    return {
        "forward_m": _metres(fix.forward_m),
        "right_m": _metres(fix.right_m),
        "detected": fix.detected,
        "confidence": round(fix.confidence, 4),
        "seen_s": _metres(fix.captured_s),
    }
