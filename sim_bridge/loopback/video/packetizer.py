"""NAL units as payloads of RTP packets: single units, aggregates (STAP-A), fragments (FU-A).

Source: RFC 6184, sections 5.6 to 5.8, packetization mode 1.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from typing import Final

from uav_bt.errors import ValueRangeError

__all__ = ["MIN_PAYLOAD_BYTES", "packetize"]

MIN_PAYLOAD_BYTES: Final = 64  # below, packets would be nearly all header

_STAP_A: Final = 24
_FU_A: Final = 28
_START: Final = 0x80
_END: Final = 0x40
_IMPORTANCE: Final = 0x60  # of a unit's first byte; an aggregate has the highest of its units
_FORBIDDEN: Final = 0x80
_SIZE: Final = struct.Struct("!H")


def packetize(
    nals: Sequence[bytes], limit_bytes: int, *, first_limit_bytes: int | None = None
) -> tuple[bytes, ...]:
    """Return the payloads that carry a picture's NAL units, in order.

    Neighbours that fit go into one packet; a unit that is too large is cut into pieces.

    Args:
        nals: the units of one picture, none of them empty.
        limit_bytes: the largest payload.
        first_limit_bytes: likewise, of the first packet, which may have to carry other things.

    Raises:
        ValueRangeError: a limit is too small, or a unit is empty.
    """
    first_limit = limit_bytes if first_limit_bytes is None else first_limit_bytes
    if min(limit_bytes, first_limit) < MIN_PAYLOAD_BYTES:
        raise ValueRangeError(
            f"a payload needs room for {MIN_PAYLOAD_BYTES} bytes at least, got "
            f"{min(limit_bytes, first_limit)}"
        )
    if not all(nals):
        raise ValueRangeError("a NAL unit has at least one byte, got none")
    payloads: list[bytes] = []
    waiting: list[bytes] = []  # units that go together so far

    def room() -> int:
        return limit_bytes if payloads else first_limit

    def flush() -> None:
        if waiting:
            payloads.append(waiting[0] if len(waiting) == 1 else _aggregate(waiting))
            waiting.clear()

    for unit in nals:
        if waiting and _aggregate_bytes([*waiting, unit]) > room():
            flush()
        if waiting or len(unit) <= room():
            waiting.append(unit)
        else:
            payloads += _fragments(unit, room(), limit_bytes)
    flush()
    return tuple(payloads)


def _aggregate_bytes(units: Sequence[bytes]) -> int:
    return 1 + sum(_SIZE.size + len(unit) for unit in units)


def _aggregate(units: Sequence[bytes]) -> bytes:
    importance = max(unit[0] & _IMPORTANCE for unit in units)
    forbidden = max(unit[0] & _FORBIDDEN for unit in units)
    parts = [bytes([forbidden | importance | _STAP_A])]
    for unit in units:
        parts += (_SIZE.pack(len(unit)), unit)
    return b"".join(parts)


def _fragments(unit: bytes, first_limit: int, limit: int) -> Iterator[bytes]:
    indicator = unit[0] & (_FORBIDDEN | _IMPORTANCE) | _FU_A
    kind = unit[0] & 0x1F
    begin, room = 1, first_limit - 2
    while begin < len(unit):
        end = min(begin + room, len(unit))
        marks = (_START if begin == 1 else 0) | (_END if end == len(unit) else 0)
        yield bytes([indicator, marks | kind]) + unit[begin:end]
        begin, room = end, limit - 2
