"""Importing the tree language is fast: `uav-bt check` must take less than 0.5 s."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

HEAVY = "cv2 torch mujoco openvino sklearn matplotlib av rich onnx filterpy control"


@pytest.mark.parametrize("module", ["uav_bt.tree", "uav_bt.plugins", "uav_bt.testing.plugin"])
def test_no_heavy_imports(module: str) -> None:
    code = f"import sys, {module}; print([m for m in '{HEAVY}'.split() if m in sys.modules])"
    done = subprocess.run(  # noqa: S603  # our own interpreter and code
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        cwd=Path(__file__).parents[3],
        check=True,
    )
    assert done.stdout.strip() == "[]"
