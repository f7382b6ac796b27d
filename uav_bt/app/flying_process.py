"""Signals and garbage collections while a mission flies."""

from __future__ import annotations

import gc
import signal
import threading
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from typing import Any, Final, NoReturn

from uav_bt.mission.runner import MissionRunner

# Ctrl-C, a request to stop, and a terminal or an ssh connection that went away.
_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def landing_on_signals(runner: MissionRunner) -> Iterator[None]:
    """Land on Ctrl-C, SIGTERM and SIGHUP; on a second one, do not wait for the landing.

    The report is written either way.
    """
    count, before = 0, dict[signal.Signals, Any]()

    def on_signal(number: int, _frame: object) -> None:
        nonlocal count
        count += 1
        runner.abort.request(f"stopped by {signal.Signals(number).name}")
        if count > 1:
            runner.abort.give_up()
            _restore(before)  # a third one ends a program that hangs

    with _handling(dict.fromkeys(_SIGNALS, on_signal), before):
        yield


def interruptible() -> AbstractContextManager[None]:
    """Raise KeyboardInterrupt on Ctrl-C and SIGTERM, inside `landing_on_signals`."""
    return _handling({signal.SIGINT: signal.default_int_handler, signal.SIGTERM: _interrupt})


def ended_by_signals() -> AbstractContextManager[None]:
    """End the process of a worker on SIGTERM and SIGHUP, inside `landing_on_signals`."""
    return _handling({signal.SIGTERM: signal.SIG_DFL, signal.SIGHUP: signal.SIG_DFL})


@contextmanager
def _handling(
    handlers: Mapping[signal.Signals, Any], before: dict[signal.Signals, Any] | None = None
) -> Iterator[None]:
    """Handle signals inside, but for ignored ones; `before` gets the former handlers.

    Python hands signals to the main thread only; elsewhere this does nothing.
    """
    before = {} if before is None else before
    if threading.current_thread() is threading.main_thread():
        for number, handler in handlers.items():
            if signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, handler)
    try:
        yield
    finally:
        _restore(before)


def _restore(handlers: Mapping[signal.Signals, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)


def _interrupt(number: int, _frame: object) -> NoReturn:
    raise KeyboardInterrupt(signal.Signals(number).name)


@contextmanager
def short_collections() -> Iterator[None]:
    """Keep garbage collections short: only objects made inside are searched.

    Objects of libraries and loaded networks live until the process ends. A full collection that
    searches them all stops every thread for more than a tenth of a second.
    """
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
