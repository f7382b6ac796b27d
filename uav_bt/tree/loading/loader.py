"""Loading and checking of tree files. All findings are reported at once."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, TypedDict, Unpack
from xml.sax.saxutils import quoteattr

from uav_bt.board import Key
from uav_bt.errors import FileError, InputError, TreeError, UnknownNameError
from uav_bt.tree.loading.before_flight import faults_of, faults_of_part
from uav_bt.tree.loading.build import Builder, Built
from uav_bt.tree.loading.document import find_main, outline
from uav_bt.tree.loading.findings import (
    WHOLE_FILE,
    Finding,
    Findings,
    Position,
    Rule,
    errors_of,
)
from uav_bt.tree.loading.given import remarks, unknown_policies
from uav_bt.tree.loading.lookup import Lookup
from uav_bt.tree.loading.parameters import Parameters
from uav_bt.tree.loading.replacements import Replacements
from uav_bt.tree.loading.source import parse_source, read_source
from uav_bt.tree.loading.uses import Uses
from uav_bt.tree.loading.variable_faults import check_variables
from uav_bt.tree.loading.whole_file import whole_file
from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.nodes import SubTree
from uav_bt.tree.port import port_text
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
    findings = Findings()
    read = _Read(source, Path(path), registry, findings, lookup=lookup, parameters=parameters)
    find_main(read.document, read.root, findings, tree_id)
    replacements = Replacements(read.document, findings, overrides, by_key, mocks)
    built = read.build(read.document.main, replacements)
    read.check_others()
    findings.raise_any(path)
    assert built is not None  # noqa: S101  # else there is a finding
    if unknown := sorted({*read.unknown_policies(built)}):
        raise TreeError(path, unknown)
    for finding in findings:
        _log.warning("Warning: %s", str(finding).replace(": warning:", ":", 1))
    return built.tree


def shipped_subtree(tree_id: str, name: str | None = None, /, **entries: object) -> SubTree:
    """Return a node that runs a tree of `trees/lib/`: `shipped_subtree("ReturnToBase")`.

    Args:
        tree_id: the ID.
        name: the node's name; default: the ID.
        entries: as a SubTree has them in a tree file, or typed; a text in braces is a reference.

    Raises:
        UnknownNameError: no tree has this ID.
        TreeError: an entry is missing, unknown or cannot be read inside.
    """
    if tree_id not in (shipped := Lookup().shipped.trees):
        raise UnknownNameError("tree of trees/lib", tree_id, shipped)
    given = {"name": name or tree_id, **entries}
    texts = (f"{key}={quoteattr(port_text(value))}" for key, value in given.items())
    subtree = f'<SubTree ID="{tree_id}" {" ".join(texts)}/>'
    source = f'<root BTCPP_format="4"><BehaviorTree ID="Python">{subtree}</BehaviorTree></root>'
    registry = NodeRegistry.installed().with_any_policy()  # leaves refuse one at their setup
    root = parse_tree(source, registry, path=Path(f"{tree_id} in Python")).root
    assert isinstance(root, SubTree)  # noqa: S101  # as it is written
    return root


class _Read:
    """A tree file that was read."""

    def __init__(
        self,
        source: str | bytes,
        path: Path,
        registry: NodeRegistry | None,
        findings: Findings,
        *,
        lookup: Lookup | None,
        parameters: Parameters | None,
    ) -> None:
        self._data = source.encode() if isinstance(source, str) else source
        self._findings = findings
        self.root = parse_source(self._data, path)
        self._registry = NodeRegistry.installed() if registry is None else registry
        self.document = document = outline(self.root, self._registry, findings, lookup)
        if parameters is not None:
            document.parameters = document.place_lists.in_parameters(parameters, document.path)
        self._builder = Builder(document, findings)
        self.uses: dict[str, Uses] = {}  # of the trees that were built, by ID

    @property
    def names_main(self) -> bool:
        """Whether the file says which tree is flown, or has no tree and should have one."""
        is_palette = any(part.tag == "TreeNodesModel" for part in self.root.children)
        has_trees = bool(self.document.trees) or is_palette
        return "main_tree_to_execute" in self.root.attributes or not has_trees

    @property
    def roots(self) -> tuple[str, ...]:
        """The trees that may be flown."""
        return (self.document.main,) if self.document.main else self.document.unused

    def build(self, tree_id: str, replacements: Replacements | None = None) -> Built | None:
        """Return a tree that may be flown; None if there is no such tree, or it grows too large."""
        document = self.document
        if tree_id not in document.trees:
            return None
        built = self._builder.build(tree_id, replacements)
        if built is not None:
            tree = built.tree
            tree.sources = {document.path.resolve(): self._data, **document.included}
            tree.whole = partial(whole_file, document, self._data)
            for name, value in document.parameters.variables.items():
                tree.variables[name] = value
            self.uses[tree_id] = check_variables(built, document, self._findings)
        return built

    def check_others(self) -> None:
        """Check the trees that are not flown.

        Of these only the structure must be right, as the engine has it: the rest is a warning.
        """
        document = self.document
        idle = Findings()
        builder = Builder(document, self._findings, idle)
        for tree_id in (*document.unused, *document.trees):
            if tree_id not in self._builder.entered | builder.entered:
                built = builder.build(tree_id)
                if built is not None and tree_id in document.unused:
                    check_variables(built, document, idle)
        self._findings.take_as_warnings(idle)

    def unknown_policies(self, built: Built) -> Iterator[Finding]:
        """Yield policies that are not registered."""
        return unknown_policies(built, self.document.parameters, self._registry)

    def remarks(self, built: Built) -> Iterator[Finding]:
        """Yield what is not installed, values of caution, and what would end the flight."""
        yield from remarks(built, self.document.parameters, self._registry)
        is_flown = self.document.is_mission and not self._registry.foreign_board
        yield from (faults_of if is_flown else faults_of_part)(self.uses[built.tree.name])


def check_file(
    path: Path,
    registry: NodeRegistry | None = None,
    *,
    tree_id: str | None = None,
    lookup: Lookup | None = None,
    parameters: Parameters | None = None,
) -> tuple[Finding, ...]:
    """Return all findings of a tree file; none for a good one. See `check_text`."""
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
    """Return all findings of a tree file's text; none for a good one. See `parse_tree`.

    If the file does not say which tree is flown, all trees that no other uses are checked.
    """
    findings = Findings()
    more: list[Finding] = []
    try:
        read = _Read(source, path, registry, findings, lookup=lookup, parameters=parameters)
        if parameters is not None or tree_id is not None or read.names_main:
            find_main(read.document, read.root, findings, tree_id)
        given = None if parameters is None else Replacements(read.document, findings)
        trees = [read.build(root, given) for root in read.roots]
        read.check_others()
        for step in (read.unknown_policies, read.remarks):
            for built in trees if not errors_of((*findings, *more)) else ():
                more += [] if built is None else step(built)
    except InputError as error:
        return findings_of(error, path)
    return (*findings, *dict.fromkeys(more))  # two leaves may read one wrong value


def findings_of(error: InputError, path: Path) -> tuple[Finding, ...]:
    """Return an error that was raised while a tree file was loaded as findings."""
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
