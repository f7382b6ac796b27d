"""What a training run of the control student keeps: a line for each validation, and curves."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.control.scoring import ControlScore
from uav_bt.errors import FileError

__all__ = ["StudentDiary"]

_CURVES: Final = ("loss", "missed", "stopped", "wrong_side", "step_error_m", "free_error_m")
_PANE_PX: Final = (320, 200)  # width, height
_BLACK, _BLUE = (40, 40, 40), (180, 90, 20)  # blue green red


class StudentDiary:
    """What a run keeps beside its checkpoint: a line for each validation, and curves.

    Args:
        folder: `scores.jsonl` and `curves.png` go there.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def note(self, step: int, loss: float, score: ControlScore | None) -> None:
        """Add a line, and draw the curves anew."""
        self._folder.mkdir(parents=True, exist_ok=True)
        plain = {} if score is None else score.to_json()
        with (self._folder / "scores.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps({"step": step, "loss": loss, **plain}) + "\n")
        self._draw()

    def lines(self) -> list[dict[str, Any]]:
        """Return what was noted; of a step that was noted twice, the later line."""
        file = self._folder / "scores.jsonl"
        lines = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
        by_step = {line["step"]: line for line in lines}
        return [by_step[step] for step in sorted(by_step)]

    def _draw(self) -> None:
        lines = self.lines()
        panes = [_pane(name, lines) for name in _CURVES]
        sheet = np.vstack([np.hstack(panes[:3]), np.hstack(panes[3:])])
        path = self._folder / "curves.png"
        done, content = cv2.imencode(".png", sheet)
        if not done:
            raise FileError(path, "the picture cannot be written")
        path.write_bytes(content.tobytes())


def _pane(name: str, lines: Sequence[Mapping[str, Any]]) -> NDArray[np.uint8]:
    """Return a curve over the steps, from nought to its most."""
    width, height = _PANE_PX
    pane = np.full((height, width, 3), 255, dtype=np.uint8)
    points = [(line["step"], line[name]) for line in lines if line.get(name) is not None]
    label = f"{name}  {points[-1][1]:.3f} at {points[-1][0]}" if points else f"{name}: none"
    cv2.putText(pane, label, (8, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.42, _BLACK, 1, cv2.LINE_AA)
    if points:
        steps, values = np.array(points, dtype=np.float64).T
        x = 8 + (width - 16) * steps / steps.max()
        y = height - 8 - (height - 36) * values / max(values.max(), 1e-9)
        curve = np.rint(np.stack([x, y], axis=1)).astype(np.int32)
        cv2.polylines(pane, [curve.reshape(-1, 1, 2)], False, _BLUE, 2, cv2.LINE_AA)
    return pane
