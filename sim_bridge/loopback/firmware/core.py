"""Shared state of the firmware's parts: world, settings and relative movements."""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Final

from sim_bridge.loopback.firmware.publisher import Handler, Publisher
from sim_bridge.loopback.firmware.settings import Settings
from sim_bridge.loopback.world import World, WorldState
from sim_bridge.twin.reference import Pace
from uav_bt.types import Hover, MoveBy, MovementState, rotate, wrap_angle

# Steady speed at a tilt of 45 degrees, m/s; a tilt of 40 degrees gives the ANAFI's 15 m/s.
SPEED_PER_TILT_MPS: Final = 15.0 / math.tan(math.radians(40.0))
_STUCK_S: Final = 3.0  # a movement without progress for this time is blocked, s
_PROGRESS_M: Final = 0.05
_PROGRESS_RAD: Final = 0.05
_UNANSWERED_S: Final = 1.0  # a command without an answer for this time is lost, s


class Outcome(enum.Enum):
    """Result of a movement."""

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


# Takes the outcome, the displacement in the frame of the start, and the state at the end.
Ending = Callable[[Outcome, Step, WorldState], None]


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
    """Commands `MoveBy` movements and monitors them.

    Args:
        world: the simulated body.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._count = 0
        self._ending: Ending | None = None
        self._start = self._mark = WorldState()
        self._turned_rad = self._marked_rad = 0.0
        self._yaw_rad = 0.0

    @property
    def running(self) -> bool:
        """Whether a movement is being executed."""
        return self._ending is not None

    def start(self, step: Step, state: WorldState, ending: Ending, pace: Pace) -> None:
        """Start a movement; a running one is interrupted.

        Args:
            step: the movement.
            state: present state of the drone.
            ending: called once, at the end of the movement.
            pace: speed limits of the movement.
        """
        self._close(Outcome.INTERRUPTED, state)
        self._count += 1
        self._ending = ending
        self._start = self._mark = state
        self._turned_rad = self._marked_rad = 0.0
        self._yaw_rad = state.attitude.yaw_rad
        self._world.move(MoveBy(id=self._count, **asdict(step)), pace)

    def interrupt(self, state: WorldState, *, hover: bool = False) -> None:
        """End a running movement.

        Args:
            state: present state of the drone.
            hover: stop the drone; otherwise another command moves it on.
        """
        if self._ending is not None and hover:
            self._world.move(Hover())
        self._close(Outcome.INTERRUPTED, state)

    def update(self, state: WorldState) -> None:
        """Monitor the movement."""
        if self._ending is None:
            return
        self._turned_rad += wrap_angle(state.attitude.yaw_rad - self._yaw_rad)
        self._yaw_rad = state.attitude.yaw_rad
        status = state.movement
        if status is None or status.id != self._count:
            if state.time_s - self._start.time_s > _UNANSWERED_S:
                self._close(Outcome.REFUSED, state)
        elif status.state is MovementState.RUNNING:
            self._watch_progress(state)
        else:
            outcomes = {
                MovementState.DONE: Outcome.DONE,
                MovementState.INTERRUPTED: Outcome.INTERRUPTED,
                MovementState.REJECTED: Outcome.REFUSED,
            }
            self._close(outcomes[status.state], state)

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
        north_m = state.north_m - self._start.north_m
        east_m = state.east_m - self._start.east_m
        forward_m, right_m = rotate(north_m, east_m, -self._start.attitude.yaw_rad)
        done = Step(
            forward_m=forward_m,
            right_m=right_m,
            down_m=self._start.altitude_m - state.altitude_m,
            yaw_rad=self._turned_rad,
        )
        ending(outcome, done, state)


def _position(state: WorldState) -> tuple[float, float, float]:
    return state.north_m, state.east_m, state.altitude_m


@dataclass(frozen=True, kw_only=True)
class Core:
    """Shared state of the firmware's parts."""

    publisher: Publisher
    world: World
    settings: Settings
    travel: Travel  # executes relative movements
    interrupt: Callable[[], None]  # ends the present movement, of any kind
    gps: bool = True  # whether there is a GPS fix

    @property
    def ceiling_m(self) -> float:
        """The altitude limit above the take-off point: the lower of client's and world's, m."""
        highest: float = self.settings.value("ardrone3.PilotingSettingsState.MaxAltitudeChanged")
        return min(highest, self.world.limits.ceiling_m)

    @property
    def pace(self) -> Pace:
        """The speed limits of relative movements: the client's, within those of the world."""
        value, limits = self.settings.value, self.world.limits
        tilt_rad = math.radians(value("ardrone3.PilotingSettingsState.MaxTiltChanged"))
        climb_mps = value("ardrone3.SpeedSettingsState.MaxVerticalSpeedChanged")
        turn_radps = math.radians(value("ardrone3.SpeedSettingsState.MaxRotationSpeedChanged"))
        return Pace(
            speed_mps=min(SPEED_PER_TILT_MPS * math.tan(tilt_rad), limits.max_speed_mps),
            climb_mps=min(climb_mps, limits.max_climb_mps),
            yaw_rate_radps=min(turn_radps, limits.max_yaw_rate_radps),
        )


class Part:
    """One part of the firmware: handles commands and reacts to the state of the world."""

    def __init__(self, core: Core) -> None:
        self._core = core
        self.handlers: Mapping[str, Handler] = {}  # by name of the command

    def update(self, state: WorldState) -> None:
        """React to a new state of the world; `state.time_s` is the present time."""
