"""Tree files of BehaviorTree.CPP 3 made into files of version 4, with comments and layout kept.

What is changed is what the engine's own guide and converter (`convert_v3_to_v4.py`) name:
https://www.behaviortree.dev/docs/migration. What has no equal there is left as it stands, and
noted.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from uav_bt.errors import TreeError
from uav_bt.tree.conditions import CONDITION_ATTRIBUTES
from uav_bt.tree.editing.markup import Attribute, Kind, Piece, resolve, scan
from uav_bt.tree.loading.elements import EDITOR_ATTRIBUTES, KIND_TAGS
from uav_bt.tree.loading.findings import WARNING, Finding, Findings, Position
from uav_bt.tree.loading.rules import Rule
from uav_bt.tree.loading.source import parse_source

# The last is a misspelling that version 3 had.
_RENAMED: Final = {
    "SequenceStar": "SequenceWithMemory",
    "SubTreePlus": "SubTree",
    "RetryUntilSuccesful": "RetryUntilSuccessful",
}
_PARALLEL: Final = {"success_threshold": "success_count", "failure_threshold": "failure_count"}
_CHECKS: Final = {f"BlackboardCheck{kind}" for kind in ("Bool", "Double", "Int", "String")}
_REFERENCE: Final = re.compile(r"\{([A-Za-z_]\w*)\}")
_NUMBER: Final = re.compile(r"-?\d+(\.\d+)?")
_YES: Final = {"yes", "true", "t", "1"}  # what the engine's converter takes for yes


@dataclass(frozen=True)
class Migrated:
    """A file of version 4.

    Attributes:
        data: its bytes.
        findings: warnings of what could not be carried over, or ticks otherwise now, with their
            places in the file of version 3.
    """

    data: bytes
    findings: tuple[Finding, ...]


def migrate_source(data: bytes, path: Path) -> Migrated:
    """Return a file of version 3 as one of version 4.

    Args:
        data: the file's bytes.
        path: what messages call the file.

    Raises:
        TreeError: it is no well-formed XML, or no file of version 3.
    """
    root = parse_source(data, path)
    version = root.attributes.get("BTCPP_format", "3")
    if root.tag != "root" or version != "3":
        got = f"<{root.tag}>" if root.tag != "root" else f'BTCPP_format="{version}"'
        message = f"expected a <root> without BTCPP_format, or with 3, got {got}"
        where = root.at("BTCPP_format")
        raise TreeError(path, [Finding(str(path), where, message, rule=Rule.ROOT)])
    migration = _Migration(data.decode(), path)
    migrated = migration.run().encode()
    parse_source(migrated, path)
    return Migrated(migrated, tuple(migration.findings))


class _Migration:
    def __init__(self, text: str, path: Path) -> None:
        self.findings = Findings()
        self._text = text
        self._path = path
        self._edits: list[tuple[int, int, str]] = []

    def run(self) -> str:
        """Return the text of version 4."""
        opened: list[tuple[Piece, str]] = []  # tags, with their new names
        for piece in scan(self._text):
            if piece.kind is Kind.END:
                _, name = opened.pop()
                self._replace(piece.start + 2, piece.start + 2 + len(piece.name), name)
            elif piece.kind in {Kind.START, Kind.EMPTY}:
                described = any(outer.name == "TreeNodesModel" for outer, _ in opened)
                name = self._element(piece, described=described)
                self._replace(piece.start + 1, piece.start + 1 + len(piece.name), name)
                if piece.kind is Kind.START:
                    opened.append((piece, name))
        text = self._text
        for start, end, content in sorted(self._edits, reverse=True):
            text = text[:start] + content + text[end:]
        return text

    def _element(self, tag: Piece, *, described: bool) -> str:
        """Change a tag's attributes, and return its new name."""
        if tag.name == "root":
            self._root(tag)
        given = {attribute.name: attribute for attribute in tag.attributes}
        node_id = tag.name
        if tag.name in KIND_TAGS and tag.name != "SubTree" and "ID" in given:
            node_id = resolve(given["ID"].value)[0]
        new = _RENAMED.get(node_id, node_id)
        if not described:
            new = self._node(tag, node_id, given) or new
        if node_id == tag.name:
            return new
        self._value(given["ID"], new)
        return tag.name

    def _node(self, tag: Piece, node_id: str, given: dict[str, Attribute]) -> str | None:
        """Change a node's attributes, and return its new ID where that depends on them."""
        for name in given.keys() & CONDITION_ATTRIBUTES:
            self._warn(tag, given[name], f"'{name}' is a script in version 4: rename the port")
        if tag.name == "SubTree":
            self._subtree(tag)
        elif tag.name == "SubTreePlus":
            for attribute in tag.attributes:
                if attribute.name == "__autoremap":
                    self._rename(attribute, "_autoremap")
        elif node_id == "Parallel":
            for old, new in _PARALLEL.items():
                if old in given:
                    self._rename(given[old], new)
        elif node_id in _CHECKS:
            return self._check(tag, node_id, given)
        return None

    def _root(self, tag: Piece) -> None:
        for attribute in tag.attributes:
            if attribute.name == "BTCPP_format":
                self._value(attribute, "4")
                return
        at = tag.start + 1 + len(tag.name)
        self._replace(at, at, ' BTCPP_format="4"')

    def _subtree(self, tag: Piece) -> None:
        """Write the names of outer variables as references; share all where all were shared."""
        for attribute in tag.attributes:
            value = resolve(attribute.value)[0]
            if attribute.name == "__shared_blackboard":
                if value.lower() not in _YES:
                    self._remove(attribute)
                    continue
                self._rename(attribute, "_autoremap")
                self._value(attribute, "true")
                message = (
                    "_autoremap shares all variables but those that begin with '_'; version 3 "
                    "shared the whole board"
                )
                self._warn(tag, attribute, message)
            elif attribute.name in {"ID", "name", *EDITOR_ATTRIBUTES, *CONDITION_ATTRIBUTES}:
                continue
            elif value.startswith("{"):
                message = f"'{attribute.name}' is a reference already; it is left as it is"
                self._warn(tag, attribute, message)
            else:
                self._value(attribute, f"{{{attribute.value}}}")

    def _check(self, tag: Piece, node_id: str, given: dict[str, Attribute]) -> str | None:
        """Make a BlackboardCheck a Precondition, as the guide has it."""
        one, other = given.get("value_A"), given.get("value_B")
        sides = [_operand(each, node_id) for each in (one, other)]
        if one is None or other is None or None in sides:
            self._warn(tag, one, f"{node_id} cannot be written as a script; it is left as it is")
            return None
        self._replace(one.start, one.end, f'if="{sides[0]} == {sides[1]}"')
        self._remove(other)
        if "return_on_mismatch" in given:
            self._rename(given["return_on_mismatch"], "else")
        message = (
            f"a {node_id} compared at every tick, and halted its child when the values differed; "
            "Precondition asks before it starts its child, and a variable that is not set is an "
            "error"
        )
        self._warn(tag, None, message)
        return "Precondition"

    # --- edits ------------------------------------------------------------------------------------

    def _replace(self, start: int, end: int, content: str) -> None:
        if self._text[start:end] != content:
            self._edits.append((start, end, content))

    def _value(self, attribute: Attribute, value: str) -> None:
        self._replace(attribute.value_start, attribute.value_end, value)

    def _rename(self, attribute: Attribute, name: str) -> None:
        self._replace(attribute.start, attribute.start + len(attribute.name), name)

    def _remove(self, attribute: Attribute) -> None:
        before = self._text[: attribute.start]
        self._replace(len(before.rstrip()), attribute.end, "")

    def _warn(self, tag: Piece, attribute: Attribute | None, message: str) -> None:
        start = tag.start if attribute is None else attribute.start
        before = self._text[:start]
        where = Position(before.count("\n") + 1, start - (before.rfind("\n") + 1) + 1)
        self.findings.add(self._path, where, message, tag.name, severity=WARNING)


def _operand(attribute: Attribute | None, node_id: str) -> str | None:
    """Return a value of a BlackboardCheck as it stands in a script; None where it cannot."""
    if attribute is None:
        return None
    value = resolve(attribute.value)[0].strip()
    reference = _REFERENCE.fullmatch(value)
    if reference is not None:
        return reference[1]
    if node_id == "BlackboardCheckString":
        plain = not any(letter in value for letter in "'\"{}&<\\")
        return f"'{value}'" if plain else None
    if node_id == "BlackboardCheckBool":
        return value.lower() if value.lower() in {"true", "false"} else None
    return value if _NUMBER.fullmatch(value) else None
