"""Worker processes that fly, kept by Pebble: a crash or a hang costs one flight.

A flight runs native code (physics, graphics, networks). When that code dies it takes its process
along, and when it hangs only another process can stop it. Each worker flies one task after the
other, so that slow imports happen once.
"""

from __future__ import annotations

import faulthandler
import gc
import importlib
import itertools
import multiprocessing
import os
import shutil
import signal
import tempfile
import threading
import traceback
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, Future
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any, Final

from pebble import ProcessExpired, ProcessPool

from uav_bt.errors import InputError, UavBtError

FLOWN: Final = "flown"  # answer: the flight's line
REFUSED: Final = "refused"  # answer: why no task of this campaign can be flown
FAILED: Final = "failed"  # answer: the error that the flight ended with
Answer = dict[str, Any]

_OUTPUT_TAIL: Final = 4000  # characters of a lost process's output that are kept; chosen


class WorkerPool:
    """A number of worker processes, replaced when they end; each flies with MODULE:FUNCTION."""

    def __init__(self, function: str, workers: int) -> None:
        self._function = function
        self._folder = tempfile.TemporaryDirectory(prefix="uav-bt-workers-")
        self._pool = ProcessPool(
            workers,
            initializer=_begin,
            initargs=(self._folder.name,),
            # A forked copy of MuJoCo or of the graphics driver does not work.
            context=multiprocessing.get_context("spawn"),
        )
        self._numbers = itertools.count()
        self._flying: set[Future[Answer]] = set()

    def fly(self, task: Mapping[str, Any], timeout_s: float) -> Future[Answer]:
        """Fly a task of JSON values after those that wait; the answer has FLOWN, REFUSED or FAILED.

        The flight is stopped after `timeout_s` of wall time.
        """
        output = Path(self._folder.name) / f"output-{next(self._numbers)}.txt"
        answered: Future[Answer] = Future()

        def ended(flight: Future[Answer]) -> None:
            self._flying.discard(flight)
            answered.set_result(_answer_of(flight, output, timeout_s))

        # The first task starts the processes, which must ignore Ctrl-C: it is for the campaign. In
        # a flight it would land the drone, and the flight would count as flown.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            flight = self._pool.schedule(
                _fly, (self._function, dict(task), str(output)), timeout=timeout_s
            )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        self._flying.add(flight)
        flight.add_done_callback(ended)
        return answered

    def close(self) -> None:
        """Stop all workers at once and remove their files; what still flies answers FAILED."""
        self._pool.stop()  # type: ignore[no-untyped-call]
        for flight in tuple(self._flying):
            flight.cancel()
        self._pool.join()
        self._folder.cleanup()


def _answer_of(flight: Future[Answer], output: Path, timeout_s: float) -> Answer:
    try:
        return flight.result()
    except CancelledError:
        return {FAILED: "the campaign was stopped"}
    except BrokenProcessPool as error:
        return {
            REFUSED: f"the worker processes ended ({error}); a script that flies a campaign must "
            'call it below `if __name__ == "__main__":`, as each worker imports the script'
        }
    except TimeoutError:
        reason = f"no end after {timeout_s:g} s of wall time; its process was stopped"
    except ProcessExpired as error:
        reason = _exit_reason(error.exitcode)
    except BaseException as error:  # noqa: BLE001 - without an answer the campaign waits for ever
        reason = f"its answer was lost: {type(error).__name__}: {error}"
    finally:
        text = output.read_text("utf-8", "replace") if output.exists() else ""
        output.unlink(missing_ok=True)
    return {FAILED: reason, "details": text.strip()[-_OUTPUT_TAIL:]}


def _exit_reason(code: int) -> str:
    if code >= 0:
        return f"its process ended by itself, with exit code {code}"
    known = -code in set(signal.Signals)
    name = signal.Signals(-code).name if known else f"signal {-code}"
    hint = "; the system may have run out of memory" if -code == signal.SIGKILL else ""
    return f"its process was ended by {name}{hint}"


# --- in the worker process ------------------------------------------------------------------------


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


def _fly(function: str, task: dict[str, Any], output: str) -> Answer:
    """Return the answer to a task; everything that is printed goes to the file `output`."""
    descriptor = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(descriptor, 1)
    os.dup2(descriptor, 2)
    os.close(descriptor)
    faulthandler.enable()
    try:
        module, _, name = function.partition(":")
        fly: Callable[[dict[str, Any]], dict[str, Any]]
        fly = getattr(importlib.import_module(module), name)
        return {FLOWN: fly(task)}
    except InputError as error:
        return {REFUSED: str(error)}
    except BaseException as error:  # noqa: BLE001 - part of the answer; a leaf may call sys.exit
        known = isinstance(error, UavBtError)
        reason = str(error) if known else f"{type(error).__name__}: {error}"
        return {FAILED: reason, "details": traceback.format_exc()}
    finally:
        # Cycles hold a flown flight together, and the collector, which counts objects, does not
        # see how large its networks are.
        gc.collect()
