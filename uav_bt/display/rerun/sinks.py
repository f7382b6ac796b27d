"""Outputs of a Rerun view: a file, Rerun's window, or a browser.

The viewer is a separate process that listens on loopback only; Rerun's default is all interfaces.
"""

from __future__ import annotations

import importlib.util
import os
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

from uav_bt.display.rerun.keeper import KEPT
from uav_bt.errors import FileError, InputError, MissingDependencyError, UavBtError
from uav_bt.files import whole_file
from uav_bt.plugins import need

if TYPE_CHECKING:
    import rerun as rr

_APPLICATION: Final = "uav_bt"
_LOOPBACK: Final = "127.0.0.1"
_FOOTER: Final = b"RRF2FOOT"  # marker near the end of a complete file
_END_BYTES: Final = 32
_FILE_S: Final = 120.0  # timeout of the last data to the disk, s
_FLUSH_S: Final = 20.0  # timeout of the last data to a viewer, which may be gone, s


def need_display(instead: str, environment: Mapping[str, str] | None = None) -> None:
    """Check that a window can be opened.

    Args:
        instead: advice for a machine without a display.
        environment: environment variables; None: those of this process.

    Raises:
        InputError: no display was found.
    """
    given = os.environ if environment is None else environment
    if not (sys.platform == "darwin" or given.get("DISPLAY") or given.get("WAYLAND_DISPLAY")):
        raise InputError(
            "there is no display to open a window on (DISPLAY and WAYLAND_DISPLAY are not set): "
            f"{instead}"
        )


@contextmanager
def saved(path: Path) -> Iterator[rr.RecordingStream]:
    """Write the drawings of the context into an rrd file, which appears complete or not at all.

    Args:
        path: path that ends in .rrd; an existing file is replaced by the complete new one.

    Raises:
        FileError: the file cannot be written.
        MissingDependencyError: Rerun is not installed.
    """
    need("view", "a view")
    import rerun as rr  # noqa: PLC0415 - an extra
    from rerun_bindings import flush_and_cleanup_orphaned_recordings  # noqa: PLC0415

    if path.suffix.lower() != ".rrd":
        raise FileError(path, "a view's name must end in .rrd")
    # Rerun ends the threads of unreferenced streams only in this call, which `rr.init` makes, too.
    # Here they are the threads of an earlier file.
    flush_and_cleanup_orphaned_recordings()
    with whole_file(path) as partial:
        partial.touch()  # the system's error for a bad folder is clearer than Rerun's
        stream = rr.RecordingStream(_APPLICATION)
        stream.save(partial)
        yield stream
        _finish(path, stream)
        _check_whole(path, partial)


def _finish(path: Path, stream: rr.RecordingStream) -> None:
    try:
        stream.flush(timeout_sec=_FILE_S)
    except RuntimeError as error:  # Rerun's writer has failed
        raise FileError(path, f"cannot be written completely: {error}") from error
    finally:
        stream.disconnect()


def _check_whole(path: Path, partial: Path) -> None:
    """Refuse a file that a full disk has truncated: Rerun's thread only logs that error."""
    with partial.open("rb") as file:
        file.seek(-min(_END_BYTES, partial.stat().st_size), os.SEEK_END)
        end = file.read()
    if _FOOTER not in end:
        raise FileError(path, "could not be written completely; is the disk full?")


class Viewer:
    """The process of a viewer, and the recording that it shows.

    Args:
        web: serve a browser instead of opening a window.
        port: port on which the viewer receives data; 0 selects a free one.
        web_port: port for the browser; 0 selects a free one.

    Raises:
        InputError: a port is taken.
        MissingDependencyError: Rerun is not installed.
        UavBtError: the viewer cannot be started.
    """

    def __init__(self, *, web: bool, port: int = 0, web_port: int = 0) -> None:
        need("view", "a view")
        import rerun as rr  # noqa: PLC0415 - an extra

        self.port = _free_port(port)
        self._web_port = _free_port(web_port) if web else None
        try:
            self._process = subprocess.Popen(  # noqa: S603 - Rerun's own program
                # A server without a window would keep running if this process were killed.
                [*(KEPT if web else ()), *viewer_command(self.port, self._web_port)],
                stdin=subprocess.PIPE if web else subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "CI": "true"},  # disables the usage reports of Rerun's viewer
                start_new_session=True,  # Ctrl-C lands the drone and must not close the window
            )
        except OSError as error:
            raise UavBtError(f"Rerun's viewer cannot be started: {error}") from error
        self.stream = rr.RecordingStream(_APPLICATION)
        self.stream.connect_grpc(self._address)

    @property
    def _address(self) -> str:
        return f"rerun+http://{_LOOPBACK}:{self.port}/proxy"

    @property
    def url(self) -> str | None:
        """The URL of the view on this machine; None for a window."""
        if self._web_port is None:
            return None
        return f"http://{_LOOPBACK}:{self._web_port}/?url={self._address.replace('+', '%2B')}"

    @property
    def closed(self) -> bool:
        """Whether the viewer has been closed."""
        return self._process.poll() is not None

    def wait(self) -> None:
        """Wait until the viewer is closed."""
        self._process.wait()

    def close(self, *, end: bool) -> None:
        """Send the remaining data; safe to call twice.

        Args:
            end: whether to end the viewer, too.
        """
        if self._process.poll() is None:
            with suppress(RuntimeError):  # the window has been closed
                self.stream.flush(timeout_sec=_FLUSH_S)
        self.stream.disconnect()
        if end and self._process.poll() is None:
            if self._process.stdin is None:
                self._process.terminate()
            else:
                self._process.stdin.close()  # the keeper ends it
            self._process.wait()


def viewer_command(port: int, web_port: int | None) -> list[str]:
    """Return the command that starts a viewer on loopback.

    Raises:
        MissingDependencyError: the program is not at its place in Rerun's wheel.
    """
    found = importlib.util.find_spec("rerun_cli")
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


def _free_port(port: int) -> int:
    """Return a port if it is free; 0 selects any free one.

    Raises:
        InputError: the port is taken.
    """
    with socket.socket() as probe:
        try:
            probe.bind((_LOOPBACK, port))
        except OSError as error:
            raise InputError(
                f"port {port} cannot be used ({error.strerror}); choose another one"
            ) from error
        return int(probe.getsockname()[1])
