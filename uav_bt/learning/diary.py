"""Diary of a training run: scores of each validation, curves, images."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from perception.depth.training.footage import LABEL_SIZE_PX, shrink
from uav_bt.errors import FileError
from uav_bt.learning.views import DepthViews
from uav_bt.types.arrays import Image

_COLUMNS: Final = 3
_SHEET_ROWS: Final = 6


class Diary:
    """Scores of a run by step."""

    def __init__(self, folder: Path, curves: Sequence[str]) -> None:
        self.folder = folder
        self._curves = tuple(curves)

    def note(self, step: int, values: Mapping[str, Any]) -> None:
        """Add a line and redraw the curves."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with (self.folder / "scores.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps({"step": step, **values}) + "\n")
        self._draw()

    def lines(self) -> list[dict[str, Any]]:
        """Return all lines; of repeated steps only the last line."""
        file = self.folder / "scores.jsonl"
        lines = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
        by_step = {line["step"]: line for line in lines}
        return [by_step[step] for step in sorted(by_step)]

    def _draw(self) -> None:
        lines = self.lines()
        rows = -(-len(self._curves) // _COLUMNS)
        figure = Figure(figsize=(4 * _COLUMNS, 2.5 * rows), layout="constrained")
        panes = figure.subplots(rows, _COLUMNS, squeeze=False).flat
        for name, pane in zip(self._curves, panes, strict=False):
            points = [(line["step"], line[name]) for line in lines if line.get(name) is not None]
            if points:
                pane.plot(*zip(*points, strict=True), marker=".")
            pane.set_title(f"{name}: {points[-1][1]:.3f}" if points else f"{name}: none")
            pane.set_ylim(bottom=0.0)
        figure.savefig(self.folder / "curves.png")


def write_depth_sheet(path: Path, views: DepthViews, predicted: NDArray[np.float32]) -> None:
    """Draw image, true and predicted depth, (N, 128, 160), of some views side by side."""
    places = np.linspace(0, len(views.rgb) - 1, _SHEET_ROWS).astype(int)
    strips = [_depth_strip(views.rgb[at], views.depth_m[at], predicted[at]) for at in places]
    if not cv2.imwrite(str(path), np.vstack(strips)[..., ::-1]):
        raise FileError(path, "the image cannot be written")


def _depth_strip(rgb: Image, truth_m: NDArray[np.float32], predicted: NDArray[np.float32]) -> Image:
    """Return image, true depth and median-scaled depth side by side, (128, 480, 3) RGB."""
    scaled = predicted * np.median(truth_m / predicted)
    return np.hstack([shrink(rgb, LABEL_SIZE_PX), _coloured(truth_m), _coloured(scaled)])


def _coloured(depth_m: NDArray[np.float32]) -> Image:
    # By inverse depth, so that near depths, which matter, use most of the colours.
    share = np.clip((1.0 / depth_m - 1.0 / 8.0) / (1.0 / 0.6 - 1.0 / 8.0), 0.0, 1.0)
    grey = np.rint(255.0 * share).astype(np.uint8)
    bgr = cv2.applyColorMap(grey, cv2.COLORMAP_TURBO)
    return np.asarray(bgr[..., ::-1], dtype=np.uint8)
