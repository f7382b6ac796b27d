"""Comparison of trees on the same flights: pairs, differences, intervals, and losses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.uav_bt.campaign.campaign_world import jsonl, line, plan
from uav_bt.campaign.plan import PlannedFile
from uav_bt.campaign.report.paired import losses_of, paired_table, pairs_of
from uav_bt.campaign.report.sources import FlightSet, read_sources
from uav_bt.errors import InputError


def flight(seed: int, tree: str = "a.xml", **fields: Any) -> dict[str, Any]:
    known = {"tree": tree, "scene": "val-a", "min_clearance_m": 0.5, "coverage_passed": 0.8}
    return line(seed, **known | fields)


def sets_of(folder: Path, *flights: dict[str, Any]) -> tuple[FlightSet, ...]:
    return read_sources([jsonl(folder / "f.jsonl", *flights)])


def rows_of(sets: tuple[FlightSet, ...], **options: Any) -> dict[str, dict[str, Any]]:
    table = paired_table(pairs_of(sets, **options))
    rows = (dict(zip(table.columns, row, strict=True)) for row in table.rows)
    return {str(row["measure"]): row for row in rows}


def test_flights_are_paired_by_scene_and_seed(tmp_path: Path) -> None:
    """Seeds 1 to 4 are in both trees; seed 5 and the other scene are in one."""
    first = [flight(seed) for seed in (1, 2, 3, 4, 5)]
    clearances_m = (0.4, 0.6, 0.7, 0.9)
    second = [
        flight(seed, "b.xml", min_clearance_m=clearance_m, coverage_passed=0.85)
        for seed, clearance_m in zip((1, 2, 3, 4), clearances_m, strict=True)
    ]
    rows = rows_of(sets_of(tmp_path, *first, *second, flight(5, "b.xml", scene="val-b")))
    row = rows["min_clearance_m"]
    assert (row["first tree"], row["second tree"], row["pairs"]) == ("a", "b", 4)
    # The differences are -0.1, 0.1, 0.2 and 0.4.
    assert (row["first"], row["second"], row["second minus first"]) == (0.5, 0.65, 0.15)
    assert row["from"] == -0.1
    assert row["to"] == 0.4
    covered = rows["coverage_passed"]
    assert (covered["unit"], covered["second minus first"]) == ("%", 5.0)
    assert (covered["from"], covered["to"]) == (5.0, 5.0)
    assert "landing_error_m" not in rows, "no flight has landed"


def test_successes_are_compared_by_mcnemars_test(tmp_path: Path) -> None:
    """Of five pairs four were lost and one was gained: p = 2 x (1 + 5) / 2**5 = 0.375."""
    first = [flight(seed, outcome="timeout" if seed == 0 else "success") for seed in range(5)]
    second = [flight(n, "b.xml", outcome="success" if n == 0 else "collision") for n in range(5)]
    row = rows_of(sets_of(tmp_path, *first, *second))["successes"]
    assert (row["pairs"], row["first"], row["second"], row["p"]) == (5, 4, 1, 0.375)


def test_a_flight_without_a_metric_has_no_difference(tmp_path: Path) -> None:
    second = [flight(1, "b.xml"), flight(2, "b.xml", min_clearance_m=None)]
    rows = rows_of(sets_of(tmp_path, flight(1), flight(2), *second))
    assert (rows["min_clearance_m"]["pairs"], rows["duration_s"]["pairs"]) == (1, 2)
    assert rows["duration_s"]["from"] is None, "two pairs have no interval"


@pytest.mark.parametrize(("all_pairs", "couples"), [(False, "ab ac"), (True, "ab ac bc")])
def test_the_first_tree_is_compared_with_each_other_one_or_all(
    tmp_path: Path, couples: str, *, all_pairs: bool
) -> None:
    sets = sets_of(tmp_path, *(flight(1, f"{name}.xml") for name in "abc"))
    found = pairs_of(sets, all_pairs=all_pairs)
    assert " ".join(one.first.label + one.second.label for one in found) == couples


def test_scenes_of_equal_name_and_different_text_are_not_paired() -> None:
    def planned(sha256: str) -> FlightSet:
        scene = PlannedFile(name="val-a", path="val-a", sha256=sha256)
        one = FlightSet(label=sha256, tree="a.xml", flights=(flight(1),), path=Path("runs"))
        return replace(one, plan=plan(scenes=[scene]))

    assert len(pairs_of([planned("1"), planned("1")])) == 1
    assert pairs_of([planned("1"), planned("2")]) == []


@pytest.mark.parametrize(
    ("changed", "losses"),
    [
        ({"outcome": "collision"}, ["b: 2 more failures"]),
        (
            {"min_clearance_m": 0.47},
            ["b: least clearance of a flight: 5th percentile 0.03 m lower"],
        ),
        ({"coverage_passed": 0.77}, ["b: free ground passed: median 3 points lower"]),
        ({"min_clearance_m": 0.49, "coverage_passed": 0.79}, []),
    ],
)
def test_large_losses_are_named(changed: dict[str, Any], losses: list[str], tmp_path: Path) -> None:
    later = [flight(seed, "b.xml", **changed) for seed in (1, 2)]
    assert losses_of(sets_of(tmp_path, flight(1), flight(2), *later)) == losses


def test_losses_need_flights_in_common(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="got one tree"):
        losses_of(sets_of(tmp_path, flight(1)))
    with pytest.raises(InputError, match="none in common of a and c"):
        losses_of(sets_of(tmp_path, flight(1), flight(1, "b.xml"), flight(2, "c.xml")))
