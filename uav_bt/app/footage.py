"""Record a flight's video and telemetry for training: what `uav-bt fly --footage FILE` does.

with footage.flight_footage(Path("flight.npz")) as recording:
    app.fly("explore_and_land_segmentation", listeners=recording)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from perception.footage.file import (
    FOOTAGE_SIZE_PX,
    Footage,
    FootageTruth,
    shrink,
    write_footage,
    write_truth,
)
from uav_bt.board.context import MissionContext
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.mission.runner import TickListener, TickRecord
from uav_bt.protocols import Drone, Referee
from uav_bt.types import Attitude, CameraModel, DroneState, Frame

__all__ = ["FootageConfig", "FootageRecorder", "flight_footage"]


@dataclass(frozen=True, kw_only=True)
class FootageConfig:
    """What is kept of a flight."""

    interval_s: float = 0.1  # between kept frames; a tick, so that none is kept twice
    size_px: tuple[int, int] = FOOTAGE_SIZE_PX  # width, height of the kept frames
    longest_s: float = 400.0  # a flight ends after 300 s; 1 GB of memory at most

    def __post_init__(self) -> None:
        if not (0.0 <= self.interval_s < self.longest_s) or min(self.size_px) < 16:
            raise ValueRangeError(
                "footage needs 0 <= interval_s < longest_s and pictures of 16x16 or more, got "
                f"{self.interval_s}, {self.longest_s}, {self.size_px}"
            )


class FootageRecorder:
    """A tick listener that keeps frames and telemetry, and the truth where it is asked for."""

    def __init__(
        self,
        camera: CameraModel,
        config: FootageConfig | None = None,
        *,
        referee: Referee | None = None,
    ) -> None:
        """Begin with nothing.

        Args:
            camera: of the frames that the drone sends.
            config: what to keep.
            referee: knows exact depth and ids; None keeps no truth.
        """
        self._config = config or FootageConfig()
        self._camera = camera.resized(*self._config.size_px)
        self._referee = referee
        self._frames: list[Frame] = []
        self._images: list[NDArray[np.uint8]] = []
        self._states: list[DroneState] = []
        self._depths: list[NDArray[np.float16]] = []
        self._ids: list[NDArray[np.uint8]] = []

    def on_tick(self, record: TickRecord) -> None:
        """Keep a tick's telemetry, and its frame when it is new and due."""
        state, frame = record.observation.state, record.observation.frame
        if not self._states or state.captured_s > self._states[-1].captured_s:
            self._states.append(state)
        if frame is not None and self._is_due(frame):
            self._keep(frame)

    def _is_due(self, frame: Frame) -> bool:
        if not self._frames:
            return True
        last = self._frames[-1]
        passed_s = frame.captured_s - last.captured_s
        # Frames come at a rhythm of their own: one that is almost due is due.
        return (
            frame.index > last.index
            and passed_s >= 0.75 * self._config.interval_s
            and passed_s > 0.0
            and frame.captured_s - self._frames[0].captured_s <= self._config.longest_s
        )

    def _keep(self, frame: Frame) -> None:
        size = self._config.size_px
        self._frames.append(frame)
        self._images.append(shrink(frame.image, size))
        if self._referee is not None:
            self._depths.append(self._referee.depth(frame, *size).astype(np.float16))
            self._ids.append(self._referee.class_ids(frame, *size))

    @property
    def empty(self) -> bool:
        """Whether no frame came yet."""
        return not self._frames

    def footage(self) -> Footage:
        """Return what was kept.

        Raises:
            ValueRangeError: nothing was.
        """
        if not self._frames:
            raise ValueRangeError("no frame came in this flight: there is no footage to keep")
        frames, states = self._frames, self._states
        return Footage(
            frames=np.stack(self._images),
            index=np.array([frame.index for frame in frames], dtype=np.int64),
            captured_s=np.array([frame.captured_s for frame in frames]),
            gimbal_pitch_rad=np.array([frame.gimbal_pitch_rad for frame in frames]),
            attitude_rad=np.array([_angles(frame.attitude) for frame in frames]),
            altitude_m=np.array([frame.altitude_m for frame in frames]),
            height_m=np.array([frame.height_m for frame in frames]),
            height_above_carpet_m=np.array([frame.height_above_carpet_m for frame in frames]),
            state_s=np.array([state.captured_s for state in states]),
            state_attitude_rad=np.array([_angles(state.attitude) for state in states]),
            velocity_mps=np.array(
                [
                    (state.velocity.forward_mps, state.velocity.right_mps, state.velocity.down_mps)
                    for state in states
                ]
            ),
            camera=self._camera,
        )

    def truth(self) -> FootageTruth | None:
        """Return the truth of the kept frames; None without a referee or frames."""
        if not self._depths:
            return None
        return FootageTruth(
            index=np.array([frame.index for frame in self._frames], dtype=np.int64),
            depth_m=np.stack(self._depths),
            ids=np.stack(self._ids),
        )


def _angles(attitude: Attitude) -> tuple[float, float, float]:
    return attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad


class FootageListeners:
    """What `app.fly` takes as `listeners`, with a recorder behind it."""

    def __init__(self, config: FootageConfig, *, with_truth: bool) -> None:
        self._config = config
        self._with_truth = with_truth
        self.recorder: FootageRecorder | None = None

    def __call__(self, drone: Drone, context: MissionContext) -> Sequence[TickListener]:
        """Begin recording a connected drone's flight.

        Raises:
            InputError: the truth was asked for, and this drone has no referee.
        """
        del context
        if self._with_truth and drone.referee is None:
            raise InputError("the truth of a flight needs a simulated drone; leave --truth away")
        referee = drone.referee if self._with_truth else None
        self.recorder = FootageRecorder(drone.camera, self._config, referee=referee)
        return [self.recorder]


@contextmanager
def flight_footage(
    path: Path, *, truth: Path | None = None, config: FootageConfig | None = None
) -> Iterator[FootageListeners]:
    """Write the footage of the flight that is flown inside, also when the flight fails.

    Args:
        path: the npz file.
        truth: a second npz file for exact depth and ids, from simulated drones only.
        config: what to keep.

    Raises:
        FileError: a file cannot be written.
        InputError: the truth was asked for, and the drone has no referee.
        ValueRangeError: the flight went well, and yet no frame came.
    """
    listeners = FootageListeners(config or FootageConfig(), with_truth=truth is not None)
    try:
        yield listeners
    except BaseException:
        # What was seen before it went wrong is worth keeping, and why it did is worth telling.
        if listeners.recorder is not None and not listeners.recorder.empty:
            _write(listeners.recorder, path, truth)
        raise
    if listeners.recorder is not None:
        _write(listeners.recorder, path, truth)


def _write(recorder: FootageRecorder, path: Path, truth: Path | None) -> None:
    write_footage(path, recorder.footage())
    known = recorder.truth()
    if truth is not None and known is not None:
        write_truth(truth, known)
