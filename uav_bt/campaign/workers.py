"""Worker processes that fly, watched from outside: a crash or a hang costs one flight.

A flight runs native code (physics, graphics, networks); when that dies it takes its process along,
and when it hangs nothing inside can stop it. So each flight has a process that may end. What
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

_STDERR_TAIL: Final = 4000  # characters of what an ended process wrote to its standard error
_STOPPED: Final = "the campaign was stopped"
_CHUNK: Final = 65536
_EXIT_S: Final = 10.0  # a core dump may come between the end of the pipe and that of the process


class Worker:
    """One process that flies one task after the other, and is replaced when it has ended.

    Args:
        function: MODULE:FUNCTION that takes a task and returns the flight's line.
    """

    def __init__(self, function: str) -> None:
        self._function = function
        self._process: subprocess.Popen[bytes] | None = None
        self._stopped = False
        self._lock = threading.Lock()  # a process is not started while it is being stopped
        self._temporary = tempfile.TemporaryDirectory(prefix="uav-bt-worker-")
        self._stderr = tempfile.TemporaryFile("w+b")  # noqa: SIM115 - closed with the worker

    def fly(self, task: Mapping[str, Any], timeout_s: float) -> dict[str, Any]:
        """Return the answer of the worker process to a task, or what became of it."""
        process = self._running()
        if process is None:
            return {FAILED: _STOPPED}
        self._stderr.truncate(0)
        try:
            return self._ask(process, json.dumps(task).encode() + b"\n", timeout_s)
        except TimeoutError:
            self._discard()
            reason = f"no end after {timeout_s:g} s of wall time; its process was stopped"
        except EOFError:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(_EXIT_S)
            self._discard()
            reason = _exit_reason(process.returncode)
        except BaseException:
            self._discard()
            raise
        return {FAILED: reason, "details": self._stderr_tail()}

    def stop(self) -> None:
        """End the process for good; called by other threads while one waits for an answer."""
        with self._lock:
            self._stopped = True
            self._kill()

    def close(self) -> None:
        """End the process and close its files; safe to call twice."""
        self.stop()
        self._discard()
        self._stderr.close()
        self._temporary.cleanup()

    def _running(self) -> subprocess.Popen[bytes] | None:
        """Return the process, a new one if need be; None once it was stopped."""
        if self._process is not None and self._process.poll() is not None:
            self._discard()
        with self._lock:
            if self._process is None and not self._stopped:
                self._process = self._started()
            return self._process

    def _started(self) -> subprocess.Popen[bytes]:
        return subprocess.Popen(  # noqa: S603 - our own interpreter and module
            [
                *(sys.executable, "-m", "uav_bt.campaign.worker_process", self._function),
                self._temporary.name,
            ],
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

    def _discard(self) -> None:
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

    def _stderr_tail(self) -> str:
        self._stderr.seek(0)
        return self._stderr.read().decode("utf-8", "replace").strip()[-_STDERR_TAIL:]


def _exit_reason(code: int | None) -> str:
    if code is not None and code < 0:
        try:
            name = signal.Signals(-code).name
        except ValueError:
            name = f"signal {-code}"
        hint = "; the system may have run out of memory" if -code == signal.SIGKILL else ""
        return f"its process was ended by {name}{hint}"
    return f"its process ended by itself, with exit code {code}"


class WorkerPool:
    """Worker processes, taken by threads that have a task, and idle between.

    Args:
        function: MODULE:FUNCTION that takes a task and returns the flight's line.
    """

    def __init__(self, function: str) -> None:
        self._function = function
        self._idle: list[Worker] = []
        self._busy: list[Worker] = []
        self._closed = False
        self._lock = threading.Lock()

    def fly(self, task: Mapping[str, Any], timeout_s: float) -> dict[str, Any]:
        """Return the answer to a task, from an idle worker or a new one."""
        with self._lock:
            if self._closed:
                return {FAILED: _STOPPED}
            worker = self._idle.pop() if self._idle else Worker(self._function)
            self._busy.append(worker)
        try:
            return worker.fly(task, timeout_s)
        finally:
            with self._lock:
                self._busy.remove(worker)
                if self._closed:
                    worker.close()
                else:
                    self._idle.append(worker)

    @property
    def flying(self) -> int:
        """How many of them are at work."""
        return len(self._busy)

    def close(self) -> None:
        """Stop them all, those that fly as well."""
        with self._lock:
            self._closed = True
            for worker in self._busy:
                worker.stop()  # the thread that waits for it closes it
            for worker in self._idle:
                worker.close()
            self._idle.clear()
