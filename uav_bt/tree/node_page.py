"""A page of the nodes of a registry, in Markdown: one section for each node."""

from __future__ import annotations

import inspect
from collections.abc import Iterator

from uav_bt.tree.describe import ABILITIES, NodeInfo, PortInfo, describe
from uav_bt.tree.node import Node
from uav_bt.tree.nodes import BUILTIN_NODES
from uav_bt.tree.registry import NodeRegistry

# A value of each type, for ports that a tree file must give.
_SAMPLES = {"float": "1.0", "int": "1", "bool": "true", "str": "name"}


def node_page(registry: NodeRegistry) -> str:
    """Return the page.

    Args:
        registry: the nodes; the format's own are left out.
    """
    nodes = [registry[name] for name in registry if registry[name] not in BUILTIN_NODES]
    links = ", ".join(f"[{node.node_id}](#{node.node_id.lower()})" for node in nodes)
    sections = [f"# Nodes\n\n{links}"]
    sections += ["\n\n".join(section(node)) for node in nodes]
    return "\n\n".join(sections) + "\n"


def example(info: NodeInfo) -> str:
    """Return a tag of the node with a value for each port that a tree file must give."""
    given = "".join(f' {port.name}="{_sample(port)}"' for port in info.ports if port.required)
    return f"<{info.node_id}{given}/>"


def section(node: type[Node]) -> Iterator[str]:
    """Yield the paragraphs about a node, in Markdown."""
    info = describe(node)
    yield f"## {info.node_id}"
    # The attributes of a class have a table here.
    yield inspect.cleandoc(node.__doc__ or "").partition("\nArgs:")[0].strip()
    yield f"Example: `{example(info)}`"
    if info.ports:
        rows = [f"| `{p.name}` | {p.type} | {_value(p)} | {_doc(p)} |" for p in info.ports]
        yield "\n".join(["| port | type | default | meaning |", "|---|---|---|---|", *rows])
    kind = f"{info.kind}."
    answers = f" Answers {', '.join(info.answers)}." if info.answers else ""
    abilities = [ABILITIES[name] for name in info.abilities]
    does = f" It {' and '.join(abilities)}." if abilities else ""
    reads, writes = (
        f" {verb} {', '.join(f'`{key}`' for key in keys)}." if keys else ""
        for verb, keys in (("Reads", info.reads), ("Writes", info.writes))
    )
    yield f"{kind}{answers}{does}{reads}{writes} Source: `{info.origin}`."


def _sample(port: PortInfo) -> str:
    return port.sample or (*port.choices, _SAMPLES.get(port.type, "name"))[0]


def _value(port: PortInfo) -> str:
    if port.required:
        return "required"
    if port.direction == "output":
        return "output"
    return f"`{port.default}`" if port.default else ""


def _doc(port: PortInfo) -> str:
    text = f"{port.doc} ({port.range})" if port.range else port.doc
    return text.replace("|", "\\|")
