"""A drone made from a record: its clock, frames and class maps are the recorded ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from uav_bt.app.replay.recorded_stills import RecordedStills
from uav_bt.board import ELAPSED
from uav_bt.errors import FileError, InputError
from uav_bt.record.moment import Moment
from uav_bt.record.reader import RecordReader
from uav_bt.types import (
    Airframe,
    CameraModel,
    ClassMap,
    Command,
    DroneState,
    Frame,
    MoveBy,
    Movement,
    Observation,
)


class MovementIds:
    """Pairs the movements of record and replay that were commanded at the same time.

    The drone answers by a movement's id, and ids are counted as movements are made: once a replay
    makes one more or one less, all that follow are shifted, and the answers must still arrive.
    """

    def __init__(self) -> None:
        self._replayed: dict[int, int] = {}  # by the recording's id

    def pair(self, recorded: Movement, replayed: Movement) -> bool:
        """Note the commands of one tick; return whether they are the same movement.

        Two that began together are the same, whatever they do; movements without numbers are.
        """
        if not isinstance(recorded, MoveBy) or not isinstance(replayed, MoveBy):
            return True
        known = self._replayed.get(recorded.id)
        if known is None and replayed.id not in self._replayed.values():
            self._replayed[recorded.id] = replayed.id
            return True
        return known == replayed.id

    def translated(self, state: DroneState) -> DroneState:
        """Return a recorded state as the replay's leaves must read it."""
        movement = state.movement
        if movement is None:
            return state
        # Ids count from 1 up: no leaf waits for a negative one.
        replayed = self._replayed.get(movement.id, -abs(movement.id))
        if replayed == movement.id:
            return state
        return replace(state, movement=replace(movement, id=replayed))


class RecordedClock:
    """Jumps from tick to tick, however long the sleep."""

    def __init__(self, drone: RecordedDrone) -> None:
        self._drone = drone
        self._after_s = 0.0

    def now(self) -> float:
        """Return the tick's recorded time; after the last tick, the time of the last sleep."""
        return max(self._after_s, self._drone.moment.tick.time_s)

    def sleep_until(self, time_s: float) -> None:
        """Go on to the next recorded tick."""
        if self._drone.at_end:
            self._after_s = max(self._after_s, time_s)
        else:
            self._drone.advance()


class RecordedDrone:
    """Gives the recorded observations, tick by tick, and obeys nothing.

    Args:
        reader: of the record.
        airframe: of the recorded drone.
        stills: whether its camera took photographs.

    Raises:
        FileError: the record has no tick.
    """

    def __init__(
        self, reader: RecordReader, airframe: Airframe | None = None, *, stills: bool = False
    ) -> None:
        self._reader = reader
        self.airframe = airframe or Airframe()
        self._moments: Iterator[Moment] = reader.moments()
        self._frame: Frame | None = None
        self._clock = RecordedClock(self)
        self.ids = MovementIds()
        self.missing_images = 0  # frames whose image the record lacks
        first = next(self._moments, None)
        if first is None:
            raise FileError(reader.path, "the record has no tick to replay")
        self.before: Moment | None = None
        self.moment = first
        self._next = next(self._moments, None)
        self._take_frame()
        self.stills = RecordedStills.of(reader, self._elapsed_s) if stills else None

    @property
    def at_end(self) -> bool:
        """Whether this is the last recorded tick."""
        return self._next is None

    def advance(self) -> None:
        """Go on to the next tick; nothing happens after the last."""
        if self._next is None:
            return
        self.before, self.moment = self.moment, self._next
        self._next = next(self._moments, None)
        self._take_frame()

    def _elapsed_s(self) -> float:
        """Return the recorded time since the take-off command, s."""
        known = self.moment.board.get(ELAPSED.name)
        return 0.0 if known is None else float(known["value"])

    def _take_frame(self) -> None:
        stored = self.moment.frame
        if stored is None:
            return
        if stored.image is None:
            self.missing_images += 1  # the one before stays, and grows old
            return
        try:
            self._frame = stored.frame()
        except InputError as error:
            raise FileError(self._reader.path, f"frame {stored.note.index}: {error}") from error

    @property
    def clock(self) -> RecordedClock:
        """The recording's time."""
        return self._clock

    @property
    def camera(self) -> CameraModel:
        """The camera that took the frames."""
        return self._reader.camera

    @property
    def referee(self) -> None:
        """None: new decisions have no consequences that a referee could judge."""
        return

    @property
    def scene(self) -> None:
        """None: no decision depends on the recorded scene."""
        return

    @property
    def live(self) -> bool:
        """A record needs no check before take-off."""
        return False

    @property
    def tick_s(self) -> None:
        """The recorded ticks set the pace."""
        return

    def connect(self) -> None:
        """Nothing needs to be done."""

    def observe(self) -> Observation:
        """Return the recorded observation of this tick."""
        return Observation(frame=self._frame, state=self.ids.translated(self.moment.state))

    def send(self, command: Command) -> Command:
        """Take a command without obeying it."""
        return command

    def disconnect(self) -> None:
        """Nothing needs to be done."""


class RecordedSegmenter:
    """The recorded class maps as a segmenter, to replay everything after segmentation."""

    def __init__(self, drone: RecordedDrone) -> None:
        self._drone = drone

    def segment(self, frame: Frame) -> ClassMap:
        """Return the class map that was recorded with a frame.

        Raises:
            InputError: no class map was recorded with it.
        """
        found = self._drone.moment.class_map
        if found is None or found.captured_s != frame.captured_s:
            raise InputError(
                f"the record has no class map of frame {frame.index}: replay with the network "
                "(--masks network)"
            )
        return found
