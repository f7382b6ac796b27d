"""Decides when and how a flight has ended. The first violation ends it."""

from __future__ import annotations

import enum
from dataclasses import dataclass, replace
from typing import Annotated, Final

from annotated_types import Gt

from uav_bt.clock import TIME_LIMIT_S
from uav_bt.lab.shipped import default_mark
from uav_bt.mission.tick import TickRecord
from uav_bt.option import Option
from uav_bt.settings import check_numbers, member
from uav_bt.tree import Status
from uav_bt.types import FlyingState, LandingMark, Pose2D, Truth
from uav_bt.types.area import Area
from uav_bt.types.place import LandOn, MissionRules

LANDING_SURFACES: Final = frozenset({"mark", "ground"})
"""Names in contacts of what the drone may touch while it takes off or lands."""


class Outcome(enum.Enum):
    """The outcome of a flight."""

    SUCCESS = "success"
    COLLISION = "collision"
    LEFT_AREA = "left_area"
    TIMEOUT = "timeout"
    ABORTED = "aborted"  # an emergency landing or an operator's stop
    ERROR = "error"  # a fault of ours


@dataclass(frozen=True)
class Verdict:
    """The outcome with its reason, one line for people."""

    outcome: Outcome
    reason: str


@dataclass(frozen=True, kw_only=True)
class JudgeConfig:
    """The rules of a flight: `FlightOptions(judge=JudgeConfig(time_limit_s=600.0))`.

    Attributes:
        time_limit_s: longest duration from the take-off command, seconds; a longer flight ends as a
            timeout. None: that of the mission's rules, or 300 s.
        land_on: where the flight must end. None: as the mission's rules say, or on the landing
            mark.

    Raises:
        ValueRangeError: a time is not positive.
        UnknownNameError: `land_on` is no member of `LandOn`.
    """

    time_limit_s: Annotated[
        float | None,
        Gt(0),
        Option(
            "End the flight as a timeout this long after the take-off command. Default: as the "
            "mission's Rules say, else 300 s.",
            "--time-limit SECONDS",
            "Mission",
        ),
    ] = None
    land_on: LandOn | None = None

    def __post_init__(self) -> None:
        check_numbers(self)
        if self.land_on is not None:
            object.__setattr__(self, "land_on", member("land_on", self.land_on, LandOn))

    @property
    def limit_s(self) -> float:
        """The time limit that holds, seconds."""
        return TIME_LIMIT_S if self.time_limit_s is None else self.time_limit_s

    def under(self, rules: MissionRules) -> JudgeConfig:
        """Return the rules of a flight with those of its mission where they are empty."""
        time_limit_s = rules.time_limit_s if self.time_limit_s is None else self.time_limit_s
        return replace(self, time_limit_s=time_limit_s, land_on=self.land_on or rules.land_on)


_PATIENCE_S: Final = 60.0  # longest without a take-off command; chosen: networks load in seconds
# Chosen: with telemetry of twice the greatest age for leaves the drone may land by its firmware.
_UNHEARD_S: Final = 1.0
# Outside the mission's area. Chosen: the error of the odometry that the arbiter keeps the area by,
# and of the stop at the boundary.
_LEFT_M: Final = 0.3
_MAY_TOUCH_GROUND: Final = frozenset(
    {FlyingState.LANDED, FlyingState.TAKING_OFF, FlyingState.LANDING, FlyingState.EMERGENCY}
)


class Judge:
    """Watches a flight, by the referee's truth if there is one, else by telemetry and board."""

    def __init__(
        self,
        config: JudgeConfig | None = None,
        mark: LandingMark | None = None,
        area: Area | None = None,
    ) -> None:
        self._config = config or JudgeConfig()
        self._area = area
        self._start: Pose2D | None = None  # the first true pose
        self._mark = mark or default_mark()
        self._land_on = self._config.land_on or LandOn.MARK
        self._mark_m: float | None = None  # when the drone was last in the air
        self._lands = False
        self._took_off_s: float | None = None
        self._started_s: float | None = None
        self._flew = False

    def took_off(self, time_s: float) -> None:
        """Note the take-off command; only the first counts."""
        if self._took_off_s is None:
            self._took_off_s = time_s

    @property
    def stays_grounded(self) -> bool:
        """Whether the mission's rules forbid a take-off."""
        return self._land_on is LandOn.NONE

    def time_left(self, now_s: float) -> float:
        """Return seconds until the time limit; the whole limit before the take-off command."""
        begin_s = self._started_s if self.stays_grounded else self._took_off_s
        return self._config.limit_s - (0.0 if begin_s is None else now_s - begin_s)

    def elapsed(self, now_s: float) -> float:
        """Return seconds since the take-off command, 0 before it."""
        return 0.0 if self._took_off_s is None else now_s - self._took_off_s

    def verdict(
        self,
        record: TickRecord,
        *,
        abort_reason: str | None,
        landing: bool = False,
        mark_m: float | None = None,
        place: Pose2D | None = None,
        failure: str = "",
    ) -> Verdict | None:
        """Return the verdict on the flight, None while it goes on.

        `landing` tells that the mission lands, by velocities or by the drone's own landing. The
        drone's estimates are `mark_m`, the horizontal distance of the landing mark's centre, and
        `place`, relative to the take-off pose with the heading clockwise. `failure` names the last
        branch of the tree that failed.
        """
        state = record.observation.state
        self._lands = landing or state.flying in _MAY_TOUCH_GROUND
        if self._started_s is None:
            self._started_s = record.time_s
        landed = state.flying is FlyingState.LANDED
        self._flew = self._flew or not landed
        if not landed:
            self._mark_m = mark_m
        violation = self._violation(record, place)
        if violation is not None:
            return violation
        if state.flying is FlyingState.EMERGENCY:  # it falls, or lies on the ground
            return Verdict(Outcome.ABORTED, abort_reason or "the drone cut its motors")
        if not landed:  # an abort waits; the runner aborts a tree that ended
            return None
        if abort_reason is None:
            if record.tree_status not in (Status.SUCCESS, Status.FAILURE):
                return None
            abort_reason = self._objection(record.tree_status, record.truth, failure)
        if abort_reason is not None:
            return Verdict(Outcome.ABORTED, abort_reason)
        how = "the tree succeeded on the ground" if self.stays_grounded else "landed"
        return Verdict(Outcome.SUCCESS, how)

    def _violation(self, record: TickRecord, place: Pose2D | None) -> Verdict | None:
        truth = record.truth
        if truth is not None:
            self._start = self._start or truth.pose
            ahead = self._start.pose_to_body(truth.pose)
            # Metres ahead and to the right of the first pose, clockwise.
            place = Pose2D(x_m=ahead.x_m, y_m=-ahead.y_m, yaw_rad=-ahead.yaw_rad)
            # A landing surface may be touched while the drone may be landing.
            unheard = record.time_s - record.observation.state.captured_s > _UNHEARD_S
            allowed = LANDING_SURFACES if unheard or self._lands else frozenset[str]()
            if hit := next((name for name in truth.contacts if name not in allowed), None):
                return Verdict(Outcome.COLLISION, f"touched {hit}")
            if self._took_off_s is not None and not truth.inside_ground:
                at = f"({truth.pose.x_m:.2f}, {truth.pose.y_m:.2f}) m"
                return Verdict(Outcome.LEFT_AREA, f"flew beyond the ground's edge at {at}")
        if self._area is not None and place is not None:
            left_m = -self._area.margin_m(place.x_m, place.y_m)
            if left_m > _LEFT_M:
                return Verdict(Outcome.LEFT_AREA, f"left the mission's area by {left_m:.2f} m")
        return self._late(record.time_s)

    def _late(self, now_s: float) -> Verdict | None:
        if self.time_left(now_s) < 0.0:
            return Verdict(Outcome.TIMEOUT, f"not over after {self._config.limit_s:.0f} s")
        if self.stays_grounded or self._took_off_s is not None or self._started_s is None:
            return None
        waited_s = now_s - self._started_s
        late = Verdict(Outcome.TIMEOUT, f"no take-off within {waited_s:.0f} s")
        return late if waited_s > _PATIENCE_S else None

    def _objection(self, status: Status, truth: Truth | None, failure: str) -> str | None:
        """Return why a flight that ended on the ground is no success; None if it is one."""
        if self.stays_grounded and self._flew:
            return "it took off, which the mission's rules forbid"
        if not (self.stays_grounded or self._flew):
            return 'the tree ended without a take-off; <Rules land_on="none"/> allows that'
        if status is Status.FAILURE:
            where = "the tree failed; landed" if self._flew else "the tree failed on the ground"
            return f"{where}; last failure: {failure}" if failure else where
        if truth is not None and truth.motors_on:
            return "the drone says it has landed, its motors still run"
        return self._misplaced(truth)

    def _misplaced(self, truth: Truth | None) -> str | None:
        """Return why the drone may not stand where it has landed; None if it may.

        Without a referee the last belief in the air counts. The mark's heading is unknown, so the
        drone counts as above it within half of its longer side.
        """
        if truth is not None:
            on_mark, distance_m = truth.on_mark, truth.landing_error_m
        else:
            distance_m = self._mark_m
            half_m = max(self._mark.length_m, self._mark.width_m) / 2.0
            on_mark = distance_m is not None and distance_m <= half_m
        if self._land_on is LandOn.GROUND and on_mark:
            return "landed on the landing mark, and the mission's rules want the ground"
        if self._land_on is LandOn.MARK and not on_mark:
            if distance_m is None:
                return "landed where no landing mark is known"
            return f"landed {distance_m:.2f} m from the landing mark's centre"
        return None
