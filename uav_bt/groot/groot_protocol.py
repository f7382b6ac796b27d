"""Requests of Groot2 and their answers, as bytes.

Source: BehaviorTree.CPP's `groot2_protocol.h`. The first frame of a request is protocol (u8), type
(u8) and id (u32), little endian. The first frame of its answer is the same six bytes and the
16-byte id of the tree. The second frame holds the content. An error is answered by two frames: the
word `error` and the reason.
"""

from __future__ import annotations

import enum
import struct
from dataclasses import dataclass
from typing import Final
from uuid import UUID

from uav_bt.errors import InputError

PROTOCOL: Final = 2
DEFAULT_PORT: Final = 1667  # port of requests; the next port is for notifications

_HEADER: Final = struct.Struct("<BBI")
HEADER_BYTES: Final = _HEADER.size
_MAX_FRAMES: Final = 2


class RequestType(enum.Enum):
    """Type of a request."""

    FULL_TREE = "T"
    STATUS = "S"
    BLACKBOARD = "B"
    TOGGLE_RECORDING = "r"
    GET_TRANSITIONS = "t"
    HOOK_INSERT = "I"
    HOOK_REMOVE = "R"
    HOOKS_DUMP = "D"
    REMOVE_ALL_HOOKS = "A"
    DISABLE_ALL_HOOKS = "X"
    BREAKPOINT_UNLOCK = "U"
    BREAKPOINT_REACHED = "N"


class ProtocolError(InputError):
    """A request that cannot be answered; the message is the answer."""


@dataclass(frozen=True, kw_only=True)
class Request:
    """A well-formed request."""

    type: RequestType
    id: int  # id set by the client, repeated in the answer
    body: bytes | None  # the second frame

    def text(self) -> str:
        """Return the body as text.

        Raises:
            ProtocolError: the body is missing or is not text.
        """
        if self.body is None:
            raise ProtocolError("must be 2 parts message")
        try:
            return self.body.decode()
        except UnicodeDecodeError:
            raise ProtocolError("the second part must be UTF-8 text") from None

    def reply_header(self, tree_id: UUID) -> bytes:
        """Return the first frame of the answer."""
        return _HEADER.pack(PROTOCOL, ord(self.type.value), self.id) + tree_id.bytes


def parse_request(frames: list[bytes]) -> Request:
    """Parse the frames of a request.

    Raises:
        ProtocolError: the message is not a request of this protocol.
    """
    if not 1 <= len(frames) <= _MAX_FRAMES:
        raise ProtocolError(f"a request has 1 or {_MAX_FRAMES} parts, got {len(frames)}")
    if len(frames[0]) != HEADER_BYTES:
        raise ProtocolError(
            f"wrong request header: expected {HEADER_BYTES} bytes, got {len(frames[0])}"
        )
    protocol, kind, request_id = _HEADER.unpack(frames[0])
    if protocol != PROTOCOL:
        raise ProtocolError(f"expected protocol {PROTOCOL}, got {protocol}")
    try:
        request_type = RequestType(chr(kind))
    except ValueError:
        raise ProtocolError(f"request not recognized: type {kind}") from None
    return Request(type=request_type, id=request_id, body=frames[1] if len(frames) > 1 else None)


def error_reply(reason: str) -> list[bytes]:
    """Return the frames of an answer that contains only the reason of an error."""
    return [b"error", reason.encode(errors="replace")]
