"""Fly and measure what the plan asks; keep a line of each flight, and what measures print."""

from __future__ import annotations

import datetime as dt
import json
import os
import shlex
import subprocess
import sys
from collections.abc import Container, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import yaml

from benchmarks.size import ROOT
from uav_bt.app import provenance
from uav_bt.campaign.plan import CampaignPlan
from uav_bt.campaign.store import FLIGHTS_FILE, METRICS, PLAN_FILE, key_of, read_flights
from uav_bt.errors import InputError, UnknownNameError
from uav_bt.files import parse_json, write_whole

PRODUCT: Final = ("behaviours", "labs", "perception", "sim_bridge", "trees", "uav_bt")
PLAN: Final = Path(__file__).with_name("plan.yaml")
_FIELDS: Final = (
    *("tree", "scene", "seed", "outcome", "reason", "on_mark", *METRICS, "objects_total"),
    *("code", "began", "hardware"),  # of the run that flew it
)


class Results:
    """A folder of results: what each entry of the plan gave, with command, commit and machine."""

    def __init__(self, folder: Path, plan: Path = PLAN) -> None:
        self.folder = folder
        self.plan: dict[str, dict[str, Any]] = yaml.safe_load(plan.read_bytes())

    def about(self, name: str) -> dict[str, Any]:
        """Return what is kept of an entry; nothing if its command has changed since."""
        file = self._file(name)
        about: dict[str, Any] = parse_json(file.read_bytes()) if file.is_file() else {}
        return about if about.get("command") == self.plan[name]["command"] else {}

    def flights(self, name: str) -> tuple[Mapping[str, Any], ...]:
        """Return the kept flights of a campaign."""
        return read_flights(self._flights_file(name)) if self.about(name) else ()

    def origin(self, name: str) -> str:
        """Return command, commits, days and machines of an entry as text."""
        runs = [
            (run["code"][:8], run["began"][:10], ", ".join(run["hardware"].split(", ")[:3]))
            for run in self.about(name)["runs"]
        ]
        found = [" and ".join(dict.fromkeys(each)) for each in zip(*runs, strict=True)]
        return f"`{self.plan[name]['command']}` ({', '.join(found)})"

    def measure(self, only: Sequence[str] = ()) -> list[str]:
        """Fly and measure what is not kept yet, or `only` these; return what failed, and why."""
        for name in only:
            if name not in self.plan:
                raise UnknownNameError("entry of the plan", name, self.plan)
        missing = []
        for name in only or self.plan:
            try:
                if self.plan[name]["command"].startswith("uav-bt campaign "):
                    self._fly(name)
                elif only or not self.about(name):
                    self._measure(name)
            except InputError as error:
                missing.append(f"{name}: {error}")
        return missing

    def keep(self, name: str, work: Path) -> None:
        """Keep what the page needs of a campaign's flights; the kept lines stay as they are."""
        campaign = parse_json((work / PLAN_FILE).read_bytes())
        for run in campaign["runs"]:
            run |= {"code": product_commit(run["code"]), "machine": ""}
        for scene in campaign["plan"]["scenes"]:
            scene["path"] = ""  # on this machine
        kept = {key_of(line): line for line in self.flights(name)}
        for line in read_flights(work / FLIGHTS_FILE):
            flown = {**line, **campaign["runs"][-1]}
            kept.setdefault(key_of(line), {key: flown[key] for key in _FIELDS if key in flown})
        text = "".join(json.dumps(line) + "\n" for line in kept.values())
        self._write(name, campaign)
        write_whole(self._flights_file(name), text)

    def _fly(self, name: str) -> None:
        about, work = self.about(name), Path("runs/results") / name
        if about and len(self.flights(name)) == len(CampaignPlan.from_json(about["plan"])):
            return
        run_command(self.plan[name].get("prepare", "python -c ''"), good={0})
        if about and not work.exists():  # another clone flew the first part
            work.mkdir(parents=True)
            write_whole(work / PLAN_FILE, json.dumps(about))
            write_whole(work / FLIGHTS_FILE, self._flights_file(name).read_bytes())
        command = f"{self.plan[name]['command']} --out {work}"
        with subprocess.Popen(words_of(command)) as flying:  # noqa: S603 - of the plan
            try:
                flying.wait()
            finally:  # Ctrl-C stops the campaign, too
                flying.wait()
                if (work / PLAN_FILE).is_file():
                    self.keep(name, work)
        if flying.returncode:
            raise InputError(f"exit code {flying.returncode} of `{command}`")

    def _measure(self, name: str) -> None:
        run_command(self.plan[name].get("prepare", "python -c ''"), good={0})
        about = {
            "code": product_commit(),
            "began": dt.datetime.now(dt.UTC).isoformat(timespec="seconds"),
            "hardware": provenance.hardware(),
        }
        lines = run_command(self.plan[name]["command"]).splitlines()
        self._write(name, {"runs": [about], "lines": lines})

    def _write(self, name: str, about: Mapping[str, Any]) -> None:
        text = json.dumps({"command": self.plan[name]["command"], **about}, indent=1)
        self.folder.mkdir(parents=True, exist_ok=True)
        write_whole(self._file(name), text + "\n")

    def _file(self, name: str) -> Path:
        return self.folder / f"{name}.json"

    def _flights_file(self, name: str) -> Path:
        return self.folder / f"{name}.jsonl"


def product_commit(commit: str = "HEAD") -> str:
    """Return the last commit up to this one that changed what flies, not only pages or tests."""
    if "+" in commit:
        return commit
    command = ["git", "-C", str(ROOT), "log", "-1", "--format=%H", commit, "--", *PRODUCT]
    return subprocess.check_output(command, text=True).strip()  # noqa: S603


def words_of(command: str) -> list[str]:
    """Return a command of the plan as words; `uav-bt` and `python` are those that run this."""
    first, *words = shlex.split(command)
    if first != "olympe-python":
        return [sys.executable, *(("-m", "uav_bt") if first == "uav-bt" else ()), *words]
    if python := os.environ.get("OLYMPE_PYTHON"):
        return [python, *words]
    raise InputError("set OLYMPE_PYTHON to a Python that has Parrot's SDK")


def run_command(command: str, good: Container[int] = (0, 1)) -> str:
    """Run a command of the plan and return what it printed; 1: a mission failed, a result."""
    done = subprocess.run(words_of(command), stdout=subprocess.PIPE, text=True, check=False)  # noqa: S603
    if done.returncode not in good:
        raise InputError(f"exit code {done.returncode} of `{command}`")
    return done.stdout
