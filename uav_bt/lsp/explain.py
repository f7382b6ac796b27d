"""Text that an editor shows for the node, attribute or name under the cursor."""

from __future__ import annotations

import inspect
import math
from typing import Any, Final

from lsprotocol import types

from uav_bt.board.blackboard import Key
from uav_bt.lsp.desk import Desk
from uav_bt.lsp.names import SUBTREE, Use, What
from uav_bt.lsp.page import Page, attribute_at
from uav_bt.tree.describe import describe
from uav_bt.tree.node import Node
from uav_bt.tree.port import Port, port_text
from uav_bt.tree.registry import NodeRegistry

_CONDITIONS: Final = {
    "_failureIf": "A script, asked before the idle node is ticked; true: the node fails.",
    "_successIf": "A script, asked before the idle node is ticked; true: the node succeeds.",
    "_skipIf": "A script, asked before the idle node is ticked; true: the node is skipped.",
    "_while": "A script, asked before each tick; false: the node is skipped, and halted if it ran.",
    "_onSuccess": "A script, run when the node succeeds.",
    "_onFailure": "A script, run when the node fails.",
    "_post": "A script, run when the node ends, either way.",
    "_onHalted": "A script, run when the node is halted.",
    "_autoremap": "`true`: every name that is not given here and not private is the outer tree's.",
}


def hover(desk: Desk, page: Page, offset: int) -> types.Hover | None:
    """Return the text for an offset; None where there is nothing to explain."""
    tag = page.tag_from(offset)
    branch = None if tag is None else page.by_tag.get(tag.start)
    if tag is None or branch is None:
        return None
    use = next((one for one in desk.uses(page) if one.start <= offset < one.end), None)
    found = attribute_at(tag, offset)
    node = desk.node(branch)
    start, end, text = tag.start + 1, tag.start + 1 + len(tag.name), ""
    if use is not None:
        start, end, text = use.start, use.end, _of_use(desk, page, use)
    if not text and found is not None:
        start, end = found.start, found.end
        ports = () if node is None else node.ports
        port = next((one for one in ports if one.name == found.name), None)
        text = explain_port(port) if port is not None else _CONDITIONS.get(found.name, "")
    elif not text and offset < end and node is not None:
        text = explain_node(node, desk.registry)
    elif not text and offset < end and tag.name == SUBTREE:
        text = _of_tree(desk, page, branch.text("ID"))
    if not text:
        return None
    content = types.MarkupContent(types.MarkupKind.Markdown, text)
    return types.Hover(content, page.range(start, end))


def _of_use(desk: Desk, page: Page, use: Use) -> str:
    if use.what is What.KEY:
        key = desk.board_keys.get(use.name)
        return "" if key is None else explain_key(key)
    if use.what is What.TREE:
        return _of_tree(desk, page, use.name)
    if use.entry:
        return f"`{use.name}`: variable of tree `{use.tree}`"
    written = [
        f"line {page.position(one.start).line + 1}: `{one.branch.tag.name}`"
        for one in desk.uses(page)
        if one.what is What.VARIABLE and (one.name, one.tree) == (use.name, use.tree)
        if one.defines or one.entry
    ]
    places = "; ".join(written[:10]) or "nowhere in this file"
    return f"`{use.name}`: variable of tree `{use.tree}`\n\nSet at {places}"


def _of_tree(desk: Desk, page: Page, tree_id: str) -> str:
    found = desk.tree(page, tree_id)
    if found is None:
        return ""
    home, branch = found
    count = sum(1 for _ in branch.walk()) - 1
    line = home.position(branch.tag.start).line + 1
    return f"**{tree_id}** (tree, {count} nodes), {home.path.name}:{line}"


def explain_node(node: type[Node], registry: NodeRegistry) -> str:
    """Return a node's docstring, ports and board keys as Markdown."""
    info = describe(node, registry)
    lines = [f"**{info.node_id}** ({info.kind})", "", inspect.cleandoc(node.__doc__ or "")]
    lines += ["", *(f"- {explain_port(port)}" for port in node.ports)]
    for word, names in (("Reads", info.reads), ("Writes", info.writes)):
        if names:
            lines += ["", f"{word} {', '.join(f'`@{name}`' for name in names)}"]
    return "\n".join(lines).strip()


def explain_port(port: Port[Any]) -> str:
    """Return a port's type, range and default in a line of Markdown."""
    facts = [" or ".join(map(port_text, port.choices)) or port.type.__name__, port.range]
    if port.direction != "input":
        facts.append(port.direction)
    if port.default is not Port.REQUIRED:
        facts.append(f"default {port_text(port.default)}")
    elif port.required:
        facts.append("required")
    told = ", ".join(fact for fact in facts if fact)
    return f"`{port.name}` ({told})" + (f": {port.doc}" if port.doc else "")


def explain_key(key: Key[Any]) -> str:
    """Return a board key's type, unit, age limit and writer as Markdown."""
    facts = [key.type.__name__, key.unit]
    if key.max_age_s != math.inf:
        facts.append(f"at most {key.max_age_s:g} s old")
    told = ", ".join(fact for fact in facts if fact)
    writer = f"\n\nWritten by {key.writer}" if key.writer else ""
    return f"`@{key.name}` ({told}): {key.doc}{writer}"
