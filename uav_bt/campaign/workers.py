"""Pilots: processes that fly, watched from outside, so that no crash and no hang goes further.

A flight runs native code (physics, graphics, networks); when that dies it takes its process along,
and when it hangs nothing inside can stop it. So each flight has a process that may be lost. What
watches it needs a thread only, and looks the same on this machine and on a cluster's.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Mapping
from typing import Any, Final

from uav_bt.campaign.worker_process import FAILED

_LAST_WORDS: Final = 4000  # characters of what a dead process wrote to its standard error stream
_STOPPED: Final = "the campaign was stopped"
_CHUNK: Final = 65536
_DYING_S: Final = 10.0  # a core dump may come between the end of the pipe and that of the process


class Pilot:
    """One process that flies one task after the other, and is replaced when it is lost.

    Args:
        function: MODULE:FUNCTION that takes a task and returns the flight's line.
    """

    def __init__(self, function: str) -> None:
        self._function = function
        self._process: subprocess.Popen[bytes] | None = None
        self._stopped = False
        self._lock = threading.Lock()  # a process is not started while it is being stopped
        self._stderr = tempfile.TemporaryFile("w+b")  # noqa: SIM115 - closed with the pilot

    def fly(self, task: Mapping[str, Any], timeout_s: float) -> dict[str, Any]:
        """Return the answer of the worker process to a task, or what became of it."""
        process = self._running()
        if process is None:
            return {FAILED: _STOPPED}
        self._stderr.truncate(0)
        try:
            return self._ask(process, json.dumps(task).encode() + b"\n", timeout_s)
        except TimeoutError:
            self._lose()
            reason = f"no end after {timeout_s:g} s of wall time; its process was stopped"
        except EOFError:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(_DYING_S)
            self._lose()
            reason = _obituary(process.returncode)
        except BaseException:
            self._lose()
            raise
        return {FAILED: reason, "details": self._last_words()}

    def stop(self) -> None:
        """End the process for good; for other threads, while one waits for an answer."""
        with self._lock:
            self._stopped = True
            self._kill()

    def close(self) -> None:
        """End the process and let go of everything; safe to call twice."""
        self.stop()
        self._lose()
        self._stderr.close()

    def _running(self) -> subprocess.Popen[bytes] | None:
        """Return the process, a new one if need be; None once it was stopped."""
        if self._process is not None and self._process.poll() is not None:
            self._lose()
        with self._lock:
            if self._process is None and not self._stopped:
                self._process = self._started()
            return self._process

    def _started(self) -> subprocess.Popen[bytes]:
        return subprocess.Popen(  # noqa: S603 - our own interpreter and module
            [sys.executable, "-m", "uav_bt.campaign.worker_process", self._function],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._stderr,
            # It must find what this process finds, also where a script added to the path.
            env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            # Ctrl-C is for the campaign: here it would land the drone, which counts as flown.
            start_new_session=True,
        )

    def _kill(self) -> None:
        process = self._process
        if process is not None and process.poll() is None:
            # It leads a session of its own, so that what it may have started goes with it.
            os.killpg(process.pid, signal.SIGKILL)

    @staticmethod
    def _ask(process: subprocess.Popen[bytes], request: bytes, timeout_s: float) -> dict[str, Any]:
        """Return the answer.

        Raises:
            TimeoutError: there was none in time.
            EOFError: the process ended, or is about to.
        """
        stdin, stdout = process.stdin, process.stdout
        if stdin is None or stdout is None:
            raise EOFError
        try:
            stdin.write(request)
            stdin.flush()
        except BrokenPipeError as error:
            raise EOFError from error
        data = b""
        deadline_s = time.monotonic() + timeout_s
        while not data.endswith(b"\n"):
            left_s = deadline_s - time.monotonic()
            if left_s <= 0.0 or not select.select([stdout], [], [], left_s)[0]:
                raise TimeoutError
            chunk = os.read(stdout.fileno(), _CHUNK)
            if not chunk:
                raise EOFError
            data += chunk
        answer: dict[str, Any] = json.loads(data)
        return answer

    def _lose(self) -> None:
        with self._lock:
            self._kill()
            process, self._process = self._process, None
        if process is None:
            return
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with contextlib.suppress(BrokenPipeError):  # what was still to be sent
                    pipe.close()

    def _last_words(self) -> str:
        self._stderr.seek(0)
        return self._stderr.read().decode("utf-8", "replace").strip()[-_LAST_WORDS:]


def _obituary(code: int | None) -> str:
    if code is not None and code < 0:
        try:
            name = signal.Signals(-code).name
        except ValueError:
            name = f"signal {-code}"
        hint = "; the system may have run out of memory" if -code == signal.SIGKILL else ""
        return f"its process was ended by {name}{hint}"
    return f"its process ended by itself, with exit code {code}"


class Pilots:
    """Idle pilots, to be taken by whichever thread has a task.

    Args:
        function: MODULE:FUNCTION that takes a task and returns the flight's line.
    """

    def __init__(self, function: str) -> None:
        self._function = function
        self._idle: list[Pilot] = []
        self._busy: list[Pilot] = []
        self._closed = False
        self._lock = threading.Lock()

    def fly(self, task: Mapping[str, Any], timeout_s: float) -> dict[str, Any]:
        """Return the answer to a task, from an idle pilot or a new one."""
        with self._lock:
            if self._closed:
                return {FAILED: _STOPPED}
            pilot = self._idle.pop() if self._idle else Pilot(self._function)
            self._busy.append(pilot)
        try:
            return pilot.fly(task, timeout_s)
        finally:
            with self._lock:
                self._busy.remove(pilot)
                if self._closed:
                    pilot.close()
                else:
                    self._idle.append(pilot)

    @property
    def flying(self) -> int:
        """How many of them are at work."""
        return len(self._busy)

    def close(self) -> None:
        """Stop them all, those that fly as well."""
        with self._lock:
            self._closed = True
            for pilot in self._busy:
                pilot.stop()  # the thread that waits for it closes it
            for pilot in self._idle:
                pilot.close()
            self._idle.clear()
