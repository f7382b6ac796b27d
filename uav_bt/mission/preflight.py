"""The check before take-off: one list of faults and remedies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from uav_bt.errors import DroneError
from uav_bt.mission.screening import FrameJudge, Screening
from uav_bt.protocols import Drone
from uav_bt.settings import check_numbers
from uav_bt.types import DroneState, FlyingState, Observation

_STEP_S: Final = 0.1  # time between two observations, seconds; chosen, as a tick of a mission
_FRAMES: Final = 3  # number of different frames that show a running video; chosen
_OLD_S: Final = 1.0  # greatest age of telemetry and frames on the ground, seconds; chosen
_WAIT_S: Final = 5.0  # longest for telemetry and frames: as long as video may take to be granted
_WITHIN: Final = f"within {_WAIT_S:.0f} s"
LOOK_S: Final = 2.5  # for which images are watched; a still video counts as frozen after 2 s
_HAND_OVER: Final = "hand over at the remote control"
_RECONNECT: Final = "connect again; restart the drone if that does not help"


@dataclass(frozen=True, kw_only=True)
class PreflightConfig:
    """Conditions for a take-off.

    Attributes:
        battery: least charge, 0 to 1. Chosen: five of an ANAFI's 25 minutes, and the critical
            charge.
        link: least quality of the radio link, 0 to 1. Chosen: two bars of five.

    Raises:
        ValueRangeError: a number is out of its range.
    """

    battery: float = 0.3
    link: float = 0.4

    def __post_init__(self) -> None:
        check_numbers(self, {"battery": 0.0, "link": 0.0}, {"battery": 1.0, "link": 1.0})


@dataclass(frozen=True)
class Check:
    """One line of the list."""

    what: str
    good: bool
    found: str
    remedy: str = ""
    optional: bool = False  # whether a flight is possible without it

    def __str__(self) -> str:
        if self.good:
            return f"{self.what}: ok, {self.found}"
        parts = [self.found, *filter(None, [self.remedy])]
        if self.optional:
            return f"{self.what}: optional, not installed: {'; '.join(parts)}"
        return f"{self.what}: NOT READY, {': '.join(parts)}"


def check_drone(
    drone: Drone, config: PreflightConfig | None = None, *, judge_frame: FrameJudge | None = None
) -> tuple[Check, ...]:
    """Observe a connected drone for a while and return the list of checks.

    `judge_frame` returns why a frame's image cannot be flown by, as in the flight.

    Raises:
        DroneError: the drone was lost during the check.
    """
    config, screening = config or PreflightConfig(), Screening(drone.camera, judge_frame)
    newest, frames = _watch(drone, screening, 0.0 if judge_frame is None else LOOK_S)
    state, now_s = newest.state, drone.clock.now()
    pilot, battery, link = state.pilot_has_control, state.battery, state.link
    charge = f"not reported {_WITHIN}" if battery is None else _percent(battery)
    rated = "its quality is not reported" if link is None else _wanted(_percent(link), config.link)
    reports = [
        Check(one.what, good=False, found=one.found, remedy=one.remedy) for one in state.faults
    ]
    return (
        Check("telemetry", *_telemetry(state, screening.state_fault, now_s), _RECONNECT),
        Check(
            "control",
            state.flying is FlyingState.LANDED and not pilot,
            "a pilot has it" if pilot else f"the drone is {state.flying.value.replace('_', ' ')}",
            _HAND_OVER if pilot else "a mission begins on the ground: land it first",
        ),
        Check(
            "battery",
            battery is not None and battery >= config.battery,
            _wanted(charge, config.battery),
            _RECONNECT if battery is None else "charge it",
        ),
        Check(
            "link",  # not all drones rate it; the row of telemetry says whether they are heard
            link is None or link >= config.link,
            rated,
            "come nearer, or choose a Wi-Fi channel that fewer others use",
        ),
        Check("video", *_video(newest, frames, screening.frame_fault, now_s)),
        *(reports or [Check("self-report", good=True, found="no faults")]),
    )


def refuse_faults(checks: Sequence[Check]) -> None:
    """Refuse a drone that fails a check.

    Raises:
        DroneError: a check failed; the message lists all that did.
    """
    faults = [str(check) for check in checks if not check.good]
    if faults:
        raise DroneError("\n  ".join(["not ready to take off, nothing was flown", *faults]))


def _watch(drone: Drone, screening: Screening, look_s: float) -> tuple[Observation, int]:
    """Observe until every check passes or the time is over; only the first frame may be bad."""
    clock = drone.clock
    start_s = clock.now()
    indices = set()
    while True:
        now_s = clock.now()
        newest = drone.observe()
        screening.usable(newest, now_s)
        if newest.frame is not None:
            indices.add(newest.frame.index)
        fresh = now_s - newest.state.captured_s <= _OLD_S
        known = None not in (newest.state.battery, newest.state.link)
        well = fresh and known and len(indices) >= _FRAMES and not screening.refused
        if now_s >= start_s + _WAIT_S or (well and now_s >= start_s + look_s):
            return newest, len(indices)
        clock.sleep_until(now_s + _STEP_S)


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def _wanted(found: str, least: float) -> str:
    return f"{found}, at least {_percent(least)} wanted"


def _telemetry(state: DroneState, fault: str | None, now_s: float) -> tuple[bool, str]:
    """Return whether telemetry is good, and what was found."""
    age_s = now_s - state.captured_s
    found = f"last heard {age_s:.1f} s ago" if age_s < 1e6 else "nothing was heard"
    if not state.connected:
        found += ", and the connection is broken"
    elif fault is not None:
        found += f", and {fault}"
    return age_s <= _OLD_S and state.connected and fault is None, found


def _video(
    newest: Observation, frames: int, fault: str | None, now_s: float
) -> tuple[bool, str, str]:
    """Return whether the video is good, what was found, and the remedy."""
    frame = newest.frame
    remedy = "see that no firewall keeps UDP out and nobody else watches the drone's video"
    if frame is None:
        return False, f"no frame {_WITHIN}", remedy
    height, width = frame.image.shape[:2]
    age_s = now_s - frame.captured_s
    found = f"{width}x{height}, {frames} frames seen, the newest {age_s:.2f} s old"
    if fault is not None:
        found += f", {fault}"
        remedy = "see that the lens is clean and the place is lit; restart the drone if it is"
    return frames >= _FRAMES and age_s <= _OLD_S and fault is None, found, remedy
