"""`uav-bt net evaluate depth`: output, files and refusals."""

from __future__ import annotations

import json
from pathlib import Path

from tests.worlds.cli import run
from uav_bt.cli.depth_tables import depth_report

ONE_SCENE = ("--scene", "train-b", "--views", 3)


def test_the_ways_without_a_network_are_measured_beside_the_paper(tmp_path: Path) -> None:
    out = tmp_path / "depth.json"
    result = run("net", "evaluate", "depth", "--model", "contact", *ONE_SCENE, "--out", out)
    assert result.exit_code == 0, result.output
    assert "contact on 3 images of train-b, unet masks" in result.stdout
    lines = [line.split() for line in result.stdout.splitlines()]
    assert ["the", "paper", "0.0740", "0.0597", "0.0988", "0.0655", "0.8342"] in lines
    assert ["the", "paper", "0.1440", "0.1628", "0.3714"] in lines
    for title in ("9x9 median", "along the ray", "pitch -2 deg", "clear"):
        assert title in result.stdout
    assert "adaptive " not in result.stdout
    written = json.loads(out.read_text())
    assert written["model"] == "contact"
    assert written["tables"]["distance"][0]["error"]["total"] == written["points"] > 50


def test_only_the_tables_asked_for_are_made() -> None:
    result = run(
        "net",
        "evaluate",
        "depth",
        "--model",
        "contact",
        "--masks",
        "exact",
        *ONE_SCENE,
        "--tables",
        "distance",
    )
    assert result.exit_code == 0, result.output
    assert "along the ray" in result.stdout
    assert "exact masks, telemetry of profile 'lab'" in result.stdout
    assert "edges, no patch" not in result.stdout


def test_figures_that_nobody_knows_are_dashes() -> None:
    error = dict.fromkeys(
        ("mean_m", "median_m", "rmse_m", "std_m", "max_m", "p95_m", "bias_m", "correlation")
    ) | {"total": 0, "valid": 0}
    result = {
        "model": "m",
        "images": 1,
        "scenes": ["s"],
        "masks": "unet",
        "profile": "lab",
        "edges": 0,
        "images_with_edges": 0,
        "median_edge_m": None,
        "points": 0,
        "tables": {"distance": [{"method": "contact", "what": "ground", "error": error}]},
    }
    lines = list(depth_report(result))
    assert lines[-1].split() == ["contact", *"------"]
