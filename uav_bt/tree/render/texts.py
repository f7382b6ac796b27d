"""A tree as text: for a terminal, for Graphviz, for Mermaid (Markdown pages)."""

from __future__ import annotations

import json
import re
from typing import Final

from uav_bt.tree.node import NodeKind
from uav_bt.tree.render.sketch import Box, one_line

__all__ = ["ascii_art", "dot", "mermaid"]

_FILLS: Final = {
    NodeKind.CONTROL: "#d6e6f8",
    NodeKind.DECORATOR: "#eadcf3",
    NodeKind.SUBTREE: "#e2e4e8",
    NodeKind.ACTION: "#d5efe0",
    NodeKind.CONDITION: "#fbe8c6",
}
# All that could mean something to Mermaid or to the HTML it makes; `#` begins its own entities.
_NOT_PLAIN: Final = re.compile(r"[^A-Za-z0-9 _.,:=+\-/{}@()\u0080-\U0010ffff]")


def ascii_art(root: Box, title: str) -> str:
    """Return a tree as indented lines of ASCII characters, one for each node."""
    lines = [one_line(title, 60)]
    stack = [(root, "", True)]
    while stack:
        box, before, last = stack.pop()
        lines.append(f"{before}{'`-- ' if last else '|-- '}{_summary(box)}")
        inside = before + ("    " if last else "|   ")
        stack += [(child, inside, child is box.children[-1]) for child in reversed(box.children)]
    text = "\n".join([*lines, ""])
    return text.encode("ascii", "backslashreplace").decode("ascii")


def _summary(box: Box) -> str:
    name = f"'{box.name}'" if box.name else ""
    return " ".join(text for text in (box.tag, name, *box.attributes) if text)


def _label(box: Box) -> list[str]:
    name = [f"'{box.name}'"] if box.name else []
    return [box.tag, *name, *box.attributes, *box.keys]


def dot(root: Box, title: str) -> str:
    """Return a tree in the language of Graphviz."""
    numbers = {id(box): number for number, box in enumerate(root.walk())}
    lines = [
        f"digraph {_quoted(one_line(title, 60))} {{",
        '  graph [ordering=out, fontname="Helvetica"];',
        '  node [shape=box, style="rounded,filled", fontname="Helvetica", fontsize=11];',
        "  edge [arrowhead=none];",
    ]
    for box in root.walk():
        label = "\\n".join(_escaped(text) for text in _label(box))
        lines.append(f'  n{numbers[id(box)]} [label="{label}", fillcolor="{_FILLS[box.kind]}"];')
    for box in root.walk():
        lines += [f"  n{numbers[id(box)]} -> n{numbers[id(child)]};" for child in box.children]
    return "\n".join([*lines, "}", ""])


def _escaped(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')


def _quoted(text: str) -> str:
    return f'"{_escaped(text)}"'


def mermaid(root: Box, title: str) -> str:
    """Return a tree as a Mermaid flowchart, which Markdown pages show."""
    numbers = {id(box): number for number, box in enumerate(root.walk())}
    # The head is YAML, of which JSON is a part; entities mean nothing there.
    lines = ["---", f"title: {json.dumps(one_line(title, 60))}", "---", "flowchart TD"]
    for box in root.walk():
        label = "<br/>".join(_entities(text) for text in _label(box))
        lines.append(f'  n{numbers[id(box)]}["{label}"]:::{box.kind.value.lower()}')
    for box in root.walk():
        lines += [f"  n{numbers[id(box)]} --- n{numbers[id(child)]}" for child in box.children]
    for kind, fill in _FILLS.items():
        lines.append(f"  classDef {kind.value.lower()} fill:{fill},stroke:#556,color:#123;")
    return "\n".join([*lines, ""])


def _entities(text: str) -> str:
    return _NOT_PLAIN.sub(lambda match: f"#{ord(match[0])};", text)
