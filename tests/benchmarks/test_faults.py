"""Flights that react to faults correctly, and the rules that judge a reaction.

A corrected reaction gets a line in `RIGHT`. `benchmarks/faults.py` flies all kinds in all phases.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import cast

import pytest

from benchmarks.faults import (
    EXPECTED,
    IN_IMAGE,
    KINDS,
    Expected,
    Facts,
    faults_of,
    fly,
    fly_each,
    main,
    problems,
    reaction,
)
from uav_bt.testing.faults import Fault

pytestmark = pytest.mark.flight

# Steps for two seconds, then a landing on the spot: a short flight.
TREE = """
<root BTCPP_format="4">
  <BehaviorTree ID="Mission">
    <ReactiveSequence>
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
    </ReactiveSequence>
  </BehaviorTree>
</root>
"""

# Faults that end the mission correctly, and faults that it survives without harm.
RIGHT = (
    "battery-low@take-off+1",
    "battery-low@explore",
    "battery-low@land",
    "battery-drains=0.4@explore",
    "video-lost@take-off+1",
    "video-lost@explore",
    "video-lost@explore~3",
    "no-frame@start",
    "late@explore",
    "slow@explore",
    "no-telemetry@explore",
    "no-telemetry@explore~2",
    "link-lost@explore",
    "no-take-off@start",
    "motors-cut@take-off+1.5",
    "motors-cut@explore",
    "emergency-state@explore",
    "landed-state@explore",
    "observe-raises@explore",
    "observe-raises@explore~0.5",
    "send-raises@explore",
    "send-raises@land~0.3",
    "listener-raises@explore",
    "disk-full@explore",
    "no-landing@explore",
    "deaf@explore",
    "pilot@explore~3",
    "never-done@explore",
    "wind@explore",
    "frozen@explore",
    "black@explore",
    "white@explore",
    "covered@explore",
    "half-size@explore",
    "empty-image@explore",
    "late=0.65@explore",
    "no-telemetry@take-off+1",
    "height-nan@explore",
    "height-absurd@land",
    "attitude-nan@explore",
    "velocity-nan@explore",
    "gimbal-nan@explore",
    "battery-nan@take-off+1",
    "no-landing@land",
    "drift@explore",
    "velocity-bias@explore",
)


# Faults of images, of their times and of the world are flown with images.
WITH_IMAGES = (
    "no-frame@start",
    "video-lost@explore",
    "late@explore",
    "frozen@explore",
    "wind@explore",
)


def short_flight(fault: str, folder: Path, time_limit_s: float = 40.0) -> Callable[[], Facts]:
    tree = folder / "short.xml"
    tree.write_text(TREE, encoding="utf-8")
    images = Fault.parse(fault, KINDS).kind.name in IN_IMAGE or fault in WITH_IMAGES
    how = {"drone": "twin" if images else "plain", "time_limit_s": time_limit_s}
    return partial(fly, fault, str(tree), folder, on_pad=False, **how)


@pytest.mark.parametrize("fault", RIGHT)
def test_the_reaction_is_right(tmp_path: Path, fault: str) -> None:
    facts = short_flight(fault, tmp_path)()
    assert reaction(fault, facts) == "right", facts


def test_every_kind_says_what_is_expected() -> None:
    assert EXPECTED.keys() == KINDS.keys()


def test_a_flight_is_watched_to_its_end(tmp_path: Path) -> None:
    """After a refused landing the drone still flies; it had kept its position in the descent."""
    facts = short_flight("no-landing@explore", tmp_path, 9.0)()
    assert facts.began_s is not None
    assert facts.motors_on
    assert facts.height_m > 0.3
    assert not facts.touched
    assert facts.report_whole


# --- the command ----------------------------------------------------------------------------------


def test_faults_begin_in_each_phase_and_those_of_the_take_off_at_the_start() -> None:
    found = [str(fault) for fault in faults_of(["late=0.7~3", "no-take-off"], ["land", "center+2"])]
    assert found == ["late=0.7@land+1~3", "late=0.7@center+2~3", "no-take-off@start"]


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
    assert main([*arguments, "--out", str(tmp_path)]) == 2
    assert message in capsys.readouterr().err


# --- the rules ------------------------------------------------------------------------------------

LANDED = Facts(
    began_s=4.0,
    outcome="aborted",
    reason="no new frame for 15 s",
    error=None,
    events=(),
    touched=(),
    beyond_edge=False,
    emergency_landing=False,
    motors_on=False,
    on_mark=False,
    height_m=0.05,
    report_whole=True,
)
STRICT = Expected(named="frame")
SUCCESS = replace(LANDED, outcome="success", reason="landed", on_mark=True)


def test_landed_and_named_is_right() -> None:
    assert problems(STRICT, "explore", LANDED) == ()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"touched": ("box-3", "wall-west")}, "touched box-3, wall-west"),
        ({"beyond_edge": True}, "flew beyond the ground's edge"),
        ({"motors_on": True, "height_m": 1.44}, "left flying at 1.4 m"),
        ({"report_whole": False}, "no whole report"),
        ({"reason": "not over after 300 s"}, "not named: aborted: not over after 300 s"),
    ],
)
def test_each_harm_is_wrong(change: dict[str, object], said: str) -> None:
    assert problems(STRICT, "explore", replace(LANDED, **change)) == (said,)  # type: ignore[arg-type]


def test_a_long_reason_is_one_short_line() -> None:
    (said,) = problems(STRICT, "explore", replace(LANDED, reason="first line\n" + 99 * "words "))
    assert "first line words" in said
    assert len(said) <= len("not named: ") + 100


def test_an_event_or_an_error_names_a_fault_too() -> None:
    silent = replace(LANDED, reason="the tree failed; landed")
    assert problems(STRICT, "explore", silent) != ()
    assert problems(STRICT, "explore", replace(silent, events=("stale frame",))) == ()
    assert problems(STRICT, "explore", replace(silent, error="DroneError: no frame")) == ()


@pytest.mark.parametrize(
    ("reason", "named"),
    [
        ("no frames", True),
        ("node 'Mission/frame' failed: error: /io/modules/frame/x.cpp", False),
        ("mainframe lost", False),
    ],
)
def test_only_words_name_a_fault(reason: str, *, named: bool) -> None:
    """Paths and the ends of words do not count: 'returns' does not contain the word 'turn'."""
    assert (problems(STRICT, "explore", replace(LANDED, reason=reason)) == ()) is named


def test_a_success_must_be_one() -> None:
    unnoticed = "not named: success: landed"
    bearable = replace(STRICT, bearable=True)
    assert problems(STRICT, "explore", SUCCESS) == (unnoticed,)
    assert problems(bearable, "explore", SUCCESS) == ()
    assert problems(STRICT, "land", SUCCESS) == ()  # it was already landing
    assert problems(replace(STRICT, may_fall=True), "land", SUCCESS) == (unnoticed,)
    assert problems(bearable, "explore", replace(SUCCESS, on_mark=False)) == (unnoticed,)
    assert problems(bearable, "explore", replace(SUCCESS, on_mark=None)) == ()
    assert problems(bearable, "explore", replace(SUCCESS, emergency_landing=True)) == (
        "a success, by an emergency landing",
        unnoticed,
    )
    assert problems(bearable, "explore", replace(SUCCESS, motors_on=True)) == (
        "left flying at 0.1 m",
        "a success, in the air",
        unnoticed,
    )


def test_less_is_asked_for_where_nobody_could_do_better() -> None:
    named = replace(LANDED, reason="frame")
    hovers = replace(named, motors_on=True)
    falls = replace(named, touched=("box-1",))
    mute = replace(named, report_whole=False)
    assert problems(replace(STRICT, may_fly=True), "explore", hovers) == ()
    assert problems(replace(STRICT, may_fall=True), "explore", falls) == ()
    assert problems(replace(STRICT, reported=False), "explore", mute) == ()
