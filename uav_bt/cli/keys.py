"""Keys of the person at the terminal: take over, hand back, land, cut the motors."""

from __future__ import annotations

import os
import select
import sys
import termios
import threading
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import click

from uav_bt.mission.runner import MissionRunner

KEYS_HELP: Final = (
    "keys: m takes over and hands back, l lands, X (shift) cuts the motors in flight, Ctrl-C lands"
)


def obey(key: str, runner: MissionRunner) -> None:
    """Carry out the action of a key; other keys do nothing.

    Args:
        key: one character.
        runner: of the mission that flies.
    """
    if key == "m":
        runner.manual = not runner.manual
    elif key == "l":
        runner.manual = False
        runner.abort.request("a person pressed l")
    elif key == "X":
        runner.abort.cut_motors("a person cut the motors")


@contextmanager
def pilot_keys(runner: MissionRunner) -> Iterator[None]:
    """Print the keys and obey them while a mission flies. Without a terminal this does nothing."""
    if sys.stdin is None or not sys.stdin.isatty():  # None: the standard input was closed
        yield
        return
    click.echo(KEYS_HELP, err=True)
    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    stop_read, stop_write = os.pipe()
    reader = threading.Thread(
        target=_read, args=(terminal, stop_read, runner), name="keys", daemon=True
    )
    try:
        tty.setcbreak(terminal)  # keys without Enter; Ctrl-C still is a signal
        reader.start()
        yield
    finally:
        os.write(stop_write, b".")
        reader.join()
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)
        os.close(stop_read)
        os.close(stop_write)


def _read(terminal: int, stop: int, runner: MissionRunner) -> None:
    while stop not in (ready := select.select([terminal, stop], [], [])[0]):
        if terminal in ready:
            pressed = os.read(terminal, 1)
            if not pressed:  # the terminal went away
                return
            obey(pressed.decode("latin-1"), runner)
