"""Decides when and how a flight has ended. The first violation ends it."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from uav_bt.clock import TIME_LIMIT_S
from uav_bt.errors import ValueRangeError
from uav_bt.tree import Status
from uav_bt.types import DroneState, FlyingState, Truth


class Outcome(enum.Enum):
    """The outcome of a flight."""

    SUCCESS = "success"
    COLLISION = "collision"
    LEFT_AREA = "left_area"
    TIMEOUT = "timeout"
    ABORTED = "aborted"  # an emergency landing or an operator's stop
    ERROR = "error"  # a fault of ours


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """The outcome with its reason, one line for people."""

    outcome: Outcome
    reason: str


@dataclass(frozen=True, kw_only=True)
class JudgeConfig:
    """The rules of a flight: `FlightOptions(judge=JudgeConfig(time_limit_s=600.0))`.

    Attributes:
        time_limit_s: longest duration from the take-off command, seconds; a longer flight ends as a
            timeout.
        patience_s: longest time without a take-off command, seconds; then the mission ends as a
            timeout. Chosen: networks load within seconds.
        landing_surfaces: shapes of the simulation that the drone may touch while it takes off or
            lands, by the beginning of their names.
        must_land_on_pad: whether a simulated flight must end on the pad; False for missions that
            land elsewhere.

    Raises:
        ValueRangeError: the time limit is not positive.
    """

    time_limit_s: float = TIME_LIMIT_S
    patience_s: float = 60.0
    landing_surfaces: tuple[str, ...] = ("helipad", "carpet")
    must_land_on_pad: bool = True

    def __post_init__(self) -> None:
        if self.time_limit_s <= 0.0:
            raise ValueRangeError(f"the time limit must be positive, got {self.time_limit_s}")


# Age of telemetry above which the drone may be landing by its firmware, seconds. Chosen: twice the
# greatest age for leaves.
_UNHEARD_S = 1.0
_MAY_TOUCH_GROUND = frozenset(
    {FlyingState.LANDED, FlyingState.TAKING_OFF, FlyingState.LANDING, FlyingState.EMERGENCY}
)


class Judge:
    """Watches a flight, by the referee's truth if there is one, else by telemetry."""

    def __init__(self, config: JudgeConfig | None = None) -> None:
        self._config = config or JudgeConfig()
        self._lands = False
        self._took_off_s: float | None = None
        self._started_s: float | None = None
        self._flew = False

    def took_off(self, time_s: float) -> None:
        """Note the take-off command; only the first counts."""
        if self._took_off_s is None:
            self._took_off_s = time_s

    def elapsed(self, now_s: float) -> float:
        """Return seconds since the take-off command, 0 before it."""
        return 0.0 if self._took_off_s is None else now_s - self._took_off_s

    def verdict(
        self,
        now_s: float,
        state: DroneState,
        truth: Truth | None,
        tree_status: Status,
        *,
        abort_reason: str | None,
        landing: bool = False,
    ) -> Verdict | None:
        """Return the verdict on the flight, None while it goes on.

        Args:
            now_s: the mission clock's time.
            state: of the drone.
            truth: of this tick; None without a referee.
            tree_status: of the mission's tree.
            abort_reason: why the mission is being aborted; None if it is not.
            landing: whether the mission lands, by velocities or by the drone's own landing.
        """
        self._lands = landing or state.flying in _MAY_TOUCH_GROUND
        if self._started_s is None:
            self._started_s = now_s
        landed = state.flying is FlyingState.LANDED
        self._flew = self._flew or not landed
        violation = self._violation(now_s, state, truth)
        if violation is not None:
            return violation
        if state.flying is FlyingState.EMERGENCY:  # it falls, or lies on the ground
            reason = abort_reason or "the drone cut its motors"
            return Verdict(outcome=Outcome.ABORTED, reason=reason)
        if abort_reason is not None:
            return Verdict(outcome=Outcome.ABORTED, reason=abort_reason) if landed else None
        if tree_status in (Status.SUCCESS, Status.FAILURE):
            return self._mission_ended(tree_status, truth, landed=landed)
        return None

    def _violation(self, now_s: float, state: DroneState, truth: Truth | None) -> Verdict | None:
        if truth is not None:
            hit = self._hit(now_s, state, truth)
            if hit is not None:
                return Verdict(outcome=Outcome.COLLISION, reason=f"touched {hit}")
            if self._took_off_s is not None and not truth.inside_carpet:
                return Verdict(
                    outcome=Outcome.LEFT_AREA,
                    reason=f"left the carpet at ({truth.pose.x_m:.2f}, {truth.pose.y_m:.2f}) m",
                )
        if self.elapsed(now_s) > self._config.time_limit_s:
            return Verdict(
                outcome=Outcome.TIMEOUT, reason=f"not over after {self._config.time_limit_s:.0f} s"
            )
        waited_s = now_s - (self._started_s if self._started_s is not None else now_s)
        if self._took_off_s is None and waited_s > self._config.patience_s:
            return Verdict(outcome=Outcome.TIMEOUT, reason=f"no take-off within {waited_s:.0f} s")
        return None

    def _hit(self, now_s: float, state: DroneState, truth: Truth) -> str | None:
        unheard = now_s - state.captured_s > _UNHEARD_S
        for geom in truth.contacts:
            landing_surface = geom.startswith(self._config.landing_surfaces)
            if not (landing_surface and (unheard or self._lands)):
                return geom
        return None

    def _mission_ended(
        self, status: Status, truth: Truth | None, *, landed: bool
    ) -> Verdict | None:
        if not landed:
            return None  # the runner brings it down, which aborts the flight
        if not self._flew:
            return Verdict(outcome=Outcome.ABORTED, reason="the tree ended without a take-off")
        if status is Status.FAILURE:
            return Verdict(outcome=Outcome.ABORTED, reason="the tree failed; landed")
        if truth is not None and truth.motors_on:
            return Verdict(
                outcome=Outcome.ABORTED, reason="the drone says it has landed, its motors still run"
            )
        if truth is not None and self._config.must_land_on_pad and not truth.on_helipad:
            return Verdict(
                outcome=Outcome.ABORTED,
                reason=f"landed {truth.landing_error_m:.2f} m from the helipad's centre",
            )
        return Verdict(outcome=Outcome.SUCCESS, reason="landed")
