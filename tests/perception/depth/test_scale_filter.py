"""The filter of the scale: smoothing, the gate, starting again, growing doubt."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.depth.scale_filter import ScaleFilter, ScaleFilterConfig
from uav_bt.errors import ValueRangeError


def test_noise_is_smoothed() -> None:
    """The spread of the output is well below that of the measurements."""
    generator = np.random.default_rng(0)
    smooth = ScaleFilter()
    found = []
    for frame in range(200):
        smooth.update(0.7 + generator.normal(0.0, 0.03), 0.03, 0.1 * frame)
        state = smooth.at(0.1 * frame)
        assert state is not None
        found.append(state[0])
    assert np.std(found[20:]) < 0.02
    assert np.mean(found[20:]) == pytest.approx(0.7, abs=0.01)


def test_an_outlier_is_turned_away_and_a_new_level_is_believed_in_the_end() -> None:
    smooth = ScaleFilter()
    for frame in range(10):
        assert smooth.update(0.0, 0.01, 0.1 * frame)
    assert not smooth.update(0.6, 0.01, 1.0)
    state = smooth.at(1.0)
    assert state is not None
    assert abs(state[0]) < 0.01

    taken = [smooth.update(0.6, 0.01, 1.1 + 0.1 * frame) for frame in range(6)]
    assert taken == [False] * 4 + [True, True]
    state = smooth.at(1.6)
    assert state is not None
    assert state[0] == pytest.approx(0.6, abs=0.01)


def test_doubt_grows_until_there_is_no_scale() -> None:
    smooth = ScaleFilter(ScaleFilterConfig(wander_std=0.05, lost_std=0.15))
    assert smooth.at(0.0) is None
    smooth.update(0.2, 0.01, 0.0)
    certain, later = smooth.at(0.0), smooth.at(4.0)

    assert certain is not None
    assert later is not None
    assert certain[1] > later[1] > 0.0
    assert smooth.at(10.0) is None


def test_time_does_not_run_backwards() -> None:
    smooth = ScaleFilter()
    smooth.update(0.0, 0.01, 5.0)
    before = smooth.at(5.0)
    assert smooth.at(1.0) == before


@pytest.mark.parametrize(
    "wrong", [(math.nan, 0.1, 0.0), (0.0, math.inf, 0.0), (0.0, 0.1, math.nan)]
)
def test_what_is_not_finite_is_refused(wrong: tuple[float, float, float]) -> None:
    with pytest.raises(ValueRangeError, match="finite"):
        ScaleFilter().update(*wrong)


def test_impossible_noise_is_refused() -> None:
    with pytest.raises(ValueRangeError, match="positive"):
        ScaleFilterConfig(floor_std=0.0)
