"""Summaries of errors: figures worked out by hand, gaps, refusals."""

import math

import numpy as np
import pytest

from perception.depth.evaluation.error_summary import summarise_errors
from uav_bt.errors import ShapeError, ValueRangeError


def test_figures_are_those_worked_out_by_hand() -> None:
    summary = summarise_errors(np.array([1.1, 2.3, 2.8, 4.0]), np.array([1.0, 2.0, 3.0, 4.0]))
    assert summary.mean_m == pytest.approx(0.15)
    assert summary.median_m == pytest.approx(0.15)
    assert summary.rmse_m == pytest.approx(math.sqrt(0.14 / 4))
    assert summary.max_m == pytest.approx(0.3)
    assert summary.bias_m == pytest.approx(0.05)
    assert summary.rmse_m**2 == pytest.approx(summary.mean_m**2 + summary.std_m**2)
    assert summary.correlation == pytest.approx(
        np.corrcoef([1.1, 2.3, 2.8, 4.0], [1.0, 2.0, 3.0, 4.0])[0, 1]
    )


def test_what_is_not_answered_counts_for_coverage_only() -> None:
    summary = summarise_errors(np.array([1.5, np.nan, np.nan, 2.5]), np.array([1.0, 9.0, 9.0, 2.0]))
    assert (summary.asked, summary.answered, summary.coverage) == (4, 2, 0.5)
    assert summary.mean_m == pytest.approx(0.5)


@pytest.mark.parametrize("count", [0, 3])
def test_without_any_answer_the_figures_are_no_numbers(count: int) -> None:
    summary = summarise_errors(np.full(count, np.nan), np.ones(count))
    assert summary.answered == 0
    assert math.isnan(summary.mean_m)
    assert math.isnan(summary.correlation)
    assert math.isnan(summary.coverage) == (count == 0)


def test_estimates_that_never_vary_correlate_with_nothing() -> None:
    summary = summarise_errors(np.array([2.0, 2.0]), np.array([1.0, 3.0]))
    assert math.isnan(summary.correlation)


def test_lists_of_unequal_length_are_refused() -> None:
    with pytest.raises(ShapeError, match="estimates must be 2"):
        summarise_errors(np.ones(3), np.ones(2))


@pytest.mark.parametrize(("estimated", "truth"), [(np.inf, 1.0), (1.0, np.nan), (1.0, np.inf)])
def test_infinite_estimates_and_unknown_truths_are_refused(estimated: float, truth: float) -> None:
    with pytest.raises(ValueRangeError, match="finite"):
        summarise_errors(np.array([estimated]), np.array([truth]))
