"""What is said and checked of any element of a tree file."""

from __future__ import annotations

from typing import Final

from uav_bt.errors import did_you_mean
from uav_bt.tree.findings import Findings
from uav_bt.tree.source import Element

__all__ = ["EDITOR_ATTRIBUTES", "check_attributes", "check_no_text", "label"]

# What graphical editors write for themselves; it means nothing to the engine.
EDITOR_ATTRIBUTES: Final = frozenset({"_collapsed", "_description", "_fullpath", "_uid"})


def label(element: Element) -> str:
    """Return how messages name an element."""
    name = element.attributes.get("name") or element.attributes.get("ID")
    return f"{element.tag} '{name}'" if name else element.tag


def check_attributes(element: Element, known: frozenset[str], findings: Findings) -> None:
    """Note every attribute that the element cannot have."""
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
