"""Outputs of a Rerun view: a file, Rerun's window, or a browser.

The viewer is a separate process that listens on loopback only; Rerun's default is all interfaces.
"""

from __future__ import annotations

import logging
import os
import socket
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Final, Generic, TypeVar

from uav_bt.errors import FileError, InputError, MissingDependencyError
from uav_bt.files import whole_file
from uav_bt.mission.tick import TickRecord
from uav_bt.plugins import need

if TYPE_CHECKING:
    import rerun as rr

T = TypeVar("T")

_LOG: Final = logging.getLogger(__name__)
_APPLICATION: Final = "uav_bt"
_LOOPBACK: Final = "127.0.0.1"
_FOOTER: Final = b"RRF2FOOT"  # in the last 32 bytes of a complete file
_FILE_S: Final = 120.0  # timeout of the last data to the disk, s
_FLUSH_S: Final = 20.0  # timeout of the last data to a viewer, which may be gone, s
WAITING_TICKS: Final = 32  # for a slow viewer; their frames need 22 MB at 640x360
# Ends a server when the standard input ends, which the system closes with this process.
_KEPT: Final = (
    "/bin/sh",
    "-c",
    'exec 3<&0; "$0" "$@" & server=$!; { cat <&3; kill $server; } & wait $server',
)


def need_display(instead: str) -> None:
    """Refuse to open a window on a machine without a display, with advice."""
    given = (os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    if sys.platform != "darwin" and not any(given):
        raise InputError(
            "there is no display to open a window on (DISPLAY and WAYLAND_DISPLAY are not set): "
            f"{instead}"
        )


@contextmanager
def saved(path: Path) -> Iterator[rr.RecordingStream]:
    """Write the drawings of the context into an rrd file, which appears complete or not at all."""
    need("view", "a view")
    import rerun as rr  # noqa: PLC0415 - an extra
    from rerun_bindings import flush_and_cleanup_orphaned_recordings  # noqa: PLC0415

    if path.suffix.lower() != ".rrd":
        raise FileError(path, "a view's name must end in .rrd")
    # Rerun ends the threads of an earlier file only in this call.
    flush_and_cleanup_orphaned_recordings()
    with whole_file(path) as partial:
        partial.touch()  # the system's error for a bad folder is clearer than Rerun's
        stream = rr.RecordingStream(_APPLICATION)
        stream.save(partial)
        yield stream
        try:
            stream.flush(timeout_sec=_FILE_S)
        except RuntimeError as error:  # Rerun's writer has failed
            raise FileError(path, f"cannot be written completely: {error}") from error
        finally:
            stream.disconnect()
        # Rerun's thread only logs that a disk is full.
        if _FOOTER not in partial.read_bytes()[-32:]:
            raise FileError(path, "could not be written completely; is the disk full?")


class Viewer:
    """The process of a viewer, in a window or for a browser, and the recording that it shows."""

    def __init__(self, *, web: bool) -> None:
        need("view", "a view")
        import rerun as rr  # noqa: PLC0415 - an extra

        self.port = _free_port()
        web_port = _free_port() if web else None
        address = f"rerun+http://{_LOOPBACK}:{self.port}/proxy"
        page = f"http://{_LOOPBACK}:{web_port}/?url={address.replace('+', '%2B')}"
        self.url = page if web else None
        self._process = subprocess.Popen(  # noqa: S603 - Rerun's own program
            # A server without a window would keep running if this process were killed.
            [*(_KEPT if web else ()), *viewer_command(self.port, web_port)],
            stdin=subprocess.PIPE if web else subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "CI": "true"},  # disables the usage reports of Rerun's viewer
            start_new_session=True,  # Ctrl-C lands the drone and must not close the window
        )
        self.stream = rr.RecordingStream(_APPLICATION)
        self.stream.connect_grpc(address)

    @property
    def closed(self) -> bool:
        """Whether the viewer has been closed."""
        return self._process.poll() is not None

    def wait(self) -> None:
        """Wait until the viewer is closed."""
        self._process.wait()

    def close(self) -> None:
        """Send the remaining data, and end a server; a window stays. Safe to call twice."""
        if not self.closed:
            with suppress(RuntimeError):  # the window has been closed
                self.stream.flush(timeout_sec=_FLUSH_S)
        self.stream.disconnect()
        if self._process.stdin is not None:
            self._process.stdin.close()
            self._process.wait()


@contextmanager
def shown(*, web: bool, instead: str) -> Iterator[Viewer]:
    """Open a viewer; a window needs a display and stays, a browser's view ends here."""
    if not web:
        need_display(instead)
    viewer = Viewer(web=web)
    try:
        yield viewer
    finally:
        viewer.close()


def viewer_command(port: int, web_port: int | None) -> list[str]:
    """Return the command that starts a viewer on loopback."""
    found = find_spec("rerun_cli")
    homes = found.submodule_search_locations if found is not None else None
    program = Path((homes or ["rerun_cli"])[0]) / "rerun"
    if not program.is_file():
        raise MissingDependencyError(
            f"Rerun's viewer is not at {program}: pip install --force-reinstall rerun-sdk"
        )
    command = [str(program), "--bind", _LOOPBACK, "--port", str(port)]
    if web_port is None:
        return [*command, "--hide-welcome-screen", "--expect-data-soon"]
    return [*command, "--serve-web", "--web-viewer-port", str(web_port)]


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((_LOOPBACK, 0))
        return int(probe.getsockname()[1])


class Background(Generic[T]):
    """A tick listener that draws in another thread; ticks that it cannot keep up with are dropped.

    `take` returns what is to be drawn of a tick, at once; `draw` draws it later. An error of
    `draw` is raised in a later tick.
    """

    def __init__(self, take: Callable[[TickRecord], T], draw: Callable[[T], None]) -> None:
        self._take = take
        self._draw = draw
        self._drawing = ThreadPoolExecutor(1, "view")
        self._waiting: deque[Future[None]] = deque()
        self.left_out = 0  # number of dropped ticks

    def on_tick(self, record: TickRecord) -> None:
        """Queue a tick."""
        while self._waiting and self._waiting[0].done():
            self._waiting.popleft().result()
        if len(self._waiting) < WAITING_TICKS:
            self._waiting.append(self._drawing.submit(self._draw, self._take(record)))
        else:
            self.left_out += 1

    def close(self) -> None:
        """Draw the queued ticks and stop; safe to call twice."""
        self._drawing.shutdown()
        if self.left_out:
            _LOG.warning("the view dropped %d ticks: this machine is too busy", self.left_out)
            self.left_out = 0
