"""The process that flies: tasks come in as lines of JSON, answers go out as lines of JSON.

    python -m uav_bt.campaign.worker_process MODULE:FUNCTION FOLDER

Its temporary files go into the folder, which is removed by what started it, or by itself when that
is gone.

It flies one task after the other, so that what is slow to import is imported once. Whatever goes
wrong in it, a crash included, costs one flight and nothing else.
"""

from __future__ import annotations

import faulthandler
import gc
import importlib
import json
import os
import queue
import shutil
import sys
import tempfile
import threading
import traceback
from collections.abc import Callable
from typing import Any, Final

from uav_bt.errors import InputError, UavBtError

FLOWN: Final = "flown"  # answer: the flight's line
REFUSED: Final = "refused"  # answer: why the task cannot be flown, nor any like it
FAILED: Final = "failed"  # answer: what was raised

FlyFunction = Callable[[dict[str, Any]], dict[str, Any]]


def _answer(fly: FlyFunction, task: dict[str, Any]) -> dict[str, Any]:
    try:
        return {FLOWN: fly(task)}
    except InputError as error:
        return {REFUSED: str(error)}
    except Exception as error:  # noqa: BLE001 - part of the answer
        known = isinstance(error, UavBtError)
        reason = str(error) if known else f"{type(error).__name__}: {error}"
        return {FAILED: reason, "details": traceback.format_exc()}


def _read(requests: queue.Queue[str], temporary: str) -> None:
    for line in sys.stdin:
        requests.put(line)
    # The campaign is gone: no one waits for the flight that may be under way.
    shutil.rmtree(temporary, ignore_errors=True)
    os._exit(0)


def main(name: str, temporary: str) -> None:
    """Answer tasks until the standard input ends.

    Args:
        name: MODULE:FUNCTION of what flies a task.
        temporary: the folder of its temporary files.
    """
    faulthandler.enable()
    tempfile.tempdir = temporary
    # What libraries print must not get among the answers.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    requests: queue.Queue[str] = queue.Queue()
    threading.Thread(target=_read, args=(requests, temporary), daemon=True).start()
    module, _, function = name.partition(":")
    fly: FlyFunction = getattr(importlib.import_module(module), function)
    while True:
        answers.write(json.dumps(_answer(fly, json.loads(requests.get()))) + "\n")
        answers.flush()
        # A flown flight is held together by cycles, and the collector, which counts objects, does
        # not see how large its networks are.
        gc.collect()


if __name__ == "__main__":
    main(*sys.argv[1:])
