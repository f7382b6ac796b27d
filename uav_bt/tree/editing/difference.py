"""What two tree files differ in, by structure: layout, comments and editors' notes do not count.

Children are aligned in their order, so that one that is put between others changes nothing about
them; what is gone in one place and the same in another has moved.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

from uav_bt.tree.editing.pairing import UNORDERED, Twin, paired
from uav_bt.tree.loading.findings import Position
from uav_bt.tree.loading.source import Element


class Change(Enum):
    """What became of a node."""

    ADDED = "added"
    REMOVED = "removed"
    MOVED = "moved"
    CHANGED = "changed"


@dataclass(frozen=True)
class Difference:
    """One thing that differs.

    Attributes:
        change: what became of it.
        path: of the node; in the second file, unless it is there no more.
        before: its place in the first file, None where it is new.
        after: its place in the second file, None where it is gone.
        details: attributes that differ, or where a moved node stood.
    """

    change: Change
    path: str
    before: Position | None
    after: Position | None
    details: tuple[str, ...] = ()


def differences(before: Element, after: Element) -> tuple[Difference, ...]:
    """Return what differs between two files, tree by tree in the order of the second.

    Args:
        before: the root element of the first file.
        after: that of the second.
    """
    old, new = paired(before, after)
    return (*_changes(new), *_without_partner(old, Change.REMOVED))


def _changes(new: Twin) -> Iterator[Difference]:
    yield from _without_partner(new, Change.ADDED)
    for node in new.walk():
        stayed = _in_order(node)
        for child in node.children:
            if child.partner is not None and child not in stayed:
                where = f"from {child.partner.path}"
                yield _difference(Change.MOVED, child.partner, child, where)
        if node.partner is not None:
            details = _attribute_changes(node.partner.attributes, node.attributes)
            if details:
                yield _difference(Change.CHANGED, node.partner, node, *details)


def _difference(change: Change, old: Twin, new: Twin, *details: str) -> Difference:
    return Difference(change, new.path, old.position, new.position, details)


def _without_partner(root: Twin, change: Change) -> Iterator[Difference]:
    """Yield what is in one file only, each part of a tree as one."""
    for node in root.walk():
        outer = node.parent
        if node.partner is not None or (outer is not None and outer.partner is None):
            continue
        inside = sum(part.partner is None for part in node.walk()) - 1
        details = (f"with {inside} more inside",) if inside else ()
        added = change is Change.ADDED
        before, after = (None, node.position) if added else (node.position, None)
        yield Difference(change, node.path, before, after, details)


def _in_order(parent: Twin) -> set[Twin]:
    """Return the children that stood under the same parent and kept their order: the most of them.

    Where the order means nothing, those are all that stood there.
    """
    old = parent.partner
    place = {} if old is None else {child: index for index, child in enumerate(old.children)}
    stayed = {
        child: place[child.partner]
        for child in parent.children
        if child.partner is not None and child.partner in place
    }
    if parent.node_id in UNORDERED:
        return set(stayed)
    # The longest growing sequence: for each length the smallest end, and what comes before it.
    ends: list[int] = []
    chains: list[Twin] = []
    before: dict[Twin, Twin | None] = {}
    for child, index in stayed.items():
        length = bisect_left(ends, index)
        before[child] = chains[length - 1] if length else None
        ends[length : length + 1] = [index]
        chains[length : length + 1] = [child]
    kept: set[Twin] = set()
    last = chains[-1] if chains else None
    while last is not None:
        kept.add(last)
        last = before[last]
    return kept


def _attribute_changes(before: dict[str, str], after: dict[str, str]) -> tuple[str, ...]:
    found = []
    for name in dict.fromkeys((*before, *after)):
        if name not in before:
            found.append(f'{name}="{after[name]}" is new')
        elif name not in after:
            found.append(f'{name}="{before[name]}" is gone')
        elif before[name] != after[name]:
            found.append(f'{name}="{before[name]}" is now "{after[name]}"')
    return tuple(found)
