"""Helpers of the Groot tests: a scripted leaf, trees of it, and a Groot2 client.

The client is written from the protocol's specification and shares no code with the publisher.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self
from xml.etree import ElementTree as ET

import msgpack
import zmq

from uav_bt.board.blackboard import Blackboard, Key
from uav_bt.board.context import MissionContext, Proposals
from uav_bt.clock import ManualClock
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, Port, Status, parse_tree
from uav_bt.tree.status import FAILURE, RUNNING, SKIPPED, SUCCESS

_LETTERS = {"S": SUCCESS, "F": FAILURE, "R": RUNNING, "K": SKIPPED}
HEIGHT = Key("height_m", float, "a height")


class Scripted(Leaf):
    """Returns one letter of its script per tick, and repeats the last one."""

    answers = tuple(_LETTERS.values())
    ports = (Port("script", str, doc="S success, F failure, R running, K skipped"),)
    _ticks = 0

    def update(self) -> Status:
        script = self.port_value("script")
        letter = script[min(self._ticks, len(script) - 1)]
        self._ticks += 1
        return _LETTERS[letter]


REGISTRY = NodeRegistry([Scripted])


def leaf(name: str, script: str, more: str = "") -> str:
    """Return the XML of a scripted leaf."""
    return f'<Scripted name="{name}" script="{script}" {more}/>'


def make_tree(body: str, *more: str) -> MissionTree:
    """Return a tree from the XML of its root node, not set up; `more` are further trees."""
    main = f'<BehaviorTree ID="Main">{body}</BehaviorTree>{"".join(more)}'
    root = f'<root BTCPP_format="4" main_tree_to_execute="Main">{main}</root>'
    return parse_tree(root, REGISTRY)


def make_context(clock: ManualClock | None = None) -> MissionContext:
    """Return a mission context with an almost empty board."""
    clock = clock or ManualClock()
    return MissionContext(
        board=Blackboard(clock, (HEIGHT,)),
        clock=clock,
        proposals=Proposals(),
        policy=lambda name: (_ for _ in ()).throw(LookupError(name)),
    )


@dataclass(frozen=True)
class Reply:
    """A parsed answer."""

    protocol: int
    type: str
    id: int
    tree_id: bytes
    body: list[bytes]


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

    def ask(self, type_: str, *body: bytes) -> Reply:
        self._id += 1
        answer = self.raw(b"\x02" + type_.encode() + self._id.to_bytes(4, "little"), *body)
        head = answer[0]
        assert len(head) == 22, answer
        reply = Reply(
            protocol=head[0],
            type=chr(head[1]),
            id=int.from_bytes(head[2:6], "little"),
            tree_id=head[6:],
            body=answer[1:],
        )
        assert (reply.protocol, reply.type, reply.id) == (2, type_, self._id)
        return reply

    def refusal(self, *frames: bytes) -> str:
        word, reason = self.raw(*frames)
        assert word == b"error"
        return reason.decode()

    def tree(self) -> ET.Element:
        (xml,) = self.ask("T").body
        return ET.fromstring(xml)  # noqa: S314  # written by the publisher

    def statuses(self) -> dict[int, int]:
        (table,) = self.ask("S").body
        assert len(table) % 3 == 0
        return dict(struct.iter_unpack("<HB", table))

    def boards(self, *names: str) -> Any:
        (packed,) = self.ask("B", ";".join(names).encode()).body
        return msgpack.unpackb(packed)

    def transitions(self) -> list[tuple[int, int, int]]:
        (records,) = self.ask("t").body
        assert len(records) % 9 == 0
        return [
            (
                int.from_bytes(records[at : at + 6], "little"),
                int.from_bytes(records[at + 6 : at + 8], "little"),
                records[at + 8],
            )
            for at in range(0, len(records), 9)
        ]

    def close(self) -> None:
        self._socket.close()
        self._context.term()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
