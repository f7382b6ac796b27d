"""Loading and checking of tree files. All findings are reported at once."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypedDict, Unpack
from xml.etree import ElementTree as ET
from xml.sax.saxutils import quoteattr

from uav_bt.board import Key
from uav_bt.errors import FileError, InputError, TreeError, UnknownNameError
from uav_bt.tree.loading.before_flight import faults_of, faults_of_part
from uav_bt.tree.loading.build import Builder
from uav_bt.tree.loading.document import Document, find_main, outline
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
from uav_bt.tree.loading.models import ENUMERATION, MEMBER
from uav_bt.tree.loading.parameters import Parameters
from uav_bt.tree.loading.replacements import Built, Replacements
from uav_bt.tree.loading.source import parse_source, read_source, to_xml
from uav_bt.tree.loading.variable_faults import check_variables
from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.node import NodeKind
from uav_bt.tree.nodes import SubTree
from uav_bt.tree.port import port_text
from uav_bt.tree.registry import NodeRegistry
from uav_bt.tree.scripted import Mock

_log = logging.getLogger(__name__)


class CheckOptions(TypedDict, total=False):
    """Keyword arguments of `check_file`.

    Attributes:
        tree_id: which of the file's trees; default: the one that it names, or the only one that no
            other uses.
        lookup: where to look for trees and included files; default: the file's folder.
        parameters: values of ports, each of one node, and of the main tree's variables. They are
            checked like those of the file.
    """

    tree_id: str | None
    lookup: Lookup | None
    parameters: Parameters | None


class TreeOptions(CheckOptions, total=False):
    """Keyword arguments of `load_tree` and `parse_tree`: those of `CheckOptions`, and these.

    Attributes:
        overrides: attribute values that replace the file's, by a node's name or path.
        by_key: attribute values that replace the file's in all leaves that write a board key,
            beneath the overrides. A leaf without the port is left unchanged.
        mocks: scripts, or mocks with outputs, of leaves that scripted ones replace
            (`uav_bt.tree.scripted`), by path, name or node id. If several fit a leaf, the first in
            this order counts. `*` stands for all leaves without other answers, except those of the
            format. Name, path, kind, ports and conditions stay those of the file.
    """

    overrides: Mapping[str, Mapping[str, str]] | None
    by_key: Mapping[Key[Any], Mapping[str, str]] | None
    mocks: Mapping[str, str | Mock] | None


def load_tree(
    path: Path | str, registry: NodeRegistry | None = None, **options: Unpack[TreeOptions]
) -> MissionTree:
    """Load a tree file; see `parse_tree`."""
    return parse_tree(read_source(Path(path)), registry, path=path, **options)


def parse_tree(
    source: str | bytes,
    registry: NodeRegistry | None = None,
    *,
    path: Path | str = "<text>",
    **options: Unpack[TreeOptions],
) -> MissionTree:
    """Load a tree from a tree file's text. Warnings are logged.

    Args:
        source: the text.
        registry: the nodes that may occur; default: all installed.
        path: what messages call the file.
        options: `tree_id`, `lookup`, `parameters`, `overrides`, `by_key` and `mocks`; see
            `TreeOptions`.

    Raises:
        TreeError: the text was refused. The error lists all findings with their places.
    """
    findings = Findings()
    read = _Read(source, Path(path), registry, findings, options)
    find_main(read.document, read.root, findings, options.get("tree_id"))
    given = (options.get("overrides"), options.get("by_key"), options.get("mocks"))
    replacements = Replacements(read.document, findings, *given)
    built = read.build(read.document.main, replacements)
    read.check_others()
    findings.raise_any(path)
    assert built is not None  # noqa: S101  # else there is a finding
    if unknown := sorted({*unknown_policies(built, read.document)}):
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
        options: CheckOptions,
    ) -> None:
        self._data = source.encode() if isinstance(source, str) else source
        self._findings = findings
        self.root = parse_source(self._data, path)
        registry = NodeRegistry.installed() if registry is None else registry
        self.document = document = outline(self.root, registry, findings, options.get("lookup"))
        if (given := options.get("parameters")) is not None:
            document.parameters = document.place_lists.in_parameters(given, path)
        self._builder = Builder(document, findings)

    @property
    def roots(self) -> tuple[str, ...]:
        """The trees that may be flown."""
        return (self.document.main,) if self.document.main else self.document.unused

    def build(self, tree_id: str, replacements: Replacements | None = None) -> Built | None:
        """Return a tree that may be flown; None if there is no such tree, or it grows too large."""
        document = self.document
        built = None
        if tree_id in document.trees:
            built = self._builder.build(tree_id, replacements)
        if built is not None:
            built.tree.sources = {document.path.resolve(): self._data, **document.included}
            built.tree.whole = partial(whole_file, document, self._data)
            for name, value in document.parameters.variables.items():
                built.tree.variables[name] = value
            check_variables(built, document, self._findings)
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


def _remarks(built: Built, document: Document) -> Iterator[Finding]:
    """Yield what is not installed, values of caution, and what would end the flight."""
    yield from remarks(built, document)
    is_flown = document.is_mission and not document.registry.foreign_board
    yield from (faults_of if is_flown else faults_of_part)(built.uses)


def check_file(
    path: Path, registry: NodeRegistry | None = None, **options: Unpack[CheckOptions]
) -> tuple[Finding, ...]:
    """Return all findings of a tree file; none for a good one. See `check_text`."""
    return check_text(None, registry, path=path, **options)


def check_text(
    source: str | bytes | None,
    registry: NodeRegistry | None = None,
    *,
    path: Path,
    **options: Unpack[CheckOptions],
) -> tuple[Finding, ...]:
    """Return all findings of a tree file's text (None: it is read); none for a good one.

    If the file does not say which tree is flown, all trees that no other uses are checked.
    """
    findings = Findings()
    more: list[Finding] = []
    try:
        source = read_source(path) if source is None else source
        read = _Read(source, path, registry, findings, options)
        has_values, tree_id = options.get("parameters") is not None, options.get("tree_id")
        parts = {"TreeNodesModel"}.intersection(part.tag for part in read.root.children)
        names_main = "main_tree_to_execute" in read.root.attributes
        is_empty = not (read.document.trees or parts)  # a file with models only is a palette
        if has_values or tree_id is not None or names_main or is_empty:
            find_main(read.document, read.root, findings, tree_id)
        given = Replacements(read.document, findings) if has_values else None
        trees = [read.build(root, given) for root in read.roots]
        read.check_others()
        for step in (unknown_policies, _remarks):
            for built in trees if not errors_of((*findings, *more)) else ():
                more += [] if built is None else step(built, read.document)
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


class FilesTogether:
    """Tree files of one workspace; each is checked when it is first asked for."""

    def __init__(
        self, files: Iterable[Path], registry: NodeRegistry, **options: Unpack[CheckOptions]
    ) -> None:
        self._called = {str(path.resolve()): str(path) for path in files}
        self._check = partial(check_file, registry=registry, **options)
        self._found: dict[str, tuple[Finding, ...]] = {}

    def findings(self, path: Path) -> tuple[Finding, ...]:
        """Return the findings of a file.

        A finding in another of the files is in the report of that other file, except when it
        depends on this file's use of it.
        """
        return tuple(one for one in self._all(str(path)) if not self._is_reported(one, str(path)))

    def _is_reported(self, finding: Finding, path: str) -> bool:
        if finding.path == path or finding.path not in self._called.values():
            return False
        # The node's path depends on the tree.
        return any(replace(finding, node=one.node) == one for one in self._all(finding.path))

    def _all(self, path: str) -> tuple[Finding, ...]:
        if path not in self._found:
            self._found[path] = tuple(
                replace(one, path=self._called.get(one.path, one.path))
                for one in self._check(Path(path))
            )
        return self._found[path]


def whole_file(document: Document, source: bytes) -> bytes:
    """Return the main tree with all that it uses as one file: its own where nothing is elsewhere.

    Args:
        document: the outline; the places of files are in its trees and defaults.
        source: the mission's own file.
    """
    if not document.included:
        return source
    root = ET.Element("root", BTCPP_format="4", main_tree_to_execute=document.main)
    used = document.within(document.main)
    for tree_id in (document.main, *sorted(used - {document.main})):
        tree = to_xml(document.trees[tree_id])
        tree.set("ID", tree_id)
        root.append(tree)
    models = ET.SubElement(root, "TreeNodesModel")
    for tree_id in sorted(used & document.subtree_ports.keys()):
        model = ET.SubElement(models, NodeKind.SUBTREE.value, ID=tree_id)
        for name, default in document.subtree_ports[tree_id].items():
            given = {} if default is None else {"default": default}
            ET.SubElement(model, "input_port", {"name": name, **given})
    enumeration = ET.SubElement(models, ENUMERATION)
    for name, value in document.enum_members.items():
        ET.SubElement(enumeration, MEMBER, name=name, value=str(value))
    return ET.tostring(root, encoding="unicode").encode()
