"""Loading and checking of tree files. All findings are reported at once."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, TypedDict, Unpack

from uav_bt.board import Key
from uav_bt.errors import FileError, InputError, TreeError, UnknownNameError
from uav_bt.tree.loading.before_flight import faults_of, faults_of_part
from uav_bt.tree.loading.builder import Builder
from uav_bt.tree.loading.checker import Checker
from uav_bt.tree.loading.document import find_main, outline
from uav_bt.tree.loading.findings import (
    WHOLE_FILE,
    Finding,
    Findings,
    Position,
    Rule,
    errors_of,
)
from uav_bt.tree.loading.given_variables import check_given_variables
from uav_bt.tree.loading.lookup import Lookup
from uav_bt.tree.loading.parameters import Parameters
from uav_bt.tree.loading.remarks import remarks_on
from uav_bt.tree.loading.source import parse_source, read_source
from uav_bt.tree.loading.variable_uses import unset_slots
from uav_bt.tree.loading.whole_file import whole_file
from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.node import Node
from uav_bt.tree.registry import NodeRegistry
from uav_bt.tree.scripted import Mock

_log = logging.getLogger(__name__)


class TreeOptions(TypedDict, total=False):
    """Keyword arguments of `load_tree`; `parse_tree` describes them."""

    tree_id: str | None
    overrides: Mapping[str, Mapping[str, str]] | None
    by_key: Mapping[Key[Any], Mapping[str, str]] | None
    mocks: Mapping[str, str | Mock] | None
    lookup: Lookup | None
    parameters: Parameters | None


def load_tree(
    path: Path | str, registry: NodeRegistry | None = None, **options: Unpack[TreeOptions]
) -> MissionTree:
    """Load a tree file.

    Args:
        path: the file.
        registry: the nodes that may occur; default: all installed.
        options: `tree_id`, `overrides`, `by_key`, `mocks`, `lookup` and `parameters`; see
            `parse_tree`.

    Raises:
        TreeError: the file was refused. The error lists all findings with their places.
    """
    return parse_tree(read_source(Path(path)), registry, path=path, **options)


def parse_tree(
    source: str | bytes,
    registry: NodeRegistry | None = None,
    *,
    path: Path | str = "<text>",
    tree_id: str | None = None,
    overrides: Mapping[str, Mapping[str, str]] | None = None,
    by_key: Mapping[Key[Any], Mapping[str, str]] | None = None,
    mocks: Mapping[str, str | Mock] | None = None,
    lookup: Lookup | None = None,
    parameters: Parameters | None = None,
) -> MissionTree:
    """Load a tree from a tree file's text. Warnings are logged.

    Args:
        source: the text.
        registry: the nodes that may occur; default: all installed.
        path: what messages call the file.
        tree_id: which of the file's trees; default: the one that it names, or the only one that no
            other uses.
        overrides: attribute values that replace the file's, by a node's name or path.
        by_key: attribute values that replace the file's in all leaves that write a board key,
            beneath the overrides. A leaf without the port is left unchanged.
        mocks: scripts, or mocks with outputs, of leaves that scripted ones replace
            (`uav_bt.tree.scripted`), by path, name or node id. If several fit a leaf, the first in
            this order counts. `*` stands for all leaves without other answers, except those of the
            format. Name, path, kind, ports and conditions stay those of the file.
        lookup: where to look for trees and included files; default: the file's folder.
        parameters: values of ports, each of one node, and of the main tree's variables. They are
            checked like those of the file.

    Raises:
        TreeError: the text was refused. The error lists all findings with their places.
    """
    data = source.encode() if isinstance(source, str) else source
    registry = NodeRegistry.installed() if registry is None else registry
    findings = Findings()
    read = _Read(data, Path(path), registry, findings, lookup)
    read.take_parameters(parameters or Parameters())
    find_main(read.document, read.root, findings, tree_id)
    Checker(read.document, findings).check(read.roots)
    check_given_variables(read.document, findings)
    findings.raise_any(path)
    for finding in findings:
        _log.warning("Warning: %s", str(finding).replace(": warning:", ":", 1))
    return read.build(overrides or {}, by_key=by_key or {}, mocks=mocks or {})


def load_shipped_tree(tree_id: str) -> Node:
    """Return the root of a new tree from `trees/lib/`, with all installed nodes.

    Args:
        tree_id: the ID.

    Raises:
        UnknownNameError: no tree has this ID.
        TreeError: its file was refused.
    """
    shipped = Lookup().shipped
    if tree_id not in shipped.trees:
        raise UnknownNameError("tree of trees/lib", tree_id, shipped.trees)
    element, file = shipped.trees[tree_id][0]
    return parse_tree(file.source, path=element.path, tree_id=tree_id).root


class _Read:
    """A tree file that was read."""

    def __init__(
        self,
        data: bytes,
        path: Path,
        registry: NodeRegistry,
        findings: Findings,
        lookup: Lookup | None,
    ) -> None:
        self.root = parse_source(data, path)
        self.document = outline(self.root, registry, findings, lookup)
        self._data = data
        self._findings = findings

    @property
    def roots(self) -> tuple[str, ...]:
        """The trees that may be flown."""
        return (self.document.main,) if self.document.main else self.document.unused

    def take_parameters(self, parameters: Parameters) -> None:
        """Take values from outside, with the places of the files that variables name."""
        document = self.document
        document.parameters = document.place_lists.in_parameters(parameters, document.path)

    def build(
        self,
        overrides: Mapping[str, Mapping[str, str]],
        *,
        by_key: Mapping[Key[Any], Mapping[str, str]],
        mocks: Mapping[str, str | Mock],
    ) -> MissionTree:
        """Return the main tree.

        Raises:
            TreeError: the tree grows too large, or an override or a mock does not fit.
        """
        document = self.document
        builder = Builder(document, self._findings)
        root = builder.build(overrides, by_key=by_key, mocks=mocks)
        self._given = builder.given
        tree = MissionTree(
            root,
            name=document.main,
            sources={document.path.resolve(): self._data, **document.included},
            whole=partial(whole_file, document, self._data),
            places=builder.places,
            replaced=builder.replaced,
            enum_members=document.enum_members,
            unset=[
                slot.name
                for slot in unset_slots(document, [document.main])
                if any(read.asks or read.named for read in slot.reads)
            ],
        )
        for name, value in document.parameters.variables.items():
            tree.variables[name] = value
        return tree

    def remarks(self) -> Iterator[Finding]:
        """Build the main tree; yield findings for names not installed, and for values of caution.

        Raises:
            TreeError: it grows too large.
        """
        tree = self.build({}, by_key={}, mocks={})
        for port, value in self._given:
            yield from remarks_on(port, value, self.document.registry)
        if self.document.registry.foreign_board:
            return
        if self.document.is_mission:
            yield from faults_of(tree)
            yield from self._unset_variables()
        else:
            yield from faults_of_part(tree)

    def _unset_variables(self) -> Iterator[Finding]:
        """Yield the reads of variables of the main tree that nothing gives a value."""
        for slot in unset_slots(self.document, [self.document.main]):
            uses = [read.use for read in slot.reads if read.asks or read.named]
            for use in uses[:1]:
                yield Finding(
                    str(use.element.path),
                    use.element.at(use.attribute),
                    f"attribute '{use.attribute}': nothing sets variable '{slot.name}' of the main "
                    f"tree: give it a value in a Script before, or with --var {slot.name}=VALUE",
                    use.element.label,
                    rule=Rule.VARIABLE,
                )


def check_file(
    path: Path,
    registry: NodeRegistry | None = None,
    *,
    tree_id: str | None = None,
    lookup: Lookup | None = None,
    parameters: Parameters | None = None,
) -> tuple[Finding, ...]:
    """Return all findings of a tree file; none for a good one. See `check_text`.

    Args:
        path: the file.
        registry: the nodes that may occur; default: all installed.
        tree_id: the tree that is to be flown; default: the one that the file names.
        lookup: where to look for trees and included files; default: the file's folder.
        parameters: values from outside; see `parse_tree`.
    """
    try:
        source = read_source(path)
    except InputError as error:
        return findings_of(error, path)
    return check_text(
        source, registry, path=path, tree_id=tree_id, lookup=lookup, parameters=parameters
    )


def check_text(
    source: str | bytes,
    registry: NodeRegistry | None = None,
    *,
    path: Path,
    tree_id: str | None = None,
    lookup: Lookup | None = None,
    parameters: Parameters | None = None,
) -> tuple[Finding, ...]:
    """Return all findings of a tree file's text; none for a good one.

    If the file does not say which tree is flown, all trees that no other uses are checked.

    Args:
        source: the text, which may differ from the file on the disk.
        registry: the nodes that may occur; default: all installed.
        path: the file.
        tree_id: the tree that is to be flown; default: the one that the file names.
        lookup: where to look for trees and included files; default: the file's folder.
        parameters: values from outside, for the one tree that is flown; see `parse_tree`.
    """
    data = source.encode() if isinstance(source, str) else source
    registry = registry or NodeRegistry.installed()
    findings = Findings()
    remarks: list[Finding] = []
    try:
        read = _Read(data, path, registry, findings, lookup)
        if parameters is None:
            _find_main_to_check(read, findings, tree_id)
        else:
            read.take_parameters(parameters)
            find_main(read.document, read.root, findings, tree_id)
        roots = read.roots
        Checker(read.document, findings).check(roots)
        check_given_variables(read.document, findings)
        if not errors_of(findings):
            for read.document.main in roots:
                remarks += read.remarks()
    except InputError as error:
        return findings_of(error, path)
    return (*findings, *remarks)


def _find_main_to_check(read: _Read, findings: Findings, tree_id: str | None) -> None:
    is_palette = any(part.tag == "TreeNodesModel" for part in read.root.children)
    if tree_id is not None or "main_tree_to_execute" in read.root.attributes:
        find_main(read.document, read.root, findings, tree_id)
    elif not read.document.trees and not is_palette:
        find_main(read.document, read.root, findings, None)


def findings_of(error: InputError, path: Path) -> tuple[Finding, ...]:
    """Return an error as findings.

    Args:
        error: raised while a tree file was loaded.
        path: the file.
    """
    if isinstance(error, FileError) and not isinstance(error, TreeError):
        position = WHOLE_FILE if error.line is None else Position(error.line, 1)
        where = error.path if error.line is None else f"{error.path}:{error.line}"
        message = str(error).removeprefix(f"{where}: ")
        return (Finding(str(error.path), position, message, rule=Rule.FILE),)
    details = error.details if isinstance(error, TreeError) else (error,)
    return tuple(
        detail if isinstance(detail, Finding) else Finding(str(path), WHOLE_FILE, str(detail))
        for detail in details
    )
