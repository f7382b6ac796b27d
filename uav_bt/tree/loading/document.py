"""A tree file's outline: its includes, its trees, its main tree, its node models."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from uav_bt.errors import did_you_mean
from uav_bt.tree.loading.elements import (
    check_attributes,
    check_no_text,
    doors,
    node_attributes,
    node_id_of,
)
from uav_bt.tree.loading.findings import WARNING, Findings, Rule
from uav_bt.tree.loading.lookup import Includes, Lookup
from uav_bt.tree.loading.models import read_models
from uav_bt.tree.loading.parameters import Parameters
from uav_bt.tree.loading.places import PlaceLists
from uav_bt.tree.loading.source import Element
from uav_bt.tree.node import NodeKind
from uav_bt.tree.nodes import SubTree
from uav_bt.tree.registry import NodeRegistry

_ROOT_ATTRIBUTES: Final = frozenset({"BTCPP_format", "main_tree_to_execute", "project_name"})
_TREE_ATTRIBUTES: Final = frozenset({"ID"})
_ROOT_CHILDREN: Final = ("BehaviorTree", "TreeNodesModel", "include")
# Characters that the engine refuses in the ID of a tree.
_NOT_IN_AN_ID: Final = frozenset(" \t\n\r<>&\"'/\\|?*:.")
_RESERVED: Final = frozenset({"root", "Root"})
_METADATA: Final = "MetadataFields"  # may hold any data of an editor


@dataclass
class Document:
    """The outline of a tree file."""

    path: Path
    registry: NodeRegistry  # the nodes that may occur
    place_lists: PlaceLists
    lookup: Lookup
    main: str = ""  # "": the file leaves it open
    is_mission: bool = False  # whether the file or the caller names the main tree
    trees: dict[str, Element] = field(default_factory=dict)
    own: tuple[str, ...] = ()  # those of the file and its includes; the others are a library's
    included: dict[Path, bytes] = field(default_factory=dict)  # texts of all other files, by path
    elsewhere: tuple[str, ...] = ()  # trees of other files, for suggestions where one is missing
    unread: str = ""  # text for messages about library files that could not be read
    # Ports of the trees that the file describes as SubTree in its TreeNodesModel: default by name,
    # None where a SubTree has to give an entry.
    subtree_ports: dict[str, dict[str, str | None]] = field(default_factory=dict)
    enum_members: dict[str, int] = field(default_factory=dict)  # of enumerations, for scripts
    parameters: Parameters = field(default_factory=Parameters)  # from outside, of the main tree

    @property
    def unused(self) -> tuple[str, ...]:
        """The file's own trees that no SubTree of another of them uses."""
        used = {
            inner
            for tree_id in self.own
            for _, inner in doors(self.trees[tree_id])
            if inner != tree_id
        }
        return tuple(tree_id for tree_id in self.own if tree_id not in used)

    def within(self, tree_id: str) -> frozenset[str]:
        """Return a tree with all that it uses, however deep."""
        found: set[str] = set()
        waiting = [tree_id]
        while waiting:
            one = waiting.pop()
            if one in self.trees and one not in found:
                found.add(one)
                waiting += [inner for _, inner in doors(self.trees[one])]
        return frozenset(found)

    def entries(self, subtree: Element) -> dict[str, str]:
        """Return a SubTree's entries and conditions, the described defaults included.

        As in the engine, a subtree that shares all variables has no defaults.
        """
        given = node_attributes(subtree)
        ports = self.subtree_ports.get(subtree.attributes.get("ID", ""))
        if not ports or autoremaps(subtree):
            return given
        defaults = {name: text for name, text in ports.items() if text is not None}
        return {**defaults, **given}


def autoremaps(subtree: Element) -> bool:
    """Return whether a SubTree shares all variables; one that is refused for it counts as such."""
    try:
        return SubTree.AUTOREMAP.convert(subtree.attributes.get("_autoremap", False))
    except ValueError:
        return True


def outline(
    root: Element, registry: NodeRegistry, findings: Findings, lookup: Lookup | None = None
) -> Document:
    """Read the outline of a file and of the files that it includes."""
    lookup = lookup or Lookup()
    included = Includes(root.path, lookup)
    document = Document(
        root.path,
        registry,
        PlaceLists(included.sources, findings),
        lookup,
        included=included.sources,
        enum_members=dict(registry.enum_members),
    )
    waiting = [root]
    while waiting:
        element = waiting.pop(0)
        if _check_root(element, findings):
            for child in element.children:
                if child.tag == "include":
                    waiting += included.read(child, findings)
            _read_parts(element, document, findings)
    document.own = tuple(document.trees)
    included.note_circles(findings)
    document.unread = lookup.library.hint()
    named = root.attributes.get("main_tree_to_execute")
    _fetch(document, lookup, findings, [] if named is None else [(root, named)])
    return document


def _check_root(root: Element, findings: Findings) -> bool:
    if root.tag != "root":
        message = f"expected the element <root>, got <{root.tag}>"
        findings.note(root, message, rule=Rule.ROOT, label="")
        return False
    check_attributes(root, _ROOT_ATTRIBUTES, findings)
    check_no_text(root, findings)
    for position, message in root.mended:
        findings.add(root.path, position, message, severity=WARNING, rule=Rule.FILE)
    version = root.attributes.get("BTCPP_format")
    expected = 'expected BTCPP_format="4", got'
    if version is None:
        findings.warn(root, f"{expected} nothing", rule=Rule.ROOT)
    elif version != "4":
        cure = ": convert it with convert_v3_to_v4.py of BehaviorTree.CPP" if version == "3" else ""
        findings.note(root, f"{expected} '{version}'{cure}", "BTCPP_format", rule=Rule.ROOT)
    return True


def _read_parts(root: Element, document: Document, findings: Findings) -> None:
    tags = Counter(child.tag for child in root.children)
    for child in root.children:
        if child.tag == "BehaviorTree":
            _read_tree(child, document, findings, alone=tags[child.tag] == 1)
        elif child.tag == "TreeNodesModel":
            _read_models(child, document, findings)
        elif child.tag not in (*_ROOT_CHILDREN, _METADATA):
            hint = did_you_mean(child.tag, _ROOT_CHILDREN)
            findings.warn(child, f"<{child.tag}> means nothing in <root>{hint}")
    for models in [child for child in root.children if child.tag == "TreeNodesModel"][1:]:
        message = "a file has one <TreeNodesModel>: move its content to the first"
        findings.note(models, message, rule=Rule.NODE_MODEL)


def _read_tree(element: Element, document: Document, findings: Findings, *, alone: bool) -> None:
    check_attributes(element, _TREE_ATTRIBUTES, findings)
    check_no_text(element, findings)
    tree_id = element.attributes.get("ID", "")
    if not tree_id and alone:
        tree_id = f"BehaviorTree_{len(document.trees)}"  # as the engine calls it
    if not tree_id:
        findings.note(element, "attribute 'ID' is missing", rule=Rule.TREE_ID)
        return
    if len(element.children) != 1:
        count = len(element.children)
        findings.note(element, f"needs exactly one child, has {count}", rule=Rule.CHILDREN)
    if tree_id in document.trees:
        first = document.trees[tree_id]
        message = f"this ID is taken by the tree at {first.path}:{first.position}"
        findings.note(element, message, "ID", rule=Rule.TREE_ID)
        return
    _check_id(element, tree_id, document.registry, findings)
    document.trees[tree_id] = element


def _check_id(element: Element, tree_id: str, registry: NodeRegistry, findings: Findings) -> None:
    forbidden = next((letter for letter in tree_id if letter in _NOT_IN_AN_ID), None)
    if forbidden is not None:
        better = "".join("_" if letter in _NOT_IN_AN_ID else letter for letter in tree_id)
        message = f"a tree's ID cannot have '{forbidden}' (the engine refuses it since 4.8.4)"
        findings.note(element, f"{message}; write '{better}'", "ID", rule=Rule.TREE_ID)
    elif tree_id in _RESERVED or tree_id in registry:
        since = "is reserved (since 4.8.4 of the engine)"
        what = since if tree_id in _RESERVED else "is the name of a node"
        message = f"'{tree_id}' {what}: choose another ID"
        findings.note(element, message, "ID", rule=Rule.TREE_ID)


def _fetch(
    document: Document, lookup: Lookup, findings: Findings, main: list[tuple[Element, str]]
) -> None:
    """Take over the trees of other files that the document's own use."""
    short = _Short(document, findings)
    for tree_id, tree in document.trees.items():
        document.trees[tree_id] = short.replaced(tree)
    waiting = [door for tree in document.trees.values() for door in doors(tree)]
    waiting += [one for one in main if one[1] in lookup.library.trees]
    while waiting:
        node, tree_id = waiting.pop()
        found = [] if tree_id in document.trees else lookup.find(tree_id, document.path)
        if not found:
            if tree_id not in document.trees:
                document.elsewhere = (*lookup.library.trees, *lookup.shipped.trees)
            continue
        if len(found) > 1:
            places = " and ".join(f"{each.path}:{each.position}" for each, _ in found)
            message = f"tree '{tree_id}' stands in several files: {places}; rename one"
            findings.note(node, message, "ID", rule=Rule.UNKNOWN_TREE)
        tree, file = short.replaced(found[0][0]), found[0][1]
        _read_tree(tree, document, findings, alone=False)
        document.included[tree.path] = file.source
        for models in file.root.children:
            if models.tag == "TreeNodesModel":
                _read_models(models, document, findings)
        waiting += doors(tree)
    for tree_id, model in short.used.items():  # a user's tree may stand in for a shipped one
        if tree_id not in document.subtree_ports:
            _read_models(replace(model, children=[model]), document, findings)


class _Short:
    """Nodes that are none, but described trees that ship: `<ReturnToBase/>`.

    Such a node is short for `<SubTree ID="ReturnToBase"/>`. A port whose type lists its literals
    (`memory|policy`) chooses the tree: not the default, but `ReturnToBaseByPolicy`.
    """

    def __init__(self, document: Document, findings: Findings) -> None:
        self._document = document
        self._findings = findings
        self.used: dict[str, Element] = {}  # models of such trees, by ID

    def replaced(self, element: Element) -> Element:
        """Return a tree with SubTrees in place of such nodes, and places in place of their files.

        Elements are shared by the readings of a file, so those that change are copied.
        """
        children = [self.replaced(child) for child in element.children]
        document, node_id = self._document, node_id_of(element)
        if element.tag == SubTree.node_id:
            tree_id = element.attributes.get("ID", "")
            tree_id = "" if tree_id in document.trees else tree_id
        else:
            tree_id = "" if node_id in document.registry else node_id
        new = element
        if tree_id and tree_id in document.lookup.described:
            attributes = self._chosen(element, tree_id)
            new = replace(element, tag=SubTree.node_id, attributes=attributes)
        if places := document.place_lists.in_attributes(new, document.registry):
            new = replace(new, attributes={**new.attributes, **places})
        same = all(one is other for one, other in zip(children, element.children, strict=True))
        return new if same else replace(new, children=children)

    def _chosen(self, element: Element, tree_id: str) -> dict[str, str]:
        described = self._document.lookup.described
        attributes = {**element.attributes, "ID": tree_id}
        takes_place = element.tag != SubTree.node_id
        for port in described[tree_id].children:
            name, choices = port.attributes.get("name", ""), port.attributes.get("type", "")
            takes_place |= "|" in choices
            chosen = attributes.pop(name, None) if "|" in choices else None
            if chosen is not None and chosen not in choices.split("|"):
                hint = did_you_mean(chosen, choices.split("|"))
                message = f"expected one of {choices.replace('|', ', ')}; got '{chosen}'{hint}"
                message = f"attribute '{name}' chooses a tree: {message}"
                self._findings.note(element, message, name, rule=Rule.ATTRIBUTE)
            elif chosen is not None and chosen != port.attributes.get("default"):
                attributes["name"] = attributes.get("name") or tree_id
                attributes["ID"] = f"{tree_id}By{chosen.capitalize()}"
        if takes_place:
            self.used[attributes["ID"]] = described[attributes["ID"]]
        return attributes


def find_main(document: Document, root: Element, findings: Findings, tree_id: str | None) -> None:
    """Find the tree that is to be flown, and note when it is not clear which."""
    named = root.attributes.get("main_tree_to_execute")
    wanted = tree_id if tree_id is not None else named
    if root.tag != "root" or (wanted is not None and wanted in document.trees):
        document.main = wanted or ""
        document.is_mission = bool(document.main)
        return
    reason = "the file has no BehaviorTree"
    at = "main_tree_to_execute" if tree_id is None and wanted is not None else ""
    if wanted is not None:
        lead = "main_tree_to_execute: " if tree_id is None else ""
        reason = f"{lead}there is no tree '{wanted}'{did_you_mean(wanted, document.trees)}"
    elif document.own:
        unused = document.unused
        if len(unused) == 1:
            document.main = unused[0]
            return
        reason = (
            f"which of these trees is meant: {', '.join(unused or document.own)}? Choose one with "
            "--tree ID (in Python: tree_id=...), or write it to main_tree_to_execute in <root>"
        )
    findings.note(root, reason, at, rule=Rule.ROOT, label="root")


def _read_models(models: Element, document: Document, findings: Findings) -> None:
    found = read_models(models, document.enum_members, findings)
    for node_id, (model, ports) in found.items():
        if model.tag == NodeKind.SUBTREE.value:
            document.subtree_ports[node_id] = {
                name: document.place_lists.in_attribute(port, "default") or None
                for name, port in ports.items()
            }
