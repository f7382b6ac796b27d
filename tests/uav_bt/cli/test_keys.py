"""Keys while a mission flies: take over, hand back, land, cut the motors."""

from __future__ import annotations

import os
import pty
import sys
import termios
import threading

import pytest

from uav_bt.cli.keys import KEYS_HELP, obey, pilot_keys


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


def press(*keys: str) -> Noted:
    noted = Noted()
    for key in keys:
        obey(key, noted)  # type: ignore[arg-type]
    return noted


def test_m_takes_over_and_hands_back() -> None:
    assert press("m").manual
    assert not press("m", "m").manual


def test_l_lands_even_when_a_person_flies() -> None:
    noted = press("m", "l")
    assert not noted.manual
    assert noted.asked == ["land: a person pressed l"]


def test_only_a_capital_x_cuts_the_motors() -> None:
    assert press("x").asked == []
    assert press("X").asked == ["cut: a person cut the motors"]


@pytest.mark.parametrize("key", ["q", " ", "\n", "\x1b"])
def test_other_keys_do_nothing(key: str) -> None:
    noted = press(key)
    assert not noted.manual
    assert noted.asked == []


def test_without_a_terminal_there_are_no_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    with open(os.devnull, encoding="utf-8") as nothing:  # noqa: PTH123  (a device, not a path)
        monkeypatch.setattr(sys, "stdin", nothing)
        with pilot_keys(Noted()):  # type: ignore[arg-type]
            assert readers() == []


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


def test_a_closed_standard_input_has_no_keys(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Then Python's `sys.stdin` is None, as in `uav-bt fly tree.xml <&-`."""
    monkeypatch.setattr(sys, "stdin", None)
    with pilot_keys(Noted()):  # type: ignore[arg-type]
        pass
    assert KEYS_HELP not in capsys.readouterr().err
