"""Ctrl-C and SIGTERM: while modules are imported they end the process, then they interrupt it."""

from __future__ import annotations

import os
import signal
from types import FrameType
from typing import Final, NoReturn

_ENDING: Final = (signal.SIGINT, signal.SIGTERM)


def end_at_once() -> None:
    """Let Ctrl-C and SIGTERM end this process with a line: nothing is begun, or all is done.

    An exception in the middle of an import would show a traceback of somebody's module.
    """
    for number in _ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _end)


def let_work_clean_up() -> None:
    """Let Ctrl-C and SIGTERM raise KeyboardInterrupt where they would have ended this process."""
    for number, handler in ((signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, _stop)):
        if signal.getsignal(number) is _end:
            signal.signal(number, handler)


def stopped_by(interrupt: KeyboardInterrupt) -> str:
    """Return what stopped the work, for a message."""
    return f"stopped by {str(interrupt) or 'Ctrl-C'}"


def _end(number: int, frame: FrameType | None) -> NoReturn:
    del frame
    name = "" if number == signal.SIGINT else signal.Signals(number).name
    os.write(2, f"Error: {stopped_by(KeyboardInterrupt(name))}\n".encode())
    os._exit(1)


def _stop(number: int, frame: FrameType | None) -> NoReturn:
    del frame
    raise KeyboardInterrupt(signal.Signals(number).name)
