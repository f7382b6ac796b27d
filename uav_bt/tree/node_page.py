"""The page of nodes in Markdown: nodes by what they do, board keys, the classes of their values."""

from __future__ import annotations

import enum
import inspect
import math
import re
import sys
import textwrap
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import is_dataclass
from itertools import groupby
from typing import Any, Final

from uav_bt.board.blackboard import Key
from uav_bt.tree.describe import own_nodes, section
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.node import Node
from uav_bt.tree.registry import NodeRegistry

_GROUPS: Final = ("Flying", "Looking", "Perceiving", "Landing", "Conditions and branches", "Others")
_HEAD: Final = re.compile(r'\A.*?:\n(?:\s*""".*?"""\n)?', re.DOTALL)  # of a class, with docstring
_FORMAT: Final = "Nodes of the format, such as `Sequence`, are in [tree files](tree-format.md)."
_VALUES: Final = (
    "Names carry the unit. Places and headings are in the [map's frame](frames.md) where nothing "
    "else is said. `Floats` is an array of float64, `Flags` one of bool."
)


def node_page(registry: NodeRegistry, *, board: bool = True) -> str:
    """Return a page about the nodes of a registry that are not the format's, and its board keys."""
    links, sections = list[str](), list[str]()
    for (_, name), nodes in groupby(sorted(own_nodes(registry), key=_group), _group):
        tags = []
        sections.append(f"## {name}")
        for node in nodes:
            tags.append(f"[{node.node_id}](#{node.node_id.lower()})")
            sections += section(node, "###")
        links.append(f"- {name}: {', '.join(tags)}")
    if board:
        links.append("- [Board keys](#board-keys) and [the classes of values](#classes-of-values)")
        sections += _board(registry)
    return "\n\n".join(["# Nodes", _FORMAT, "\n".join(links), *sections]) + "\n"


def _group(node: type[Node]) -> tuple[int, str]:
    """Return place and text of a node's heading: the one that it names, or by what it declares."""
    found = "Conditions and branches"
    if issubclass(node, Leaf):
        acts = "Flying" if node.moves else "Looking" if node.points else None
        fills = found if node.condition else "Perceiving" if node.writes else "Others"
        found = node.group or ("Landing" if node.lands else acts or fills)
    return (_GROUPS.index(found) if found in _GROUPS else len(_GROUPS)), found


def _board(registry: NodeRegistry) -> Iterator[str]:
    """Yield the paragraphs about board keys and the classes of their values."""
    keys = [key for _, key in sorted(registry.board_keys.items())]
    classes: dict[type, str] = {}
    for key in keys:
        _add_class(key.type, classes)
    head = "| key | type | meaning | written by | stale after |\n|---|---|---|---|---|"
    yield "## Board keys"
    yield "\n".join([head, *(_row(key, classes) for key in keys)])
    yield f"## Classes of values\n\n{_VALUES}"
    for kind, text in sorted(classes.items(), key=lambda item: item[0].__name__):
        doc = inspect.cleandoc(kind.__doc__ or "")
        yield f"### {kind.__name__}\n\n{doc}\n\n```text\n{text}\n```"


def _row(key: Key[Any], classes: dict[type, str]) -> str:
    name = key.type.__name__
    kind = f"[{name}](#{name.lower()})" if key.type in classes else name
    meaning = (f"{key.doc}, {key.unit}" if key.unit else key.doc).replace("|", "\\|")
    age = "-" if math.isinf(key.max_age_s) else f"{key.max_age_s:g} s"
    return f"| `{key.name}` | {kind} | {meaning} | {key.writer or '-'} | {age} |"


def _add_class(kind: Any, classes: dict[type, str]) -> None:
    """Add the fields of a dataclass or an enumeration as its source has them, and their classes."""
    is_one = is_dataclass(kind) or isinstance(kind, enum.EnumMeta)
    if not is_one or kind in classes:
        return
    fields, calls = list[str](), list[str]()
    classes[kind] = ""
    for base in kind.__mro__[::-1]:
        if base.__module__ in sys.stdlib_module_names:
            continue
        with suppress(OSError):  # a class that no file has
            body = _HEAD.sub("", textwrap.dedent(inspect.getsource(base)))
            shown = textwrap.dedent(re.split(r"(?m)^    (?:@|def |__)", body)[0])
            fields.append(re.sub(r" = field\([^#\n]*\)", "", shown).strip())
            calls += _calls(base)
            for word in re.findall(r"[A-Z]\w+", shown):
                _add_class(vars(sys.modules[base.__module__]).get(word), classes)
    classes[kind] = "\n\n".join(filter(None, ("\n".join(fields), "\n".join(calls))))


def _calls(kind: type) -> Iterator[str]:
    """Yield a line for each public property and method of a class."""
    for name, member in vars(kind).items():
        call = getattr(member, "fget", getattr(member, "func", member))
        if not name.startswith("_") and inspect.isfunction(call):
            given = re.sub(r"'|self(, )?", "", str(inspect.signature(call)))
            shown = given if call is member else given.removeprefix("()")
            yield f"{name}{shown}  # {(call.__doc__ or '').partition(chr(10))[0]}"
