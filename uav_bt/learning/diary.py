"""What a training run keeps beside its checkpoint: a line for each validation, and curves."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

_COLUMNS: Final = 3


class Diary:
    """A run's scores by step.

    Args:
        folder: `scores.jsonl` and `curves.png` go there.
        curves: names of the values that are drawn over the steps.
    """

    def __init__(self, folder: Path, curves: Sequence[str]) -> None:
        self.folder = folder
        self._curves = tuple(curves)

    def note(self, step: int, values: Mapping[str, Any]) -> None:
        """Add a line, and draw the curves anew.

        Args:
            step: of the training.
            values: anything JSON can hold, by name; None where there is no value.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        with (self.folder / "scores.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps({"step": step, **values}) + "\n")
        self._draw()

    def lines(self) -> list[dict[str, Any]]:
        """Return what was noted; of a step that was noted twice, the later line."""
        file = self.folder / "scores.jsonl"
        lines = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
        by_step = {line["step"]: line for line in lines}
        return [by_step[step] for step in sorted(by_step)]

    def _draw(self) -> None:
        from matplotlib.figure import Figure  # noqa: PLC0415  (only the training extra has it)

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
