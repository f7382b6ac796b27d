"""One relative movement at a time, watched to its end: what moveBy, moveTo and RTH are made of."""

from __future__ import annotations

import enum
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from sim_bridge.loopback.world import World, WorldState
from uav_bt.types import Hover, MoveBy, MovementState, wrap_angle

__all__ = ["Outcome", "Step", "Travel", "Travelled"]

_STUCK_S: Final = 3.0  # s without progress after which something is in the way
_PROGRESS_M: Final = 0.05
_PROGRESS_RAD: Final = 0.05
_UNHEARD_S: Final = 1.0  # s after which an order that nobody answers is lost


class Outcome(enum.Enum):
    """How a movement ended."""

    DONE = "done"
    INTERRUPTED = "interrupted"
    REFUSED = "refused"
    STUCK = "stuck"


@dataclass(frozen=True, kw_only=True)
class Step:
    """A relative movement in the heading-aligned body frame."""

    forward_m: float = 0.0
    right_m: float = 0.0
    down_m: float = 0.0
    yaw_rad: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Travelled:
    """What became of a movement."""

    outcome: Outcome
    done: Step  # as far as it came, in the frame in which it began


Ending = Callable[[Travelled, WorldState], None]


class Travel:
    """Gives a world its `MoveBy`s and watches them."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._count = 0
        self._ending: Ending | None = None
        self._start = self._mark = WorldState()
        self._turned_rad = self._marked_rad = 0.0
        self._yaw_rad = 0.0

    @property
    def under_way(self) -> bool:
        """Whether a movement runs."""
        return self._ending is not None

    def start(self, step: Step, state: WorldState, ending: Ending) -> None:
        """Begin a movement; one that runs is interrupted.

        Args:
            step: the movement.
            state: the drone's at present.
            ending: told once, when it is over.
        """
        self._close(Outcome.INTERRUPTED, state)
        self._count += 1
        self._ending = ending
        self._start = self._mark = state
        self._turned_rad = self._marked_rad = 0.0
        self._yaw_rad = state.attitude.yaw_rad
        self._world.move(
            MoveBy(
                id=self._count,
                forward_m=step.forward_m,
                right_m=step.right_m,
                down_m=step.down_m,
                yaw_rad=step.yaw_rad,
            )
        )

    def interrupt(self, state: WorldState, *, hover: bool = False) -> None:
        """End the movement, if one runs.

        Args:
            state: the drone's at present.
            hover: stop there; otherwise something else moves the drone on.
        """
        if self._ending is not None and hover:
            self._world.move(Hover())
        self._close(Outcome.INTERRUPTED, state)

    def update(self, state: WorldState) -> None:
        """Watch the movement."""
        if self._ending is None:
            return
        turn = wrap_angle(state.attitude.yaw_rad - self._yaw_rad)
        self._turned_rad += turn
        self._yaw_rad = state.attitude.yaw_rad
        told = state.movement
        if told is None or told.id != self._count:
            if state.time_s - self._start.time_s > _UNHEARD_S:
                self._close(Outcome.REFUSED, state)
        elif told.state is MovementState.RUNNING:
            self._watch_progress(state)
        else:
            outcomes = {
                MovementState.DONE: Outcome.DONE,
                MovementState.INTERRUPTED: Outcome.INTERRUPTED,
                MovementState.REJECTED: Outcome.REFUSED,
            }
            self._close(outcomes[told.state], state)

    def _watch_progress(self, state: WorldState) -> None:
        gone_m = math.dist(_position(state), _position(self._mark))
        turned = abs(self._turned_rad - self._marked_rad)
        if gone_m > _PROGRESS_M or turned > _PROGRESS_RAD:
            self._mark, self._marked_rad = state, self._turned_rad
        elif state.time_s - self._mark.time_s > _STUCK_S:
            self._world.move(Hover())
            self._close(Outcome.STUCK, state)

    def _close(self, outcome: Outcome, state: WorldState) -> None:
        if self._ending is None:
            return
        ending, self._ending = self._ending, None
        north = state.north_m - self._start.north_m
        east = state.east_m - self._start.east_m
        heading = self._start.attitude.yaw_rad
        done = Step(
            forward_m=north * math.cos(heading) + east * math.sin(heading),
            right_m=east * math.cos(heading) - north * math.sin(heading),
            down_m=self._start.altitude_m - state.altitude_m,
            yaw_rad=self._turned_rad,
        )
        ending(Travelled(outcome=outcome, done=done), state)


def _position(state: WorldState) -> tuple[float, float, float]:
    return state.north_m, state.east_m, state.altitude_m
