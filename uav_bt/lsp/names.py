"""Names that can stand at a cursor in a text, which may be unfinished XML."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

from uav_bt.board import Key
from uav_bt.tree.describe import section
from uav_bt.tree.loading.attributes import POLICY_PORT
from uav_bt.tree.loading.elements import KIND_TAGS
from uav_bt.tree.loading.lookup import Lookup
from uav_bt.tree.loading.models import PORT_DIRECTIONS
from uav_bt.tree.loading.source import walk
from uav_bt.tree.loading.variable_faults import key_fits
from uav_bt.tree.node import NodeKind
from uav_bt.tree.port import CONDITION_ATTRIBUTES, Port, port_text
from uav_bt.tree.registry import NodeRegistry
from uav_bt.tree.script.parser import SCRIPTS, parse_text

# A quote that is still open does not reach over the beginning of the next tag.
_QUOTED: Final = r"""(?:"[^"<]*+(?:<(?![\w/!])[^"<]*+)*+"|'[^'<]*+(?:<(?![\w/!])[^'<]*+)*+')"""
_MARKUP: Final = re.compile(
    r"<!--.*?(?:-->|\Z)|<!\[CDATA\[.*?(?:\]\]>|\Z)|<[?!][^>]*+>?"
    r"|<(?P<slash>/?)(?P<name>[^\s<>/=\"'!?]*+)"
    rf"(?P<rest>(?:{_QUOTED}|[^<>/]|/(?!>))*+)(?P<closing>/?>)?",
    re.DOTALL,
)
_ATTRIBUTE: Final = re.compile(
    r"(?P<name>[^\s=<>/\"']++)(?:\s*+=\s*+(?P<quote>[\"'])(?P<value>.*?)(?:(?P=quote)|\Z))?",
    re.DOTALL,
)


class Attribute(NamedTuple):
    """An attribute of a tag; places are offsets in the text."""

    name: str
    value: str  # between the quotes, entities unresolved
    start: int
    name_end: int
    value_start: int  # -1: it has no value yet
    value_end: int


class Tag(NamedTuple):
    """A tag, which may be unfinished."""

    name: str
    attributes: tuple[Attribute, ...]
    start: int
    name_end: int
    end: int
    is_end: bool  # `</A>`
    closing: str  # its last characters: `>`, `/>`, or nothing yet

    def value(self, name: str) -> str:
        """Return the value of an attribute; empty without the attribute."""
        return next((one.value for one in self.attributes if one.name == name), "")

    def attribute_at(self, offset: int) -> Attribute | None:
        """Return the attribute that a cursor is in, or stands behind."""
        reached = (one for one in self.attributes if offset <= max(one.name_end, one.value_end))
        return next((one for one in reached if one.start < offset), None)


def tags(text: str) -> Iterator[Tag]:
    """Iterate over all tags; comments are passed over."""
    for match in _MARKUP.finditer(text):
        if match["name"] is not None:
            attributes = tuple(
                Attribute(m["name"], m["value"] or "", m.start(), m.end("name"), *m.span("value"))
                for m in _ATTRIBUTE.finditer(text, *match.span("rest"))
            )
            places = match.start(), match.end("name"), match.end()
            is_end, closing = bool(match["slash"]), match["closing"] or ""
            yield Tag(match["name"], attributes, *places, is_end, closing)


def place(text: str, offset: int) -> tuple[Tag | None, list[str]]:
    """Return the tag that a cursor is in, and the names of the open elements around it."""
    opened: list[str] = []
    for tag in tags(text):
        if offset <= tag.start:
            break
        if offset < tag.end or (offset == tag.end and not tag.closing):
            return tag, opened
        if tag.is_end and tag.name in opened:
            while opened.pop() != tag.name:
                pass
        elif not tag.is_end and tag.closing == ">":
            opened.append(tag.name)
    return None, opened


_SUBTREE: Final = NodeKind.SUBTREE.value
_GENERIC: Final = ("name", *sorted(CONDITION_ATTRIBUTES))
_NO_NODES: Final = {"root": ("BTCPP_format", "main_tree_to_execute"), "BehaviorTree": ("ID",)}
# A variable stands between braces, is assigned in a script, or is named by SetBlackboard.
_VARIABLE: Final = re.compile(
    r"\{\s*([A-Za-z_][\w.\-]*)\s*\}|\b([A-Za-z_]\w*)\s*:=|\boutput_key\s*=\s*[\"'](\w+)"
)


class Name(NamedTuple):
    """A name that can stand at the cursor."""

    text: str
    doc: str = ""  # Markdown
    more: str = ""  # what completion writes behind it


@dataclass(frozen=True)
class Names:
    """Finds the names of a registry, of other files, and of a document's text."""

    registry: NodeRegistry
    lookup: Lookup
    path: Path  # of the document
    text: str

    def at(self, offset: int) -> tuple[int, int, list[Name]]:
        """Return the part of the text that a cursor is in, and the names that can stand there."""
        tag, around = place(self.text, offset)
        if tag is None or (tag.is_end and offset == tag.start + 1):
            return offset, offset, []
        if tag.is_end:
            more = "" if tag.closing else ">"
            return tag.start + 2, tag.name_end, [Name(one, more=more) for one in around[-1:]]
        if offset <= tag.name_end:
            return tag.start + 1, tag.name_end, [*self._elements(around)]
        found = tag.attribute_at(offset)
        if found is not None and 0 < found.value_start <= offset:
            return self._in_value(tag, found, offset)
        start, end = (offset, offset) if found is None else (found.start, found.name_end)
        more = '=""' if found is None or found.value_start < 0 else ""
        given = {one.name for one in tag.attributes if one is not found}
        names = self._attributes(tag).items()
        return start, end, [Name(name, doc, more) for name, doc in names if name not in given]

    def _elements(self, around: list[str]) -> Iterator[Name]:
        if "BehaviorTree" in around:
            yield from self._nodes()
            yield from (Name(f'{_SUBTREE} ID="{tree_id}"') for tree_id in self._trees())
        else:
            yield from map(Name, ("BehaviorTree", "include") if around else ("root",))

    def _nodes(self, kind: str = "") -> Iterator[Name]:
        for node in (self.registry[node_id] for node_id in self.registry):
            if kind in {"", node.kind.value}:
                yield Name(node.node_id, "\n\n".join(section(node)))

    def _trees(self) -> list[str]:
        own = [tag.value("ID") for tag in tags(self.text) if tag.name == "BehaviorTree"]
        return sorted({*own, *self.lookup.library.trees, *self.lookup.shipped.trees} - {""})

    def _ports(self, tag: Tag) -> dict[str, Port[Any]]:
        explicit = tag.name in KIND_TAGS and tag.name != _SUBTREE
        node = self.registry.get(tag.value("ID") if explicit else tag.name)
        return {} if node is None else {port.name: port for port in node.ports}

    def _attributes(self, tag: Tag) -> dict[str, str]:
        """Return the attributes that an element can have, with their documentation."""
        if tag.name in _NO_NODES:
            return dict.fromkeys(_NO_NODES[tag.name], "")
        found = {name: _of_port(port) for name, port in self._ports(tag).items()}
        if tag.name == _SUBTREE:
            found |= {**self._entries(tag.value("ID")), "_autoremap": ""}
        explicit = {"ID": ""} if tag.name in KIND_TAGS else {}
        return found | explicit | dict.fromkeys(_GENERIC, "")

    def _entries(self, tree_id: str) -> dict[str, str]:
        """Return the ports of a subtree that another file describes."""
        files = [file for _, file in self.lookup.find(tree_id, self.path)]
        return {
            port.attributes.get("name", ""): port.text
            for model in (one for file in files for one in walk(file.root))
            if (model.tag, model.attributes.get("ID")) == (_SUBTREE, tree_id)
            for port in model.children
            if port.tag in PORT_DIRECTIONS
        }

    def _in_value(self, tag: Tag, attribute: Attribute, at: int) -> tuple[int, int, list[Name]]:
        before = self.text[attribute.value_start : at]
        after = self.text[at : attribute.value_end]
        port = self._ports(tag).get(attribute.name)
        check = None if port is None else port.check
        if attribute.name not in CONDITION_ATTRIBUTES and check not in SCRIPTS:
            # With a blank in it, the value is rather an open quote that reaches too far.
            end = at if re.search(r"\s", after) else attribute.value_end
            return attribute.value_start, end, [*self._literals(tag, attribute.name, port, at)]
        if check is parse_text and "{" not in before.rpartition("}")[2]:
            return at, at, []  # the names in a text are between braces
        start = at - len(re.split(r"[^\w@]", before)[-1])
        end = at + len(re.split(r"\W", after)[0])
        keys = self.registry.board_keys.values()
        plain = (key for key in keys if issubclass(key.type, (int, float, str)))
        on_board = (Name(f"@{key.name}", _of_key(key)) for key in plain)
        return start, end, [*map(Name, self._variables(at)), *on_board]

    def _literals(self, tag: Tag, name: str, port: Port[Any] | None, at: int) -> Iterator[Name]:
        if (tag.name, name) in {("root", "main_tree_to_execute"), (_SUBTREE, "ID")}:
            yield from map(Name, self._trees())
        elif name == "ID" and tag.name in KIND_TAGS:
            yield from self._nodes(tag.name)
        elif port is not None or tag.name == _SUBTREE:
            yield from () if port is None else map(Name, self._choices(port))
            yield from (Name(f"{{{one}}}") for one in self._variables(at))
            keys = self.registry.board_keys.values()
            fitting = (key for key in keys if port is None or key_fits(port, key))
            yield from (Name(f"{{@{key.name}}}", _of_key(key)) for key in fitting)

    def _choices(self, port: Port[Any]) -> list[str]:
        if port.name == POLICY_PORT:
            return sorted(self.registry.policies or ())
        if port.type is bool:
            return ["true", "false"]
        default = () if port.default is Port.REQUIRED else (port.default,)
        return [port_text(value) for value in port.choices or default]

    def _variables(self, at: int) -> list[str]:
        """Return the variables of the document, without the name that is being typed."""
        subtrees = (tag for tag in tags(self.text) if tag.name == _SUBTREE)
        found = {one.name for tag in subtrees for one in tag.attributes}
        uses = (one for one in _VARIABLE.finditer(self.text) if not one.start() < at <= one.end())
        found.update(name for one in uses for name in one.groups() if name)
        return sorted(found - {"ID", "_autoremap", *_GENERIC})


def _of_port(port: Port[Any]) -> str:
    kind = " or ".join(map(port_text, port.choices)) or port.type.__name__
    direction = "" if port.direction == "input" else port.direction
    default = "" if port.default is Port.REQUIRED else f"default {port_text(port.default)}"
    required = "required" if port.required else ""
    facts = ", ".join(filter(None, (kind, port.range, direction, default, required)))
    return f"`{port.name}` ({facts}): {port.doc}"


def _of_key(key: Key[Any]) -> str:
    age = "" if key.max_age_s == math.inf else f"at most {key.max_age_s:g} s old"
    writer = f"written by {key.writer}" if key.writer else ""
    facts = ", ".join(filter(None, (key.type.__name__, key.unit, age, writer)))
    return f"`@{key.name}` ({facts}): {key.doc}"
