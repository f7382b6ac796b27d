"""A campaign's folder: its plan, and a line for each flight that a killed process leaves whole."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, Final

from uav_bt.campaign.flight_lines import read_flights
from uav_bt.campaign.plan import CampaignPlan
from uav_bt.errors import FileError, InputError
from uav_bt.files import parse_json, read_bounded, reading, write_whole, writing

PLAN_FILE: Final = "campaign.json"
FLIGHTS_FILE: Final = "flights.jsonl"
RECORDS_FOLDER: Final = "records"
OUTPUTS_FOLDER: Final = "flights"  # a folder for each flight that wrote files
_LOCK_FILE: Final = ".lock"
_MAX_PLAN_BYTES: Final = 50_000_000  # it lists every run, and a cluster starts many
_FORMAT: Final = 1  # of campaign.json


def read_plan(folder: Path) -> tuple[CampaignPlan, list[dict[str, Any]]]:
    """Return the plan of a campaign's folder, and its runs."""
    path = folder / PLAN_FILE
    with reading(path):
        if not path.exists():
            raise FileError(path, "no such file; this folder holds no campaign")
    data = read_bounded(path, _MAX_PLAN_BYTES)
    try:
        content = parse_json(data)
        version, plan, runs = content["format"], content["plan"], content["runs"]
        read = CampaignPlan.from_json(plan) if version == _FORMAT else None
    except FileError:  # a lab file
        raise
    except (KeyError, TypeError) as error:
        raise FileError(path, "not a campaign: needs 'format', 'plan' and 'runs'") from error
    except InputError as error:
        raise FileError(path, str(error)) from error
    if read is None:
        raise FileError(path, f"has format {version}, this version of uav-bt reads {_FORMAT}")
    if not isinstance(runs, list):
        raise FileError(path, f"not a campaign: 'runs' must be a list, got {runs!r:.40}")
    return read, runs


class CampaignStore:
    """A campaign's folder, open for one campaign at a time; made by `opened`."""

    def __init__(self, folder: Path, out: IO[bytes], *, repaired: bool) -> None:
        self.folder = folder
        self.repaired = repaired  # whether a last line that was half written was taken away
        self.kept = read_flights(folder / FLIGHTS_FILE)  # the flights that were there on opening
        self._out = out

    @classmethod
    @contextmanager
    def opened(
        cls, folder: Path, plan: CampaignPlan, run: Mapping[str, Any]
    ) -> Iterator[CampaignStore]:
        """Open a folder for a plan: a new one, or one that the same plan began to fill.

        `run` tells people of this run: when, where, of which commit. An InputError says in what the
        folder's plan differs, a FileError that it cannot be written to now.
        """
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
            lock = (folder / _LOCK_FILE).open("w")
        with lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise FileError(folder, "another campaign is at work in this folder") from error
            _settle(folder, plan, run)
            with writing(folder / FLIGHTS_FILE):
                out = (folder / FLIGHTS_FILE).open("a+b", buffering=0)
            with out:
                yield cls(folder, out, repaired=_repair(out))

    def keep(self, flight: Mapping[str, Any]) -> None:
        """Write a flight down; it is on the disk on return, and after a FileError nothing of it."""
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
                f"cannot be written: {error.strerror}; all flights before this one are kept, and "
                "the same command goes on from there",
            ) from error


def _settle(folder: Path, plan: CampaignPlan, run: Mapping[str, Any]) -> None:
    """Write the plan, or find that it is the one in the folder."""
    runs: list[dict[str, Any]] = []
    flights = folder / FLIGHTS_FILE
    if (folder / PLAN_FILE).exists():
        before, runs = read_plan(folder)
        differences = plan.differences(before)
        if differences and flights.exists() and flights.stat().st_size:
            raise InputError(
                f"{folder} holds another campaign; choose another folder, or fly what it says:\n  "
                + "\n  ".join(differences)
            )
        if differences:
            runs = []  # it was refused, or stopped, before its first flight: nothing is lost
    elif flights.exists():
        raise FileError(flights, f"flights without a plan ({PLAN_FILE}); choose another folder")
    content = {"format": _FORMAT, "plan": plan.to_json(), "runs": [*runs, dict(run)]}
    write_whole(folder / PLAN_FILE, json.dumps(content, indent=2) + "\n")


def _repair(file: IO[bytes]) -> bool:
    """Take away a last line without its end, which a killed campaign or a full disk left."""
    file.seek(0)
    data = file.read()
    whole = data.rfind(b"\n") + 1
    if whole == len(data):
        return False
    file.truncate(whole)
    os.fsync(file.fileno())
    return True
