"""Flights of the shipped control student in the twin, and of one without answers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import pytest

from perception.control.runtime import SHIPPED_STUDENT
from uav_bt import app

pytestmark = pytest.mark.flight

ROOT = Path(__file__).parents[3]
SMALL = app.FlightOptions(scene="val-b", seed=3, image_size_px=(320, 180))
EXPLORES = '="90000"'  # duration of the exploration, ms


def shortened(name: str, folder: Path) -> Path:
    """Return a shipped mission that explores for 3 s only."""
    text = (ROOT / "trees" / f"{name}.xml").read_text(encoding="utf-8")
    assert EXPLORES in text
    path = folder / f"{name}.xml"
    path.write_text(text.replace(EXPLORES, '="3000"', 1), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "mission", ["explore_and_land_student", "explore_and_land_student_guarded"]
)
def test_the_shipped_student_explores(mission: str, tmp_path: Path) -> None:
    """Whether it comes home is for campaigns: on another processor it flies another way."""
    report = app.fly(shortened(mission, tmp_path), SMALL)
    assert report.outcome != "error", report.reason
    assert report.explore_distance_m is not None
    assert report.explore_distance_m > 0.0


def test_a_network_without_an_answer_lets_the_drone_hover(tmp_path: Path) -> None:
    """An invalid answer never becomes zero: the drone waits for the next view, with a warning."""
    model = onnx.load(SHIPPED_STUDENT)
    (bias,) = [one for one in model.graph.initializer if one.name == "head.bias"]
    bias.CopyFrom(onnx.numpy_helper.from_array(np.full(5, np.nan, np.float32), bias.name))
    (tmp_path / "nan.onnx").write_bytes(model.SerializeToString())
    tree = shortened("explore_and_land_student", tmp_path)
    text = tree.read_text(encoding="utf-8")
    tree.write_text(text.replace('"student"', f'"student:{tmp_path}/nan.onnx"'), encoding="utf-8")
    flown = app.fly(tree, SMALL)
    assert flown.outcome == "success"
    (warning,) = [event for event in flown.events if event.kind == "warning"]
    assert warning.text.endswith("nan.onnx: the network's answer holds NaN or infinity")
    assert warning.node.endswith("step_or_turn/Explore")
