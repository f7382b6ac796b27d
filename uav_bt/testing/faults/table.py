"""The table of the kinds of faults. Tests may define further `FaultKind` values.

A row has name, description, effect on observations, default level with its unit, and the range of
levels. The effects of a kind without a level get NaN as their level; the kinds `...-nan` report it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from uav_bt.testing.faults import effects as fx
from uav_bt.testing.faults.kind import FaultKind
from uav_bt.types import FlyingState, Hover, Land, MoveBy, Release, TakeOff

_KINDS: Final = (
    FaultKind("frozen", "the image stops, with fresh timestamps and telemetry", fx.frozen),
    FaultKind("black", "black images", fx.black, in_image=True),
    FaultKind("white", "overexposed images", fx.white, in_image=True),
    FaultKind(
        "noise",
        "white noise, with this standard deviation",
        fx.noisy,
        80,
        "grey levels",
        0,
        255,
        in_image=True,
    ),
    FaultKind(
        "covered",
        "a covered lens: blurred and dark",
        fx.covered,
        0.08,
        "of the light",
        0,
        1,
        in_image=True,
    ),
    # Frames older than 6 s are not kept.
    FaultKind("late", "late frames, of this age", fx.late, 1, "s", 0, 6),
    FaultKind("slow", "slow video", fx.slow, 4, "frames/s", 0.2, 30),
    FaultKind(
        "video-lost", "no new frame comes", lambda seen, at: replace(seen, frame=at.before.frame)
    ),
    FaultKind(
        "no-frame", "observations without a frame", lambda seen, _: replace(seen, frame=None)
    ),
    FaultKind("half-size", "images of half the size", fx.half_size, in_image=True),
    FaultKind("empty-image", "images without a pixel", fx.empty, in_image=True),
    FaultKind(
        "no-telemetry",
        "no new telemetry comes",
        lambda seen, at: replace(seen, state=at.before.state),
    ),
    FaultKind(
        "link-lost", "nothing comes and nothing arrives", lambda _, at: at.before, send=fx.unheard
    ),
    FaultKind("height-nan", "heights NaN", fx.heights),
    FaultKind("height-absurd", "absurd heights", fx.heights, 1e4, "m"),
    FaultKind("height-bias", "heights are too great", fx.raised, 0.3, "m"),
    FaultKind("attitude-nan", "attitude NaN", fx.tilted),
    FaultKind("attitude-absurd", "absurd angles", fx.tilted, 100, "rad"),
    FaultKind("yaw-jump", "a wrong heading", fx.turned, 0.8, "rad", -3.14, 3.14),
    FaultKind("yaw-drift", "the heading drifts", fx.turning, 0.035, "rad/s", -3.14, 3.14),
    FaultKind("velocity-nan", "velocity NaN", fx.velocity),
    FaultKind("velocity-absurd", "an absurd velocity", fx.velocity, 500, "m/s"),
    FaultKind(
        "velocity-bias", "the forward velocity is too great, or too low", fx.biased, -0.2, "m/s"
    ),
    FaultKind("position-jump", "dead reckoning jumps forward once", fx.jumped, 1, "m"),
    FaultKind("time-jump", "later timestamps", fx.dated, 5, "s"),
    FaultKind("gimbal-nan", "the camera's pitch NaN", fx.pointed),
    FaultKind("gimbal-absurd", "an absurd camera pitch", fx.pointed, 50, "rad"),
    FaultKind(
        "gimbal-stuck",
        "the camera stays where it points",
        send=lambda command, _: replace(command, gimbal=None),
    ),
    FaultKind("battery-nan", "a charge of NaN", fx.charged),
    FaultKind("battery-low", "a low battery", fx.charged, 0.05, "of the charge", 0, 1),
    FaultKind("battery-drains", "a draining battery", fx.drained, 0.1, "of the charge per s", 0, 1),
    FaultKind("yaw-ignored", "the drone does not turn", send=fx.unturned),
    FaultKind("never-done", "no movement is reported done", fx.never_done),
    FaultKind(
        "interrupted",
        "every movement is interrupted at once",
        fx.interrupted,
        send=fx.instead(MoveBy, Hover()),
    ),
    FaultKind("no-take-off", "take-off is refused", send=fx.instead(TakeOff, Release())),
    FaultKind("no-landing", "landing is refused", send=fx.instead(Land, Hover())),
    FaultKind("deaf", "no command arrives", send=fx.unheard),
    FaultKind("motors-cut", "the drone stops its motors", send=fx.cut),
    FaultKind(
        "emergency-state",
        "the drone says that its motors were cut",
        fx.flying(FlyingState.EMERGENCY),
    ),
    FaultKind(
        "landed-state", "the drone says that it stands on the ground", fx.flying(FlyingState.LANDED)
    ),
    FaultKind("pilot", "a pilot has control", fx.piloted),
    FaultKind(
        "wind",
        "a steady wind towards world x",
        None,
        0.2,
        "m/s²",
        -10,
        10,
        disturb=lambda level: {"wind_mps2": (level, 0.0)},
    ),
    FaultKind(
        "drift",
        "drift of the estimate towards world x",
        None,
        0.1,
        "m/s",
        -10,
        10,
        disturb=lambda level: {"drift_mps": (level, 0.0)},
    ),
    FaultKind("observe-raises", "observing raises", fx.raises),
    FaultKind("send-raises", "sending raises", send=fx.raises),
    FaultKind("listener-raises", "a listener raises", follow=fx.listener_raises),
)

FAULTS: Final[Mapping[str, FaultKind]] = {kind.name: kind for kind in _KINDS}
