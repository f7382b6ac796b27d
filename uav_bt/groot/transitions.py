"""Status transitions, and the nine bytes that Groot2 and its log files have for each.

Facts from BehaviorTree.CPP's `groot2_publisher.cpp` and `bt_file_logger_v2.cpp`: six bytes of
microseconds, two of the node's uid, one of the status; little endian.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import Final, NamedTuple

from uav_bt.errors import ValueRangeError
from uav_bt.tree.status import Status

NEWLY_IDLE: Final = 10  # added to the status that a now idle node had before

# The time's lower four bytes and its upper two, then uid and status.
_RECORD: Final = struct.Struct("<IHHB")
RECORD_BYTES: Final = _RECORD.size
MAX_TIME_US: Final = (1 << 48) - 1  # almost nine years


class Transition(NamedTuple):
    """A node's status changed."""

    time_us: int  # microseconds of the mission clock, or since a log's beginning
    uid: int
    status: Status


def pack(transitions: Iterable[Transition], first_time_us: int = 0) -> bytes:
    """Return transitions as records, nine bytes each.

    Args:
        transitions: what happened.
        first_time_us: subtracted from the times.

    Raises:
        ValueRangeError: a time lies before the first or does not fit six bytes.
    """
    records = bytearray()
    for time_us, uid, status in transitions:
        since_us = time_us - first_time_us
        if not 0 <= since_us <= MAX_TIME_US:
            raise ValueRangeError(
                f"a transition's time must lie within 0 and {MAX_TIME_US} us after the log began, "
                f"got {since_us} us"
            )
        records += _RECORD.pack(since_us & 0xFFFFFFFF, since_us >> 32, uid, status.value)
    return bytes(records)


def unpack(record: bytes) -> Transition:
    """Return the transition of one record, its time since the log's beginning.

    Raises:
        ValueRangeError: it is not nine bytes long, or there is no such status.
    """
    if len(record) != RECORD_BYTES:
        raise ValueRangeError(f"a record has {RECORD_BYTES} bytes, got {len(record)}")
    low, high, uid, status = _RECORD.unpack(record)
    try:
        return Transition(high << 32 | low, uid, Status(status))
    except ValueError:
        raise ValueRangeError(f"a status is a number from 0 to 4, got {status}") from None
