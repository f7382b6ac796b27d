"""Loading tree files: strict, whole reports, nothing evaluated."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from uav_bt.tree.loading.builder import Builder
from uav_bt.tree.loading.checker import Checker
from uav_bt.tree.loading.document import outline
from uav_bt.tree.loading.findings import Findings
from uav_bt.tree.loading.source import parse_source, read_source
from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.registry import NodeRegistry

__all__ = ["load_tree", "parse_tree"]


def load_tree(
    path: Path | str,
    registry: NodeRegistry | None = None,
    *,
    overrides: Mapping[str, Mapping[str, str]] | None = None,
    mocks: Mapping[str, str] | None = None,
) -> MissionTree:
    """Load a tree file.

    Args:
        path: the file.
        registry: the nodes that may occur; default: all installed.
        overrides: attribute values that replace the file's, by a node's name or path.
        mocks: scripts of leaves that are replaced by scripted ones (`uav_bt.tree.scripted`), by
            path, name or node id; of several that fit a leaf, in this order the first counts. Name,
            path, kind, ports and conditions stay as the file has them.

    Raises:
        TreeError: the file was refused; all that is wrong with it, each with its place.
    """
    path = Path(path)
    return parse_tree(read_source(path), registry, path=path, overrides=overrides, mocks=mocks)


def parse_tree(
    source: str | bytes,
    registry: NodeRegistry | None = None,
    *,
    path: Path | str = "<text>",
    overrides: Mapping[str, Mapping[str, str]] | None = None,
    mocks: Mapping[str, str] | None = None,
) -> MissionTree:
    """Load a tree from a tree file's text.

    Args:
        source: the text.
        registry: the nodes that may occur; default: all installed.
        path: what messages call the file.
        overrides: attribute values that replace the file's, by a node's name or path.
        mocks: scripts of leaves that are replaced by scripted ones (`uav_bt.tree.scripted`), by
            path, name or node id; of several that fit a leaf, in this order the first counts. Name,
            path, kind, ports and conditions stay as the file has them.

    Raises:
        TreeError: the text was refused; all that is wrong with it, each with its place.
    """
    data = source.encode() if isinstance(source, str) else source
    path = Path(path)
    registry = NodeRegistry.installed() if registry is None else registry
    findings = Findings()
    document = outline(parse_source(data, path), registry, findings)
    Checker(document, registry, findings).check()
    findings.raise_any(path)
    builder = Builder(document, registry, findings)
    root = builder.build(overrides or {}, mocks or {})
    return MissionTree(
        root, name=document.main, text=data.decode(errors="replace"), places=builder.places
    )
