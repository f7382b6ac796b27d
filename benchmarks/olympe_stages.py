"""Times of the stages from a frame's capture to its command, over Olympe.

The processor time of the thread stands beside the wall time. The difference is waiting, mostly for
other work on the cores.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_bridge.olympe.commands import CommandQueue, Job, Kind
from sim_bridge.olympe.drone import OlympeDrone
from sim_bridge.olympe.sdk import Sdk, load_sdk
from sim_bridge.olympe.video import FrameClock
from uav_bt import app
from uav_bt.mission.drone_wrapper import DroneWrapper
from uav_bt.mission.tick import TickRecord
from uav_bt.protocols import Drone
from uav_bt.types import Command, Observation

_FULL = 2  # the oldest generation's number
Moment = tuple[float, float]  # s of the wall, and of this thread's own time


def moment() -> Moment:
    """Return now."""
    return time.perf_counter(), time.thread_time()


@dataclass(frozen=True, kw_only=True)
class Arrival:
    """A frame that the SDK delivered."""

    age_s: float  # since its capture
    called_s: float  # when the SDK called us
    copied_s: float  # when it was ours


class TimedClock(FrameClock):
    """Notes when frames arrive."""

    def __init__(self) -> None:
        super().__init__()
        self.called: tuple[float, float] = (0.0, 0.0)  # by the SDK: the age then, and the time
        self.arrivals: list[Arrival] = []  # by the frame's index

    def frame_arrived(self) -> None:
        """Note it; called on the video's thread."""
        age_s, called_s = self.called
        self.arrivals.append(Arrival(age_s=age_s, called_s=called_s, copied_s=time.perf_counter()))
        super().frame_arrived()

    def sdk(self) -> Sdk:
        """Return the SDK; its frames are looked at when they come (version 8 on)."""
        sdk = load_sdk()

        def stream(on_frame: Callable[[Any], None]) -> Any:
            def timed(frame: Any) -> None:
                called_s = time.perf_counter()
                captured_us = frame.vmeta()[1]["camera"]["utc_timestamp"]
                self.called = time.time() - 1e-6 * captured_us, called_s
                on_frame(frame)

            return sdk.stream(timed)

        return replace(sdk, stream=stream)


class TimedQueue(CommandQueue):
    """Notes when commands wait and when the SDK has them."""

    def __init__(self) -> None:
        super().__init__()
        self.taken_s: list[tuple[float, float]] = []  # handed to the queue, done

    def submit(self, kind: Kind, job: Job) -> None:
        """Queue it, timed."""
        handed_s = time.perf_counter()

        def timed() -> object:
            try:
                return job()
            finally:
                self.taken_s.append((handed_s, time.perf_counter()))

        super().submit(kind, timed)


class TimedDrone(DroneWrapper):
    """Notes when the mission looks and when it commands.

    Args:
        drone: the drone.
        clock: its clock.
    """

    def __init__(self, drone: OlympeDrone, clock: TimedClock) -> None:
        super().__init__(drone)
        self._frames = clock
        self._looks: tuple[int, Moment, Moment] | None = None
        self._used = -1
        self.stages: dict[str, list[Moment]] = {}
        self._perception: dict[str, list[float]] = {}
        self._counted: dict[str, int] = {}  # times of each stage until the tick before
        self._pending: tuple[Moment, Moment] | None = None
        self._collecting_s = 0.0

    def watch(self, flight: app.Flight[Drone]) -> Sequence[TimedDrone]:
        """Follow a flight."""
        self._perception = flight.context.stage_times_s
        gc.callbacks.append(self._collected)
        return (self,)

    def disconnect(self) -> None:
        """Disconnect; what is collected from now on stops no mission."""
        if self._collected in gc.callbacks:
            gc.callbacks.remove(self._collected)
        super().disconnect()

    def _collected(self, phase: str, info: dict[str, int]) -> None:
        """Note how long the garbage collector stopped all threads."""
        if phase == "start":
            self._collecting_s = time.perf_counter()
        elif info["generation"] == _FULL:
            self._note("full garbage collections", time.perf_counter() - self._collecting_s)

    def observe(self) -> Observation:
        """Look, timed."""
        began = moment()
        seen = super().observe()
        new = seen.frame is not None and seen.frame.index > self._used
        self._looks = (seen.frame.index, began, moment()) if new and seen.frame else None
        return seen

    def send(self, command: Command) -> Command:
        """Command, timed."""
        began = moment()
        sent = super().send(command)
        self._pending = began, moment()
        return sent

    def on_tick(self, record: TickRecord) -> None:
        """Sum up the tick of a new frame."""
        looks, pending = self._looks, self._pending
        if looks is None or pending is None:
            return
        self._used, began, seen = looks
        frame, (decided, sent) = self._frames.arrivals[self._used], pending
        note = self._note
        note("capture to callback", frame.age_s)
        note("copying out", frame.copied_s - frame.called_s)
        note("wait for the tick", began[0] - frame.copied_s)
        note("conversion to RGB", *_between(began, seen))
        inside_s = 0.0
        for stage, times_s in self._perception.items():
            if len(times_s) > self._counted.get(stage, 0):  # the stage ran in this tick
                note(stage, times_s[-1])
                inside_s += times_s[-1]
            self._counted[stage] = len(times_s)
        note("rest of the tree", record.compute_s - inside_s)
        wall_s, own_s = _between(seen, decided)
        note("screening, board, tree", wall_s, own_s)
        note("handing to the queue", *_between(decided, sent))
        note("frame to command", sent[0] - frame.copied_s, sent[1] - began[1])

    def _note(self, stage: str, wall_s: float, own_s: float | None = None) -> None:
        own_s = float("nan") if own_s is None else own_s
        self.stages.setdefault(stage, []).append((wall_s, own_s))

    def used_hz(self) -> tuple[float, float]:
        """Return how many frames came a second, and how many were used."""
        times_s = [each.copied_s for each in self._frames.arrivals]
        span_s = times_s[-1] - times_s[0]
        return len(times_s) / span_s, len(self.stages["frame to command"]) / span_s

    def frame_to_command_ms(self) -> NDArray[np.float64]:
        """Return 50, 95 and 99 % of the time from a frame's arrival to its command."""
        walls = np.array(self.stages["frame to command"])[:, 0]
        return 1e3 * np.percentile(walls, [50, 95, 99])


def _between(start: Moment, end: Moment) -> Moment:
    return end[0] - start[0], end[1] - start[1]


def timed_drone(make: Callable[..., OlympeDrone]) -> tuple[TimedDrone, TimedQueue]:
    """Return a drone that is timed, and its queue."""
    clock, queue = TimedClock(), TimedQueue()
    drone = make(sdk=clock.sdk, clock=clock, commands=lambda: queue)
    return TimedDrone(drone, clock), queue


def table(flights: Sequence[TimedDrone], queues: Sequence[TimedQueue]) -> Iterator[str]:
    """Yield the lines of a Markdown table of all stages, milliseconds."""
    yield "| stage | p50 | p95 | own p50 | own p95 |"
    yield "|---|---|---|---|---|"
    for stage in dict.fromkeys(name for flight in flights for name in flight.stages):
        rows = np.array([row for each in flights for row in each.stages.get(stage, ())])
        yield f"| {stage} | {_cells(rows[:, 0])} | {_cells(rows[:, 1])} |"
    waits = np.array([end - start for queue in queues for start, end in queue.taken_s])
    yield f"| queue to SDK's answer | {_cells(waits)} | | |"


def _cells(times_s: NDArray[np.float64]) -> str:
    if np.isnan(times_s).all():
        return " | "
    return " | ".join(f"{value:.1f}" for value in 1e3 * np.percentile(times_s, [50, 95]))
