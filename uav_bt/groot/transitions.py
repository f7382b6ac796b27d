"""Numbers of a tree's nodes, the tree as XML, and status transitions as Groot2 takes them.

Source: BehaviorTree.CPP's `groot2_publisher.cpp` and `bt_file_logger_v2.cpp`. A record has six
bytes of microseconds, two of the node's uid and one of the status, little endian.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple, Self
from xml.etree import ElementTree as ET

from uav_bt.errors import FileError, InputError
from uav_bt.files import writing
from uav_bt.protocols import Clock
from uav_bt.tree import MissionTree, Node
from uav_bt.tree.describe import add_model
from uav_bt.tree.nodes.base import SubTree
from uav_bt.tree.observer import NodeEvent, observe, unobserve
from uav_bt.tree.port import port_text
from uav_bt.tree.status import FAILURE, IDLE, SUCCESS, Status

MAX_UID: Final = 0xFFFF  # a uid has two bytes


class TreeInstance(NamedTuple):
    """One use of a tree of the file; a tree that is used twice has two instances."""

    tree_id: str
    full_path: str  # names of the outer instances and of this one; empty for the main tree
    root: Node

    @property
    def board_name(self) -> str:
        """The name of this instance's blackboard in the protocol."""
        return self.full_path or self.tree_id


class TreeNumbering:
    """Numbers of a tree's nodes, from 1, parents first, in the order of the file.

    Attributes:
        nodes: all nodes; the tree must not change.
        uids: their numbers, by path.
        full_paths: names of the instances, by path of the SubTree node.
        instances: the main tree, and all others in the order of the file.
    """

    def __init__(self, tree: MissionTree) -> None:
        self.nodes = tuple(tree.nodes())
        if len(self.nodes) > MAX_UID:
            count = f"{len(self.nodes)} nodes; at most {MAX_UID} can be numbered"
            raise InputError(f"tree '{tree.name}' has {count}")
        self.uids = {node.path: uid for uid, node in enumerate(self.nodes, 1)}
        self.full_paths: dict[str, str] = {}
        self.instances = [TreeInstance(tree.name, "", tree.root)]
        for node in self.nodes:
            if isinstance(node, SubTree):
                full_path = self.full_paths[node.path] = self._name(node)
                self.instances.append(TreeInstance(node.tree_id, full_path, node.child))

    def _name(self, node: SubTree) -> str:
        outer = node.parent
        while outer is not None and not isinstance(outer, SubTree):
            outer = outer.parent
        full_path = node.name if outer is None else f"{self.full_paths[outer.path]}/{node.name}"
        # BehaviorTree.CPP numbers an unnamed instance. Here unnamed means that name and id are
        # equal. A name used twice is numbered, too, because the paths name the blackboards.
        if node.name == node.tree_id or full_path in self.full_paths.values():
            return f"{full_path}::{self.uids[node.path]}"
        return full_path


# Characters that XML cannot contain; a node composed in Python may have them in its name.
_UNWRITABLE: Final = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")


def tree_xml(numbering: TreeNumbering) -> str:
    """Return a numbered tree as XML for Groot2.

    Each instance of a tree is a separate `BehaviorTree` with its `_fullpath`, which the `SubTree`
    node has, too. All nodes have their `_uid`. The `TreeNodesModel` describes the node classes in
    use.
    """
    root = ET.Element("root", BTCPP_format="4", main_tree_to_execute=numbering.instances[0].tree_id)
    for instance in numbering.instances:
        names = {"ID": instance.tree_id, "_fullpath": instance.full_path}
        _add_node(_added(root, "BehaviorTree", names), instance.root, numbering)
    model = ET.SubElement(root, "TreeNodesModel")
    classes = {node.node_id: type(node) for node in numbering.nodes}
    for node_id in sorted(classes):
        if not issubclass(classes[node_id], SubTree):  # subtrees need no description
            add_model(model, classes[node_id])
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _add_node(parent: ET.Element, node: Node, numbering: TreeNumbering) -> None:
    subtree = node if isinstance(node, SubTree) else None
    names = {"name": node.name}
    if subtree is not None:
        names = {"ID": subtree.tree_id, **names, "_fullpath": numbering.full_paths[node.path]}
    names["_uid"] = str(numbering.uids[node.path])
    tag = node.node_id if subtree is None else SubTree.node_id
    element = _added(parent, tag, names | _attributes(node))
    for child in node.children if subtree is None else ():
        _add_node(element, child, numbering)


def _added(parent: ET.Element, tag: str, attributes: dict[str, str]) -> ET.Element:
    attributes = {name: _UNWRITABLE.sub("\ufffd", text) for name, text in attributes.items()}
    return ET.SubElement(parent, tag, attributes)


def _attributes(node: Node) -> dict[str, str]:
    """Return the attributes of a node in a tree file, including defaults."""
    attributes: dict[str, str] = {}
    for port in node.ports:
        reference = node.reference(port)
        if reference is not None:
            attributes[port.name] = str(reference)
        elif port.direction == "input":
            attributes[port.name] = port_text(node.port_value(port.name))
    if isinstance(node, SubTree):
        attributes |= node.attributes
    return attributes | node.condition_scripts


_RECORD: Final = struct.Struct("<IHHB")  # lower four and upper two bytes of the time, uid, status
_ROOT_UID: Final = 1


class Transition(NamedTuple):
    """A change of a node's status."""

    time_us: int  # microseconds of mission time
    uid: int
    status: Status


def pack(transitions: Iterable[Transition], first_time_us: int) -> bytes:
    """Return transitions as records, with their times since the first time."""
    records = []
    for time_us, uid, status in transitions:
        high, low = divmod(time_us - first_time_us, 1 << 32)
        records.append(_RECORD.pack(low, high, uid, status.value))
    return b"".join(records)


class TransitionRecorder:
    """Records the transitions of a tree until `detach`.

    They come when they happen, in the order of BehaviorTree.CPP's loggers. A node that starts and
    ends in one tick gives a RUNNING (if it has one), a result and an IDLE. SKIPPED gives no
    transition: it is an answer, not a status of a node.
    """

    def __init__(self, numbering: TreeNumbering, clock: Clock) -> None:
        self._numbering = numbering
        self._clock = clock
        self._noted: list[Transition] = []
        self._root_ended = False
        observe(numbering.nodes, self._note)

    def detach(self) -> None:
        """Stop recording; `take` still returns recorded transitions. Safe to call twice."""
        unobserve(self._numbering.nodes, self._note)

    def take(self) -> list[Transition]:
        """Return the transitions since the last call; call after each tick and at the end.

        In BehaviorTree.CPP a finished root is idle after its tick, but here trees reset it at the
        next tick. This method keeps the order of BehaviorTree.CPP.
        """
        status = self._numbering.nodes[0].node_status
        if not self._root_ended and (status is SUCCESS or status is FAILURE):
            self._add(_ROOT_UID, IDLE)
            self._root_ended = True
        noted, self._noted = self._noted, []
        return noted

    def _note(self, node: Node, event: NodeEvent) -> None:
        if event is not NodeEvent.STATUS:
            return
        uid = self._numbering.uids[node.path]
        if uid == _ROOT_UID:
            reset, self._root_ended = self._root_ended, False
            if reset and node.node_status is IDLE:
                return  # `take` has recorded it after the tick
        self._add(uid, node.node_status)

    def _add(self, uid: int, status: Status) -> None:
        self._noted.append(Transition(round(self._clock.now() * 1e6), uid, status))


SUFFIX: Final = ".btlog"  # the only suffix that Groot2 opens

_MAGIC: Final = b"BTCPP4-FileLogger2\x01"


class BtlogWriter:
    """Writes a log during a flight. Use it as a context manager.

    Each `write` reaches the operating system, so that an interrupted mission leaves a log. A full
    disk ends the log, not the mission; the end of the context then raises the error. An existing
    file is replaced, not before `begin`.
    """

    def __init__(self, path: Path) -> None:
        if path.suffix != SUFFIX:
            raise FileError(path, f"Groot2 opens only files named *{SUFFIX}; choose such a name")
        self._path = path
        self._first_time_us = 0
        self._fault: FileError | None = None
        self._file: BinaryIO | None = None

    def begin(self, xml: str, first_time_us: int) -> None:
        """Open the file and write its head: the numbered tree, and the mission time."""
        if self._file is not None:
            raise FileError(self._path, "this log has begun already; write another file")
        with writing(self._path):
            self._file = self._path.open("wb", buffering=0)
        self._first_time_us = first_time_us
        data = xml.encode()
        self._put(_MAGIC + struct.pack("<i", len(data)) + data + struct.pack("<q", first_time_us))

    def write(self, transitions: Iterable[Transition]) -> None:
        """Append transitions, in the order of their times."""
        self._put(pack(transitions, self._first_time_us))

    def _put(self, data: bytes) -> None:
        if self._file is None or self._fault is not None:
            return
        try:
            while data:
                data = data[self._file.write(data) :]
        except OSError as error:
            self._fault = FileError(self._path, f"the log ends early: {error.strerror}")

    def __enter__(self) -> Self:
        """Return the writer."""
        return self

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        """Close the file; an earlier exception has priority over an error of the log."""
        if self._file is not None:
            self._file.close()
        if self._fault is not None and error is None:
            raise self._fault
        if self._fault is not None and error is not None:
            error.add_note(str(self._fault))
