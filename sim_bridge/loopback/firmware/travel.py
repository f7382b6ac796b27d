"""Trips of relative movements: one leg after the other, each watched to its end."""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from typing import Final

from sim_bridge.loopback.twin_world import TwinWorld
from sim_bridge.loopback.world import WorldState
from sim_bridge.twin.reference import Pace
from uav_bt.types import Hover, MoveBy, MovementState, rotate, wrap_angle

_STUCK_S: Final = 3.0  # a movement without progress for this time is blocked, s
_PROGRESS_M: Final = 0.05
_PROGRESS_RAD: Final = 0.05
_UNANSWERED_S: Final = 1.0  # a command without an answer for this time is lost, s


class Outcome(enum.Enum):
    """Result of a trip."""

    DONE = MovementState.DONE
    INTERRUPTED = MovementState.INTERRUPTED
    REFUSED = MovementState.REJECTED
    STUCK = "stuck"


@dataclass(frozen=True, kw_only=True)
class Step:
    """A displacement in the heading-aligned body frame."""

    forward_m: float = 0.0
    right_m: float = 0.0
    down_m: float = 0.0
    yaw_rad: float = 0.0


Leg = Callable[[WorldState], Step]  # returns the movement from the state at its start
Ending = Callable[[Outcome, Step], None]  # takes the displacement in the frame of the start


def step_to(
    state: WorldState, north_m: float, east_m: float, altitude_m: float, yaw_rad: float
) -> Step:
    """Return the relative movement to a point.

    Args:
        state: present state of the drone.
        north_m: position of the point north of the world's origin.
        east_m: position of the point east of the world's origin.
        altitude_m: altitude of the point above the take-off point.
        yaw_rad: heading at the end, clockwise from north.
    """
    heading = state.attitude.yaw_rad
    forward, right = rotate(north_m - state.north_m, east_m - state.east_m, -heading)
    return Step(
        forward_m=forward,
        right_m=right,
        down_m=state.altitude_m - altitude_m,
        yaw_rad=wrap_angle(yaw_rad - heading),
    )


class Travel:
    """Flies one trip at a time."""

    def __init__(self, world: TwinWorld) -> None:
        self._world = world
        self._legs: Iterator[Leg] = iter(())
        self._pace: Pace = world.pace
        self._ending: Ending | None = None  # None: no trip
        self._leg = 0  # number of the leg, over all trips
        self._start = self._leg_start = self._progress = WorldState()
        self._yaw_rad = self._turned_rad = self._progress_rad = 0.0

    @property
    def running(self) -> bool:
        """Whether a trip is being flown."""
        return self._ending is not None

    def start(self, legs: Iterable[Leg], pace: Pace, ending: Ending) -> None:
        """Start a trip, after the end of the last one.

        Args:
            legs: the movements.
            pace: speed limits of the movements.
            ending: called once, at the end of the trip.
        """
        state = self._world.state()
        self._legs, self._pace, self._ending = iter(legs), pace, ending
        self._start = state
        self._yaw_rad, self._turned_rad = state.attitude.yaw_rad, 0.0
        self._next_leg(state)

    def interrupt(self) -> None:
        """End a running trip; another command moves the drone on, or stops it."""
        self._close(Outcome.INTERRUPTED, self._world.state())

    def update(self, state: WorldState) -> None:
        """Watch the movement; begin the next leg after its end."""
        if self._ending is None:
            return
        self._turned_rad += wrap_angle(state.attitude.yaw_rad - self._yaw_rad)
        self._yaw_rad = state.attitude.yaw_rad
        status = state.movement
        if status is None or status.id != self._leg:
            if state.time_s - self._leg_start.time_s > _UNANSWERED_S:
                self._close(Outcome.REFUSED, state)
        elif status.state is MovementState.RUNNING:
            self._watch_progress(state)
        elif status.state is MovementState.DONE:
            self._next_leg(state)
        else:
            self._close(Outcome(status.state), state)

    def _next_leg(self, state: WorldState) -> None:
        leg = next(self._legs, None)
        if leg is None:
            self._close(Outcome.DONE, state)
            return
        self._leg += 1
        self._leg_start = self._progress = state
        self._progress_rad = self._turned_rad
        self._world.move(MoveBy(id=self._leg, **asdict(leg(state))), self._pace)

    def _watch_progress(self, state: WorldState) -> None:
        moved_m = math.dist(_position(state), _position(self._progress))
        turned_rad = abs(self._turned_rad - self._progress_rad)
        if moved_m > _PROGRESS_M or turned_rad > _PROGRESS_RAD:
            self._progress, self._progress_rad = state, self._turned_rad
        elif state.time_s - self._progress.time_s > _STUCK_S:
            self._world.move(Hover())
            self._close(Outcome.STUCK, state)

    def _close(self, outcome: Outcome, state: WorldState) -> None:
        if self._ending is None:
            return
        ending, self._ending = self._ending, None
        start = self._start
        done = step_to(start, state.north_m, state.east_m, state.altitude_m, start.attitude.yaw_rad)
        ending(outcome, replace(done, yaw_rad=self._turned_rad))


def _position(state: WorldState) -> tuple[float, float, float]:
    return state.north_m, state.east_m, state.altitude_m
