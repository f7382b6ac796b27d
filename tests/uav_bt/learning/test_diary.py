"""Diary of a training run: a line for each validation, and curves."""

from __future__ import annotations

import json
from pathlib import Path

import cv2

from uav_bt.learning.diary import Diary


def test_a_step_that_is_noted_twice_counts_once(tmp_path: Path) -> None:
    diary = Diary(tmp_path, ("loss",))
    for step, loss in ((500, 0.9), (1000, 0.5), (1000, 0.4)):
        diary.note(step, {"loss": loss})
    assert [(line["step"], line["loss"]) for line in diary.lines()] == [(500, 0.9), (1000, 0.4)]
    assert len((tmp_path / "scores.jsonl").read_text().splitlines()) == 3
    assert json.loads((tmp_path / "scores.jsonl").read_text().splitlines()[0])["step"] == 500


def test_every_curve_is_drawn_also_one_without_values(tmp_path: Path) -> None:
    diary = Diary(tmp_path, ("loss", "a", "b", "none"))
    diary.note(1, {"loss": 0.5, "a": 1.0, "b": None})
    diary.note(2, {"loss": 0.4, "a": 2.0, "b": 0.1})
    drawn = cv2.imread(str(tmp_path / "curves.png"))
    assert drawn is not None
    assert drawn.shape[:2] == (500, 1200)
    assert drawn.std() > 10.0
