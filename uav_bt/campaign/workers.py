"""Worker processes that fly, kept by Pebble: a crash or a hang costs one flight.

A flight runs native code (physics, graphics, networks). When that code dies its process dies,
and when it hangs only another process can stop it. Each worker flies one task after the other,
so that slow imports happen once.
"""

from __future__ import annotations

import faulthandler
import gc
import json
import multiprocessing
import os
import shutil
import signal
import tempfile
import threading
import time
import traceback
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from pebble import ProcessExpired, ProcessPool

from uav_bt import app
from uav_bt.app.flight import changes_of
from uav_bt.app.flight_outputs import OBJECTS_FILES
from uav_bt.app.flying_process import ended_by_signals
from uav_bt.app.options import FlightOptions
from uav_bt.campaign.plan import FlightTask
from uav_bt.errors import InputError, UavBtError
from uav_bt.mission.judge import Outcome
from uav_bt.mission.tick import TickRecord

Line = dict[str, Any]
"""A flight's line."""

Fly = Callable[[FlightTask], Line]
"""Flies a task in a worker's process, which imports it; an InputError refuses all tasks."""

_PATH_INTERVAL_S: Final = 0.5  # at 0.5 m/s a point every quarter of a metre
_OUTPUT_TAIL: Final = 4000  # characters of a lost process's output that are kept; chosen


def lost_line(task: FlightTask, reason: str, details: str = "") -> Line:
    """Return the line of a flight that did not end by itself.

    It has the options as given, `random` among the faults: to draw them takes the drone, which
    may have ended the process.
    """
    options = task.options
    return {
        "scene": task.scene,
        "seed": options.seed,
        "tree": task.tree,
        "drone": options.drone_name,
        "profile": options.profile,
        **asdict(changes_of(options)),
        "outcome": Outcome.ERROR.value,
        "reason": reason,
        "details": details,
    }


class WorkerPool:
    """A number of worker processes, replaced when they end."""

    def __init__(self, fly: Fly, workers: int) -> None:
        self._fly = fly
        self._folder = tempfile.TemporaryDirectory(prefix="uav-bt-workers-")
        self._pool = ProcessPool(
            workers,
            initializer=_begin,
            initargs=(self._folder.name,),
            # A forked copy of MuJoCo or of the graphics driver does not work.
            context=multiprocessing.get_context("spawn"),
        )
        self._count = 0
        self._flying: dict[Future[Line], tuple[FlightTask, Path, float]] = {}

    def start(self, task: FlightTask, timeout_s: float) -> Future[Line]:
        """Fly a task after those that wait, for `timeout_s` of wall time at most."""
        self._count += 1
        output = Path(self._folder.name) / f"output-{self._count}.txt"
        # The first task starts the processes, which must ignore Ctrl-C: in a flight it would
        # land the drone, and the flight would count as flown.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            flight = self._pool.schedule(_fly, (self._fly, task, str(output)), timeout=timeout_s)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        self._flying[flight] = task, output, timeout_s
        return flight

    def line_of(self, flight: Future[Line]) -> Line:
        """Wait for a flight's end and return its line; an InputError refuses all tasks."""
        task, output, timeout_s = self._flying[flight]
        try:
            return flight.result()
        except InputError:
            raise
        except CancelledError:
            reason = "the campaign was stopped"
        except BrokenProcessPool as error:
            raise InputError(
                f"the worker processes ended ({error}); a script that flies a campaign must "
                'call it below `if __name__ == "__main__":`, as each worker imports the script'
            ) from error
        except TimeoutError:
            reason = f"no end after {timeout_s:g} s of wall time; its process was stopped"
        except ProcessExpired as error:
            reason = _exit_reason(error.exitcode)
        except Exception as error:  # noqa: BLE001 - the campaign goes on
            reason = f"its answer was lost: {type(error).__name__}: {error}"
        finally:
            del self._flying[flight]
            text = output.read_text("utf-8", "replace") if output.exists() else ""
            output.unlink(missing_ok=True)
        return lost_line(task, reason, text.strip()[-_OUTPUT_TAIL:])

    def close(self) -> None:
        """Stop all workers at once and remove their files; what still flies is lost."""
        self._pool.stop()  # type: ignore[no-untyped-call]
        for flight in tuple(self._flying):
            flight.cancel()
        self._pool.join()
        self._folder.cleanup()


def _exit_reason(code: int) -> str:
    if code >= 0:
        return f"its process ended by itself, with exit code {code}"
    known = -code in set(signal.Signals)
    name = signal.Signals(-code).name if known else f"signal {-code}"
    hint = "; the system may have run out of memory" if -code == signal.SIGKILL else ""
    return f"its process was ended by {name}{hint}"


# --- in the worker process ---


def _begin(folder: str) -> None:
    """Put the process's temporary files into a folder, and end with the campaign."""
    # Pebble's own handler exits with a code, which would not name the signal.
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    tempfile.tempdir = folder
    # The process waits for this thread when its pipe closes, so that the folder is removed.
    threading.Thread(target=_end_with_campaign, args=(folder,)).start()


def _end_with_campaign(folder: str) -> None:
    campaign = multiprocessing.parent_process()
    if campaign is not None:
        campaign.join()
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(0)


def _fly(fly: Fly, task: FlightTask, output: str) -> Line:
    """Return the line of a task; everything that is printed goes to the file `output`."""
    with Path(output).open("wb") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
    faulthandler.enable()
    try:
        return fly(task)
    except InputError as error:
        raise InputError(str(error)) from error  # not each of its classes travels
    except BaseException as error:  # noqa: BLE001 - a leaf may call sys.exit
        known = isinstance(error, UavBtError)
        reason = str(error) if known else f"{type(error).__name__}: {error}"
        return lost_line(task, reason, traceback.format_exc())
    finally:
        # Cycles hold a flown flight together, and the collector does not see how large it is.
        gc.collect()


def fly_task(task: FlightTask) -> Line:
    """Fly a flight in this process, and return its line.

    An InputError says that the flight was refused before anything flew.
    """
    keeper = PathKeeper()
    outputs = None if task.folder is None else Path(task.folder)
    if outputs is not None:
        shutil.rmtree(outputs, ignore_errors=True)  # of an interrupted one

    began_s = time.perf_counter()
    flight = reported(
        task.tree_path,
        task.options,
        out=outputs,
        listeners=[lambda _: [keeper]],
        controls=lambda _: ended_by_signals(),
    )
    # The objects of a flight in which no leaf wrote a file are in its line.
    if outputs is not None and outputs.is_dir():
        written = {file.name for file in outputs.iterdir()}
        if written.issubset(OBJECTS_FILES):
            shutil.rmtree(outputs)
    flight |= {"scene": task.scene, "tree": task.tree, "path": keeper.points}
    if task.options.exact_masks:
        flight["exact_masks"] = True
    flight["wall_s"] = round(time.perf_counter() - began_s, 3)
    return flight


def reported(tree: str, options: FlightOptions, **how: Any) -> Line:
    """Fly a mission as `app.fly` does, and return its report, also if an error ended the flight."""
    with tempfile.TemporaryDirectory(prefix="uav-bt-flight-") as folder:
        report = Path(folder) / "report.json"
        try:
            app.fly(tree, options, report=report, **how)
        except Exception:
            if not report.exists():  # nothing flew
                raise
        line: Line = json.loads(report.read_text(encoding="utf-8"))
        return line


class PathKeeper:
    """Keeps the referee's positions at 2 Hz: mission seconds, and x, y, z in world metres."""

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
