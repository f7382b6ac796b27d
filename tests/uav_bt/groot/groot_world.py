"""Helpers of the Groot tests: trees of scripted leaves, and a Groot2 client.

The client is written from the protocol's specification and shares no code with the publisher.
"""

from __future__ import annotations

import socket
import struct
from contextlib import suppress
from pathlib import Path
from typing import Any, Self
from xml.etree import ElementTree as ET

import msgpack
import zmq

from tests.conformance import REGISTRY
from tests.worlds.trees import document
from uav_bt.board.blackboard import Blackboard, Key
from uav_bt.board.context import MissionContext
from uav_bt.clock import ManualClock
from uav_bt.tree import MissionTree, Status, parse_tree

HEIGHT = Key("height_m", float, "a height")


def make_tree(body: str, *more: str) -> MissionTree:
    """Return a tree from the XML of its root node, not set up; `more` are further trees."""
    return parse_tree(document(body, *more), REGISTRY)


def make_context(clock: ManualClock | None = None) -> MissionContext:
    """Return a mission context with an almost empty board."""
    clock = clock or ManualClock()
    return MissionContext(board=Blackboard(clock, (HEIGHT,)), clock=clock)


def free_ports() -> int:
    """Return a port that is free, as the next one is."""
    while True:
        with socket.socket() as one, socket.socket() as other:
            one.bind(("127.0.0.1", 0))
            port: int = one.getsockname()[1]
            with suppress(OSError, OverflowError):
                other.bind(("127.0.0.1", port + 1))
                return port


def read_log(path: Path) -> tuple[str, int, list[tuple[int, int, Status]]]:
    """Return the XML, the first time, and the complete transitions of a log."""
    data = path.read_bytes()
    assert data[:19] == b"BTCPP4-FileLogger2\x01"
    (length,) = struct.unpack_from("<i", data, 19)
    (first_us,) = struct.unpack_from("<q", data, 23 + length)
    records = data[31 + length :]
    return (
        data[23 : 23 + length].decode(),
        first_us,
        [(time, uid, Status(code)) for time, uid, code in _records(records)],
    )


def _records(data: bytes) -> list[tuple[int, int, int]]:
    """Return microseconds, uid and status of records."""
    assert len(data) % 9 == 0
    parts = struct.iter_unpack("<IHHB", data)
    return [(high << 32 | low, uid, code) for low, high, uid, code in parts]


class GrootClient:
    """Sends requests like Groot2, with a timeout of 5 s."""

    def __init__(self, port: int) -> None:
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.REQ)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.setsockopt(zmq.RCVTIMEO, 5000)
        self._socket.connect(f"tcp://127.0.0.1:{port}")
        self._id = 0x01020300

    def raw(self, *frames: bytes) -> list[bytes]:
        self._socket.send_multipart(frames)
        return self._socket.recv_multipart()

    def ask(self, type_: str, *body: bytes) -> tuple[bytes, list[bytes]]:
        """Return the tree's id and the content of an answer."""
        self._id += 1
        head = b"\x02" + type_.encode() + self._id.to_bytes(4, "little")
        answer = self.raw(head, *body)
        assert (answer[0][:6], len(answer[0])) == (head, 22), answer
        return answer[0][6:], answer[1:]

    def refusal(self, *frames: bytes) -> str:
        word, reason = self.raw(*frames)
        assert word == b"error"
        return reason.decode()

    def tree(self) -> ET.Element:
        return ET.fromstring(self.ask("T")[1][0])  # noqa: S314  # written by the publisher

    def statuses(self) -> dict[int, int]:
        return dict(struct.iter_unpack("<HB", self.ask("S")[1][0]))

    def boards(self, *names: str) -> Any:
        return msgpack.unpackb(self.ask("B", ";".join(names).encode())[1][0])

    def transitions(self) -> list[tuple[int, int, int]]:
        return _records(self.ask("t")[1][0])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_error: object) -> None:
        self._socket.close()
        self._context.term()
