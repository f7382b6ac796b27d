"""`uav-bt tree` and `lsp`: nodes, drawings and schema of tree files; their language server."""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal

import click

from uav_bt.cli.declare import command
from uav_bt.cli.shared import (
    FlownRegistry,
    OutputFile,
    ParameterSets,
    Registry,
    print_or_write,
    single,
)
from uav_bt.option import Option
from uav_bt.tree import Node, NodeRegistry, load_tree
from uav_bt.tree.describe import (
    ABILITIES,
    declared,
    default_text,
    in_order,
    node_page,
    origin,
    palette_xml,
    summary,
)
from uav_bt.tree.describe import render as draw
from uav_bt.tree.loading.lookup import Folders, TreeId
from uav_bt.tree.loading.schema import schema_xml
from uav_bt.tree.nodes import BUILTIN_NODES
from uav_bt.tree.port import Port, port_text
from uav_bt.tree.shipped import resolve_tree


@command()
def nodes(
    names: Annotated[tuple[str, ...], Option(form="[NODE]...")] = (),
    *,
    format_: Annotated[
        Literal["text", "json", "xml", "markdown"], Option(form="--format")
    ] = "text",
    registry: FlownRegistry,
) -> None:
    """List the nodes that tree files can use.

    With each node go its attributes and the board keys it reads and writes.

    As JSON, one array of objects: node_id, kind, doc, ports, reads and writes (board keys), builtin
    (of the format itself) and origin (module and class). A port without a default, or a number
    without a bound (least, most), has null there.

    Options:
        format_: xml: a node model (TreeNodesModel) that graphical tree editors load; markdown: a
            page with a section for each node.
    """
    if format_ in {"xml", "markdown"}:
        chosen = NodeRegistry(registry[name] for name in names) if names else registry
        click.echo((palette_xml if format_ == "xml" else node_page)(chosen), nl=False)
        return
    listed = [registry[name] for name in names] or in_order(registry)
    if format_ == "json":
        click.echo(json.dumps([_as_json(node) for node in listed], indent=2))
        return
    click.echo("\n\n".join(_described(node) for node in listed))


def _described(node: type[Node]) -> str:
    found = declared(node)
    of = "of the format" if node in BUILTIN_NODES else origin(node)
    lines = [f"{node.node_id}  ({node.kind.value.lower()}, {of})", summary(node)]
    lines += [_attribute(port) for port in node.ports]
    lines.append(f"answers {', '.join(found.answers)}" if found.answers else "")
    lines += [ABILITIES[name] for name in found.abilities]
    lines.append(f"reads {', '.join(found.reads)}" if found.reads else "")
    lines.append(f"writes {', '.join(found.writes)}" if found.writes else "")
    return "\n    ".join(line for line in lines if line)


def _as_json(node: type[Node]) -> dict[str, Any]:
    plain = ("name", "doc", "direction", "least", "most", "range", "required", "sample")
    ports = [
        {
            **{name: getattr(port, name) for name in plain},
            "type": port.type.__name__,
            "default": default_text(port),
            "choices": [*map(port_text, port.choices)],
        }
        for port in node.ports
    ]
    return {
        "node_id": node.node_id,
        "kind": node.kind.value,
        "doc": summary(node),
        "ports": ports,
        **declared(node)._asdict(),
        "builtin": node in BUILTIN_NODES,
        "origin": origin(node),
    }


def _attribute(port: Port[Any]) -> str:
    default = default_text(port)
    given = port.name if default is None else f'{port.name}="{default}"'
    kind = " or ".join(map(port_text, port.choices)) or port.type.__name__
    kind += f", {port.range}" if port.range else ""
    direction = "" if port.direction == "input" else f", {port.direction}"
    return f"{given}  {kind}{direction}" + (f": {port.doc}" if port.doc else "")


@command()
def render(
    tree: str,
    *,
    format_: Annotated[Literal["ascii", "svg"], Option(form="--format")] = "ascii",
    out: OutputFile = None,
    tree_id: TreeId = None,
    registry: Registry,
    tree_folders: Folders,
    parameters: ParameterSets,
) -> None:
    """Draw a tree file, with its subtrees in place.

    TREE is a file, or the name of a mission that ships with uav-bt. Each node shows its name and
    the values of its ports; svg also shows the board keys that it reads and writes.

    Options:
        format_: The form of the drawing.
        out: The file to write; the text is printed if not given.
    """
    lookup = tree_folders.lookup()
    loaded = load_tree(
        resolve_tree(tree),
        registry,
        tree_id=tree_id,
        lookup=lookup,
        parameters=single(parameters),
    )
    print_or_write(draw(loaded.root, loaded.name, format_), out)


@command()
def schema(*, out: OutputFile = None, registry: Registry) -> None:
    """Write an XML Schema of tree files with all installed nodes.

    XML editors complete, explain and check tree files with it. They find it by their settings, or
    by this line at the head of a tree file:

    \b
      <?xml-model href="uav-bt.xsd"?>

    Options:
        out: The file to write; the text is printed if not given.
    """  # noqa: D301  (click needs the backspace)
    print_or_write(schema_xml(registry), out)


@command()
def lsp(*, registry: Registry) -> None:
    """Check and complete tree files in editors.

    An editor starts this and speaks the Language Server Protocol with it over standard input and
    output: findings while one types, completion and hover. SubTrees are looked up in all files of
    the editor's folder as they were saved, as `uav-bt check FOLDER` does. docs/editors.md has the
    settings of VS Code, Neovim and Emacs.
    """
    from uav_bt.lsp.server import serve  # noqa: PLC0415  (an extra)

    serve(registry)
