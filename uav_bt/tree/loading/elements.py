"""What messages call an element of a tree file, and checks of any element."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from uav_bt.errors import did_you_mean
from uav_bt.tree.loading.findings import Findings
from uav_bt.tree.loading.source import Element
from uav_bt.tree.node import NodeKind

KIND_TAGS: Final = frozenset(kind.value for kind in NodeKind)

# What graphical editors write for themselves; it means nothing to the engine.
EDITOR_ATTRIBUTES: Final = frozenset({"_collapsed", "_description", "_fullpath", "_uid"})


def label(element: Element) -> str:
    """Return how messages name an element."""
    name = element.attributes.get("name") or element.attributes.get("ID")
    return f"{element.tag} '{name}'" if name else element.tag


def check_attributes(element: Element, known: frozenset[str], findings: Findings) -> None:
    """Note every attribute that the element cannot have.

    Args:
        element: of a tree file.
        known: the attributes that it can have.
        findings: where they are added.
    """
    for attribute in element.attributes:
        if attribute in known or attribute in EDITOR_ATTRIBUTES:
            continue
        findings.add(
            element.path,
            element.at(attribute),
            f"unknown attribute '{attribute}'{did_you_mean(attribute, known)}",
            label(element),
        )


def check_no_text(element: Element, findings: Findings) -> None:
    """Note text between tags, which a tree file has no place for."""
    text = element.text.strip()
    if text:
        findings.add(
            element.path, element.position, f"unexpected text '{text[:40]}'", label(element)
        )


def walk(element: Element) -> Iterator[Element]:
    """Iterate over everything below an element."""
    for child in element.children:
        yield child
        yield from walk(child)


def node_id_of(element: Element) -> str:
    """Return the id of the node; `<Explore/>` and `<Action ID="Explore"/>` are the same."""
    if element.tag in KIND_TAGS and element.tag != NodeKind.SUBTREE.value:
        return element.attributes.get("ID", "")
    return element.tag


def node_attributes(element: Element) -> dict[str, str]:
    """Return the attributes that are ports (or a subtree's entries)."""
    return {
        name: text
        for name, text in element.attributes.items()
        if name not in {"ID", "name", "_autoremap"} and name not in EDITOR_ATTRIBUTES
    }
