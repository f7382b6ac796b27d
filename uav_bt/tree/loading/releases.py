"""Which releases of the engine, BehaviorTree.CPP, take a tree file, and why one does not.

Only what this loader takes is looked at; what it refuses is in the file's report anyway. A release
stands for its newest patch: nothing of what follows changed between two patches of one release.
Where a change's source is not given beside it, `docs/tree-files.md` has it, with what was seen in a
running engine and what was read.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from functools import partial
from typing import Final

from uav_bt.tree.conditions import CONDITION_ATTRIBUTES
from uav_bt.tree.loading.document import Document
from uav_bt.tree.loading.elements import KIND_TAGS, node_attributes, node_id_of
from uav_bt.tree.loading.findings import ERROR, WARNING, Findings
from uav_bt.tree.loading.rules import Rule
from uav_bt.tree.loading.scopes import Slot, Use
from uav_bt.tree.loading.source import Element, walk
from uav_bt.tree.loading.variable_uses import VariableUses
from uav_bt.tree.node import NodeKind
from uav_bt.tree.nodes import ReactiveSequence, Switch2, TryCatch
from uav_bt.tree.port import bind_ports
from uav_bt.tree.registry import NodeRegistry
from uav_bt.tree.script import SCRIPTS, ScriptError, parse_script
from uav_bt.tree.script.before_4_9 import read_before_4_9
from uav_bt.tree.script.expressions import Binary, Comparison, Name
from uav_bt.tree.script.parser import tokenize

Version = tuple[int, int, int]

RELEASES: Final[Mapping[str, Version]] = {"4.6": (4, 6, 2), "4.8": (4, 8, 4), "4.10": (4, 10, 0)}
"""The releases that can be asked for, with their newest patches."""

_SWITCHED: Final = Switch2.VARIABLE  # all switches share it


class Change(Enum):
    """What the engine took up with a version, or gave up: what, the version, and what it says.

    Where it says nothing, the version is the first of which it is not known.
    """

    MINUS_AFTER_EQUALS = "`==-1` in a script", (4, 7, 0), "taken since"
    KIND_TAG = "`<Action ID>` of a node with children", (4, 8, 0), "taken since"
    WORDS = "semicolons, names and texts in scripts", (4, 9, 0), "taken since"
    OPERATORS = "operators and numbers in scripts", (4, 9, 0), ""
    AND_BESIDE_OR = "an `&&` after an or, without brackets", (4, 9, 0), ""
    TRY_CATCH = "the node `TryCatch`", (4, 9, 0), "taken since"
    NO_ID = "a tree without `ID` beside other elements", (4, 9, 0), ""
    SWITCH_TEXT = "a `Switch` over the variable of a number's port", (5, 0, 0), ""
    NUMBER_ENTRY = "a SubTree's number is a number", (4, 9, 1), "a number since"
    REACTIVE_KIND_TAG = "`<Action ID>` in a `ReactiveSequence`", (4, 7, 0), "taken before"
    DOUBLE_QUOTES = "texts in double quotes", (4, 9, 0), "taken before"
    LETTERS = "letters other than ASCII in a script's names", (4, 9, 0), "taken before"

    def __init__(self, what: str, version: Version, words: str) -> None:
        self.what = what
        self.since = version
        self.words = words

    def concerns(self, release: str) -> bool:
        """Return whether a release refuses what the change is about, or reads it otherwise."""
        later = RELEASES[release] >= self.since
        return later == (self.words == "taken before")

    def __str__(self) -> str:
        """Return when it is otherwise, for a message."""
        return f", {self.words} {'.'.join(map(str, self.since))}" if self.words else ""


@dataclass(frozen=True)
class _Trait:
    """Something in a file that not all releases take, or that they read in different ways."""

    change: Change
    element: Element
    problem: str
    cure: str
    attribute: str = ""
    verdict: str = "refused by"  # or what the releases do with it
    severity: str = ERROR


def check_releases(
    document: Document,
    registry: NodeRegistry,
    findings: Findings,
    releases: Iterable[str],
    roots: Iterable[str],
) -> None:
    """Note why releases of the engine do not take a file, or read it otherwise.

    Args:
        document: the file's outline.
        registry: the nodes that may occur.
        findings: where they are added.
        releases: of `RELEASES`.
        roots: the trees that may be flown; of the others the engine reads no scripts.

    Raises:
        TreeError: there are too many findings.
    """
    asked = list(dict.fromkeys(releases))
    if not asked:
        return
    for trait in _traits(document, registry, list(roots)):
        named = [release for release in asked if trait.change.concerns(release)]
        if named:
            findings.add(
                trait.element.path,
                trait.element.at(trait.attribute),
                f"{trait.problem}: {trait.verdict} engine {' and '.join(named)}{trait.change}; "
                f"{trait.cure}",
                trait.element.label,
                severity=trait.severity,
                rule=Rule.ENGINE,
            )


def _traits(document: Document, registry: NodeRegistry, roots: list[str]) -> Iterator[_Trait]:
    for root in document.roots:
        yield from _without_id(root)
    flown = document.within(roots)
    for tree_id, tree in document.trees.items():
        for element in walk(tree):
            yield from _of_a_node(element)
            severity = ERROR if tree_id in flown else WARNING
            for attribute, source in _scripts(element, registry):
                trait = partial(_Trait, element=element, attribute=attribute)
                yield from _of_a_script(source, attribute, trait, severity)
    for scope in VariableUses(document, registry).find(roots):
        for slot in scope.slots():
            yield from _number_entries(scope.door, slot, registry)
            yield from _switched_numbers(slot)


# --- structure ------------------------------------------------------------------------------------


def _without_id(root: Element) -> Iterator[_Trait]:
    for tree in root.children:
        if tree.tag == "BehaviorTree" and not tree.attributes.get("ID") and len(root.children) > 1:
            yield _Trait(Change.NO_ID, tree, "no 'ID' beside other elements", "write an ID")


def _of_a_node(element: Element) -> Iterator[_Trait]:
    node_id = node_id_of(element)
    if node_id == TryCatch.node_id:
        cure = (
            "write <Fallback><Sequence>...</Sequence><ForceFailure>the last child</ForceFailure>"
            "</Fallback>"
        )
        yield _Trait(Change.TRY_CATCH, element, "node 'TryCatch'", cure)
    if node_id == ReactiveSequence.node_id:
        for child in element.children:
            if child.tag in KIND_TAGS and child.tag != NodeKind.SUBTREE.value:
                inner = child.attributes.get("ID", "")
                problem = f'<{child.tag} ID="{inner}"> in a ReactiveSequence'
                yield _Trait(Change.REACTIVE_KIND_TAG, child, problem, f"write <{inner}>")
    children = {"Action": 0, "Condition": 0, "Decorator": 1}.get(element.tag)
    if children is not None and len(element.children) != children:
        problem = f"<{element.tag}> with other than {children} children"
        yield _Trait(Change.KIND_TAG, element, problem, f"write <{node_id}>")


# --- scripts --------------------------------------------------------------------------------------


def _scripts(element: Element, registry: NodeRegistry) -> Iterator[tuple[str, str]]:
    """Yield the scripts of a node that stand in the file, by attribute."""
    given = node_attributes(element)
    for name in CONDITION_ATTRIBUTES.intersection(given):
        yield name, given.pop(name)
    node_id = node_id_of(element)
    if element.tag == NodeKind.SUBTREE.value or node_id not in registry:
        return
    ports = [port for port in registry[node_id].ports if port.check in SCRIPTS]
    bound, _ = bind_ports(ports, dict(given))
    for port in ports:
        if port.name in given and isinstance(bound.get(port.name), str):
            yield port.name, given[port.name]


def _of_a_script(
    source: str, attribute: str, trait: partial[_Trait], severity: str
) -> Iterator[_Trait]:
    try:
        parse_script(source)
    except ScriptError:
        return  # refused by all
    lead = f"attribute '{attribute}': "
    older = read_before_4_9(source)
    if older.refused is not None:
        change = Change.WORDS if older.refused.mended else Change.OPERATORS
        problem, cure = lead + older.refused.problem, older.refused.cure
        yield trait(change, problem=problem, cure=cure, severity=severity)
    if older.differs is not None:
        yield trait(
            Change.AND_BESIDE_OR,
            problem=lead + older.differs.problem,
            cure=older.differs.cure,
            verdict="so it is in",
            severity=WARNING,
        )
    for change, column, problem, cure in _words(source):
        where = f"{lead}column {column}: "
        yield trait(change, problem=where + problem, cure=cure, severity=severity)


def _words(source: str) -> Iterator[tuple[Change, int, str, str]]:
    tokens = tokenize(source)
    for token in tokens:
        if token.text.startswith('"'):
            cure = "write it as '...'"
            yield Change.DOUBLE_QUOTES, token.column, "a text in double quotes", cure
        elif token.kind == "name" and not token.text.isascii():
            problem = f"letters other than ASCII in '{token.text}'"
            yield Change.LETTERS, token.column, problem, "rename it"
        # The engine's CHANGELOG says so of `A==-1` (pull request 896), and no more.
        elif token.text == "==" and re.match(r"-[0-9]", source[token.column + 1 :]):
            cure = "put the number in brackets"
            yield Change.MINUS_AFTER_EQUALS, token.column, "'-' right after '=='", cure


# --- numbers of SubTrees --------------------------------------------------------------------------


def _number_entries(door: Element | None, slot: Slot, registry: NodeRegistry) -> Iterator[_Trait]:
    """Yield an entry that is a number, where a script does what a text cannot do."""
    for entry in slot.writes:
        if door is None or entry.use.element is not door or entry.kind not in {int, float}:
            continue
        uses = [each.use for each in slot.reads if each.part and _computes(each.part, each.use)]
        uses += [
            write.use
            for write in slot.writes
            if write.use.attribute in dict(_scripts(write.use.element, registry))
        ]
        for use in uses[:1]:
            yield _Trait(
                Change.NUMBER_ENTRY,
                door,
                f"entry '{slot.name}' is a number in {use}",
                f'set a variable in a Script, and give {slot.name}="{{variable}}"',
                entry.use.attribute,
                verdict="a text in",
                severity=WARNING,
            )


def _computes(name: Name, use: Use) -> bool:
    """Return whether a script does more with a variable than a text that is a number can do."""
    script = parse_script(use.element.attributes[use.attribute])
    harmless = 0
    for part in script.walk():
        names = [each for each in part.parts() if isinstance(each, Name)]
        compares = isinstance(part, Comparison) and len(names) == 1
        if compares or (isinstance(part, Binary) and part.sign == ".."):
            harmless += names.count(name)
    return [*script.walk()].count(name) > harmless


def _switched_numbers(slot: Slot) -> Iterator[_Trait]:
    """Yield a Switch over a variable that a port has made a number: there it takes texts only."""
    made = None
    for use, port in slot.ports:
        if port is _SWITCHED and made is not None:
            yield _Trait(
                Change.SWITCH_TEXT,
                use.element,
                f"variable '{slot.name}' is a number for {made}, and a text for {use.element.tag}",
                f'copy it: <Script code="copy := {slot.name}"/>, {use.attribute}="{{copy}}"',
                use.attribute,
            )
        elif port is _SWITCHED or port.type is str:
            return  # the first to make a variable gives its type; a text is taken by all
        elif port.type in {bool, int, float}:
            made = made or use
