"""One flight of a campaign, in the process that was made for it."""

from __future__ import annotations

import json
import shutil
import tempfile
import time
from pathlib import Path
from typing import Any, Final

from uav_bt import app
from uav_bt.app.flight_outputs import OBJECTS_FILES
from uav_bt.app.flying_process import ended_by_signals
from uav_bt.campaign.plan import FlightTask
from uav_bt.mission.tick import TickRecord

_PATH_INTERVAL_S: Final = 0.5  # at 0.5 m/s a point every quarter of a metre: maps need no more


def fly_task(task: FlightTask) -> dict[str, Any]:
    """Fly a flight in this process, and return its line.

    An InputError says that the flight was refused before anything flew.
    """
    options, keeper = task.flight_options(), PathKeeper()
    outputs = None if task.folder is None else Path(task.folder)
    if outputs is not None:
        shutil.rmtree(outputs, ignore_errors=True)  # of the same flight, when it was interrupted

    began_s = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="uav-bt-flight-") as folder:
        report = Path(folder) / "report.json"
        try:
            app.fly(
                task.tree_path,
                options,
                out=outputs,
                report=report,
                listeners=[lambda _: [keeper]],
                controls=lambda _: ended_by_signals(),
            )
        except Exception:
            if not report.exists():  # nothing flew; otherwise the report tells of the fault, too
                raise
        flight: dict[str, Any] = json.loads(report.read_text(encoding="utf-8"))
    # The objects of a flight in which no leaf wrote a file are in its line.
    if outputs is not None and outputs.is_dir():
        written = {file.name for file in outputs.iterdir()}
        if written.issubset(OBJECTS_FILES):
            shutil.rmtree(outputs)
    flight |= {"scene": task.scene, "tree": task.tree, "path": keeper.points}
    if options.exact_masks:
        flight["exact_masks"] = True
    flight["wall_s"] = round(time.perf_counter() - began_s, 3)
    return flight


class PathKeeper:
    """Listens to the runner and keeps the referee's positions at 2 Hz; nothing without a referee.

    `points` are time in mission seconds, and x, y, z in world metres, all to the thousandth.
    """

    def __init__(self) -> None:
        self.points: list[tuple[float, ...]] = []

    def on_tick(self, record: TickRecord) -> None:
        """Keep the position of a tick that is due."""
        # Half a tick early is on time: ticks are a tenth of a second, and floats add up.
        due_s = self.points[-1][0] + _PATH_INTERVAL_S - 0.05 if self.points else 0.0
        if record.truth is not None and record.time_s >= due_s:
            pose = record.truth.pose
            values = (record.time_s, pose.x_m, pose.y_m, pose.z_m)
            self.points.append(tuple(round(value, 3) for value in values))
