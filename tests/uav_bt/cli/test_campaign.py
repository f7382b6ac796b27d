"""`uav-bt campaign` and `uav-bt report`: a small campaign, and all refusals."""

from __future__ import annotations

import io
import json
import shutil
from pathlib import Path
from typing import Any

import click
import pytest
from rich.console import Console

from tests.worlds.cli import HOP, assert_refused, run, tree_file
from uav_bt import campaign as campaigns
from uav_bt.cli.progress import campaign_progress

SMALL = ("--drone", "plain", "--profile", "ideal", "--workers", 1)


def flights_of(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "flights.jsonl").read_text().splitlines()]


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign of two short flights."""
    folder = tmp_path_factory.mktemp("campaign")
    mission = tree_file(folder, HOP)
    out = folder / "out"
    done = run("campaign", mission, "--scenes", "val-*", "--flights", 1, *SMALL, "--out", out)
    assert done.exit_code == 0, done.output
    assert "mission.xml: success 2 of 2 (95 % Wilson interval 34.2 to 100.0 %)\n" in done.stdout
    assert "1/2 mission.xml val-" in done.stderr
    (heads,) = (line for line in done.stdout.splitlines() if "median" in line)
    assert heads.split() == ["unit", "n", "mean", "median", "p5", "p95", "least", "most"]
    assert len(heads) <= 80
    return out


@pytest.fixture
def folder(flown: Path, tmp_path: Path) -> Path:
    """A copy of the campaign, which a test may change."""
    return Path(shutil.copytree(flown, tmp_path / "c"))


def test_flights_are_kept_with_their_way(flown: Path) -> None:
    one, two = sorted(flights_of(flown), key=lambda flight: flight["scene"])
    assert (one["scene"], two["scene"], one["tree"]) == ("val-a", "val-b", "mission.xml")
    assert one["outcome"] == two["outcome"] == "success"
    assert one["duration_s"] > 3.0
    times, heights = ([point[i] for point in one["path"]] for i in (0, 3))
    assert times[:3] == [0.0, 0.5, 1.0]
    assert max(heights) > 1.0


def test_a_report_is_written_into_the_folder(folder: Path) -> None:
    done = run("report", folder)
    assert done.exit_code == 0, done.output
    files = [Path(line) for line in done.stdout.splitlines()]
    assert files[0] == folder / "report.html"
    assert all(file.is_file() for file in files)
    assert {file.suffix for file in files} == {".html", ".png", ".csv"}
    assert (folder / "report-figures" / "scene-val-a.png") in files


def test_a_worse_tree_makes_the_exit_code(folder: Path, tmp_path: Path) -> None:
    worse = tmp_path / "worse.jsonl"
    worse.write_text((folder / "flights.jsonl").read_text().replace('"success"', '"timeout"'))
    words = ("report", folder, worse, "--figures", "none", "--not-worse")
    done = run(*words, "--out", tmp_path / "r.html")
    assert done.exit_code == 1, done.output
    assert f"worse: mission ({worse}): 2 more failures" in done.stderr
    assert run("report", folder, folder / "flights.jsonl", *words[3:]).exit_code == 0
    assert_refused(run("report", folder, "--not-worse"), "got one tree")


def test_a_file_of_flights_is_reported_beside_it(folder: Path) -> None:
    file = (folder / "flights.jsonl").rename(folder / "mine.jsonl")
    done = run("report", file, "--figures", "none")
    assert done.exit_code == 0, done.output
    assert done.stdout.splitlines()[0] == str(folder / "mine.html")


def test_a_resumed_campaign_flies_nothing_again_and_fails_under_a_limit(folder: Path) -> None:
    before = (folder / "flights.jsonl").read_text()
    assert run("campaign", "--resume", folder, "--fail-under", 100).exit_code == 0
    assert (folder / "flights.jsonl").read_text() == before
    (folder / "flights.jsonl").write_text(before.replace("success", "collision", 1))
    assert run("campaign", "--resume", folder, "--fail-under", 50).exit_code == 0
    assert run("campaign", "--resume", folder, "--fail-under", 51).exit_code == 1


def test_a_stopped_campaign_can_be_resumed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def stopped(*_: Any, on_flight: Any, **__: Any) -> None:
        on_flight({"outcome": "success", "tree": "t", "scene": "s", "seed": 0}, True)
        raise KeyboardInterrupt

    monkeypatch.setattr(campaigns, "run", stopped)
    done = run("campaign", "land_only", "--flights", 2, "--out", tmp_path / "out")
    assert done.exit_code == 1
    assert "stopped; 1 of 4 flights are kept" in done.stderr


def test_on_a_terminal_a_bar_counts_outcomes_and_names_failures() -> None:
    told = io.StringIO()
    console = Console(file=told, force_terminal=True, width=100)
    with campaign_progress(3, Path("out"), console) as progress:
        progress.add({"outcome": "success", "tree": "t", "scene": "s", "seed": 0}, now=False)
        progress.add({"outcome": "success", "tree": "t", "scene": "s", "seed": 1}, now=True)
        progress.add(
            {"outcome": "timeout", "tree": "t", "scene": "s", "seed": 2, "reason": "[red]"},
            now=True,
        )
        assert progress.outcomes.total() == 3
    text = click.unstyle(told.getvalue())
    assert "success 2  timeout 1" in text
    assert "3/3 t s seed 2: timeout, [red]" in text
    assert "seed 1" not in text
