"""Outputs of views: files are complete or absent, viewers listen on loopback only."""

from __future__ import annotations

import logging
import socket
import sys
import threading
import time
from pathlib import Path

import pytest

from tests.uav_bt.display.display_world import World
from tests.worlds.processes import python
from uav_bt.display.rerun import sinks
from uav_bt.errors import FileError, InputError, MissingDependencyError
from uav_bt.mission.tick import TickRecord


def test_a_file_appears_when_it_is_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "flight.rrd"
    with sinks.saved(path):
        assert not path.exists()
    assert path.read_bytes()[:4] == b"RRF2"
    monkeypatch.setattr(sinks, "_FOOTER", b"what a whole file would end with")
    with pytest.raises(FileError, match="is the disk full"), sinks.saved(tmp_path / "cut.rrd"):
        pass
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(("name", "words"), [("flight.mcap", ".rrd"), ("no/flight.rrd", "written")])
def test_a_file_that_cannot_be_is_refused(tmp_path: Path, name: str, words: str) -> None:
    with pytest.raises(FileError, match=words), sinks.saved(tmp_path / name):
        pass


@pytest.mark.parametrize("web_port", [None, 9090])
def test_viewers_listen_on_loopback_only(web_port: int | None) -> None:
    command = sinks.viewer_command(9876, web_port)
    assert command[command.index("--bind") + 1] == "127.0.0.1"
    assert command[command.index("--port") + 1] == "9876"
    assert ("--serve-web" in command) == (web_port is not None)
    assert Path(command[0]).is_file()


def test_files_leave_no_threads_behind(tmp_path: Path) -> None:
    """Each stream has threads; those of one file may end with the next file."""
    counts = []
    for number in range(6):
        with sinks.saved(tmp_path / f"{number}.rrd"):
            pass
        counts.append(len(list(Path("/proc/self/task").iterdir())))
    assert counts[5] <= counts[1]


KILLED = """
import os, signal, socket
from uav_bt.display.rerun import sinks
with sinks.shown(web=True, instead="") as viewer:
    print(viewer.url, flush=True)
    port = int(viewer.url.split("/?")[0].rpartition(":")[2])
    while True:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                break
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_server_ends_with_the_process_that_started_it() -> None:
    """SIGKILL leaves the process no time to end the server."""
    assert answers(port_of(python("-c", KILLED).stdout), False)


def answers(port: int, wanted: object) -> bool:
    """Return whether a port is open (or closed, as wanted) within a timeout."""
    until_s = time.monotonic() + 30.0
    while time.monotonic() < until_s:
        with socket.socket() as probe:
            if (probe.connect_ex(("127.0.0.1", port)) == 0) is wanted:
                return True
        time.sleep(0.1)
    return False


def port_of(url: str) -> int:
    """Return the port of a viewer's page."""
    return int(url.removeprefix("http://127.0.0.1:").partition("/")[0])


def test_closing_a_web_view_ends_its_server() -> None:
    with sinks.shown(web=True, instead="") as viewer:
        port = port_of(str(viewer.url))
        assert answers(port, True)
    assert viewer.closed
    assert answers(port, False)


def test_what_a_view_lacks_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sinks.sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(InputError, match="do that"), sinks.shown(web=False, instead="do that"):
        pass
    monkeypatch.setitem(sys.modules, "rerun", None)
    message = r"a view needs rerun; run `pip install .*\[view\]"
    with pytest.raises(MissingDependencyError, match=message), sinks.shown(web=True, instead=""):
        pass
    monkeypatch.setattr(sinks, "find_spec", lambda _: None)
    with pytest.raises(MissingDependencyError, match="rerun-sdk"):
        sinks.viewer_command(9876)


class SlowView:
    """A view that waits until a test lets it draw."""

    def __init__(self) -> None:
        self.seen: list[int] = []
        self.may_go_on = threading.Event()

    def take(self, record: TickRecord) -> int:
        return record.index

    def draw(self, index: int) -> None:
        assert self.may_go_on.wait(30.0)
        if index < 0:
            raise ValueError("the window is gone")
        self.seen.append(index)


def test_ticks_that_take_too_long_are_omitted_and_reported(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(sinks, "WAITING_TICKS", 3)
    view, world = SlowView(), World()
    background = sinks.Background(view)
    for _ in range(5):
        background.on_tick(world.tick())
    assert background.left_out == 2
    view.may_go_on.set()
    with caplog.at_level(logging.WARNING):
        background.close()
    background.close()
    assert view.seen == [0, 1, 2]
    assert caplog.text.count("dropped 2 ticks") == 1


def test_a_view_that_fails_is_an_error_of_a_later_tick() -> None:
    view, world = SlowView(), World()
    view.may_go_on.set()
    background = sinks.Background(view)
    background.on_tick(world.tick(index=-1))
    background.close()
    with pytest.raises(ValueError, match="the window is gone"):
        background.on_tick(world.tick())
