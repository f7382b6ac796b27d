"""Random disturbances: cheap per step and reproducible from a seed."""

from __future__ import annotations

import math

import numpy as np

_BLOCK = 4096


def child_seed(seed: int, *path: int) -> np.random.SeedSequence:
    """Return an independent seed for one purpose within a flight, identified by numbers."""
    return np.random.SeedSequence(seed, spawn_key=path)


class NormalStream:
    """Standard normal numbers, generated in blocks because single calls are slow."""

    def __init__(self, seed: np.random.SeedSequence) -> None:
        self._generator = np.random.Generator(np.random.PCG64(seed))
        self._block: list[float] = []

    def draw(self) -> float:
        """Return the next number."""
        if not self._block:
            self._block = self._generator.standard_normal(_BLOCK).tolist()
        return self._block.pop()


class OrnsteinUhlenbeck:
    """Ornstein-Uhlenbeck process: a random value around zero with a correlation time.

    The discrete step is exact: the standard deviation is `std` for every step length; 0 keeps the
    value at 0.
    """

    def __init__(self, stream: NormalStream, std: float, time_s: float, step_s: float) -> None:
        self._keep = math.exp(-step_s / time_s)
        self._kick = std * math.sqrt(1.0 - self._keep**2)
        self._stream = stream
        self.value = std * stream.draw() if std else 0.0

    def step(self) -> float:
        """Advance by one step and return the new value."""
        if self._kick:
            self.value = self._keep * self.value + self._kick * self._stream.draw()
        return self.value
