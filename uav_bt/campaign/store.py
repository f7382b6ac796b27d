"""A campaign's folder: its plan, and a line for each flight."""

from __future__ import annotations

import fcntl
import json
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, Final, NamedTuple

from pydantic import ConfigDict, NonNegativeInt, ValidationError, create_model

from uav_bt.campaign.plan import CampaignPlan, FlightKey
from uav_bt.errors import FileError, InputError
from uav_bt.files import parse_json, read_bounded, reading, write_whole, writing
from uav_bt.mission.flight_report import EXPLORE_S, Percentiles
from uav_bt.mission.judge import Outcome

PLAN_FILE: Final = "campaign.json"
FLIGHTS_FILE: Final = "flights.jsonl"
_MAX_PLAN_BYTES: Final = 50_000_000  # it lists every run, and a cluster starts many
_FORMAT: Final = 1  # of campaign.json
_FIRST: Final = f"in the first {EXPLORE_S:.0f} s"


class Metric(NamedTuple):
    """A number in a flight's line."""

    words: str  # its name in reports
    unit: str = ""  # in reports: s, m or %; empty: a count. In the line a share is 0 to 1


METRICS: Final = {
    "duration_s": Metric("duration", "s"),
    "explore_distance_m": Metric(f"distance {_FIRST}", "m"),
    "total_distance_m": Metric("total distance", "m"),
    "search_distance_m": Metric("distance while searching", "m"),
    "time_to_find_mark_s": Metric("time to find the landing mark", "s"),
    "time_to_land_s": Metric("time from there to motors off", "s"),
    "landing_error_m": Metric("landing error", "m"),
    "min_clearance_m": Metric("least clearance of a flight", "m"),
    "coverage_passed_90s": Metric(f"free ground passed {_FIRST}", "%"),
    "coverage_passed": Metric("free ground passed", "%"),
    "coverage_seen_90s": Metric(f"free ground seen {_FIRST}", "%"),
    "coverage_seen": Metric("free ground seen", "%"),
    "objects_found": Metric("objects found by the map"),
    "false_objects": Metric("objects of the map that are not there"),
    "map_drift_90s_m": Metric("drift of the map after 90 s", "m"),
    "map_drift_180s_m": Metric("drift of the map after 180 s", "m"),
    "map_drift_m": Metric("drift of the map at the end", "m"),
}
"""Fields of a flight's line that hold a number, or null when the flight did not reach it."""

_OPTIONAL: Final[dict[str, Any]] = {
    **dict.fromkeys((*METRICS, "objects_total", "map_restarts", "wall_s"), float),
    **dict.fromkeys(("reason", "lab", "drone", "record", "folder", "details", "profile"), str),
    "movers": NonNegativeInt,
    **dict.fromkeys(("vary_room", "on_mark"), bool),
    "faults": list[str],
    **dict.fromkeys(("ports", "variables"), dict[str, Any]),
    **dict.fromkeys(("object_errors_m", "object_height_errors_m"), list[float]),
    "tick_ms": Percentiles,
    "perception_ms": dict[str, Percentiles | None],
    "path": list[tuple[float, float, float, float]],  # t, x, y, z
    "coverage_curve": list[tuple[float, float, float]],  # t, passed, seen
}
_LINE: Final = create_model(  # type: ignore[call-overload]
    "FlightLine",
    __config__=ConfigDict(strict=True, allow_inf_nan=False),
    tree=str,
    scene=(str | None, None),
    seed=NonNegativeInt,
    outcome=Outcome,
    **{name: (kind | None, None) for name, kind in _OPTIONAL.items()},
)
"""What the program reads of a line. A file may come from other programs, or be edited."""


def key_of(flight: Mapping[str, Any]) -> FlightKey:
    """Return the key that identifies a flight in its campaign."""
    return flight["tree"], flight["scene"], flight["seed"]


def file_stem(key: FlightKey) -> str:
    """Return the stem of a flight's files; two flights may have the same."""
    tree, scene, seed = key
    # A scene may be called anything.
    return re.sub(r"[^\w.-]+", "_", f"{Path(tree).stem}-{scene}-{seed}")


def read_flights(path: Path) -> tuple[dict[str, Any], ...]:
    """Return the flights of a file in their order; of one that it has twice the later line."""
    flights: dict[FlightKey, dict[str, Any]] = {}
    with reading(path), path.open("rb") as file:
        for number, line in enumerate(file, start=1):
            if not line.strip():
                continue
            try:
                flight = _read_flight(line)
            except InputError as error:
                remedy = "delete this line; a campaign flies its flight again"
                raise FileError(path, f"{error}; {remedy}", number) from error
            flights.pop(key_of(flight), None)
            flights[key_of(flight)] = flight
    return tuple(flights.values())


def _read_flight(line: bytes) -> dict[str, Any]:
    flight = parse_json(line)
    try:
        _LINE.model_validate_json(line)
    except ValidationError as error:
        raise InputError(f"no flight: {_first(error)}") from error
    return {"scene": None, **flight}


def _first(error: ValidationError) -> str:
    """Return the first thing that is wrong: where, what, and the value."""
    wrong = error.errors()[0]
    where = ".".join(map(str, wrong["loc"]))
    return f"'{where}': {wrong['msg']}, got {wrong['input']!r:.60}"


def read_plan(folder: Path) -> tuple[CampaignPlan, list[dict[str, Any]]]:
    """Return the plan of a campaign's folder, and its runs."""
    path = folder / PLAN_FILE
    try:
        content = parse_json(read_bounded(path, _MAX_PLAN_BYTES))
        version = content["format"]
        if version == _FORMAT:
            runs = [dict(run) for run in content["runs"]]
            return CampaignPlan.from_json(content["plan"]), runs
    except FileError:  # also of a lab file
        raise
    except (InputError, KeyError, TypeError, ValueError, OSError) as error:
        wrong = _first(error) if isinstance(error, ValidationError) else repr(error)
        raise FileError(path, f"expected a campaign's format, plan and runs; {wrong}") from error
    raise FileError(path, f"has format {version!r:.20}, this version of uav-bt reads {_FORMAT}")


class CampaignStore:
    """A campaign's folder, open for one campaign at a time; made by `opened`."""

    def __init__(self, folder: Path, out: IO[bytes], runs: list[dict[str, Any]]) -> None:
        self.folder = folder
        self.runs = runs  # of its plan; the last is the one that opened it
        self.repaired = _repair(out)  # whether half a line was taken away
        self.kept = read_flights(folder / FLIGHTS_FILE)  # that were there on opening
        self._out = out

    @classmethod
    @contextmanager
    def opened(
        cls, folder: Path, plan: CampaignPlan, run: Mapping[str, Any]
    ) -> Iterator[CampaignStore]:
        """Open a folder for a plan: a new one, or one that the same plan began to fill.

        `run` tells of this run: when, where, of which commit. An InputError says in what the
        folder's plan differs.
        """
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
            out = (folder / FLIGHTS_FILE).open("a+b", buffering=0)
        with out:
            try:
                fcntl.flock(out, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise FileError(folder, "another campaign is at work in this folder") from error
            runs = [*_runs_before(folder, plan), dict(run)]
            content = {"format": _FORMAT, "plan": plan.to_json(), "runs": runs}
            write_whole(folder / PLAN_FILE, json.dumps(content, indent=2) + "\n")
            yield cls(folder, out, runs)

    def keep(self, flight: Mapping[str, Any]) -> None:
        """Write a flight to the disk, or nothing of it and a FileError."""
        line = json.dumps(flight, allow_nan=False).encode() + b"\n"
        size = os.fstat(self._out.fileno()).st_size
        try:
            written = self._out.write(line)
            if written != len(line):  # a full disk writes a part
                raise OSError(28, "no space left on device")  # noqa: TRY301 - one way out
            os.fsync(self._out.fileno())
        except OSError as error:
            os.ftruncate(self._out.fileno(), size)
            raise FileError(
                self.folder / FLIGHTS_FILE,
                f"cannot be written: {error.strerror}; all flights before this one are kept, "
                "and the same command goes on from there",
            ) from error


def _runs_before(folder: Path, plan: CampaignPlan) -> list[dict[str, Any]]:
    """Return the runs of the plan in a folder; refuse another campaign's folder."""
    flights = folder / FLIGHTS_FILE
    has_flights = flights.stat().st_size > 0
    if not (folder / PLAN_FILE).exists():
        if has_flights:
            raise FileError(flights, f"flights without a plan ({PLAN_FILE}); choose another folder")
        return []
    before, runs = read_plan(folder)
    differences = plan.differences(before)
    if differences and has_flights:
        raise InputError(
            f"{folder} holds another campaign; choose another folder, or fly what it says:\n  "
            + "\n  ".join(differences)
        )
    # One that was refused, or stopped, before its first flight: nothing is lost.
    return [] if differences else runs


def _repair(file: IO[bytes]) -> bool:
    """Take away a last line without its end, which a killed campaign left."""
    file.seek(0)
    data = file.read()
    whole = data.rfind(b"\n") + 1
    if whole == len(data):
        return False
    file.truncate(whole)
    os.fsync(file.fileno())
    return True
