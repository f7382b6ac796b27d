"""Watch for edited files: dates and sizes are polled, then contents compared."""

from __future__ import annotations

import hashlib
import stat
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Final

_POLL_S: Final = 0.5  # wall time

_Stamp = tuple[int, int, int]


class FileWatch:
    """Notices that the content of files has changed. A missing file is awaited.

    Editors may write into the file, or write a new one and rename it.

    Args:
        contents: Present contents of the files, by path.
        timer: Wall clock, seconds.
    """

    def __init__(
        self, contents: Mapping[Path, bytes], *, timer: Callable[[], float] = time.monotonic
    ) -> None:
        self._timer = timer
        self._next_s = timer() + _POLL_S
        self.know(contents)

    def know(self, contents: Mapping[Path, bytes]) -> None:
        """Watch these files and no others, from these contents on."""
        self._digests = {path: hashlib.sha256(data).digest() for path, data in contents.items()}
        self._stamps: dict[Path, _Stamp] = {}

    def add(self, paths: Iterable[Path]) -> None:
        """Watch further files from their present content on. Unreadable files are skipped."""
        for path in paths:
            if path not in self._digests and (digest := _digest(path)) is not None:
                self._digests[path] = digest

    def changed(self) -> bool:
        """Return whether a file has another content than when this was last asked.

        Between two looks at the disk, half a second apart, nothing has changed.
        """
        now_s = self._timer()
        if now_s < self._next_s:
            return False
        self._next_s = now_s + _POLL_S
        # All files are checked: edits of several files count as one change.
        return sum(self._has_changed(path) for path in self._digests) > 0

    def _has_changed(self, path: Path) -> bool:
        stamp = _stamp(path)
        if stamp is None or stamp == self._stamps.get(path):
            return False
        digest = _digest(path)
        if digest is None:
            return False
        self._stamps[path] = stamp
        known, self._digests[path] = self._digests[path], digest
        return digest != known


def _stamp(path: Path) -> _Stamp | None:
    """Return date, size and inode of a file. None: there is no such file."""
    try:
        now = path.stat()
    except OSError:
        return None
    return (now.st_mtime_ns, now.st_size, now.st_ino) if stat.S_ISREG(now.st_mode) else None


def _digest(path: Path) -> bytes | None:
    """Return the hash of a file's content. None: there is no file to read."""
    if _stamp(path) is None:  # reading a pipe would block
        return None
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").digest()
    except OSError:
        return None
