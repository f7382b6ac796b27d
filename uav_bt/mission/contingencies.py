"""The early end of a mission: lasting conditions, an operator's stop, a tree that ends in the air.

The safety table (`safety.py`) answers within the tick. A lasting condition is answered here, by an
abort, which is a landing, or by an error if the drone is out of reach.
"""

from __future__ import annotations

from uav_bt.board.keys import STATE
from uav_bt.errors import DroneError
from uav_bt.mission.judge import Outcome, Verdict
from uav_bt.mission.lasting import Lasting
from uav_bt.mission.limits import Limits
from uav_bt.mission.map_check import MapWatch
from uav_bt.mission.obedience import ObedienceWatch
from uav_bt.mission.safety import AIRBORNE, Override
from uav_bt.mission.screening import Screening
from uav_bt.mission.tick import TickRecord
from uav_bt.types.site_map import SiteMap

_OUT_OF_REACH = "it hovers, lands or returns by its own rules; take over with its remote control"


class Abort:
    """The one place for every reason to end a mission early, and the wait for the landing.

    Every method except `follow` may be called from a signal handler or another thread. The landing
    is waited for by `grace_s`.
    """

    def __init__(self, grace_s: float) -> None:
        self._grace_s = grace_s
        self._landing = Lasting()
        self.reason: str | None = None  # None: not aborted
        self.cut = False  # stop the motors
        self.given_up = False  # do not wait for the landing

    def __bool__(self) -> bool:
        """Return whether the mission is being aborted."""
        return self.reason is not None

    def request(self, reason: str) -> None:
        """Request a landing with the next tick; the first reason counts."""
        if self.reason is None:
            self.reason = reason

    def cut_motors(self, reason: str) -> None:
        """Stop the motors with the next tick."""
        self.cut = True
        self.request(reason)

    def give_up(self) -> None:
        """Command one last landing and return."""
        self.given_up = True

    def follow(self, record: TickRecord) -> Verdict | None:
        """Return the verdict of an aborted mission, None while it waits for the landing."""
        lands = record.override is Override.ABORT
        if self._landing.update(record.time_s, holds=lands) > self._grace_s:
            self.given_up = True
        if self.reason is None or not self.given_up:
            return None
        return Verdict(Outcome.ABORTED, self.reason)


class Contingencies:
    """Watches one mission for conditions that must end it."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._obedience = ObedienceWatch()
        self.map = MapWatch()
        self._blind, self._refused, self._unheard = (Lasting() for _ in range(3))

    def abort_reason(
        self,
        record: TickRecord,
        screening: Screening,
        *,
        drift: str | None,
        site_map: SiteMap | None,
    ) -> str | None:
        """Return the reason to abort the mission with a landing; None without one.

        `drift` says why the place cannot be held, None while it can.

        Raises:
            DroneError: the connection is lost, or no telemetry has come for too long.
        """
        now_s, state, override = record.time_s, record.observation.state, record.override
        self.map.update(site_map, now_s, airborne=state.flying in AIRBORNE)
        if state.lost:
            raise DroneError(f"the connection to the drone is broken: {_OUT_OF_REACH}")
        fault = self._obedience.complaint(record.command, state, now_s) or drift
        # The override holds for one tick; the abort holds until the drone has landed.
        if override is Override.BATTERY:
            return f"critical battery: {100 * (state.battery or 0.0):.0f} %"
        if fault is not None and override is not Override.MANUAL:
            return f"the drone does not obey: {fault}"
        if self.map.trouble is not None and override is None:
            return self.map.trouble
        return self._out_of_touch(now_s, override, screening, now_s - state.captured_s)

    def _out_of_touch(
        self, now_s: float, override: Override | None, screening: Screening, state_age_s: float
    ) -> str | None:
        limits = self._limits
        blind_s = self._blind.update(now_s, holds=override is Override.STALE_FRAME)
        # A few impossible values among good ones, or before them, do not count.
        refused = screening.state_fault is not None and state_age_s > STATE.max_age_s
        refused_s = self._refused.update(now_s, holds=refused)
        unheard_s = self._unheard.update(now_s, holds=override is Override.LINK)
        if unheard_s > limits.link_lost_s and screening.state_fault is None:
            raise DroneError(f"nothing heard from the drone for {unheard_s:.0f} s: {_OUT_OF_REACH}")
        if blind_s > limits.blind_s:
            why = f": {screening.frame_fault}" if screening.frame_fault else ""
            return f"no usable frame for {blind_s:.0f} s{why}"
        if refused_s > limits.link_lost_s:  # telemetry arrives with impossible values
            return f"no usable telemetry for {refused_s:.0f} s: {screening.state_fault}"
        return None
