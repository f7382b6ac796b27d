"""Where a view goes: into a file, into Rerun's own window, or into a browser. Loopback only.

The viewer is a process of its own, which listens on loopback: Rerun's default is every interface.
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
_FOOTER: Final = b"RRF2FOOT"  # near the end of a whole file
_END_BYTES: Final = 32
_FILE_S: Final = 120.0  # for what is still on its way to the disk
_FLUSH_S: Final = 20.0  # for what is still on its way to a viewer that may be gone


def need_display(instead: str, environment: Mapping[str, str] | None = None) -> None:
    """Make sure that a window can open here.

    Args:
        instead: what to do without a display.
        environment: the process's, if it is another one than ours.

    Raises:
        InputError: it cannot.
    """
    given = os.environ if environment is None else environment
    if not (sys.platform == "darwin" or given.get("DISPLAY") or given.get("WAYLAND_DISPLAY")):
        raise InputError(
            "there is no display to open a window on (DISPLAY and WAYLAND_DISPLAY are not set): "
            f"{instead}"
        )


@contextmanager
def saved(path: Path) -> Iterator[rr.RecordingStream]:
    """Write what is drawn inside into an rrd file; it appears whole or not at all.

    Args:
        path: ends in .rrd; an existing file is replaced when the new one is whole.

    Raises:
        FileError: the file cannot be written.
        MissingDependencyError: Rerun is not installed.
    """
    need("view", "rerun", what="a view")
    import rerun as rr  # noqa: PLC0415 - only views need it
    from rerun_bindings import flush_and_cleanup_orphaned_recordings  # noqa: PLC0415

    if path.suffix.lower() != ".rrd":
        raise FileError(path, "a view's name must end in .rrd")
    # The threads of a stream that nobody has any more end when Rerun is asked to look, as `rr.init`
    # does it: here those of the file before.
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
    except RuntimeError as error:  # what Rerun raises when its writer gave up
        raise FileError(path, f"cannot be written to the end: {error}") from error
    finally:
        stream.disconnect()


def _check_whole(path: Path, partial: Path) -> None:
    """Refuse a file that a full disk cut short: Rerun writes in a thread and only logs that."""
    with partial.open("rb") as file:
        file.seek(-min(_END_BYTES, partial.stat().st_size), os.SEEK_END)
        end = file.read()
    if _FOOTER not in end:
        raise FileError(path, "could not be written to the end; is the disk full?")


class Viewer:
    """A viewer's process, and the recording that it shows.

    Args:
        web: serve a browser instead of opening a window.
        port: where the viewer receives; 0 for any that is free.
        web_port: where the browser finds it; 0 for any that is free.

    Raises:
        InputError: a port is taken.
        MissingDependencyError: Rerun is not installed.
        UavBtError: the viewer cannot be started.
    """

    def __init__(self, *, web: bool, port: int = 0, web_port: int = 0) -> None:
        need("view", "rerun", what="a view")
        import rerun as rr  # noqa: PLC0415 - only views need it

        self.port = _free_port(port)
        self._web_port = _free_port(web_port) if web else None
        try:
            self._process = subprocess.Popen(  # noqa: S603 - Rerun's own program
                # A server without a window would be forgotten if this process were killed.
                [*(KEPT if web else ()), *viewer_command(self.port, self._web_port)],
                stdin=subprocess.PIPE if web else subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "CI": "true"},  # where Rerun's viewer does not report its use
                start_new_session=True,  # Ctrl-C lands the drone; it must not close the window
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
        """Where a browser on this machine finds the view; None for a window."""
        if self._web_port is None:
            return None
        return f"http://{_LOOPBACK}:{self._web_port}/?url={self._address.replace('+', '%2B')}"

    @property
    def closed(self) -> bool:
        """Whether the viewer was closed."""
        return self._process.poll() is not None

    def wait(self) -> None:
        """Return when the viewer was closed."""
        self._process.wait()

    def close(self, *, end: bool) -> None:
        """Hand over what is still on its way; safe to call twice.

        Args:
            end: end the viewer, too.
        """
        if self._process.poll() is None:
            with suppress(RuntimeError):  # the window was closed
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
        MissingDependencyError: Rerun's program is not where its wheel puts it.
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
    """Return a port that is free; 0 asks for any.

    Raises:
        InputError: it is taken.
    """
    with socket.socket() as probe:
        try:
            probe.bind((_LOOPBACK, port))
        except OSError as error:
            raise InputError(
                f"port {port} cannot be used ({error.strerror}); name another"
            ) from error
        return int(probe.getsockname()[1])
