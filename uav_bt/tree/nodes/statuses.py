"""Statuses by the names that tree files give them."""

from __future__ import annotations

from typing import Final

from uav_bt.tree.status import FAILURE, RUNNING, SKIPPED, SUCCESS, Status

__all__ = ["STATUSES", "STATUS_NAMES"]

STATUSES: Final[dict[str, Status]] = {
    "SUCCESS": SUCCESS,
    "FAILURE": FAILURE,
    "SKIPPED": SKIPPED,
    "RUNNING": RUNNING,
}
STATUS_NAMES: Final = tuple(STATUSES)
