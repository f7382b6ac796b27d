"""The nodes that a log is about, read from its XML, whoever wrote it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final
from xml.parsers import expat

from uav_bt.errors import FileError

__all__ = ["LoggedNode", "read_logged_tree"]

_MAX_DEPTH: Final = 1000  # elements inside elements
_MAX_NODES: Final = 0xFFFF  # more have no number


@dataclass(frozen=True, kw_only=True)
class LoggedNode:
    """A node as a log names it."""

    uid: int
    node_id: str  # the class
    name: str
    path: str  # names from the tree down


class _Reader:
    """Collects nodes while the XML is parsed; refuses what could make parsing expensive."""

    def __init__(self, path: Path) -> None:
        self.nodes: dict[int, LoggedNode] = {}
        self._path = path
        self._names: list[str] = []
        self._model = False  # inside the TreeNodesModel, which describes classes
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.StartDoctypeDeclHandler = self._doctype

    def bad(self, message: str) -> FileError:
        """Return an error that names the place in the XML."""
        line = self.parser.CurrentLineNumber
        return FileError(self._path, f"its XML, line {line}: {message}")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        if len(self._names) >= _MAX_DEPTH:
            raise self.bad(f"deeper than {_MAX_DEPTH} elements")
        if tag == "TreeNodesModel":
            self._model = True
        if tag == "BehaviorTree":
            inside = attributes.get("_fullpath") or attributes.get("ID", "")
            self._names.append(inside)
            return
        name = attributes.get("name") or attributes.get("ID") or tag
        self._names.append("" if tag == "root" else name)
        if "_uid" in attributes and not self._model:
            self._add(tag, name, attributes)

    def _add(self, tag: str, name: str, attributes: dict[str, str]) -> None:
        text = attributes["_uid"]
        uid = int(text) if text.isascii() and text.isdigit() and len(text) <= len("65535") else -1
        if not 0 <= uid <= _MAX_NODES:
            raise self.bad(f"_uid of '{name}' must be a number up to {_MAX_NODES}, got '{text}'")
        if uid in self.nodes:
            raise self.bad(f"'{name}' and '{self.nodes[uid].name}' both have _uid {uid}")
        # Some writers use explicit elements: the class is their ID.
        explicit = tag in {"Action", "Condition", "Control", "Decorator"}
        self.nodes[uid] = LoggedNode(
            uid=uid,
            node_id=attributes.get("ID", tag) if explicit else tag,
            name=name,
            path="/".join(part for part in self._names if part),
        )

    def _end(self, tag: str) -> None:
        self._names.pop()
        if tag == "TreeNodesModel":
            self._model = False

    def _doctype(self, *_: object) -> None:
        raise self.bad("document type declarations are refused")


def read_logged_tree(xml: str, path: Path) -> dict[int, LoggedNode]:
    """Return the nodes of a log's tree by uid.

    Args:
        xml: the tree, as the log holds it.
        path: the log's file, for messages.

    Raises:
        FileError: it is no XML, or numbers its nodes wrongly.
    """
    reader = _Reader(path)
    try:
        reader.parser.Parse(xml, True)
    except expat.ExpatError as error:
        raise reader.bad(expat.errors.messages.get(error.code, "no XML")) from error
    if not reader.nodes:
        raise FileError(path, "its XML numbers no node (`_uid`)")
    return reader.nodes
