"""The check before take-off: one list of faults and remedies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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


@dataclass(frozen=True, kw_only=True)
class PreflightConfig:
    """Conditions for a take-off.

    Attributes:
        battery: least charge, 0 to 1. Chosen: five of an ANAFI's 25 minutes, and the critical
            charge.
        link: least quality of the radio link, 0 to 1. Chosen: two bars of five.
        wait_s: longest wait for the first telemetry and frames, seconds. Chosen: as
            long as the video may take to be granted (`OlympeConfig.video_limit_s`).
        look_s: time for which the images are watched, seconds, within the wait. Chosen: longer than
            the 2 s after which a still video counts as frozen (`uav_bt.app.assembly`).

    Raises:
        ValueRangeError: a number is out of its range.
    """

    battery: float = 0.3
    link: float = 0.4
    wait_s: float = 5.0
    look_s: float = 2.5

    def __post_init__(self) -> None:
        shares = {"battery": 0.0, "link": 0.0}
        check_numbers(self, {**shares, "look_s": 0.0}, dict.fromkeys(shares, 1.0))


@dataclass(frozen=True, kw_only=True)
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
    drone: Drone,
    config: PreflightConfig | None = None,
    *,
    judge_frame: FrameJudge | None = None,
) -> tuple[Check, ...]:
    """Observe a connected drone for a while and return the list of checks.

    Args:
        drone: connected, on the ground.
        config: conditions for a take-off.
        judge_frame: returns why a frame's image cannot be flown by, as in the flight; None trusts
            all images.

    Raises:
        DroneError: the drone was lost during the check.
    """
    config = config or PreflightConfig()
    seen = _watch(drone, config, judge_frame)
    state, now_s = seen.newest.state, drone.clock.now()
    return (
        _telemetry(state, seen.state_fault, now_s),
        _standing(state),
        _battery(state, config),
        _link(state, config),
        _video(seen, now_s, config),
        *_reported(state),
    )


def refuse_faults(checks: Sequence[Check]) -> None:
    """Refuse a drone that fails a check.

    Raises:
        DroneError: a check failed; the message lists all that did.
    """
    faults = [str(check) for check in checks if not check.good]
    if faults:
        raise DroneError("\n  ".join(["not ready to take off, nothing was flown", *faults]))


@dataclass(frozen=True, kw_only=True)
class _Seen:
    """The observations of a check."""

    newest: Observation
    frames: int  # number of different ones
    frame_fault: str | None  # of the newest frame
    state_fault: str | None  # of the newest telemetry


def _watch(drone: Drone, config: PreflightConfig, judge_frame: FrameJudge | None) -> _Seen:
    """Observe until every check passes or the time is over; only the first frame may be bad."""
    clock, screening = drone.clock, Screening(drone.camera, judge_frame)
    start_s = clock.now()
    look_s = 0.0 if judge_frame is None else config.look_s
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
        if now_s >= start_s + config.wait_s or (well and now_s >= start_s + look_s):
            return _Seen(
                newest=newest,
                frames=len(indices),
                frame_fault=screening.frame_fault,
                state_fault=screening.state_fault,
            )
        clock.sleep_until(now_s + _STEP_S)


def _telemetry(state: DroneState, fault: str | None, now_s: float) -> Check:
    age_s = now_s - state.captured_s
    found = f"last heard {age_s:.1f} s ago" if age_s < 1e6 else "nothing was heard"
    if not state.connected:
        found += ", and the connection is broken"
    elif fault is not None:
        found += f", and {fault}"
    return Check(
        what="telemetry",
        good=age_s <= _OLD_S and state.connected and fault is None,
        found=found,
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
        # Not all drones rate their link; `_telemetry` checks that they are heard.
        return Check(what="link", good=True, found="its quality is not reported")
    return Check(
        what="link",
        good=state.link >= config.link,
        found=f"{100 * state.link:.0f} %, at least {100 * config.link:.0f} % wanted",
        remedy="come nearer, or choose a Wi-Fi channel that fewer others use",
    )


def _video(seen: _Seen, now_s: float, config: PreflightConfig) -> Check:
    frame, fault = seen.newest.frame, seen.frame_fault
    remedy = "see that no firewall keeps UDP out and nobody else watches the drone's video"
    if frame is None:
        return Check(
            what="video", good=False, found=f"no frame within {config.wait_s:.0f} s", remedy=remedy
        )
    height, width = frame.image.shape[:2]
    age_s = now_s - frame.captured_s
    found = f"{width}x{height}, {seen.frames} frames seen, the newest {age_s:.2f} s old"
    if fault is not None:
        found += f", {fault}"
        remedy = "see that the lens is clean and the place is lit; restart the drone if it is"
    return Check(
        what="video",
        good=seen.frames >= _FRAMES and age_s <= _OLD_S and fault is None,
        found=found,
        remedy=remedy,
    )


def _reported(state: DroneState) -> Iterator[Check]:
    """Check the faults that the drone reports about itself."""
    for fault in state.faults:
        yield Check(what=fault.what, good=False, found=fault.found, remedy=fault.remedy)
    if not state.faults:
        yield Check(what="self-report", good=True, found="no faults")
