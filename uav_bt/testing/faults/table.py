"""The table of the kinds of faults. Tests may define further `FaultKind` values.

The effects of a kind without a level get NaN as their level; the kinds named `...-nan` report it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from uav_bt.testing.faults import images, movements, state_faults
from uav_bt.testing.faults.images import image
from uav_bt.testing.faults.kind import FaultKind
from uav_bt.testing.faults.movements import instead
from uav_bt.testing.faults.state_faults import both, of_state
from uav_bt.types import FlyingState, Hover, Land, MoveBy, Release, TakeOff

_KINDS: Final = (
    FaultKind(
        name="frozen",
        what="the image stops, with fresh timestamps and telemetry",
        observe=image(images.frozen),
    ),
    FaultKind(
        name="black",
        what="black images",
        observe=image(lambda frame, _: np.zeros_like(frame.image)),
        in_image=True,
    ),
    FaultKind(
        name="white",
        what="overexposed images",
        observe=image(lambda frame, _: np.full_like(frame.image, 255)),
        in_image=True,
    ),
    FaultKind(
        name="noise",
        what="white noise, with this standard deviation",
        level=80.0,
        unit="grey levels",
        least=0.0,
        most=255.0,
        observe=image(images.noisy),
        in_image=True,
    ),
    FaultKind(
        name="covered",
        what="a covered lens: blurred and dark",
        level=0.08,
        unit="of the light",
        least=0.0,
        most=1.0,
        observe=image(images.covered),
        in_image=True,
    ),
    FaultKind(
        name="late",
        what="late frames, of this age",
        level=1.0,
        unit="s",
        least=0.0,
        most=6.0,  # older frames are not kept
        observe=images.late,
    ),
    FaultKind(
        name="slow",
        what="slow video",
        level=4.0,
        unit="frames/s",
        least=0.2,  # older frames are not kept
        most=30.0,
        observe=images.slow,
    ),
    FaultKind(
        name="video-lost",
        what="no new frame comes",
        observe=lambda seen, at: replace(seen, frame=at.before.frame),
    ),
    FaultKind(
        name="no-frame",
        what="observations without a frame",
        observe=lambda seen, _: replace(seen, frame=None),
    ),
    FaultKind(
        name="half-size",
        what="images of half the size",
        observe=image(lambda frame, _: np.ascontiguousarray(frame.image[::2, ::2])),
        in_image=True,
    ),
    FaultKind(
        name="empty-image",
        what="images without a pixel",
        observe=image(lambda frame, _: frame.image[:0, :0]),
        in_image=True,
    ),
    FaultKind(
        name="no-telemetry",
        what="no new telemetry comes",
        observe=lambda seen, at: replace(seen, state=at.before.state),
    ),
    FaultKind(
        name="link-lost",
        what="nothing comes and nothing arrives",
        observe=lambda _, at: at.before,
        send=movements.unheard,
    ),
    FaultKind(name="height-nan", what="heights NaN", observe=both(state_faults.height)),
    FaultKind(
        name="height-absurd",
        what="absurd heights",
        level=1.0e4,
        unit="m",
        observe=both(state_faults.height),
    ),
    FaultKind(
        name="height-bias",
        what="heights are too great",
        level=0.3,
        unit="m",
        observe=both(state_faults.raised),
    ),
    FaultKind(name="attitude-nan", what="attitude NaN", observe=both(state_faults.tilted)),
    FaultKind(
        name="attitude-absurd",
        what="absurd angles",
        level=100.0,
        unit="rad",
        observe=both(state_faults.tilted),
    ),
    FaultKind(
        name="yaw-jump",
        what="a wrong heading",
        level=0.8,
        unit="rad",
        least=-3.14,
        most=3.14,
        observe=both(state_faults.turned),
    ),
    FaultKind(
        name="yaw-drift",
        what="the heading drifts",
        level=0.035,
        unit="rad/s",
        least=-3.14,
        most=3.14,
        observe=both(state_faults.turned, lambda at: at.level * at.since_s),
    ),
    FaultKind(name="velocity-nan", what="velocity NaN", observe=of_state(state_faults.velocity)),
    FaultKind(
        name="velocity-absurd",
        what="an absurd velocity",
        level=500.0,
        unit="m/s",
        observe=of_state(state_faults.velocity),
    ),
    FaultKind(
        name="velocity-bias",
        what="the forward velocity is too great, or too low",
        level=-0.2,
        unit="m/s",
        observe=of_state(lambda state, at: state_faults.faster(state, at.level)),
    ),
    FaultKind(
        name="position-jump",
        what="dead reckoning jumps forward once",
        level=1.0,
        unit="m",
        observe=of_state(state_faults.jumped),
    ),
    FaultKind(
        name="time-jump",
        what="later timestamps",
        level=5.0,
        unit="s",
        observe=both(state_faults.dated),
    ),
    FaultKind(
        name="gimbal-nan",
        what="the camera's pitch NaN",
        observe=both(state_faults.pointed),
    ),
    FaultKind(
        name="gimbal-absurd",
        what="an absurd camera pitch",
        level=50.0,
        unit="rad",
        observe=both(state_faults.pointed),
    ),
    FaultKind(
        name="gimbal-stuck",
        what="the camera stays where it points",
        send=lambda command, _: replace(command, gimbal=None),
    ),
    FaultKind(
        name="battery-nan",
        what="a charge of NaN",
        observe=of_state(lambda state, at: replace(state, battery=at.level)),
    ),
    FaultKind(
        name="battery-low",
        what="a low battery",
        level=0.05,
        unit="of the charge",
        least=0.0,
        most=1.0,
        observe=of_state(lambda state, at: replace(state, battery=at.level)),
    ),
    FaultKind(
        name="battery-drains",
        what="a draining battery",
        level=0.1,
        unit="of the charge per s",
        least=0.0,
        most=1.0,
        observe=of_state(state_faults.drained),
    ),
    FaultKind(name="yaw-ignored", what="the drone does not turn", send=movements.unturned),
    FaultKind(
        name="never-done",
        what="no movement is reported done",
        observe=of_state(movements.never_done),
    ),
    FaultKind(
        name="interrupted",
        what="every movement is interrupted at once",
        observe=of_state(movements.interrupted),
        send=instead(MoveBy, Hover()),
    ),
    FaultKind(name="no-take-off", what="take-off is refused", send=instead(TakeOff, Release())),
    FaultKind(name="no-landing", what="landing is refused", send=instead(Land, Hover())),
    FaultKind(name="deaf", what="no command arrives", send=movements.unheard),
    FaultKind(name="motors-cut", what="the drone stops its motors", send=movements.cut),
    FaultKind(
        name="emergency-state",
        what="the drone says that its motors were cut",
        observe=state_faults.flying(FlyingState.EMERGENCY),
    ),
    FaultKind(
        name="landed-state",
        what="the drone says that it stands on the ground",
        observe=state_faults.flying(FlyingState.LANDED),
    ),
    FaultKind(
        name="pilot",
        what="a pilot has control",
        observe=of_state(lambda state, _: replace(state, pilot_has_control=True)),
    ),
    FaultKind(
        name="wind",
        what="a steady wind towards world x",
        level=0.2,
        unit="m/s²",
        least=-10.0,
        most=10.0,
        disturb=lambda level: {"wind_mps2": (level, 0.0)},
    ),
    FaultKind(
        name="drift",
        what="drift of the estimate towards world x",
        level=0.1,
        unit="m/s",
        least=-10.0,
        most=10.0,
        disturb=lambda level: {"drift_mps": (level, 0.0)},
    ),
    FaultKind(name="observe-raises", what="observing raises", observe=movements.raises),
    FaultKind(name="send-raises", what="sending raises", send=movements.raises),
    FaultKind(name="listener-raises", what="a listener raises", follow=movements.listener_raises),
)

FAULTS: Final[Mapping[str, FaultKind]] = {kind.name: kind for kind in _KINDS}
