"""Arguments and options that several commands take."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import click
from annotated_types import Ge, Gt

from uav_bt.files import write_whole
from uav_bt.lab.lab import Lab
from uav_bt.option import Option
from uav_bt.tree import NodeRegistry
from uav_bt.tree.loading.findings import Findings
from uav_bt.tree.loading.models import with_palette
from uav_bt.tree.loading.parameters import Parameters, Params, Ports, Variables
from uav_bt.tree.registry import OwnLeaves, with_leaves

RUNS: Final = Path("runs")  # the folder of results; git ignores it
_NONE: Final[Mapping[str, str]] = {}

Count = Annotated[int, Ge(1)]
Positive = Annotated[float, Gt(0)]
InputFile = Annotated[Path | None, Option(path="read")]
OutputFile = Annotated[Path | None, Option(path="written")]
OutputFolder = Annotated[Path | None, Option(path="folder")]
Records = Annotated[tuple[Path, ...], Option(form="RECORDS...")]
TextFormat = Annotated[
    Literal["text", "json"], Option("text is for people; json is one object.", "--format")
]
Workers = Annotated[int | None, Ge(1), Option("Flights at a time; default: all cores.")]
Steps = Annotated[int, Ge(1), Option("Steps of training.")]
Device = Annotated[
    Literal["cpu", "cuda"],
    Option("Where PyTorch trains; 'cuda' needs a GPU and a PyTorch built for it."),
]
CheckedLab = Annotated[
    str | None,
    Option(
        "Check the mission in this lab, too: a shipped lab, a folder of labs/, or a path.",
        "--lab NAME",
    ),
]


def registry_with(*, leaves: OwnLeaves = (), palette: InputFile = None) -> NodeRegistry:
    """Return the installed nodes, those of Python files and those of a palette.

    Options:
        palette: A file with a TreeNodesModel, such as Groot2 exports or saves in its tree files, of
            nodes that are not installed here.
    """
    registry = with_leaves(NodeRegistry.installed(), [Path(file) for file in leaves])
    if palette is None:
        return registry
    odd = Findings()
    registry = with_palette(registry, palette, odd)
    for finding in odd:
        click.echo(str(finding), err=True)
    return registry


Registry = Annotated[NodeRegistry, Option(parts=registry_with)]
FlownRegistry = Annotated[NodeRegistry, Option(parts=registry_with, only=("leaves",))]
"""Registries with a palette and without."""


def _parameters(
    *, ports: Ports = _NONE, variables: Variables = _NONE, params: Params = None
) -> tuple[Parameters, ...]:
    """Return the values of the command line: none, one set, or one for each variant of the file."""
    own = Parameters(ports=ports, variables=variables)
    if params is None:
        return (own,) if ports or variables else ()
    from uav_bt.tree.loading.parameter_file import read_parameters  # noqa: PLC0415  (reads YAML)

    file = read_parameters(params)
    return tuple(own.over(each) for each in file.variants.values() or [file.common])


ParameterSets = Annotated[tuple[Parameters, ...], Option(parts=_parameters)]


def single(parameters: Sequence[Parameters]) -> Parameters | None:
    """Return the one set of values of a command that takes no variants; None without values."""
    if len(parameters) > 1:
        raise click.UsageError(
            f"the file of --params has {len(parameters)} variants, which a campaign flies and "
            "`uav-bt check` checks: give a file with `set` and `var` only"
        )
    return next(iter(parameters), None)


def refuse_in_lab(
    lab: Lab,
    registry: NodeRegistry,
    tree: Path | str,
    parameters: Sequence[Parameters | None],
    **lookup: Any,
) -> None:
    """Refuse a mission that does not fit a lab, with each set of values; None: no values.

    `lookup` says which tree is meant and where others are found, as `FlightOptions` takes it.
    """
    # Late: `uav-bt check` answers at once, and these import the parts of a flight.
    from uav_bt.app.flight import check  # noqa: PLC0415

    for each in parameters:
        given = each or Parameters()
        check(tree, registry, lab=lab, ports=given.ports, variables=given.variables, **lookup)


def print_or_write(text: str, out: Path | None) -> None:
    """Print a text, or write it to a file and name the file."""
    if out is None:
        click.echo(text, nl=False)
        return
    write_whole(out, text)
    click.echo(f"written: {out}")


def write_scores(scores: Mapping[str, Any], out: Path | None) -> None:
    """Write scores as JSON, if there is a file for them."""
    if out is not None:
        write_whole(out, json.dumps(scores, indent=2) + "\n")
        click.echo(f"scores: {out}")


def table(rows: Sequence[Sequence[object]], *, left: int = 1, indent: str = "") -> str:
    """Return a table as text; the first `left` columns are words, the others are numbers."""
    texts = [[str(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*texts, strict=True)]
    lines = []
    for row in texts:
        cells = [f"{cell:{'<' if n < left else '>'}{widths[n]}}" for n, cell in enumerate(row)]
        lines.append(f"{indent}{'  '.join(cells)}".rstrip())
    return "\n".join(lines)
