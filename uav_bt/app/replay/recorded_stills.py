"""Photographs of a recorded drone's camera: they end when they did in the flight."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from uav_bt.errors import DroneError, FileError, InputError
from uav_bt.files import parse_json
from uav_bt.protocols import Still, StillState
from uav_bt.record.reader import RecordReader
from uav_bt.types.flight_results import EventKind

_ROUNDED_S: Final = 5e-4  # times of events are written in milliseconds


@dataclass(frozen=True, kw_only=True)
class _Ended:
    """A photograph of the flight."""

    time_s: float  # since the take-off command
    still: Still


class RecordedStills:
    """Answers as the drone's camera did in the flight; implements `StillCamera`.

    Args:
        ended: The photographs of the flight, in their order.
        elapsed_s: Returns the time since the take-off command, s.
    """

    def __init__(self, ended: list[_Ended], elapsed_s: Callable[[], float]) -> None:
        self._ended = ended
        self._elapsed_s = elapsed_s
        self._asked_s: list[float] = []

    @classmethod
    def of(cls, reader: RecordReader, elapsed_s: Callable[[], float]) -> RecordedStills | None:
        """Return the photographs of a record; None if it was not closed, and so has no report.

        Args:
            reader: Of the record.
            elapsed_s: Returns the time since the take-off command, s.

        Raises:
            FileError: The report in the record is damaged.
        """
        end = reader.end
        if end is None or "report" not in end:
            return None
        try:
            return cls(list(_photos(parse_json(end["report"]))), elapsed_s)
        except (InputError, KeyError, TypeError, ValueError) as error:
            raise FileError(reader.path, f"the report in the record is damaged: {error}") from error

    def take_still(self) -> int:
        """Note that a photograph is asked for; return its number."""
        self._asked_s.append(self._elapsed_s())
        return len(self._asked_s) - 1

    def still(self, number: int) -> Still:
        """Return the present state of a photograph, as it was in the flight.

        Args:
            number: As `take_still` returned it.
        """
        asked_s, now_s = self._asked_s[number], self._elapsed_s()
        later = (one for one in self._ended if one.time_s >= asked_s - _ROUNDED_S)
        ended = next(later, None)
        return Still() if ended is None or now_s < ended.time_s - _ROUNDED_S else ended.still

    def fetch_still(self, media: str, limit_s: float) -> bytes:
        """Refuse: a record has no photographs.

        Raises:
            DroneError: Always.
        """
        raise DroneError(f"a record has no photograph '{media}' (asked for within {limit_s:g} s)")


def _photos(report: Any) -> list[_Ended]:
    """Return when the photographs of a report were stored, and how the camera had ended."""
    reasons = {
        float(event["time_s"]): str(event["text"]).rpartition(": ")[2]
        for event in report["events"]
        if event["kind"] == EventKind.NO_PHOTO.value
    }
    times_s = [
        float(event["time_s"])
        for event in report["events"]
        if event["kind"] == EventKind.PHOTO.value
    ]
    found = []
    for time_s, photo in zip(times_s, report["photos"], strict=False):
        media = photo.get("camera_media")
        still = (
            Still(state=StillState.FAILED, reason=reasons.get(time_s, "it failed in the flight"))
            if media is None
            else Still(state=StillState.SAVED, media=str(media))
        )
        found.append(_Ended(time_s=time_s, still=still))
    return found
