"""One flight of a campaign, in the process that was made for it."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from uav_bt import app
from uav_bt.campaign.path_keeper import PathKeeper
from uav_bt.campaign.plan import FlightTask


def fly_task(values: Mapping[str, Any]) -> dict[str, Any]:
    """Fly one flight of a campaign in this process and return its line.

    Args:
        values: what `FlightTask.to_json` wrote.

    Raises:
        InputError: the flight was refused before anything flew.
    """
    task = FlightTask.from_json(values)
    options = app.FlightOptions(
        scene=task.scene_path,
        seed=task.seed,
        profile=task.profile,
        policies=task.policies,
        image_size_px=task.image_size_px,
        exact_masks=task.exact_masks,
        record=None if task.record is None else Path(task.record),
        record_quality=task.record_quality,  # type: ignore[arg-type]  # the plan's maker checked it
    )
    keeper = PathKeeper()

    began_s = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="uav-bt-flight-") as folder:
        written = Path(folder) / "report.json"
        try:
            flight = app.fly(
                task.tree_path, options, report=written, listeners=[lambda _: [keeper]]
            ).to_json()
        except Exception:
            if not written.exists():  # nothing flew
                raise
            flight = json.loads(written.read_text(encoding="utf-8"))  # tells of the fault, too
    flight |= {"scene": task.scene, "tree": task.tree}
    if task.exact_masks:
        flight["exact_masks"] = True
    flight["path"] = keeper.points
    flight["wall_s"] = round(time.perf_counter() - began_s, 3)
    return flight
