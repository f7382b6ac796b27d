"""Disturbances: configured statistics, and reproducible."""

from __future__ import annotations

import numpy as np
import pytest

from sim_bridge.twin.noise import NormalStream, OrnsteinUhlenbeck, child_seed


def test_the_process_has_its_standard_deviation_and_correlation_time() -> None:
    """In the long run: standard deviation 0.5, correlation 1/e after the correlation time."""
    wander = OrnsteinUhlenbeck(
        std=0.5, time_s=1.0, step_s=0.1, stream=NormalStream(child_seed(0, 1))
    )
    values = np.array([wander.step() for _ in range(60_000)])
    assert values.std() == pytest.approx(0.5, rel=0.05)
    assert np.corrcoef(values[:-10], values[10:])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.05)


def test_no_strength_is_exactly_nothing() -> None:
    """A disturbance of zero strength stays at zero and uses no random numbers."""
    stream, fresh = (NormalStream(child_seed(3, 1)) for _ in range(2))
    wander = OrnsteinUhlenbeck(std=0.0, time_s=1.0, step_s=0.1, stream=stream)
    assert [wander.step() for _ in range(5)] == [0.0] * 5
    assert stream.draw() == fresh.draw()


def test_purposes_and_seeds_are_independent() -> None:
    """Different purposes or seeds give different streams; equal ones give equal streams."""
    draws = {path: NormalStream(child_seed(*path)).draw() for path in ((0, 1), (0, 2), (1, 1))}
    assert len(set(draws.values())) == 3
    assert NormalStream(child_seed(0, 1)).draw() == draws[0, 1]
