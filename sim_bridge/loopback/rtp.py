"""RTP packets of frames, numbered and stamped for each client, and sender reports.

Sources: RFC 3550, sections 5.1, 6.4.1, 6.5 and 6.6; for the payloads (single units and fragments
FU-A) RFC 6184, sections 5.6 and 5.8, packetization mode 1. As in Parrot's libvideo-streaming
(`vstrm_rtp_h264.h`), the first packet of a frame has a header extension with the frame's metadata:
a word with the indices of the last and the present part and the padding, an offset, and the
message, all big endian. The sender reports contain the drone's monotonic clock instead of the date.
A client can then compare their time with the capture time in the metadata.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from secrets import randbits
from typing import Final

from sim_bridge.loopback.encoder import CLOCK_HZ, is_key

PAYLOAD_TYPE: Final = 96  # the only type that Parrot's receiver accepts
MTU_BYTES: Final = 1400  # packet with RTP header; Parrot's receiver needs less than 1500
EXTENSION_ID: Final = 0x5062

_HEADER: Final = struct.Struct("!BBHII")
_VERSION: Final = 0x80
_EXTENDED: Final = 0x10
_MARKER: Final = 0x80
_SENDER_REPORT, _DESCRIPTION, _GOODBYE = 200, 202, 203
_CNAME: Final = 1
_FU_A: Final = 28
_FU_START, _FU_END = 0x80, 0x40


@dataclass(frozen=True, kw_only=True)
class FramePackets:
    """Packets of an encoded frame, identical for all clients."""

    captured_s: float  # capture time by the monotonic clock
    is_key: bool
    bodies: tuple[bytes, ...]  # packets without RTP header; the first begins with the extension
    payload_bytes: int


def packetize(nals: tuple[bytes, ...], metadata: bytes, captured_s: float) -> FramePackets:
    """Split an encoded frame into packets; the first carries the metadata.

    Args:
        nals: the NAL units of the frame.
        metadata: encoded `TimedMetadata`.
        captured_s: capture time by the monotonic clock, s.
    """
    padding = -len(metadata) % 4
    words = 1 + (len(metadata) + padding) // 4
    # There is one part: number 0, the last one, at offset 0.
    head = struct.pack("!HHHH", EXTENSION_ID, words, padding, 0) + metadata + bytes(padding)
    limit = MTU_BYTES - _HEADER.size
    payloads: list[bytes] = []
    for unit in nals:
        room = limit if payloads else limit - len(head)
        if len(unit) <= room:
            payloads.append(unit)
        else:
            payloads += _fragments(unit, room, limit)
    return FramePackets(
        captured_s=captured_s,
        is_key=is_key(nals),
        bodies=(head + payloads[0], *payloads[1:]),
        payload_bytes=sum(map(len, payloads)),
    )


def _fragments(unit: bytes, first_limit: int, limit: int) -> Iterator[bytes]:
    indicator = unit[0] & 0xE0 | _FU_A
    kind = unit[0] & 0x1F
    begin, room = 1, first_limit - 2
    while begin < len(unit):
        end = min(begin + room, len(unit))
        marks = (_FU_START if begin == 1 else 0) | (_FU_END if end == len(unit) else 0)
        yield bytes([indicator, marks | kind]) + unit[begin:end]
        begin, room = end, limit - 2


class RtpStream:
    """Numbers and stamps the packets of one client, from unpredictable numbers on (RFC 3550).

    Args:
        cname: name of the sender in reports; Parrot's clients use it as the serial number.
    """

    def __init__(self, cname: str) -> None:
        self.ssrc = randbits(32)
        self.next_sequence = randbits(16)
        self._offset = randbits(32)
        self._cname = cname.encode()[:255]
        self._packets = 0
        self._payload_bytes = 0

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
            yield _HEADER.pack(flags, kind, self.next_sequence, stamp, self.ssrc) + body
            self.next_sequence = (self.next_sequence + 1) & 0xFFFF
        self._packets += len(frame.bodies)
        self._payload_bytes += frame.payload_bytes

    def report(self, now_s: float) -> bytes:
        """Return a sender report with the sender's name, at a monotonic time."""
        ntp = round(now_s * (1 << 32))
        counts = (self._packets & 0xFFFF_FFFF, self._payload_bytes & 0xFFFF_FFFF)
        body = struct.pack("!IQIII", self.ssrc, ntp, self.stamp(now_s), *counts)
        chunk = struct.pack("!IBB", self.ssrc, _CNAME, len(self._cname)) + self._cname + b"\x00"
        chunk += bytes(-len(chunk) % 4)
        return _control(_SENDER_REPORT, 0, body) + _control(_DESCRIPTION, 1, chunk)

    def goodbye(self, now_s: float) -> bytes:
        """Return a last report and a BYE packet."""
        return self.report(now_s) + _control(_GOODBYE, 1, self.ssrc.to_bytes(4, "big"))


def _control(kind: int, count: int, body: bytes) -> bytes:
    return struct.pack("!BBH", _VERSION | count, kind, len(body) // 4) + body
