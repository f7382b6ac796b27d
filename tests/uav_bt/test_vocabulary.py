"""Answers of policies, clocks, compiled kernels and plug-ins."""

from __future__ import annotations

import logging
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.worlds.processes import ROOT, python
from tests.worlds.tables import cases
from uav_bt import plugins
from uav_bt.answers import Advance, Answer, Blocked, FollowLeg, Rotate
from uav_bt.clock import ManualClock, TickClock, WallClock
from uav_bt.compiled import _say, compiled
from uav_bt.errors import InputError, MissingDependencyError, ValueRangeError
from uav_bt.landing_marks import MarkSighting, MarkView
from uav_bt.plugins import need
from uav_bt.types import LandingMark

# --- answers --------------------------------------------------------------------------------------

CASES = cases("values")

KINDS: dict[str, Any] = {kind.__name__: kind for kind in (Advance, FollowLeg, Rotate, Blocked)}
TURNS: list[Callable[[float], Answer]] = [
    lambda yaw_rad: Advance(forward_m=0.3, yaw_rad=yaw_rad),
    lambda yaw_rad: FollowLeg(yaw_rad=yaw_rad, speed_mps=0.3),
    lambda yaw_rad: Rotate(yaw_rad=yaw_rad),
    lambda yaw_rad: Blocked(yaw_rad=yaw_rad),
]


@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("yaw_rad", [30.0, -90.0, math.nan, math.inf])
def test_a_turn_in_degrees_is_refused(turn: Callable[[float], Answer], yaw_rad: float) -> None:
    with pytest.raises(ValueRangeError, match=r"in radians, .*write math\.radians.*, got "):
        turn(yaw_rad)
    turn(-2.0 * math.pi)


@pytest.mark.parametrize(("kind", "given", "why"), CASES["refused_answers"])
def test_answers_of_other_values_are_refused(kind: str, given: dict[str, object], why: str) -> None:
    with pytest.raises(ValueRangeError, match=why):
        KINDS[kind](**given)
    numpys: dict[str, Any] = {"yaw_rad": np.float32(0.3), "ground_ends": np.bool_(True)}
    assert Blocked(**numpys).ground_ends


def test_numbers_of_a_network_are_compared_in_full() -> None:
    assert Advance(forward_m=np.float32(0.3)).forward_m == np.float32(0.3)
    for bad in (np.float32(0.0), np.float32(math.inf)):
        with pytest.raises(ValueRangeError, match="positive and finite"):
            Advance(forward_m=bad)


# --- clocks ---------------------------------------------------------------------------------------


def test_a_wall_clock_sleeps_what_is_left_if_any(monkeypatch: pytest.MonkeyPatch) -> None:
    slept: list[float] = []
    monkeypatch.setattr(time, "monotonic", lambda: 1000.0)
    monkeypatch.setattr(time, "sleep", slept.append)
    clock = WallClock()
    clock.sleep_until(0.3)
    clock.sleep_until(-2.0)
    assert slept == [0.3, 0.0]
    monkeypatch.setattr(time, "monotonic", lambda: 1002.5)
    assert clock.now() == 2.5


def test_a_tick_clock_stands_still_until_the_next_tick() -> None:
    real = ManualClock(1.0)
    clock = TickClock(real)
    real.advance(0.5)
    assert clock.now() == 1.5  # no tick has begun
    assert clock.begin_tick() == 1.5
    real.advance(0.1)
    assert clock.now() == 1.5
    clock.sleep_until(2.0)
    assert (real.now(), clock.now()) == (2.0, 1.5)
    assert clock.begin_tick() == clock.now() == 2.0


# --- kernels --------------------------------------------------------------------------------------


def total(values: np.ndarray, divisor: float) -> float:
    """Return the sum of quotients, one after the other."""
    found = 0.0
    for value in values:
        found += value / divisor
    return found


SIGNATURE = "float64(float64[::1], float64)"


def test_a_division_by_zero_is_infinite() -> None:
    assert compiled(SIGNATURE)(total)(np.ones(3), 0.0) == np.inf


def test_another_type_is_refused_instead_of_compiled_in_flight() -> None:
    kernel = compiled(SIGNATURE)(total)
    with pytest.raises(TypeError, match="No matching definition"):
        kernel(np.ones((2, 2)), 1.0)


def test_without_a_folder_that_can_be_written_one_message_says_what_to_set(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """The kernel works all the same."""
    _say.cache_clear()
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null/cache")
    elsewhere = total.__code__.replace(co_filename="/dev/null/kernel.py")
    lost = type(total)(elsewhere, total.__globals__)
    with caplog.at_level(logging.WARNING, logger="uav_bt.compiled"):
        assert compiled(SIGNATURE)(lost)(np.ones(3), 1.0) == 3.0
        compiled(SIGNATURE)(lost)
    assert [record.message.count("NUMBA_CACHE_DIR") for record in caplog.records] == [1]


def test_a_second_process_takes_the_kernels_from_the_cache(tmp_path: Path) -> None:
    """The first process says that it compiles, the second is silent."""
    (tmp_path / "kernels.py").write_text(
        "from uav_bt.compiled import compiled\n"
        "@compiled('float64(float64)')\n"
        "def twice(value):\n"
        "    return 2.0 * value\n"
        "print(twice(21.0))\n"
    )
    for message in ("compiling for this machine", ""):
        where = {"PYTHONPATH": f"{ROOT}:{tmp_path}", "HOME": str(tmp_path)}
        done = python("-c", "import kernels", folder=tmp_path, environment=where)
        assert done.stdout == "42.0\n"
        assert (message in done.stderr) if message else not done.stderr


# --- plug-ins -------------------------------------------------------------------------------------


def test_everything_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "zmq", None)
    monkeypatch.setitem(sys.modules, "msgpack", None)
    with pytest.raises(MissingDependencyError) as missing:
        need("live", "Groot2")
    assert str(missing.value) == (
        "Groot2 needs zmq and msgpack; "
        'run `pip install -c constraints.txt -e ".[live]"` in the folder of uav-bt\'s source'
    )


def test_what_cannot_decide_is_no_policy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plugins, "load", lambda _group, _name: object)
    with pytest.raises(InputError, match="policy 'dumb' has no method `decide"):
        plugins.make_policy("dumb")


# --- landing marks --------------------------------------------------------------------------------

MARK = LandingMark(kind="beacon", length_m=0.5, width_m=0.5, height_m=0.1)


class Beacon:
    """A landing mark of another package."""

    uses_images, shows_heading = True, False

    def __init__(self, mark: LandingMark) -> None:
        self.mark = mark

    def find(self, view: MarkView) -> MarkSighting | None:
        """Return a sighting straight ahead."""
        del view
        return MarkSighting(forward_m=1.0, right_m=0.0, height_m=self.mark.height_m)

    def picture(self) -> None:
        """Return no picture."""


class Blind:
    """A class without the members of a finder."""

    def __init__(self, mark: LandingMark) -> None:
        del mark


def broken(mark: LandingMark) -> None:
    raise OSError("no driver")


def registered(monkeypatch: pytest.MonkeyPatch, kind: object) -> None:
    monkeypatch.setattr(plugins, "load", lambda *_: kind)


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (Blind, "landing mark 'beacon' lacks find, picture, uses_images or shows_heading: .*Blind"),
        (broken, r"landing mark 'beacon' cannot be made: .*no driver"),
    ],
)
def test_what_is_no_landing_mark_is_refused(
    monkeypatch: pytest.MonkeyPatch, kind: object, message: str
) -> None:
    registered(monkeypatch, Beacon)
    assert isinstance(plugins.make_mark_finder(MARK), Beacon)
    registered(monkeypatch, kind)
    with pytest.raises(InputError, match=message):
        plugins.make_mark_finder(MARK)


@pytest.mark.parametrize(
    "wrong", [{"forward_m": math.nan}, {"confidence": 1.2}, {"heading_deg": math.inf}]
)
def test_a_sighting_is_finite_and_its_confidence_a_share(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueRangeError, match="must be finite and its confidence within 0 and 1"):
        MarkSighting(**{"forward_m": 1.0, "right_m": 0.0, "height_m": 0.0, **wrong})
