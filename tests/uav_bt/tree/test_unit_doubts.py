"""Values that were probably written in another unit are warnings, and no value is refused."""

from __future__ import annotations

import pytest

from tests.worlds.trees import check, document
from uav_bt.mission.judge import JudgeConfig
from uav_bt.tree.loading.findings import Finding, Rule, errors_of


def findings(body: str) -> tuple[Finding, ...]:
    return check(document(body))


def doubt(body: str) -> str:
    (found,) = findings(body)
    assert errors_of((found,)) == ()
    assert found.rule is Rule.UNIT
    return found.message


@pytest.mark.parametrize(
    ("written", "meant"),
    [("-1.047", "-60"), ("1.57", "90"), ("0.79", "45"), ("3.14159", "180"), ("6.283", "360")],
)
def test_a_fraction_of_pi_in_degrees_looks_like_radians(written: str, meant: str) -> None:
    message = doubt(f'<Turn degrees="{written}"/>')
    assert message.startswith("attribute 'degrees': ")
    assert message.endswith(f"looks like radians; for {meant} degrees write {meant}")


def test_a_port_that_ends_in_deg_is_in_degrees() -> None:
    assert "for -30 degrees write -30" in doubt('<TakeOff gimbal_deg="-0.5236"/>')


@pytest.mark.parametrize("written", ["0", "-60", "3", "1.5", "-0.5", "0.3", "0.7", "15.71", "1.6"])
def test_other_angles_are_degrees(written: str) -> None:
    """Zero, whole and half degrees, more than 1 % from a multiple of 15 degrees, or over 2 pi."""
    assert findings(f'<Turn degrees="{written}"/>') == ()


def test_a_time_beyond_the_time_limit_of_a_mission_is_doubted() -> None:
    assert JudgeConfig().limit_s == 300.0
    assert findings('<HoverFor seconds="300"/>') == ()
    message = doubt('<HoverFor seconds="1000"/>')
    assert "1000 s is longer than a mission, whose time limit is 300 s" in message
    assert "attribute 'give_up_s': 400 s" in doubt('<TakeOff give_up_s="400"/>')


def test_milliseconds_below_ten_look_like_seconds() -> None:
    limited = '<Timeout msec="{}"><AlwaysSuccess/></Timeout>'
    assert "5 ms is shorter than a tick; for 5 s write 5000" in doubt(limited.format(5))
    assert findings(limited.format(0)) == ()  # no limit
    assert findings(limited.format(10)) == ()
    late = '<Delay delay_msec="2"><AlwaysSuccess/></Delay>'
    assert "attribute 'delay_msec': 2 ms" in doubt(late)


def test_defaults_and_references_are_not_doubted() -> None:
    script = '<Script code="angle := 1.047"/>'
    assert findings(f'<Sequence>{script}<Turn degrees="{{angle}}"/></Sequence>') == ()


def test_the_time_limit_of_a_missions_rules_is_a_limit_itself() -> None:
    assert findings('<Rules time_limit_s="1000"/>') == ()
