"""The check before a propeller turns: everything that is wrong, with what to do, in one list."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from uav_bt.errors import DroneError, ValueRangeError
from uav_bt.protocols import Drone
from uav_bt.types import DroneState, FlyingState, Frame, Observation

_STEP_S: Final = 0.1
_FRAMES: Final = 3  # of a video that moves on
_OLD_S: Final = 1.0  # for telemetry and frames alike


@dataclass(frozen=True, kw_only=True)
class PreflightConfig:
    """What a drone must show before it takes off."""

    battery: float = 0.3  # of its charge; a mission takes five minutes of twenty-five
    link: float = 0.4  # of the best link there is
    wait_s: float = 5.0  # for the first telemetry and the first frames

    def __post_init__(self) -> None:
        if not (0.0 <= self.battery <= 1.0 and 0.0 <= self.link <= 1.0 and self.wait_s > 0.0):
            raise ValueRangeError(
                f"battery and link are shares from 0 to 1, the wait is positive: {self}"
            )


@dataclass(frozen=True, kw_only=True)
class Check:
    """One line of the list."""

    what: str
    good: bool
    found: str
    remedy: str = ""
    optional: bool = False  # whether one can do without it

    def __str__(self) -> str:
        mark = "ok" if self.good else "missing" if self.optional else "NOT READY"
        remedy = f": {self.remedy}" if self.remedy and not self.good else ""
        return f"{self.what}: {mark}, {self.found}{remedy}"


def check_drone(drone: Drone, config: PreflightConfig | None = None) -> tuple[Check, ...]:
    """Observe a connected drone for a while and return what is good and what is not.

    Args:
        drone: connected, on the ground.
        config: what is good enough.

    Raises:
        DroneError: the drone was lost during the check.
    """
    config = config or PreflightConfig()
    seen, frames = _watch(drone, config.wait_s)
    now_s = drone.clock.now()
    return (
        _telemetry(seen.state, now_s),
        _standing(seen.state),
        _battery(seen.state, config),
        _link(seen.state, config),
        _video(seen.frame, frames, now_s, config),
        *_reported(seen.state),
    )


def refuse_faults(checks: Sequence[Check]) -> None:
    """Go on only when all is well.

    Raises:
        DroneError: something is not; the message lists all of it.
    """
    faults = [str(check) for check in checks if not check.good]
    if faults:
        raise DroneError("\n  ".join(["not ready to take off, nothing was flown", *faults]))


def _watch(drone: Drone, wait_s: float) -> tuple[Observation, int]:
    """Return the last observation and how many frames came, up to what is enough."""
    clock = drone.clock
    end_s = clock.now() + wait_s
    seen = drone.observe()
    indices = set()
    while True:
        now_s = clock.now()
        if seen.frame is not None:
            indices.add(seen.frame.index)
        fresh = now_s - seen.state.captured_s <= _OLD_S
        known = None not in (seen.state.battery, seen.state.link)
        if now_s >= end_s or (fresh and known and len(indices) >= _FRAMES):
            return seen, len(indices)
        clock.sleep_until(now_s + _STEP_S)
        seen = drone.observe()


def _telemetry(state: DroneState, now_s: float) -> Check:
    age_s = now_s - state.captured_s
    found = f"last heard {age_s:.1f} s ago" if age_s < 1e6 else "nothing was heard"
    return Check(
        what="telemetry",
        good=age_s <= _OLD_S and state.connected,
        found=found if state.connected else f"{found}, and the connection is broken",
        remedy="connect again; restart the drone if that does not help",
    )


def _standing(state: DroneState) -> Check:
    if state.pilot_has_control:
        return Check(
            what="control",
            good=False,
            found="a pilot has it",
            remedy="hand over at the remote control",
        )
    return Check(
        what="control",
        good=state.flying is FlyingState.LANDED,
        found=f"the drone is {state.flying.value.replace('_', ' ')}",
        remedy="a mission begins on the ground: land it first",
    )


def _battery(state: DroneState, config: PreflightConfig) -> Check:
    wanted = f"at least {100 * config.battery:.0f} % wanted"
    if state.battery is None:
        return Check(
            what="battery",
            good=False,
            found=f"not reported within {config.wait_s:.0f} s, {wanted}",
            remedy="connect again; restart the drone if that does not help",
        )
    return Check(
        what="battery",
        good=state.battery >= config.battery,
        found=f"{100 * state.battery:.0f} %, {wanted}",
        remedy="charge it",
    )


def _link(state: DroneState, config: PreflightConfig) -> Check:
    if state.link is None:
        # Not all drones rate their link; that they are heard is checked above.
        return Check(what="link", good=True, found="its quality is not reported")
    return Check(
        what="link",
        good=state.link >= config.link,
        found=f"{100 * state.link:.0f} %, at least {100 * config.link:.0f} % wanted",
        remedy="come nearer, or choose a Wi-Fi channel that fewer others use",
    )


def _video(frame: Frame | None, frames: int, now_s: float, config: PreflightConfig) -> Check:
    remedy = "see that no firewall keeps UDP out and nobody else watches the drone's video"
    if frame is None:
        return Check(
            what="video", good=False, found=f"no frame within {config.wait_s:.0f} s", remedy=remedy
        )
    height, width = frame.image.shape[:2]
    age_s = now_s - frame.captured_s
    return Check(
        what="video",
        good=frames >= _FRAMES and age_s <= _OLD_S,
        found=f"{width}x{height}, {frames} frames seen, the newest {age_s:.2f} s old",
        remedy=remedy,
    )


def _reported(state: DroneState) -> Iterator[Check]:
    """Check what the drone says about itself."""
    for fault in state.faults:
        yield Check(what=fault.what, good=False, found=fault.found, remedy=fault.remedy)
    if not state.faults:
        yield Check(what="self-report", good=True, found="no faults")
