"""`uav-bt net evaluate depth`: output, files and refusals."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.worlds.cli import run
from uav_bt.cli.evaluate import depth_table

ONE_SCENE = ("--scene", "train-b", "--views", 3)


def test_ground_contact_is_measured_beside_the_paper(tmp_path: Path) -> None:
    out = tmp_path / "depth.json"
    result = run("net", "evaluate", "depth", "--model", "contact", *ONE_SCENE, "--out", out)
    assert result.exit_code == 0, result.output
    assert "contact on 3 images of train-b, unet masks, telemetry of profile 'lab'" in result.stdout
    paper, contact = result.stdout.splitlines()[3:5]
    figures = ["0.0740", "0.0597", "0.0988", "0.0655", "0.8342", "0.1440", "0.1628", "0.3714"]
    assert paper.split() == ["the", "paper", "(adaptive)", *figures]
    assert contact.split()[0] == "contact"
    written = json.loads(out.read_text())
    assert (written["model"], written["images"]) == ("contact", 3)
    (row,) = written["rows"]
    assert row["distances"]["total"] == written["points"] > 50
    assert row["edges"]["total"] == written["edges"] > 3
    assert row["edges"]["mean_m"] < 0.05
    assert row["edges"]["rmse_m"] ** 2 == pytest.approx(
        row["edges"]["mean_m"] ** 2 + row["edges"]["std_m"] ** 2, abs=1e-4
    )


def test_every_method_has_a_row_on_exact_masks() -> None:
    result = run("net", "evaluate", "depth", "--masks", "exact", *ONE_SCENE)
    assert result.exit_code == 0, result.output
    assert "exact masks" in result.stdout
    rows = [line.split()[0] for line in result.stdout.splitlines()[4:]]
    assert rows == ["constant", "least_squares", "adaptive", "flown", "contact"]


def test_figures_that_nobody_knows_are_dashes() -> None:
    names = ("mean_m", "median_m", "rmse_m", "std_m", "max_m", "correlation")
    error = dict.fromkeys(names) | {"total": 0, "valid": 0}
    row = {"method": "contact", "edges": error, "distances": error, "obstacles": error}
    heads, _, contact = depth_table([row]).splitlines()
    assert contact.split() == ["contact", *"------------"]
    assert len(heads) == len(contact), "numbers are aligned at the right"
