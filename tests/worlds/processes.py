"""Our interpreter in a process of its own, and a full disk in this one."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).parents[2]
FULL_BYTES: Final = 64  # less than any file of ours has


@contextmanager
def full_disk() -> Iterator[None]:
    """Let no file of this process grow beyond some bytes: the system refuses each further one."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (FULL_BYTES, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def python(
    *arguments: object,
    folder: Path = ROOT,
    environment: Mapping[str, str] | None = None,
    **how: Any,
) -> subprocess.CompletedProcess[str]:
    """Run Python in a folder, with more variables of the environment, and return its outputs."""
    return subprocess.run(  # noqa: S603  # our own interpreter and arguments
        [sys.executable, *map(str, arguments)],
        cwd=folder,
        env={**os.environ, **(environment or {})},
        text=True,
        check=False,
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **how},
    )
