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
_PROGRESS: Final = 0.05  # m, or rad


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
    """Return the relative movement to a point, with the heading at the end."""
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
        self._start = self._progress = world.state()

    @property
    def running(self) -> bool:
        """Whether a trip is being flown."""
        return self._ending is not None

    def start(self, legs: Iterable[Leg], pace: Pace, ending: Ending) -> None:
        """Start a trip, after the end of the last one; `ending` is called once, at its end."""
        self._legs, self._pace, self._ending = iter(legs), pace, ending
        self._start = self._world.state()
        self._next_leg(self._start)

    def interrupt(self) -> None:
        """End a running trip; another command moves the drone on, or stops it."""
        self._close(Outcome.INTERRUPTED, self._world.state())

    def update(self, state: WorldState) -> None:
        """Watch the movement; begin the next leg after its end."""
        if self._ending is None:
            return
        status = state.movement
        if status is None or status.id != self._leg:
            return  # the drone has not yet received the command
        if status.state is MovementState.RUNNING:
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
        self._progress = state
        self._world.move(MoveBy(id=self._leg, **asdict(leg(state))), self._pace)

    def _watch_progress(self, state: WorldState) -> None:
        if math.dist(_pose(state), _pose(self._progress)) > _PROGRESS:
            self._progress = state
        elif state.captured_s - self._progress.captured_s > _STUCK_S:
            self._world.move(Hover())
            self._close(Outcome.STUCK, state)

    def _close(self, outcome: Outcome, state: WorldState) -> None:
        if self._ending is None:
            return
        ending, self._ending = self._ending, None
        start = self._start
        done = step_to(start, state.north_m, state.east_m, state.altitude_m, start.attitude.yaw_rad)
        ending(outcome, replace(done, yaw_rad=state.turned_rad - start.turned_rad))


def _pose(state: WorldState) -> tuple[float, float, float, float]:
    return state.north_m, state.east_m, state.altitude_m, state.turned_rad
