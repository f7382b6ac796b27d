"""Outputs of a Rerun view: a file, Rerun's window, or a browser.

The viewer is a process that listens on loopback only; Rerun's default is all interfaces.
"""

from __future__ import annotations

import logging
import os
import socket
import subprocess
import sys
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from uav_bt.errors import FileError, InputError, MissingDependencyError
from uav_bt.files import whole_file
from uav_bt.mission.tick import TickRecord
from uav_bt.plugins import need

if TYPE_CHECKING:
    import rerun as rr

    from uav_bt.display.rerun.flight_view import FlightView

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


@contextmanager
def saved(path: Path) -> Iterator[rr.RecordingStream]:
    """Write what is drawn inside into an rrd file that appears complete or not at all."""
    need("view", "a view")
    import rerun as rr  # noqa: PLC0415 - an extra
    from rerun_bindings import flush_and_cleanup_orphaned_recordings  # noqa: PLC0415

    if path.suffix.lower() != ".rrd":
        raise FileError(path, "a view's name must end in .rrd")
    # Rerun ends the threads of an earlier file only in this call.
    flush_and_cleanup_orphaned_recordings()
    with whole_file(path) as partial:
        # Rerun hangs on a disk that takes nothing, and the system's errors are clearer.
        partial.write_bytes(bytes(4096))
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


class Viewer(NamedTuple):
    """A viewer's process and the recording that it shows."""

    process: subprocess.Popen[bytes]
    stream: rr.RecordingStream
    url: str | None  # of a browser's view

    @property
    def closed(self) -> bool:
        """Whether the viewer has been closed."""
        return self.process.poll() is not None


@contextmanager
def shown(*, web: bool, instead: str) -> Iterator[Viewer]:
    """Open a viewer; a window needs a display and stays, a browser's view ends here.

    The error about a missing display says what to do `instead`.
    """
    need("view", "a view")
    import rerun as rr  # noqa: PLC0415 - an extra

    displays = [os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")]
    if not web and sys.platform != "darwin" and not any(displays):
        raise InputError(
            "there is no display to open a window on (DISPLAY and WAYLAND_DISPLAY are not set): "
            f"{instead}"
        )
    port, web_port = _free_port(), _free_port()
    address = f"rerun+http://{_LOOPBACK}:{port}/proxy"
    page = f"http://{_LOOPBACK}:{web_port}/?url={address.replace('+', '%2B')}"
    process = subprocess.Popen(  # noqa: S603 - Rerun's own program
        # A server without a window would keep running if this process were killed.
        [*_KEPT, *viewer_command(port, web_port)] if web else viewer_command(port),
        stdin=subprocess.PIPE if web else subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "CI": "true"},  # disables the usage reports of Rerun's viewer
        start_new_session=True,  # Ctrl-C lands the drone and must not close the window
    )
    stream = rr.RecordingStream(_APPLICATION)
    stream.connect_grpc(address)
    viewer = Viewer(process, stream, page if web else None)
    try:
        yield viewer
    finally:
        if not viewer.closed:
            with suppress(RuntimeError):  # the window has been closed
                stream.flush(timeout_sec=_FLUSH_S)
        stream.disconnect()
        if process.stdin is not None:
            process.stdin.close()
            process.wait()


def viewer_command(port: int, web_port: int | None = None) -> list[str]:
    """Return the command that starts a viewer; `web_port` is for browsers."""
    found = find_spec("rerun_cli")
    if found is None or found.origin is None:
        raise MissingDependencyError(
            "Rerun's viewer is not installed: pip install --force-reinstall rerun-sdk"
        )
    program = Path(found.origin).with_name("rerun")
    command = [str(program), "--bind", _LOOPBACK, "--port", str(port)]
    if web_port is None:
        return [*command, "--hide-welcome-screen", "--expect-data-soon"]
    return [*command, "--serve-web", "--web-viewer-port", str(web_port)]


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((_LOOPBACK, 0))
        return int(probe.getsockname()[1])


class Background:
    """A tick listener that draws a view in another thread, and drops ticks if that is slow.

    An error of the drawing is raised in a later tick.
    """

    def __init__(self, view: FlightView) -> None:
        self._view = view
        self._drawing = ThreadPoolExecutor(1, "view")
        self._waiting: deque[Future[None]] = deque()
        self.left_out = 0  # number of dropped ticks

    def on_tick(self, record: TickRecord) -> None:
        """Queue a tick."""
        while self._waiting and self._waiting[0].done():
            self._waiting.popleft().result()
        if len(self._waiting) < WAITING_TICKS:
            self._waiting.append(self._drawing.submit(self._view.draw, self._view.take(record)))
        else:
            self.left_out += 1

    def close(self) -> None:
        """Draw the queued ticks and stop; safe to call twice."""
        self._drawing.shutdown()
        if self.left_out:
            _LOG.warning("the view dropped %d ticks: this machine is too busy", self.left_out)
            self.left_out = 0
