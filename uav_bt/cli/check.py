"""`uav-bt check` and `new`: they import little, so that they answer at once."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Final, Literal

import click

from uav_bt.cli.declare import command
from uav_bt.cli.shared import CheckedLab, ParameterSets, Registry, refuse_in_lab
from uav_bt.errors import FileError, InputError
from uav_bt.files import reading
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import load_lab
from uav_bt.option import Option
from uav_bt.tree import NodeRegistry
from uav_bt.tree.loading.findings import Finding, Rule, errors_of
from uav_bt.tree.loading.loader import FilesTogether, check_text, findings_of
from uav_bt.tree.loading.lookup import Folders, Library, Lookup, TreeFolders, TreeId
from uav_bt.tree.loading.parameters import Parameters
from uav_bt.tree.loading.source import MAX_BYTES, read_source
from uav_bt.tree.shipped import resolve_tree, tree_files, write_starter

_STDIN: Final = "-"  # as a TREE
_Report = tuple[Path, tuple[Finding, ...]]


@command()
def check(
    trees: Annotated[tuple[str, ...], Option(form="TREE...")],
    *,
    tree_id: TreeId = None,
    registry: Registry,
    tree_folders: Folders,
    parameters: ParameterSets,
    lab: CheckedLab = None,
    format_: Annotated[Literal["text", "json"], Option(form="--format")] = "text",
) -> None:
    """Check tree files and report all that is wrong.

    TREE is a file, a folder with tree files, or the name of a mission that ships with uav-bt. A
    folder is one workspace: its files use each other's trees. - is standard input, and a pipe is
    read, too. Exits with 2 when something is refused; a warning is about what flies all the same.
    --set, --var and --params are for one file, which is checked with their values, and with those
    of each variant of the parameter file. --lab refuses a mission that does not fit the settings of
    a lab: its network and flight height, its ceiling and its area.

    As JSON, each line is an object with file, ok and findings: objects with path, line, column,
    node, message, severity (error or warning) and rule, a name that stays. The path is that of an
    included file if the mistake is there. Line and column count from 1; null is the whole file.

    Options:
        format_: json: one object a line and file, with its findings.
    """
    lookup = tree_folders.lookup()
    one = bool(parameters or lab)
    if one and (len(trees) > 1 or Path(trees[0]).is_dir()):
        raise click.UsageError(
            "--set, --var, --params and --lab are for one mission: name one tree file"
        )
    place = None if lab is None else load_lab(lab)
    refused = False
    for tree in trees:
        if one or _is_pipe(tree):
            sets = parameters or [None]
            found = _single(tree, registry, tree_id, tree_folders, sets, lab=place)
        else:
            found = _of_files(tree, registry, tree_id, lookup)
        for path, findings in found:
            errors = errors_of(findings)
            refused |= bool(errors)
            if format_ == "json":
                click.echo(_as_json(path, findings))
                continue
            for finding in findings:
                click.echo(str(finding), err=True)
            if not errors:
                click.echo(f"{path}: good")
    if refused:
        raise SystemExit(InputError.exit_code)


def _of_files(
    tree: str, registry: NodeRegistry, tree_id: str | None, lookup: Lookup
) -> Iterator[_Report]:
    """Yield the findings of each file of a TREE."""
    try:
        files = tree_files(tree)
        if Path(tree).is_dir():
            lookup = replace(lookup, library=Library((*lookup.library.files, *files)))
    except FileError as error:
        yield Path(tree), findings_of(error, Path(tree))
        return
    together = FilesTogether(files, registry, tree_id=tree_id, lookup=lookup)
    for path in files:
        yield path, together.findings(path)


def _single(
    tree: str,
    registry: NodeRegistry,
    tree_id: str | None,
    folders: TreeFolders,
    parameters: Sequence[Parameters | None],
    *,
    lab: Lab | None,
) -> Iterator[_Report]:
    """Yield the name and the findings of one text, which is read once, with each set of values."""
    path, lookup = Path(tree), folders.lookup()
    found: list[Finding] = []
    try:
        path, source = _read(tree)
        for each in parameters:
            found += check_text(
                source, registry, path=path, tree_id=tree_id, lookup=lookup, parameters=each
            )
        if lab is not None:
            found = [one for one in found if one.rule is not Rule.LAB]
        if lab is not None and not errors_of(found):
            text = source.decode() if _is_pipe(tree) else path
            refuse_in_lab(lab, registry, text, parameters, tree_id=tree_id, tree_folders=folders)
    except InputError as error:
        found += findings_of(error, path)
    yield path, tuple(dict.fromkeys(found))


def _is_pipe(tree: str) -> bool:
    return tree == _STDIN or Path(tree).is_fifo() or Path(tree).is_char_device()


def _read(tree: str) -> tuple[Path, bytes]:
    """Return the name and the text of a file, of a shipped mission or from a pipe."""
    if not _is_pipe(tree):
        path = resolve_tree(tree)
        return path, read_source(path)
    with reading(Path(tree)), click.open_file(tree, "rb") as pipe:
        return Path("<stdin>" if tree == _STDIN else tree), pipe.read(MAX_BYTES + 1)


def _as_json(path: Path, findings: tuple[Finding, ...]) -> str:
    found = [
        {
            "path": finding.path,
            # A position of 0 means the whole file.
            "line": finding.position.line or None,
            "column": finding.position.column or None,
            "node": finding.node,
            "message": finding.message,
            "severity": finding.severity,
            "rule": finding.rule.value,
        }
        for finding in findings
    ]
    return json.dumps({"file": str(path), "ok": not errors_of(findings), "findings": found})


@command()
def new(
    file: Path,
    *,
    start: Annotated[Literal["hover", "land", "explore"], Option(form="--from")] = "hover",
) -> None:
    """Write a commented mission file to begin with.

    FILE is the new file, such as my_mission.xml. A file that exists is not overwritten.

    Options:
        start: hover: up, look round, down; land: find the mark, land; explore: the whole mission.
    """
    write_starter(file, start)
    click.echo(f"written: {file} (fly it: uav-bt fly {file})")
