"""Helpers of the campaign tests: plans, and simulated flights.

`fly` runs in a worker's process, which imports this module by name. The policies of a plan map each
seed to the fate of its flight.
"""

from __future__ import annotations

import os
import select
import sys
import tempfile
import weakref
from pathlib import Path
from typing import Any

from uav_bt.app.options import FlightOptions
from uav_bt.campaign.plan import SHARED, CampaignPlan, PlannedFile, PlannedTree
from uav_bt.errors import InputError

FLY = "tests.uav_bt.campaign.campaign_world:fly"


def plan(
    *, trees: tuple[str, ...] = ("one.xml",), scenes: tuple[str, ...] = ("lab",), **how: Any
) -> CampaignPlan:
    """Return a plan of files that need not exist; `how` may contain options of flights, too."""
    shared = {name: how.pop(name) for name in SHARED if name in how}
    return CampaignPlan(
        **{
            "trees": tuple(PlannedTree(name=name, path=name, sha256="0" * 64) for name in trees),
            "scenes": tuple(PlannedFile(name=name, path=name, sha256="1" * 64) for name in scenes),
            "flights": 2,
            "timeout_s": 60.0,
            "options": FlightOptions(**shared),
            **how,
        }
    )


def line(seed: int = 0, **fields: Any) -> dict[str, Any]:
    """Return a flight as in the campaign's folder."""
    return {
        "tree": "one.xml",
        "scene": "lab",
        "seed": seed,
        "outcome": "success",
        "reason": "landed",
        "duration_s": 100.0 + seed,
        **fields,
    }


def comparable(flight: dict[str, Any]) -> dict[str, Any]:
    """Return a flight without computing times: on one machine it agrees for each seed."""
    times = {"tick_ms", "perception_ms", "slow_leaves", "wall_s"}
    return {name: value for name, value in flight.items() if name not in times}


def lose_process(fate: str) -> None:
    """End this process by a signal or by its exit code, after the first moments of a flight."""
    select.select([], [], [], 0.3)
    if fate == "exits":
        os._exit(3)
    sys.stderr.write("a library's last words\n")
    sys.stderr.flush()
    os.abort()


def fly(task: dict[str, Any]) -> dict[str, Any]:
    """End with the fate of this seed; `wall_s` of the result is the process id."""
    if task.get("litters"):
        tempfile.mkdtemp()
    fate = task["policies"].get(str(task["seed"]), "lands")
    if fate in ("crashes", "exits"):
        lose_process(fate)
    if fate == "hangs":
        os.read(os.pipe()[0], 1)
    if fate == "calls sys.exit":
        sys.exit(3)
    if fate == "has an answer that cannot be sent":
        return line(task["seed"], wall_s=sys.stderr)
    if fate == "raises":
        raise RuntimeError("out of luck")
    if fate == "is refused":
        raise InputError("no such weights")
    if fate == "is chatty":
        os.write(1, b"a library's banner\n")
    if fate.startswith("leaves a cycle to "):
        collected = Path(fate.removeprefix("leaves a cycle to "))
        weakref.finalize(type("Cyclic", (), {}), collected.touch)  # a reference cycle
    return line(task["seed"], tree=task["tree"], scene=task["scene"], wall_s=os.getpid())
