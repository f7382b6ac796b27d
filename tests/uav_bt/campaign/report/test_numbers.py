"""The numbers behind the report: summaries, densities, coverage."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_bridge.twin.scene_file import load_scene
from uav_bt.app.film import map_of_scene
from uav_bt.app.provenance import hardware
from uav_bt.campaign.report.coverage_figure import curve_of, mean_curve
from uav_bt.campaign.report.lab_figures import ground_of, visited_cells
from uav_bt.campaign.report.statistics import Distribution, bandwidth, density, summarise, wilson
from uav_bt.display.lab_map import LabMap, MapItem
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.mission.covered_ground import GroundCells
from uav_bt.types.ground import Ground

CELLS = GroundCells(Ground(size_m=(5.0, 4.0)))


def test_a_summary_counts_outcomes_success_first() -> None:
    outcomes = ["timeout", "collision", "collision", "success"]
    summary = summarise([{"outcome": outcome, "duration_s": 1.0} for outcome in outcomes])
    assert list(summary.outcomes.items()) == [("success", 1), ("collision", 2), ("timeout", 1)]
    assert summary.successes == 1
    assert summary.success_text == "1 of 4"
    assert summary.metrics["time_to_land_s"] is None


def test_distributions_tell_where_the_values_lie() -> None:
    flights = [{"outcome": "success", "duration_s": float(value)} for value in range(101)]
    found = summarise(flights).metrics["duration_s"]
    assert found is not None
    assert (found.count, found.mean, found.median) == (101, 50.0, 50.0)
    assert (found.p5, found.p95, found.least, found.most) == (5.0, 95.0, 0.0, 100.0)


def test_nothing_cannot_be_summarised() -> None:
    with pytest.raises(InputError, match="no flights"):
        summarise([])


def test_a_density_integrates_to_one_above_zero() -> None:
    at = np.linspace(0.0, 60.0, 6001)
    values = [0.0, 0.0, 0.0, 1.0, 5.0, 20.0]
    assert np.trapezoid(density(values, at), at) == pytest.approx(1.0, abs=1e-3)


def test_a_density_is_that_of_the_distribution_the_values_come_from() -> None:
    values = np.abs(np.random.default_rng(0).normal(30.0, 4.0, 4000))
    at = np.array([30.0, 34.0])
    exact = np.exp(-0.5 * ((at - 30.0) / 4.0) ** 2) / (4.0 * math.sqrt(2.0 * math.pi))
    assert density(values.tolist(), at) == pytest.approx(exact, rel=0.08)


def test_the_bandwidth_survives_values_that_are_mostly_the_same() -> None:
    assert bandwidth([0.0] * 20 + [5.0]) > 0.0
    assert bandwidth([3.0, 3.0]) == 0.0


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [
        (81, 263, 0.2553, 0.3662),  # Newcombe 1998, table I, method 3
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilsons_interval_agrees_with_newcombe(
    successes: int, trials: int, low: float, high: float
) -> None:
    assert wilson(successes, trials) == pytest.approx((low, high), abs=5e-5)


def test_nothing_but_successes_is_no_certainty() -> None:
    low, high = wilson(100, 100)
    assert (round(low, 4), high) == (0.963, 1.0)


@pytest.mark.parametrize(("successes", "trials"), [(0, 0), (3, 2), (-1, 2)])
def test_impossible_counts_are_refused(successes: int, trials: int) -> None:
    with pytest.raises(ValueRangeError, match="0 <= successes <= trials"):
        wilson(successes, trials)


def test_a_straight_way_passes_a_band_of_the_ground() -> None:
    passed = visited_cells([[0.0, -2.5, 0.1, 1.5], [9.0, 2.5, 0.1, 1.5]], CELLS)
    rows = np.flatnonzero(passed.all(axis=1))
    assert CELLS.y_m[rows].min() == pytest.approx(-0.375)
    assert CELLS.y_m[rows].max() == pytest.approx(0.575)
    assert CELLS.share(passed) == pytest.approx(0.25)


def test_rows_go_up_and_columns_go_right() -> None:
    passed = visited_cells([[0.0, 2.375, 1.875, 1.0]], CELLS)
    assert bool(passed[-1, -1])
    assert not passed[0].any()
    assert not passed[:, 0].any()


def test_no_way_passes_nothing() -> None:
    assert not visited_cells([], CELLS).any()


def test_the_ground_of_a_map_is_free_of_boxes_and_mark() -> None:
    box = MapItem(x_m=0.0, y_m=0.0, size_m=(1.0, 0.5, 1.9), yaw_rad=math.pi / 2)
    pad = MapItem(x_m=-2.0, y_m=-1.5, size_m=(0.5, 0.5, 0.4))
    ground = ground_of(LabMap(ground_size_m=(5.0, 4.0), boxes=(box,), mark=pad))
    assert (~GroundCells(ground).free).sum() * 0.05**2 == pytest.approx(0.5 + 0.25)
    assert [item.height_m for item in ground.standing] == [1.9, 0.4]


def test_the_ground_of_a_map_with_parts_is_that_of_its_scene() -> None:
    scene = load_scene("depot-train-a")
    assert ground_of(map_of_scene(scene)) == scene.ground_plan


def covered(*passed: float, duration_s: float) -> dict[str, Any]:
    return {
        "duration_s": duration_s,
        "coverage_passed": passed[-1],
        "coverage_seen": 0.75,
        "coverage_curve": [[10.0 * (n + 1), share, 0.5] for n, share in enumerate(passed[:-1])],
    }


def test_the_curve_of_a_flight_begins_with_its_first_sample_and_ends_with_the_flight() -> None:
    flight = covered(0.125, 0.25, 0.375, duration_s=27.5)
    assert curve_of(flight, "passed").tolist() == [[10.0, 12.5], [20.0, 25.0], [27.5, 37.5]]
    assert curve_of(flight, "seen").tolist() == [[10.0, 50.0], [20.0, 50.0], [27.5, 75.0]]
    assert curve_of(covered(0.25, duration_s=8.0), "passed").tolist() == [[8.0, 25.0]]


def test_the_mean_curve_ends_when_half_of_the_flights_have_ended() -> None:
    flights = [
        covered(0.125, 0.125, duration_s=15.0),
        covered(0.25, 0.25, 0.25, duration_s=25.0),
        covered(0.5, 0.5, 0.5, 0.5, duration_s=35.0),
        covered(0.625, 0.75, 0.875, 0.875, 0.875, duration_s=45.0),
    ]
    means = [[10.0, 37.5], [20.0, 50.0], [30.0, 68.75]]
    assert mean_curve(flights, "passed").tolist() == means
    assert mean_curve([], "passed").shape == (0, 2)


@pytest.mark.parametrize(("count", "has"), [(2, False), (3, True)])
def test_two_flights_have_no_percentiles(count: int, *, has: bool) -> None:
    found = Distribution.of([1.0] * count)
    assert found is not None
    assert (found.p5 is not None, found.p95 is not None) == (has, has)


def test_the_hardware_names_processor_vnni_and_memory(tmp_path: Path) -> None:
    info = tmp_path / "cpuinfo"
    info.write_text("model name\t: Chip 9\nflags\t\t: fpu avx512_vnni\n")
    assert hardware(info).startswith("Chip 9, ")
    assert ", VNNI, " in hardware(info)
    (memory,) = (part for part in hardware(info).split(", ") if part.endswith(" GiB memory"))
    assert float(memory.removesuffix(" GiB memory")) > 0.0
    info.write_text("model name\t: Chip 8\nflags\t\t: fpu avx2\n")
    assert ", no VNNI, " in hardware(info)
