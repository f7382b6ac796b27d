"""`uav-bt net pick` and `net train`: inputs, outputs and refusals."""

from __future__ import annotations

from http.server import HTTPServer
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.uav_bt.cli.cli_world import run


def test_picking_serves_a_page_until_it_is_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((9, 16, 3), dtype=np.uint8))

    def stopped(_: HTTPServer) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(HTTPServer, "serve_forever", stopped)
    picks = tmp_path / "picks.csv"
    result = run("net", "pick", tmp_path, "--picks", picks)
    assert result.exit_code == 0, result.output
    assert "open http://127.0.0.1:" in result.stdout
    assert f"0 picks: {picks}" in result.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["train", "depth", "absent.mcap"], ["absent.mcap"]),
        (["train", "depth", "a.mcap", "--out", "net.onnx"], [".safetensors"]),
        (["train", "depth", "a.mcap", "--out", "nowhere/n.safetensors"], ["create it first"]),
        (["train", "depth", "a.mcap", "--steps", "0"], ["--steps"]),
        (["train", "control"], ["control"]),
        (["pick", "absent"], ["absent: is not a folder"]),
        (["pick", "."], ["holds no photographs"]),
    ],
)
def test_a_mistake_is_told_and_nothing_is_written(
    arguments: list[str], words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run("net", *arguments)
    assert result.exit_code == 2, result.output
    assert "Traceback" not in result.stderr
    for word in words:
        assert word in result.stderr
    assert list(tmp_path.iterdir()) == []
