"""`uav-bt tree`, `simulate` and `lsp`: nodes, drawings, dry runs, the language server."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import click
from annotated_types import Gt, Le

from uav_bt.cli.declare import command
from uav_bt.cli.shared import (
    CheckedLab,
    Count,
    FlownRegistry,
    OutputFile,
    ParameterSets,
    Registry,
    print_or_write,
    refuse_in_lab,
    single,
)
from uav_bt.lab.shipped import load_lab
from uav_bt.option import Option
from uav_bt.tree import Node, NodeRegistry, describe, load_tree
from uav_bt.tree.loading.lookup import Folders, TreeId
from uav_bt.tree.loading.schema import schema_xml
from uav_bt.tree.node_page import node_page
from uav_bt.tree.nodes import BUILTIN_NODES
from uav_bt.tree.port import port_text
from uav_bt.tree.shipped import resolve_tree

if TYPE_CHECKING:
    from uav_bt.tree.dry_run import SimulatedTick


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
            page with a section for each node, and one for each board key's type.
    """
    chosen = NodeRegistry(registry[name] for name in names) if names else registry
    listed = [registry[name] for name in names] or describe.in_order(registry)
    if format_ == "xml":
        click.echo(describe.palette_xml(chosen), nl=False)
    elif format_ == "markdown":
        click.echo(node_page(chosen, board=not names), nl=False)
    elif format_ == "json":
        click.echo(json.dumps([_as_json(node) for node in listed], indent=2))
    else:
        from rich.console import Console  # noqa: PLC0415  (only here, and slow to import)
        from rich.markdown import Markdown  # noqa: PLC0415

        sections = "\n\n".join(text for node in listed for text in describe.section(node))
        Console().print(Markdown(sections))


def _as_json(node: type[Node]) -> dict[str, Any]:
    plain = ("name", "doc", "direction", "least", "most", "range", "required", "sample")
    ports = [
        {
            **{name: getattr(port, name) for name in plain},
            "type": port.type.__name__,
            "default": describe.default_text(port),
            "choices": [*map(port_text, port.choices)],
        }
        for port in node.ports
    ]
    return {
        "node_id": node.node_id,
        "kind": node.kind.value,
        "doc": describe.summary(node),
        "ports": ports,
        **describe.declared(node)._asdict(),
        "builtin": node in BUILTIN_NODES,
        "origin": describe.origin(node),
    }


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
    path, lookup, values = resolve_tree(tree), tree_folders.lookup(), single(parameters)
    loaded = load_tree(path, registry, tree_id=tree_id, lookup=lookup, parameters=values)
    print_or_write(describe.render(loaded.root, loaded.name, format_), out)


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
def simulate(
    tree: str,
    *,
    script: Annotated[Path, Option(path="read")],
    ticks: Count = 1000,
    tick_s: Annotated[float, Gt(0), Le(3600)] = 0.1,
    format_: Annotated[Literal["table", "json"], Option(form="--format")] = "table",
    tree_id: TreeId = None,
    registry: FlownRegistry,
    tree_folders: Folders,
    parameters: ParameterSets,
    lab: CheckedLab = None,
) -> bool:
    """Tick a tree file with leaves that answer by a script.

    TREE is a file, or the name of a mission that ships with uav-bt. Nothing flies: this shows which
    leaves run when, which are halted, and the values of the variables. Exits with 0 when the root
    succeeds, with 1 when it fails, is skipped or does not end. Ticks that repeat the one before are
    left out of the table.

    \b
    The script is a YAML file, such as this answers.yaml:
      leaves: {TakeOff: RRS, Explore: (RRS), Avoid: F}  # by path, name or node id
      default: S                                        # for all other leaves
      outputs: {Measure: {depth_m: 1.5}}                # when it succeeds
      variables: {laps: 3}                              # --var takes precedence
      board: {phase: explore}

    R is running, S success, F failure, K skipped. The last answer stays; those in brackets are
    given over and over.

    Options:
        script: Answers of the leaves (YAML).
        ticks: Stop after this many ticks.
        tick_s: Seconds between two ticks, for timers.
        format_: json: one object with all ticks.
    """  # noqa: D301  (click needs the backspace)
    from uav_bt.tree.dry_run import Simulation, read_script  # noqa: PLC0415  (reads YAML)

    values, path = single(parameters), resolve_tree(tree)
    if lab is not None:
        place = load_lab(lab)
        refuse_in_lab(place, registry, path, [values], tree_id=tree_id, tree_folders=tree_folders)
    simulation = Simulation(
        path,
        read_script(script),
        registry,
        tick_s=tick_s,
        tree_id=tree_id,
        lookup=tree_folders.lookup(),
        parameters=values,
    )
    steps = simulation.run(ticks)
    if format_ == "json":
        done = list(steps)
        last, root = done[-1], done[-1].status.name
        report = {"tree": tree, "status": root, "ticks": [_tick_json(step) for step in done]}
        click.echo(json.dumps(report, indent=2))
    else:
        last = _print_table(steps)
        root = last.status.name
        ended = "not ended" if root == "RUNNING" else root
        ticked = "1 tick" if last.tick == 1 else f"{last.tick} ticks"
        click.echo(f"{ended} after {ticked}, {last.time_s:.2f} s")
    return root == "SUCCESS"


def _print_table(steps: Iterator[SimulatedTick]) -> SimulatedTick:
    """Print a line for each tick that does not repeat the one before; return the last tick."""
    click.echo(" tick     time  root     leaves")
    last = next(steps)
    click.echo(_tick_line(last))
    for step in steps:
        same = (step.status, step.answers) == (last.status, last.answers)
        if not same or step.halted or step.changed:
            click.echo(_tick_line(step))
        last = step
    return last


def _tick_line(step: SimulatedTick) -> str:
    parts = [", ".join(f"{leaf} {status.letter}" for leaf, status in step.answers)]
    if step.halted:
        parts.append(f"halted {', '.join(step.halted)}")
    if changed := {n: "none" if v is None else _plain(v) for n, v in step.changed.items()}:
        parts.append(", ".join(f"{name}={text}" for name, text in changed.items()))
    what = "; ".join(filter(None, parts))
    return f"{step.tick:>5}  {step.time_s:>7.2f}  {step.status.name:<7}  {what}".rstrip()


def _plain(value: Any) -> Any:
    plain = value is None or isinstance(value, (bool, int, float, str))
    return value if plain else f"<{type(value).__name__}>"


def _tick_json(step: SimulatedTick) -> dict[str, Any]:
    return {
        "tick": step.tick,
        "time_s": round(step.time_s, 6),
        "status": step.status.name,
        "leaves": [{"leaf": leaf, "status": status.name} for leaf, status in step.answers],
        "halted": list(step.halted),
        "changed": {name: _plain(value) for name, value in step.changed.items()},
    }


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
