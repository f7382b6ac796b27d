"""A drone made from a record: clock, frames, class maps and photographs are the recorded ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from uav_bt.board import ELAPSED
from uav_bt.errors import DroneError, FileError, InputError
from uav_bt.files import parse_json
from uav_bt.protocols import Still, StillState
from uav_bt.record.moment import Moment
from uav_bt.record.reader import RecordReader
from uav_bt.types import (
    Airframe,
    ClassMap,
    Command,
    DroneState,
    Frame,
    MoveBy,
    Movement,
    Observation,
)
from uav_bt.types.flight_results import EventKind

_ROUNDED_S: Final = 5e-4  # times of events are written in milliseconds


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

    `stills`: whether its camera took photographs.
    """

    referee = None  # new decisions have no consequences that it could judge
    scene = None  # no decision depends on it
    live = False  # no check before take-off
    tick_s = None  # the recorded ticks set the pace

    def __init__(
        self, reader: RecordReader, airframe: Airframe | None = None, *, stills: bool = False
    ) -> None:
        self._reader = reader
        self.airframe = airframe or Airframe()
        self.camera = reader.camera
        self.clock = RecordedClock(self)
        self.ids = MovementIds()
        self.missing_images = 0  # frames whose image the record lacks
        self._frame: Frame | None = None
        self._moments: Iterator[Moment] = reader.moments()
        first = next(self._moments, None)
        if first is None:
            raise FileError(reader.path, "the record has no tick to replay")
        self.before: Moment | None = None
        self.moment = first
        self._next = next(self._moments, None)
        self._take_frame()
        report = (reader.end or {}).get("report") if stills else None
        self.stills = None if report is None else RecordedStills(self, report, reader.path)

    @property
    def at_end(self) -> bool:
        """Whether this is the last recorded tick."""
        return self._next is None

    @property
    def elapsed_s(self) -> float:
        """Recorded time since the take-off command."""
        known = self.moment.board.get(ELAPSED.name)
        return 0.0 if known is None else float(known["value"])

    def advance(self) -> None:
        """Go on to the next tick; nothing happens after the last."""
        if self._next is not None:
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
        try:
            self._frame = stored.frame()
        except InputError as error:
            raise FileError(self._reader.path, f"frame {stored.note.index}: {error}") from error

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
        """Return the class map that was recorded with a frame; InputError if there is none."""
        found = self._drone.moment.class_map
        if found is None or found.captured_s != frame.captured_s:
            raise InputError(
                f"the record has no class map of frame {frame.index}: replay with the network "
                "(--masks network)"
            )
        return found


class RecordedStills:
    """Photographs of the drone's camera, which end when they did in the flight (`StillCamera`).

    They are read from the report in the record, a JSON text.
    """

    def __init__(self, drone: RecordedDrone, report: str, path: Path) -> None:
        self._drone = drone
        self._asked_s: list[float] = []
        try:
            self._ended = list(_ended(parse_json(report)))
        except (InputError, KeyError, TypeError, ValueError) as error:
            raise FileError(path, f"the report in the record is damaged: {error}") from error

    def take_still(self) -> int:
        """Note that a photograph is asked for; return its number."""
        self._asked_s.append(self._drone.elapsed_s)
        return len(self._asked_s) - 1

    def still(self, number: int) -> Still:
        """Return the present state of a photograph, as it was in the flight."""
        asked_s, now_s = self._asked_s[number] - _ROUNDED_S, self._drone.elapsed_s + _ROUNDED_S
        ended_s, still = next((one for one in self._ended if one[0] >= asked_s), (None, Still()))
        return Still() if ended_s is None or now_s < ended_s else still

    def fetch_still(self, media: str, limit_s: float) -> bytes:
        """Refuse with a DroneError: a record has no photographs."""
        raise DroneError(f"a record has no photograph '{media}' (asked for within {limit_s:g} s)")


def _ended(report: Any) -> Iterator[tuple[float, Still]]:
    """Yield the photographs of a report: seconds since take-off, and how the camera ended."""
    of = {kind: [e for e in report["events"] if e["kind"] == kind.value] for kind in EventKind}
    reasons = {
        float(event["time_s"]): str(event["text"]).rpartition(": ")[2]
        for event in of[EventKind.NO_PHOTO]
    }
    for event, photo in zip(of[EventKind.PHOTO], report["photos"], strict=False):
        time_s, media = float(event["time_s"]), photo.get("camera_media")
        reason = reasons.get(time_s, "it failed in the flight")
        failed = Still(state=StillState.FAILED, reason=reason)
        saved = Still(state=StillState.SAVED, media=str(media))
        yield time_s, failed if media is None else saved
