"""Keys while a mission flies: take over, hand back, land, cut the motors."""

from __future__ import annotations

import os
import pty
import sys
import termios
import threading

import pytest

from uav_bt.cli.fly import KEYS_HELP, obey, pilot_keys


class Noted:
    """A runner that records its requests."""

    def __init__(self) -> None:
        self._manual = False
        self.asked: list[str] = []
        self.pressed = threading.Event()
        self.abort = self

    @property
    def manual(self) -> bool:
        return self._manual

    @manual.setter
    def manual(self, manual: bool) -> None:
        self._manual = manual
        self.pressed.set()

    def request(self, reason: str) -> None:
        self.asked.append(f"land: {reason}")

    def cut_motors(self, reason: str) -> None:
        self.asked.append(f"cut: {reason}")


def readers() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "keys"]


@pytest.mark.parametrize(
    ("keys", "manual", "asked"),
    [
        ("m", True, []),
        ("mm", False, []),
        ("ml", False, ["land: a person pressed l"]),  # even when a person flies
        ("X", False, ["cut: a person cut the motors"]),  # a capital only
        ("xq \n\x1b", False, []),
    ],
)
def test_each_key_has_its_action_and_others_do_nothing(
    keys: str, asked: list[str], *, manual: bool
) -> None:
    noted = Noted()
    for key in keys:
        obey(key, noted)  # type: ignore[arg-type]
    assert (noted.manual, noted.asked) == (manual, asked)


@pytest.mark.parametrize("closed", [True, False])
def test_without_a_terminal_there_are_no_keys(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *, closed: bool
) -> None:
    """Python's `sys.stdin` is None after `uav-bt fly tree.xml <&-`."""
    with open(os.devnull, encoding="utf-8") as nothing:  # noqa: PTH123  (a device, not a path)
        monkeypatch.setattr(sys, "stdin", None if closed else nothing)
        with pilot_keys(Noted()):  # type: ignore[arg-type]
            assert readers() == []
    assert KEYS_HELP not in capsys.readouterr().err


def test_a_key_at_a_terminal_counts_and_reader_and_terminal_are_as_before(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ours, theirs = pty.openpty()
    noted = Noted()
    with os.fdopen(theirs, "r", encoding="utf-8") as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        before = termios.tcgetattr(terminal.fileno())
        with pilot_keys(noted):  # type: ignore[arg-type]
            assert termios.tcgetattr(terminal.fileno()) != before
            os.write(ours, b"m")
            assert noted.pressed.wait(30.0)
            (reader,) = readers()
        assert not reader.is_alive()
        assert termios.tcgetattr(terminal.fileno()) == before
    os.close(ours)
    assert noted.manual
    assert capsys.readouterr().err == f"{KEYS_HELP}\n"
