"""Right reactions to each kind of fault: one table, and the verdict on a flight."""

from __future__ import annotations

import re
from dataclasses import dataclass
from textwrap import shorten
from typing import Final

from uav_bt.mission.judge import Outcome
from uav_bt.types import MissionPhase


@dataclass(frozen=True, kw_only=True)
class Expected:
    """Requirements on the reaction to one kind of fault."""

    named: str  # a regular expression of its names in reasons and warnings, from a word's begin
    bearable: bool = False  # a mission that ends on the mark all the same is right
    may_fly: bool = False  # no command can land it: it may hover at the end
    may_fall: bool = False  # its motors stop anywhere: it may touch what stands there
    reported: bool = True  # False: no report can be written


@dataclass(frozen=True, kw_only=True)
class Facts:
    """Outcome of one flight; unknown values are None."""

    began_s: float | None  # when the fault had its first effect, mission time
    outcome: str | None = None  # of the report
    reason: str | None = None
    error: str | None = None  # what flying raised
    events: tuple[str, ...] = ()  # overrides, logged warnings, what else the report says
    touched: tuple[str, ...] = ()  # but for the landing surfaces
    beyond_edge: bool = False
    emergency_landing: bool = False  # whether that phase was reached
    motors_on: bool = False  # 3 s after the end
    on_mark: bool | None = None  # None also where the mission need not end there
    height_m: float = 0.0  # above the ground, at the end
    report_whole: bool = False


_IMAGE: Final = r"image|frame|video|camera|blind|dark|frozen|stands still|bright"
_SHAPE: Final = r"(image|frame).*(size|shape|empty|\d+x\d+)"
_TELEMETRY: Final = r"telemetry|link|nothing (was )?heard"

_EXPECTED: Final = (
    ("frozen black white covered video-lost no-frame", Expected(named=_IMAGE)),
    ("noise late slow", Expected(named=_IMAGE, bearable=True)),
    ("half-size empty-image", Expected(named=_SHAPE)),
    ("no-telemetry", Expected(named=_TELEMETRY)),
    ("link-lost", Expected(named=_TELEMETRY, may_fly=True)),
    ("height-nan height-absurd", Expected(named="height|altitude")),
    ("height-bias", Expected(named="height|altitude", bearable=True)),
    ("attitude-nan attitude-absurd", Expected(named="attitude|heading|yaw|roll")),
    ("yaw-jump yaw-drift yaw-ignored", Expected(named="heading|yaw|turn", bearable=True)),
    ("velocity-nan velocity-absurd", Expected(named="velocity|speed|m/s")),
    ("velocity-bias", Expected(named="velocity|speed|odometry", bearable=True)),
    ("position-jump", Expected(named="velocity|speed|position|odometry", bearable=True)),
    ("time-jump", Expected(named="time|clock|stamp|future|nothing heard", bearable=True)),
    ("gimbal-nan gimbal-absurd", Expected(named="gimbal|camera")),
    ("gimbal-stuck", Expected(named="gimbal|camera", bearable=True)),
    ("battery-nan battery-low", Expected(named="battery")),
    ("battery-drains", Expected(named="battery", bearable=True)),  # it may land before
    ("never-done", Expected(named="movement|obey|not done", bearable=True)),
    ("interrupted", Expected(named="movement|interrupted", bearable=True)),
    ("no-take-off", Expected(named="take.?off")),
    ("no-landing", Expected(named="still (flies|in the air)|not land|landing", may_fly=True)),
    ("deaf", Expected(named="still (flies|in the air)|not land|obey|command", may_fly=True)),
    ("motors-cut", Expected(named="motors|emergency", may_fall=True)),
    ("emergency-state", Expected(named="motors|emergency")),
    ("landed-state", Expected(named="has landed.*motors|still (flies|in the air)|not take off")),
    ("pilot", Expected(named="pilot|manual", may_fly=True)),
    ("wind drift", Expected(named="wind|drift|pushed", bearable=True)),
    ("observe-raises", Expected(named="fell over")),
    ("send-raises", Expected(named="fell over", may_fly=True)),
    ("listener-raises", Expected(named="fell over", bearable=True)),
    ("disk-full", Expected(named=r"written|space|File too large", reported=False)),
)
EXPECTED: Final = {kind: expected for kinds, expected in _EXPECTED for kind in kinds.split()}


def problems(expected: Expected, phase: str, facts: Facts) -> tuple[str, ...]:
    """Return the errors of a reaction to a fault that began in a phase; none when it is right."""
    success = facts.outcome == Outcome.SUCCESS.value
    text = "\n".join([*facts.events, facts.error or "", "" if success else facts.reason or ""])
    words = re.sub(r"\S*/\S*", "", text)  # paths of nodes and files name no fault
    named = re.search(rf"\b(?:{expected.named})", words, re.IGNORECASE) is not None
    # The mission may end as without the fault.
    bearable = expected.bearable or (phase == MissionPhase.LAND and not expected.may_fall)
    landed = not facts.motors_on and facts.on_mark is not False
    flown_through = bearable and landed and success and not facts.emergency_landing
    brief = shorten(f"{facts.outcome}: {facts.reason}", 100)
    wrong = {
        f"touched {', '.join(facts.touched)}": bool(facts.touched) and not expected.may_fall,
        "flew beyond the ground's edge": facts.beyond_edge,
        f"left flying at {facts.height_m:.1f} m": facts.motors_on and not expected.may_fly,
        "a success, in the air": success and facts.motors_on,
        "a success, by an emergency landing": success and facts.emergency_landing,
        "no whole report": expected.reported and not facts.report_whole,
        f"not named: {brief}": not (named or flown_through),
    }
    return tuple(text for text, holds in wrong.items() if holds)
