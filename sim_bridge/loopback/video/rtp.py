"""RTP packets of frames, numbered and stamped for each client, and sender reports.

Sources: RFC 3550, sections 5.1, 6.4.1, 6.5 and 6.6; for the payloads (single units, aggregates
STAP-A, fragments FU-A) RFC 6184, sections 5.6 to 5.8, packetization mode 1. As in Parrot's
libvideo-streaming, the sender reports contain the drone's monotonic clock instead of the date. A
client can then compare their time with the capture time in the metadata.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from random import Random
from typing import Final

from sim_bridge.loopback.video.encoder import CLOCK_HZ, EncodedFrame
from sim_bridge.loopback.video.frame import extension
from uav_bt.errors import ValueRangeError

PAYLOAD_TYPE: Final = 96  # the only type that Parrot's receiver accepts
MTU_BYTES: Final = 1400  # packet with RTP header; Parrot's receiver needs less than 1500

_HEADER: Final = struct.Struct("!BBHII")
_VERSION: Final = 0x80
_EXTENDED: Final = 0x10
_MARKER: Final = 0x80
_SENDER_REPORT: Final = 200
_DESCRIPTION: Final = 202
_GOODBYE: Final = 203
_CNAME: Final = 1
_WORD: Final = 4
MIN_PAYLOAD_BYTES: Final = 64  # smaller packets would be mostly header
_STAP_A: Final = 24
_FU_A: Final = 28
_FU_START: Final = 0x80
_FU_END: Final = 0x40
_NRI: Final = 0x60  # importance bits in a unit's first byte; an aggregate has the highest
_FORBIDDEN: Final = 0x80
_SIZE: Final = struct.Struct("!H")


@dataclass(frozen=True, kw_only=True)
class FramePackets:
    """Packets of an encoded frame, identical for all clients."""

    captured_s: float  # capture time by the monotonic clock
    is_key: bool
    bodies: tuple[bytes, ...]  # packets without RTP header; the first begins with `extension`
    payload_bytes: int

    @classmethod
    def of(cls, frame: EncodedFrame, metadata: bytes, captured_s: float) -> FramePackets:
        """Split an encoded frame into packets; the first carries the metadata.

        Args:
            frame: the frame.
            metadata: encoded `TimedMetadata`.
            captured_s: capture time by the monotonic clock, s.
        """
        head = extension(metadata)
        room = MTU_BYTES - _HEADER.size
        payloads = packetize(frame.nals, room, first_limit_bytes=room - len(head))
        return cls(
            captured_s=captured_s,
            is_key=frame.is_key,
            bodies=(head + payloads[0], *payloads[1:]),
            payload_bytes=sum(len(one) for one in payloads),
        )


class RtpStream:
    """Numbers and stamps the packets of one client.

    Args:
        random: source of the first numbers, which RFC 3550 requires to be unpredictable.
        cname: name of the sender in reports; Parrot's clients use it as the serial number.
    """

    def __init__(self, random: Random, cname: str) -> None:
        self.ssrc = random.getrandbits(32)
        self._sequence = random.getrandbits(16)
        self._offset = random.getrandbits(32)
        self._cname = cname.encode()[:255]
        self._packets = 0
        self._payload_bytes = 0

    @property
    def next_sequence(self) -> int:
        """The sequence number of the next packet."""
        return self._sequence

    def stamp(self, time_s: float) -> int:
        """Return the RTP timestamp of a monotonic time."""
        return (self._offset + round(time_s * CLOCK_HZ)) & 0xFFFF_FFFF

    def packets(self, frame: FramePackets) -> Iterator[bytes]:
        """Yield the packets of a frame; the last one has the marker."""
        stamp = self.stamp(frame.captured_s)
        last = len(frame.bodies) - 1
        for at, body in enumerate(frame.bodies):
            flags = _VERSION if at else _VERSION | _EXTENDED
            kind = PAYLOAD_TYPE | (_MARKER if at == last else 0)
            yield _HEADER.pack(flags, kind, self._sequence, stamp, self.ssrc) + body
            self._sequence = (self._sequence + 1) & 0xFFFF
        self._packets += len(frame.bodies)
        self._payload_bytes += frame.payload_bytes

    def report(self, now_s: float) -> bytes:
        """Return a sender report with the sender's name.

        Args:
            now_s: present time by the monotonic clock, s.
        """
        seconds = int(now_s)
        fraction = int((now_s - seconds) * (1 << 32))
        body = struct.pack(
            "!IIIIII",
            self.ssrc,
            seconds & 0xFFFF_FFFF,
            fraction,
            self.stamp(now_s),
            self._packets & 0xFFFF_FFFF,
            self._payload_bytes & 0xFFFF_FFFF,
        )
        item = bytes([_CNAME, len(self._cname)]) + self._cname + b"\x00"
        chunk = self.ssrc.to_bytes(4, "big") + item
        chunk += bytes(-len(chunk) % _WORD)
        return _control(_SENDER_REPORT, 0, body) + _control(_DESCRIPTION, 1, chunk)

    def goodbye(self, now_s: float) -> bytes:
        """Return a last report and a BYE packet."""
        return self.report(now_s) + _control(_GOODBYE, 1, self.ssrc.to_bytes(4, "big"))


def _control(kind: int, count: int, body: bytes) -> bytes:
    return struct.pack("!BBH", _VERSION | count, kind, len(body) // _WORD) + body


def packetize(
    nals: Sequence[bytes], limit_bytes: int, *, first_limit_bytes: int | None = None
) -> tuple[bytes, ...]:
    """Return the payloads that carry the NAL units of a frame, in order.

    Small neighbours are aggregated into one packet; a unit that is too large is fragmented.

    Args:
        nals: the units of one frame, not empty.
        limit_bytes: size limit of a payload.
        first_limit_bytes: size limit of the first payload, whose packet may carry an extension.

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
    waiting: list[bytes] = []  # units to aggregate

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
    importance = max(unit[0] & _NRI for unit in units)
    forbidden = max(unit[0] & _FORBIDDEN for unit in units)
    parts = [bytes([forbidden | importance | _STAP_A])]
    for unit in units:
        parts += (_SIZE.pack(len(unit)), unit)
    return b"".join(parts)


def _fragments(unit: bytes, first_limit: int, limit: int) -> Iterator[bytes]:
    indicator = unit[0] & (_FORBIDDEN | _NRI) | _FU_A
    kind = unit[0] & 0x1F
    begin, room = 1, first_limit - 2
    while begin < len(unit):
        end = min(begin + room, len(unit))
        marks = (_FU_START if begin == 1 else 0) | (_FU_END if end == len(unit) else 0)
        yield bytes([indicator, marks | kind]) + unit[begin:end]
        begin, room = end, limit - 2
