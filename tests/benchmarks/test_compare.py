"""Comparison of campaigns: pairs, differences, intervals, and the rule for a worse result."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.compare import main
from uav_bt.campaign.report.statistics import mcnemar, mean_interval
from uav_bt.campaign.store import FLIGHTS_FILE


def flight(seed: int, **fields: Any) -> dict[str, Any]:
    return {
        "tree": "a",
        "scene": "val-a",
        "seed": seed,
        "outcome": "success",
        "min_clearance_m": 0.5,
        "coverage_curve": [[90.0, 0.6, 0.9], [170.0, 0.8, 1.0], [190.0, 0.9, 1.0]],
        "time_to_find_helipad_s": 4.0,
        "time_to_land_s": 11.0,
        "objects_found": 3,
        "objects_total": 4,
        **fields,
    }


def campaign(folder: Path, name: str, flights: list[dict[str, Any]]) -> str:
    (folder / name).mkdir()
    text = "".join(json.dumps(one) + "\n" for one in flights)
    (folder / name / FLIGHTS_FILE).write_text(text, encoding="utf-8")
    return str(folder / name)


def test_flights_are_paired_by_scene_and_seed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Seeds 1 and 2 are in both sets; the missions have different names."""
    before = campaign(tmp_path, "before", [flight(seed) for seed in (1, 2, 3)])
    later = [flight(1, tree="b", min_clearance_m=0.6), flight(2, tree="b", min_clearance_m=0.8)]
    after = campaign(tmp_path, "after", later)

    assert main([before, after]) == 0

    out = capsys.readouterr().out
    assert "| success | 3 of 3 (44 to 100 %) | 2 of 2 (34 to 100 %) |" in out
    assert "| clearance, m | 0.50 (0.50; 0.50; 0.50) | 0.70 (0.70; 0.61; 0.60) |" in out
    assert "| covered in 180 s | 0.80 (0.80; 0.80; 0.80) |" in out
    assert "| time home, s | 15.0 (15.0; 15.0; 15.0) |" in out
    assert "| objects found | 0.75 " in out
    assert "2 pairs: 0 successes gained, 0 lost" in out
    assert "| clearance, m | 2 | +0.20 (+0.10 to +0.30) | +0.20 |" in out
    assert out.endswith("not worse\n")


def test_missions_of_one_campaign_are_compared(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    both = campaign(tmp_path, "both", [flight(1), flight(1, tree="b", outcome="timeout")])
    assert main([f"{both}:a", f"{both}:b"]) == 0
    assert "1 pairs: 0 successes gained, 1 lost" in capsys.readouterr().out


def test_a_flight_without_a_value_has_no_difference(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = campaign(tmp_path, "before", [flight(1), flight(2)])
    after = campaign(tmp_path, "after", [flight(1), flight(2, time_to_land_s=None)])
    main([before, after])
    assert "| time home, s | 1 | +0.0 | +0.0 |" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"outcome": "collision"}, "worse: 2 more failures"),
        ({"min_clearance_m": 0.47}, "worse: clearance, m: 0.030 less"),
        ({"coverage_curve": [[170.0, 0.77, 1.0]]}, "worse: covered in 180 s: 0.030 less"),
    ],
)
def test_worse_flights_make_the_exit_code(
    changed: dict[str, Any], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = campaign(tmp_path, "before", [flight(1), flight(2)])
    after = campaign(tmp_path, "after", [flight(seed, **changed) for seed in (1, 2)])
    assert main([before, after, "--not-worse"]) == 1
    assert words in capsys.readouterr().out


@pytest.mark.parametrize(
    "changed", [{"min_clearance_m": 0.49}, {"coverage_curve": [[170.0, 0.79, 1.0]]}]
)
def test_small_losses_are_not_worse(changed: dict[str, Any], tmp_path: Path) -> None:
    before = campaign(tmp_path, "before", [flight(1), flight(2)])
    after = campaign(tmp_path, "after", [flight(seed, **changed) for seed in (1, 2)])
    assert main([before, after, "--not-worse"]) == 0


def test_the_interval_of_a_mean() -> None:
    """For many values it equals the normal interval of 1.96 standard errors."""
    values = np.random.default_rng(1).normal(3.0, 1.0, 400)
    low, high = mean_interval(values)
    assert low == pytest.approx(values.mean() - 1.96 * 0.05, abs=0.015)
    assert high == pytest.approx(values.mean() + 1.96 * 0.05, abs=0.015)


def test_what_cannot_be_compared_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = campaign(tmp_path, "one", [flight(1)])
    other = campaign(tmp_path, "other", [flight(2)])
    (tmp_path / "damaged").mkdir()
    (tmp_path / "damaged" / FLIGHTS_FILE).write_text("{")
    for words, message in (
        ([one], "two sets of flights or more"),
        ([one, one], "expected different sets"),
        ([one, other], "none in common"),
        ([one, str(tmp_path / "absent")], "absent"),
        ([one, f"{one}:moon"], "got none (missions there: a)"),
        ([one, str(tmp_path / "damaged")], "expected whole flights"),
    ):
        with pytest.raises(SystemExit) as end:
            main(words)
        assert end.value.code == 2
        assert message in capsys.readouterr().err


def test_mcnemars_exact_test() -> None:
    """One of five different pairs: 2 x (1 + 5) / 2**5; equal sets give no evidence."""
    assert mcnemar(1, 4) == pytest.approx(0.375)
    assert mcnemar(0, 0) == 1.0
