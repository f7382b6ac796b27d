"""The error of a missing package names the extra that installs it."""

from __future__ import annotations

import math
import sys

import pytest

from uav_bt import plugins
from uav_bt.errors import InputError, MissingDependencyError, ValueRangeError
from uav_bt.landing_marks import MarkSighting, MarkView
from uav_bt.plugins import need
from uav_bt.types import LandingMark


def test_everything_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "zmq", None)
    monkeypatch.setitem(sys.modules, "msgpack", None)
    with pytest.raises(MissingDependencyError) as missing:
        need("live", "Groot2")
    assert str(missing.value) == (
        "Groot2 needs zmq and msgpack; "
        'run `pip install -c constraints.txt -e ".[live]"` in the folder of uav-bt\'s source'
    )


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


def test_an_unknown_landing_mark_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"unknown landing mark 'beacon'.*apriltag.*helipad"):
        plugins.make_mark_finder(MARK)


@pytest.mark.parametrize(
    "wrong", [{"forward_m": math.nan}, {"confidence": 1.2}, {"heading_deg": math.inf}]
)
def test_a_sighting_is_finite_and_its_confidence_a_share(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueRangeError, match="must be finite and its confidence within 0 and 1"):
        MarkSighting(**{"forward_m": 1.0, "right_m": 0.0, "height_m": 0.0, **wrong})
