"""The numbers behind the report: intervals, spreads, coverage, pairs of flights."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.uav_bt.campaign.campaign_world import jsonl, line, plan
from uav_bt.app.provenance import hardware
from uav_bt.campaign.plan import PlannedFile
from uav_bt.campaign.report.figures import curve_of, mean_curve, visited_cells
from uav_bt.campaign.report.paired import losses_of, paired_table, pairs_of
from uav_bt.campaign.report.sources import FlightSet, read_sources
from uav_bt.campaign.report.statistics import (
    mcnemar,
    median_interval,
    rate_interval,
    spread,
    success_interval,
    success_words,
)
from uav_bt.errors import InputError
from uav_bt.mission.covered_ground import GroundCells
from uav_bt.types.ground import Ground

CELLS = GroundCells(Ground(size_m=(5.0, 4.0)))


def flights(successes: int, trials: int) -> list[dict[str, str]]:
    return [{"outcome": "success" if n < successes else "timeout"} for n in range(trials)]


def test_successes_of_a_few_flights_are_counted_and_not_given_in_percent() -> None:
    assert success_words(flights(9, 9)) == "9 of 9"
    assert success_words(flights(19, 20)) == "19 of 20, 95.0 %"


def test_a_spread_tells_where_the_values_lie() -> None:
    found = spread([float(value) for value in range(101)])
    assert list(found.values()) == [50.0, 50.0, 5.0, 95.0, 0.0, 100.0]
    two, three = spread([1.0] * 2), spread([1.0] * 3)
    assert (two["5 %"], two["95 %"], three["5 %"], three["95 %"]) == (None, None, 1.0, 1.0)
    assert set(spread([]).values()) == {None}


@pytest.mark.parametrize(
    ("interval", "ends"),
    [
        (success_interval(flights(81, 263)), (25.53, 36.62)),  # Newcombe 1998, table I, method 3
        (success_interval(flights(15, 148)), (6.24, 16.05)),
        (success_interval(flights(0, 20)), (0.0, 16.11)),
        (success_interval(flights(100, 100)), (96.30, 100.0)),
        (rate_interval(0, 1.0), (0.0, 2.996)),  # Garwood 1936
        (rate_interval(1, 0.01), (2.532, 557.16)),
        (rate_interval(10, 2.0), (2.398, 9.195)),
    ],
)
def test_intervals_agree_with_published_ones(
    interval: tuple[float, float], ends: tuple[float, float]
) -> None:
    assert interval == pytest.approx(ends, abs=5e-3)


def test_the_interval_of_a_median() -> None:
    """For many values it equals the normal interval: 1.96 x 1.2533 x 1 / 20 on both sides."""
    values = np.random.default_rng(1).normal(3.0, 1.0, 400)
    low, high = median_interval(values)
    assert low is not None
    assert high is not None
    assert high - low == pytest.approx(2.0 * 1.96 * 1.2533 / 20.0, rel=0.2)
    assert low < np.median(values) < high
    assert median_interval(values[:2]) == (None, None)


def test_mcnemars_exact_test() -> None:
    """One of five different pairs: 2 x (1 + 5) / 2**5; equal sets give no evidence."""
    assert mcnemar(1, 4) == pytest.approx(0.375)
    assert mcnemar(0, 0) == 1.0


def test_a_path_passes_the_cells_around_it() -> None:
    """Rows go up and columns to the right."""
    ends = np.array([[0.0, -2.5, 0.1, 1.5], [9.0, 2.5, 0.1, 1.5]])
    straight = visited_cells(np.linspace(*ends, 21), CELLS)
    rows = np.flatnonzero(straight.all(axis=1))
    assert CELLS.y_m[rows].min() == pytest.approx(-0.375)
    assert CELLS.y_m[rows].max() == pytest.approx(0.575)
    corner = visited_cells([[0.0, 2.375, 1.875, 1.0]], CELLS)
    assert bool(corner[-1, -1])
    assert not corner[0].any()
    assert not corner[:, 0].any()


def covered(*passed: float, duration_s: float) -> dict[str, Any]:
    return {
        "duration_s": duration_s,
        "coverage_passed": passed[-1],
        "coverage_seen": 0.75,
        "coverage_curve": [[10.0 * (n + 1), share, 0.5] for n, share in enumerate(passed[:-1])],
    }


def test_the_curve_of_a_flight_begins_with_its_first_sample_and_ends_with_the_flight() -> None:
    """Time in s, shares passed and seen in %."""
    flight = covered(0.125, 0.25, 0.375, duration_s=27.5)
    assert curve_of(flight).tolist() == [[10.0, 12.5, 50.0], [20.0, 25.0, 50.0], [27.5, 37.5, 75.0]]
    assert curve_of(covered(0.25, duration_s=8.0)).tolist() == [[8.0, 25.0, 75.0]]


def test_the_mean_curve_ends_when_half_of_the_flights_have_ended() -> None:
    flights = [
        covered(0.125, 0.125, duration_s=15.0),
        covered(0.25, 0.25, 0.25, duration_s=25.0),
        covered(0.5, 0.5, 0.5, 0.5, duration_s=35.0),
        covered(0.625, 0.75, 0.875, 0.875, 0.875, duration_s=45.0),
    ]
    means = [[10.0, 37.5, 50.0], [20.0, 50.0, 50.0], [30.0, 68.75, 50.0]]
    assert mean_curve(flights).tolist() == means
    assert mean_curve([]).shape == (0, 3)


def test_the_hardware_names_processor_vnni_and_memory(tmp_path: Path) -> None:
    info = tmp_path / "cpuinfo"
    info.write_text("model name\t: Chip 9\nflags\t\t: fpu avx512_vnni\n")
    assert hardware(info).startswith("Chip 9, ")
    assert ", VNNI, " in hardware(info)
    (memory,) = (part for part in hardware(info).split(", ") if part.endswith(" GiB memory"))
    assert float(memory.removesuffix(" GiB memory")) > 0.0
    info.write_text("model name\t: Chip 8\nflags\t\t: fpu avx2\n")
    assert ", no VNNI, " in hardware(info)


# --- trees on the same flights -------------------------------------------------------------------


def flight_of(seed: int, tree: str = "a.xml", **fields: Any) -> dict[str, Any]:
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
    first = [flight_of(seed) for seed in (1, 2, 3, 4, 5)]
    clearances_m = (0.4, 0.6, 0.7, 0.9)
    second = [
        flight_of(seed, "b.xml", min_clearance_m=clearance_m, coverage_passed=0.85)
        for seed, clearance_m in zip((1, 2, 3, 4), clearances_m, strict=True)
    ]
    rows = rows_of(sets_of(tmp_path, *first, *second, flight_of(5, "b.xml", scene="val-b")))
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
    """Of six pairs four were lost and one was gained: p = 2 x (1 + 5) / 2**5 = 0.375."""
    first = [flight_of(seed, outcome="timeout" if seed == 0 else "success") for seed in range(6)]
    second = [flight_of(n, "b.xml", outcome="collision" if n % 5 else "success") for n in range(6)]
    sets = sets_of(tmp_path, *first, *second)
    row = rows_of(sets)["successes"]
    assert (row["pairs"], row["first"], row["second"], row["p"]) == (6, 5, 2, 0.375)
    assert losses_of(sets) == ["b: 3 more failures"]


def test_a_flight_without_a_metric_has_no_difference(tmp_path: Path) -> None:
    second = [flight_of(1, "b.xml"), flight_of(2, "b.xml", min_clearance_m=None)]
    rows = rows_of(sets_of(tmp_path, flight_of(1), flight_of(2), *second))
    assert (rows["min_clearance_m"]["pairs"], rows["duration_s"]["pairs"]) == (1, 2)
    assert rows["duration_s"]["from"] is None, "two pairs have no interval"


@pytest.mark.parametrize(("all_pairs", "couples"), [(False, "ab ac"), (True, "ab ac bc")])
def test_the_first_tree_is_compared_with_each_other_one_or_all(
    tmp_path: Path, couples: str, *, all_pairs: bool
) -> None:
    sets = sets_of(tmp_path, *(flight_of(1, f"{name}.xml") for name in "abc"))
    found = pairs_of(sets, all_pairs=all_pairs)
    assert " ".join(one.first.label + one.second.label for one in found) == couples


def test_scenes_of_equal_name_and_different_text_are_not_paired() -> None:
    def planned(sha256: str) -> FlightSet:
        scene = PlannedFile(name="val-a", path="val-a", sha256=sha256)
        one = FlightSet(label=sha256, tree="a.xml", flights=(flight_of(1),), path=Path("runs"))
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
    later = [flight_of(seed, "b.xml", **changed) for seed in (1, 2)]
    assert losses_of(sets_of(tmp_path, flight_of(1), flight_of(2), *later)) == losses


def test_losses_need_flights_in_common(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="got one tree"):
        losses_of(sets_of(tmp_path, flight_of(1)))
    with pytest.raises(InputError, match="none in common of a and c"):
        losses_of(sets_of(tmp_path, flight_of(1), flight_of(1, "b.xml"), flight_of(2, "c.xml")))
