"""A drone made from a record: clock, frames and class maps are the recorded ones."""

from __future__ import annotations

from dataclasses import replace

from uav_bt.errors import FileError, InputError
from uav_bt.record.moment import Moment
from uav_bt.record.reader import RecordReader
from uav_bt.types import Airframe, ClassMap, Command, DroneState, Frame, MoveBy, Observation
from uav_bt.types.commands import Movement


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
        if recorded.id not in self._replayed and replayed.id not in self._replayed.values():
            self._replayed[recorded.id] = replayed.id
        return self._replayed.get(recorded.id) == replayed.id

    def translated(self, state: DroneState) -> DroneState:
        """Return a recorded state as the replay's leaves must read it."""
        if (movement := state.movement) is None:
            return state
        # Ids count from 1 up: no leaf waits for a negative one.
        replayed = self._replayed.get(movement.id, -abs(movement.id))
        return replace(state, movement=replace(movement, id=replayed))


class RecordedDrone:
    """Gives the recorded observations, tick by tick, and obeys nothing.

    It is its own clock, which jumps from tick to tick, however long the sleep.
    """

    referee = None  # new decisions have no consequences that it could judge
    scene = None  # no decision depends on it
    live = False  # no check before take-off
    tick_s = None  # the recorded ticks set the pace

    def __init__(self, reader: RecordReader, airframe: Airframe) -> None:
        self._reader = reader
        self.clock = self
        self.airframe = airframe
        self.camera = reader.camera
        self.ids = MovementIds()
        self.missing_images = 0  # frames whose image the record lacks
        self._frame: Frame | None = None
        self._slept_to_s = 0.0  # after the last tick
        self._moments = reader.moments()
        first = next(self._moments, None)
        if first is None:
            raise FileError(reader.path, "the record has no tick to replay")
        self.before: Moment | None = None
        self.moment = first
        self._next = next(self._moments, None)
        self._take_frame()

    @property
    def at_end(self) -> bool:
        """Whether this is the last recorded tick."""
        return self._next is None

    def now(self) -> float:
        """Return the recorded time; after the last tick, that of the last sleep."""
        return max(self._slept_to_s, self.moment.tick.time_s)

    def sleep_until(self, time_s: float) -> None:
        """Go on to the next recorded tick."""
        if self._next is None:
            self._slept_to_s = max(self._slept_to_s, time_s)
            return
        self.before, self.moment = self.moment, self._next
        self._next = next(self._moments, None)
        self._take_frame()

    def _take_frame(self) -> None:
        stored = self.moment.frame
        if stored is None:
            return
        if stored.image is None:
            self.missing_images += 1  # the one before stays, and grows old
            return
        with self._reader.intact(f"frame {stored.note.index}"):
            self._frame = stored.frame()

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

    def segment(self, frame: Frame) -> ClassMap:
        """Return the class map that was recorded with a frame."""
        found = self.moment.class_map
        if found is None or found.captured_s != frame.captured_s:
            raise InputError(
                f"the record has no class map of frame {frame.index}: replay with --masks network"
            )
        return found
