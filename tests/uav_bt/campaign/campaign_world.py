"""Helpers of the campaign tests: plans, simulated flights, and their lines.

`fly` runs in a worker's process, which imports this module by name. The policies of a plan map each
seed to the fate of its flight.
"""

from __future__ import annotations

import json
import os
import select
import sys
import tempfile
import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from uav_bt.app.options import SHARED, FlightOptions
from uav_bt.campaign.plan import CampaignPlan, FlightTask, PlannedFile
from uav_bt.campaign.store import CampaignStore
from uav_bt.errors import InputError


def plan(
    *, trees: Sequence[Any] = ("one.xml",), scenes: Sequence[Any] = ("lab",), **how: Any
) -> CampaignPlan:
    """Return a plan of files that need not exist; `how` may contain options of flights, too."""
    shared = {name: how.pop(name) for name in SHARED if name in how}
    return CampaignPlan(
        **{
            "trees": tuple(_planned(tree, "0" * 64) for tree in trees),
            "scenes": tuple(_planned(scene, "1" * 64) for scene in scenes),
            "flights": 2,
            "timeout_s": 60.0,
            "options": FlightOptions(**shared),
            **how,
        }
    )


def _planned(file: str | PlannedFile, sha256: str) -> PlannedFile:
    return PlannedFile(name=file, path=file, sha256=sha256) if isinstance(file, str) else file


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


def jsonl(path: Path, *flights: dict[str, Any]) -> Path:
    """Write flights to a file, one a line."""
    path.write_text("".join(json.dumps(one) + "\n" for one in flights), encoding="utf-8")
    return path


def keep(folder: Path, *flights: dict[str, Any], of: CampaignPlan | None = None) -> CampaignStore:
    """Keep flights in the folder of a plan."""
    with CampaignStore.opened(folder, of or plan(), {"code": "abc"}) as store:
        for flight in flights:
            store.keep(flight)
    return store


def comparable(flight: dict[str, Any]) -> dict[str, Any]:
    """Return a flight without computing times: on one machine it agrees for each seed."""
    times = {"tick_ms", "perception_ms", "slow_leaves", "wall_s"}
    return {name: value for name, value in flight.items() if name not in times}


def fly(task: FlightTask) -> dict[str, Any]:
    """End with the fate of this seed; `wall_s` of the result is the process id."""
    seed = task.options.seed
    fate = task.options.policy_names.get(str(seed), "lands")
    tempfile.mkdtemp()  # a file that its process leaves
    if fate in ("crashes", "exits"):
        select.select([], [], [], 0.3)  # the first moments of a flight
        if fate == "exits":
            os._exit(3)
        sys.stderr.write("a library's last words\n")
        sys.stderr.flush()
        os.abort()
    if fate == "hangs":
        os.read(os.pipe()[0], 1)
    if fate == "calls sys.exit":
        sys.exit(3)
    if fate == "has an answer that cannot be sent":
        return line(seed, wall_s=sys.stderr)
    if fate == "raises":
        raise RuntimeError("out of luck")
    if fate == "is refused":
        raise InputError("no such weights")
    if fate == "is chatty":
        os.write(1, b"a library's banner\n")
    if fate.startswith("leaves a cycle to "):
        collected = Path(fate.removeprefix("leaves a cycle to "))
        weakref.finalize(type("Cyclic", (), {}), collected.touch)  # a reference cycle
    return line(seed, tree=task.tree, scene=task.scene, wall_s=os.getpid())
