"""One client's stream of RTP packets and its sender reports.

Source: RFC 3550, sections 5.1, 6.4.1, 6.5 and 6.6. As in Parrot's libvideo-streaming, the time of
the sender reports is the drone's monotonic clock, not the date: what a client computes from it is
comparable with the capture time in the frame's metadata.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from random import Random
from typing import Final

from sim_bridge.loopback.video.encoder import CLOCK_HZ, EncodedFrame
from sim_bridge.loopback.video.metadata import extension
from sim_bridge.loopback.video.packetizer import packetize

__all__ = ["MTU_BYTES", "PAYLOAD_TYPE", "Picture", "RtpStream", "picture"]

PAYLOAD_TYPE: Final = 96  # the only one that Parrot's receiver takes
MTU_BYTES: Final = 1400  # of a packet with its RTP header; Parrot's receiver wants less than 1500

_HEADER: Final = struct.Struct("!BBHII")
_VERSION: Final = 0x80
_EXTENDED: Final = 0x10
_MARKER: Final = 0x80
_SENDER_REPORT: Final = 200
_DESCRIPTION: Final = 202
_GOODBYE: Final = 203
_CNAME: Final = 1
_WORD: Final = 4


@dataclass(frozen=True, kw_only=True)
class Picture:
    """A picture ready to be sent: what is the same for all clients."""

    captured_s: float  # monotonic
    is_key: bool
    bodies: tuple[bytes, ...]  # packets without their RTP header; the first begins with `extension`
    payload_bytes: int


def picture(frame: EncodedFrame, metadata: bytes, captured_s: float) -> Picture:
    """Cut an encoded picture into packets, the metadata on the first.

    Args:
        frame: the picture.
        metadata: encoded `TimedMetadata`.
        captured_s: when it was captured, monotonic.
    """
    head = extension(metadata)
    room = MTU_BYTES - _HEADER.size
    payloads = packetize(frame.nals, room, first_limit_bytes=room - len(head))
    return Picture(
        captured_s=captured_s,
        is_key=frame.is_key,
        bodies=tuple(head + one if not at else one for at, one in enumerate(payloads)),
        payload_bytes=sum(len(one) for one in payloads),
    )


class RtpStream:
    """Numbers and stamps one client's packets.

    Args:
        random: where the stream begins; RFC 3550 wants it to be unpredictable.
        cname: the sender's name in the reports; Parrot's clients take it for the serial number.
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
        """The number that the next packet has."""
        return self._sequence

    def stamp(self, time_s: float) -> int:
        """Return the RTP time stamp of a monotonic time."""
        return (self._offset + round(time_s * CLOCK_HZ)) & 0xFFFF_FFFF

    def packets(self, shown: Picture) -> Iterator[bytes]:
        """Return the picture's packets; the last one has the marker."""
        stamp = self.stamp(shown.captured_s)
        last = len(shown.bodies) - 1
        for at, body in enumerate(shown.bodies):
            flags = _VERSION if at else _VERSION | _EXTENDED
            kind = PAYLOAD_TYPE | (_MARKER if at == last else 0)
            yield _HEADER.pack(flags, kind, self._sequence, stamp, self.ssrc) + body
            self._sequence = (self._sequence + 1) & 0xFFFF
        self._packets += len(shown.bodies)
        self._payload_bytes += shown.payload_bytes

    def report(self, now_s: float) -> bytes:
        """Return a sender report of this moment, with the sender's name.

        Args:
            now_s: monotonic.
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
        """Return a last report that says that nothing more will come."""
        return self.report(now_s) + _control(_GOODBYE, 1, self.ssrc.to_bytes(4, "big"))


def _control(kind: int, count: int, body: bytes) -> bytes:
    return struct.pack("!BBH", _VERSION | count, kind, len(body) // _WORD) + body
