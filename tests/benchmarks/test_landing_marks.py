"""The measurement of landing marks."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from benchmarks import landing_marks
from sim_bridge.twin.scene_file import load_scene
from uav_bt.plugins import make_mark_finder


@pytest.mark.parametrize("name", landing_marks.MARKS.split(","))
def test_each_mark_stands_in_its_scenes(name: str, tmp_path: Path) -> None:
    landing_marks.write_scene(name, 3, tmp_path)
    scene = load_scene(str(tmp_path / f"{name}-3.yaml"))
    assert scene.mark == landing_marks.scene_of(name).mark
    assert make_mark_finder(scene.mark) is not None
    assert math.dist(scene.start_m, landing_marks.CENTRE_M) >= 2.0


def test_a_view_from_above_has_hardly_an_error() -> None:
    scene = landing_marks.scene_of("apriltag-0")
    errors = np.abs(landing_marks.errors_in_views(scene, 1.5, 60.0, 2))
    assert errors.shape == (2, 2)
    assert errors[:, 0].max() < 0.01
    assert errors[:, 1].max() < 0.5
