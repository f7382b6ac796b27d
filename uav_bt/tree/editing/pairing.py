"""Pairs the nodes of two tree files: which of the one is which of the other."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

from uav_bt.tree.loading.elements import node_attributes, node_id_of
from uav_bt.tree.loading.findings import Position
from uav_bt.tree.loading.source import Element
from uav_bt.tree.node import NodeKind
from uav_bt.tree.placing import child_paths

UNORDERED: Final = frozenset({"root", "TreeNodesModel"})
"""What holds its parts by name: their order means nothing."""

_ALIGNED: Final = 250_000  # pairs of children that are compared; beyond, only same ones are paired
_REMARKS: Final = frozenset({"MetadataFields", "description"})  # of editors, for people


@dataclass(eq=False)
class Twin:
    """A node, and which one it is in the other file: None where it has no partner there."""

    node_id: str
    attributes: dict[str, str]
    position: Position
    path: str
    parent: Twin | None
    children: list[Twin] = field(default_factory=list)
    shape: int = 0  # the same number: the same node with the same ones inside
    size: int = 1
    partner: Twin | None = None

    def walk(self) -> Iterator[Twin]:
        """Iterate over the node and all below."""
        yield self
        for child in self.children:
            yield from child.walk()


def paired(before: Element, after: Element) -> tuple[Twin, Twin]:
    """Return the roots of two files, with each node paired that is in both.

    Args:
        before: the root element of the first file.
        after: that of the second.
    """
    shapes: dict[object, int] = {}
    old, new = _node(before, "", None, shapes), _node(after, "", None, shapes)
    _pair(old, new)
    _pair_moved(old, new)
    return old, new


def _node(element: Element, path: str, parent: Twin | None, shapes: dict[object, int]) -> Twin:
    attributes = _attributes(element)
    if parent is not None and parent.node_id == "TreeNodesModel":
        attributes["kind"] = element.tag
    node = Twin(node_id_of(element), attributes, element.position, path or "root", parent)
    inner = [child for child in element.children if child.tag not in _REMARKS]
    names = [_label(child) for child in inner]
    node.children = [
        _node(child, child_path.removeprefix("/"), node, shapes)
        for child, child_path in zip(inner, child_paths(path, names), strict=True)
    ]
    inside = tuple(child.shape for child in node.children)
    content = (node.node_id, tuple(sorted(node.attributes.items())), inside)
    node.shape = shapes.setdefault(content, len(shapes))
    node.size += sum(child.size for child in node.children)
    return node


def _label(element: Element) -> str:
    attributes = element.attributes
    if element.tag in {"BehaviorTree", NodeKind.SUBTREE.value}:
        return attributes.get("name") or attributes.get("ID") or element.tag
    return attributes.get("name") or node_id_of(element) or attributes.get("path") or element.tag


def _attributes(element: Element) -> dict[str, str]:
    """Return what means something: `<A/>` and `<Action ID="A"/>` are the same."""
    kept = node_attributes(element)
    by_kind = element.tag != node_id_of(element)
    for name in ("name",) if by_kind else ("ID", "name", "_autoremap"):
        if name in element.attributes:
            kept[name] = element.attributes[name]
    return kept


def _pair(old: Twin, new: Twin) -> None:
    """Pair two nodes, and as many as can be of what is in them."""
    old.partner, new.partner = new, old
    for one, other in _aligned(_free(old), _free(new)):
        _pair(one, other)


def _aligned(old: list[Twin], new: list[Twin]) -> list[tuple[Twin, Twin]]:
    """Return the pairs of children, in order, that have the most in common."""
    parent = old[0].parent if old else None
    if parent is not None and parent.node_id in UNORDERED:
        return _by_name(old, new)
    head = 0
    while head < min(len(old), len(new)) and old[head].shape == new[head].shape:
        head += 1
    tail = 0
    while tail < min(len(old), len(new)) - head and old[-1 - tail].shape == new[-1 - tail].shape:
        tail += 1
    pairs = list(zip(old[:head], new[:head], strict=True))
    if tail:
        pairs += zip(old[-tail:], new[-tail:], strict=True)
    old, new = old[head : len(old) - tail], new[head : len(new) - tail]
    if len(old) * len(new) <= _ALIGNED:
        pairs += _best(old, new)
    return pairs


def _by_name(old: list[Twin], new: list[Twin]) -> list[tuple[Twin, Twin]]:
    free = {(node.node_id, node.path): node for node in reversed(old)}
    pairs = ((free.pop((node.node_id, node.path), None), node) for node in new)
    return [(one, other) for one, other in pairs if one is not None]


def _best(old: list[Twin], new: list[Twin]) -> list[tuple[Twin, Twin]]:
    """Return the pairs of the best alignment, by dynamic programming from the ends."""
    best = [[0.0] * (len(new) + 1) for _ in range(len(old) + 1)]
    alike = [[_alike(one, other) for other in new] for one in old]
    for row in reversed(range(len(old))):
        for column in reversed(range(len(new))):
            together = best[row + 1][column + 1] + alike[row][column]
            alone = max(best[row + 1][column], best[row][column + 1])
            best[row][column] = max(together if alike[row][column] else 0.0, alone)
    pairs = []
    row = column = 0
    while row < len(old) and column < len(new):
        value = best[row][column]
        if value == best[row + 1][column]:
            row += 1
        elif value == best[row][column + 1]:
            column += 1
        else:
            pairs.append((old[row], new[column]))
            row, column = row + 1, column + 1
    return pairs


def _alike(one: Twin, other: Twin) -> float:
    """Return how much two nodes have in common; 0 where they cannot be the same."""
    if one.shape == other.shape:
        return 3.0 + one.size
    if one.node_id != other.node_id:
        return 0.0
    names = one.attributes.keys() | other.attributes.keys()
    same = sum(one.attributes.get(name) == other.attributes.get(name) for name in names)
    inside = {child.shape for child in one.children} & {child.shape for child in other.children}
    named = bool(one.attributes.get("name")) and one.attributes["name"] == other.attributes.get(
        "name"
    )
    return 1.0 + same / max(1, len(names)) + len(inside) + named


def _pair_moved(old: Twin, new: Twin) -> None:
    """Pair what stands elsewhere now."""
    _pair_same(old, new)
    before, after = _named(old), _named(new)
    for key in before.keys() & after.keys():
        if len(before[key]) == len(after[key]) == 1:
            _pair_free(before[key][0], after[key][0])
    # What lost its place with much of what is in it: around it, something was put or taken away.
    for node in reversed(list(new.walk())):
        outer = Counter(child.partner.parent for child in node.children if child.partner)
        for one, _ in outer.most_common():
            if one is not None and one.node_id == node.node_id:
                _pair_free(one, node)


def _pair_free(one: Twin, other: Twin) -> None:
    if one.partner is None and other.partner is None:
        _pair(one, other)


def _pair_same(old: Twin, new: Twin) -> None:
    """Pair parts that are the same, the largest first."""
    gone: dict[int, list[Twin]] = {}
    for node in reversed(list(old.walk())):
        if node.partner is None:
            gone.setdefault(node.shape, []).append(node)
    for node in sorted(new.walk(), key=lambda node: -node.size):
        waiting = gone.get(node.shape, [])
        while waiting and waiting[-1].partner is not None:
            waiting.pop()
        if node.partner is None and waiting:
            for one, other in zip(waiting.pop().walk(), node.walk(), strict=True):
                one.partner, other.partner = other, one


def _named(root: Twin) -> dict[tuple[str, str], list[Twin]]:
    found: dict[tuple[str, str], list[Twin]] = {}
    for node in root.walk():
        if node.partner is None and node.attributes.get("name"):
            found.setdefault((node.node_id, node.attributes["name"]), []).append(node)
    return found


def _free(node: Twin) -> list[Twin]:
    return [child for child in node.children if child.partner is None]
