"""Standard output that cannot be written, such as a full disk behind `>`."""

from __future__ import annotations

import errno
import os
import sys
from typing import Final

import click

from uav_bt.errors import UavBtError

_OF_DISKS: Final = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})


def output_fault(error: Exception) -> UavBtError | None:
    """Return the error for a standard output that cannot be written; else None.

    Args:
        error: raised by a command.
    """
    # A file with a name has errors that name it.
    if not isinstance(error, OSError) or error.filename or error.errno not in _OF_DISKS:
        return None
    try:
        click.echo()  # a failed write leaves no other trace in the stream
    except OSError as fault:
        # Python flushes again when it exits, and must not fail then.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return UavBtError(f"standard output cannot be written: {fault.strerror or fault}")
    return None
