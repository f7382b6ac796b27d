"""`uav-bt net train`: refusals."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.uav_bt.cli.cli_world import run


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["depth", "absent.mcap"], ["absent.mcap"]),
        (["depth", "a.mcap", "--out", "net.onnx"], [".safetensors"]),
        (["depth", "a.mcap", "--out", "nowhere/n.safetensors"], ["create it first"]),
        (["depth", "a.mcap", "--steps", "0"], ["--steps"]),
        (["control"], ["control"]),
    ],
)
def test_a_mistake_is_reported_and_nothing_is_written(
    arguments: list[str], words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run("net", "train", *arguments)
    assert result.exit_code == 2, result.output
    assert "Traceback" not in result.stderr
    for word in words:
        assert word in result.stderr
    assert list(tmp_path.iterdir()) == []
