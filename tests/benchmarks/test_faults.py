"""Flights that react to faults correctly, and the rules that judge a reaction.

A corrected reaction gets an entry in `RIGHT`. `benchmarks/faults.py` flies all kinds in all phases.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import cast

import pytest

from benchmarks import faults
from benchmarks.faults import Expected, Facts, fly, fly_each, problems, reaction
from uav_bt.testing.faults import Fault

pytestmark = pytest.mark.flight

# Steps for two seconds, then a landing on the spot: a short flight.
TREE = """<root BTCPP_format="4"><BehaviorTree ID="Mission"><ReactiveSequence>
  <Segment/> <FindMark/> <TrackMotion/> <MapSite/>
  <Fallback>
    <Sequence>
      <TakeOff height_m="1.2" gimbal_deg="-30"/>
      <ForceSuccess><Timeout msec="2000"><Repeat num_cycles="-1">
        <Fallback> <Explore/> <Avoid/> </Fallback>
      </Repeat></Timeout></ForceSuccess>
      <Land/>
    </Sequence>
    <EmergencyLand/>
  </Fallback>
</ReactiveSequence></BehaviorTree></root>"""

# Faults that end the mission correctly, and faults that it survives without harm.
RIGHT = (
    *("battery-low@take-off+1", "battery-low@explore", "battery-low@land"),
    *("battery-drains=0.4@explore", "video-lost@take-off+1", "video-lost@explore"),
    *("video-lost@explore~3", "no-frame@start", "late@explore", "slow@explore"),
    *("no-telemetry@explore", "no-telemetry@explore~2", "link-lost@explore"),
    *("no-take-off@start", "motors-cut@take-off+1.5", "motors-cut@explore"),
    *("emergency-state@explore", "landed-state@explore", "observe-raises@explore"),
    *("observe-raises@explore~0.5", "send-raises@explore", "send-raises@land~0.3"),
    *("listener-raises@explore", "disk-full@explore", "no-landing@explore", "deaf@explore"),
    *("pilot@explore~3", "never-done@explore", "wind@explore", "frozen@explore"),
    *("black@explore", "white@explore", "covered@explore", "half-size@explore"),
    *("empty-image@explore", "late=0.65@explore", "no-telemetry@take-off+1"),
    *("height-nan@explore", "height-absurd@land", "attitude-nan@explore"),
    *("velocity-nan@explore", "gimbal-nan@explore", "battery-nan@take-off+1"),
    *("no-landing@land", "drift@explore", "velocity-bias@explore"),
)


# Faults of images, of their times and of the world are flown with images.
WITH_IMAGES = {f"{name}@explore" for name in ("video-lost", "late", "frozen", "wind")}
WITH_IMAGES |= {"no-frame@start"}


def short_flight(fault: str, folder: Path, time_limit_s: float = 40.0) -> Callable[[], Facts]:
    tree = folder / "short.xml"
    tree.write_text(TREE, encoding="utf-8")
    images = Fault.parse(fault, faults.KINDS).kind.name in faults.IN_IMAGE or fault in WITH_IMAGES
    how = {"drone": "twin" if images else "plain", "time_limit_s": time_limit_s}
    return partial(fly, fault, str(tree), folder, on_pad=False, **how)


@pytest.mark.parametrize("fault", RIGHT)
def test_the_reaction_is_right(tmp_path: Path, fault: str) -> None:
    facts = short_flight(fault, tmp_path)()
    assert reaction(fault, facts) == "right", facts


def test_every_kind_says_what_is_expected() -> None:
    assert faults.EXPECTED.keys() == faults.KINDS.keys()


# --- the command ----------------------------------------------------------------------------------


def test_faults_begin_in_each_phase_and_those_of_the_take_off_at_the_start() -> None:
    found = faults.faults_of(["late=0.7~3", "no-take-off"], ["land", "center+2"])
    assert [*map(str, found)] == ["late=0.7@land+1~3", "late=0.7@center+2~3", "no-take-off@start"]


def test_a_flight_whose_process_dies_is_wrong_and_the_next_one_flies(tmp_path: Path) -> None:
    fault = "battery-low@explore"
    deadly = cast("Callable[[], Facts]", partial(os._exit, 9))
    dead, flown = fly_each([deadly, short_flight(fault, tmp_path)], 1)
    assert "not named" in reaction(fault, dead)
    assert reaction(fault, flown) == "right"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--kind", "blakc"], "unknown fault 'blakc'; did you mean 'black'?"),
        (["--kind", "late=soon"], "expected a number as level, got 'soon'"),
        (["--kind", "black", "--phase", "land", "--scene", "moon"], "moon"),
    ],
)
def test_what_cannot_be_flown_is_refused(
    tmp_path: Path, arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert faults.main([*arguments, "--out", str(tmp_path)]) == 2
    assert message in capsys.readouterr().err


# --- the rules ------------------------------------------------------------------------------------

LANDED = Facts(
    began_s=4.0,
    outcome="aborted",
    reason="no new frame for 15 s",
    on_mark=False,
    height_m=0.05,
    report_whole=True,
)
SUCCESS = replace(LANDED, outcome="success", reason="landed", on_mark=True)
BY_EMERGENCY = replace(SUCCESS, emergency_landing=True)
IN_THE_AIR = replace(SUCCESS, motors_on=True)
SILENT = replace(LANDED, reason="the tree failed; landed")
NAMED = replace(LANDED, reason="frame")
STRICT = Expected(named="frame")
BEARABLE = replace(STRICT, bearable=True)
UNNOTICED = "not named: success: landed"
PATH = "node 'Mission/frame' failed: error: /io/modules/frame/x.cpp"


@pytest.mark.parametrize(
    ("expected", "facts", "said"),
    [
        (STRICT, LANDED, ""),
        # harm
        (STRICT, replace(LANDED, touched=("box-3", "wall")), "touched box-3, wall"),
        (STRICT, replace(LANDED, beyond_edge=True), "flew beyond the ground's edge"),
        (STRICT, replace(LANDED, motors_on=True, height_m=1.44), "left flying at 1.4 m"),
        (STRICT, replace(LANDED, report_whole=False), "no whole report"),
        # an event or an error names a fault, too; paths and the ends of words do not
        (STRICT, SILENT, "not named: aborted: the tree failed; landed"),
        (STRICT, replace(SILENT, events=("stale frame",)), ""),
        (STRICT, replace(SILENT, error="DroneError: no frame"), ""),
        (STRICT, replace(LANDED, reason="no frames"), ""),
        (STRICT, replace(LANDED, reason=PATH), f"not named: aborted: {PATH}"),
        (STRICT, replace(LANDED, reason="mainframe lost"), "not named: aborted: mainframe lost"),
        # a success must be one
        (STRICT, SUCCESS, UNNOTICED),
        (BEARABLE, SUCCESS, ""),
        (BEARABLE, replace(SUCCESS, on_mark=False), UNNOTICED),
        (BEARABLE, replace(SUCCESS, on_mark=None), ""),
        (BEARABLE, BY_EMERGENCY, f"a success, by an emergency landing; {UNNOTICED}"),
        (BEARABLE, IN_THE_AIR, f"left flying at 0.1 m; a success, in the air; {UNNOTICED}"),
        # less is asked for where nobody could do better
        (replace(STRICT, may_fly=True), replace(NAMED, motors_on=True), ""),
        (replace(STRICT, may_fall=True), replace(NAMED, touched=("box-1",)), ""),
        (replace(STRICT, reported=False), replace(NAMED, report_whole=False), ""),
    ],
)
def test_the_rules(expected: Expected, facts: Facts, said: str) -> None:
    assert "; ".join(problems(expected, "explore", facts)) == said


def test_a_drone_that_lands_already_may_succeed_unless_it_falls() -> None:
    assert problems(STRICT, "land", SUCCESS) == ()
    assert problems(replace(STRICT, may_fall=True), "land", SUCCESS) == (UNNOTICED,)


def test_a_long_reason_is_one_short_line() -> None:
    (said,) = problems(STRICT, "explore", replace(LANDED, reason="first line\n" + 99 * "words "))
    assert "first line words" in said
    assert len(said) <= len("not named: ") + 100
