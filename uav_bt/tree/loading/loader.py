"""Loading tree files: strict, whole reports, nothing evaluated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from uav_bt import plugins
from uav_bt.errors import FileError, InputError, TreeError
from uav_bt.tree.loading.builder import POLICY_PORT, Builder
from uav_bt.tree.loading.checker import Checker
from uav_bt.tree.loading.document import outline
from uav_bt.tree.loading.findings import WHOLE_FILE, Finding, Findings, Position
from uav_bt.tree.loading.palette import PalettePort
from uav_bt.tree.loading.source import parse_source, read_source
from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.registry import NodeRegistry


def load_tree(
    path: Path | str,
    registry: NodeRegistry | None = None,
    *,
    overrides: Mapping[str, Mapping[str, str]] | None = None,
    by_id: Mapping[str, Mapping[str, str]] | None = None,
    mocks: Mapping[str, str] | None = None,
) -> MissionTree:
    """Load a tree file.

    Args:
        path: the file.
        registry: the nodes that may occur; default: all installed.
        overrides: attribute values that replace the file's, by a node's name or path.
        by_id: attribute values that replace the file's in all nodes of an id, beneath the
            overrides. An id that does not occur, or a port that a node does not have, is no error.
        mocks: scripts of leaves that are replaced by scripted ones (`uav_bt.tree.scripted`), by
            path, name or node id; of several that fit a leaf, in this order the first counts. Name,
            path, kind, ports and conditions stay as the file has them.

    Raises:
        TreeError: the file was refused; all that is wrong with it, each with its place.
    """
    path = Path(path)
    return parse_tree(
        read_source(path), registry, path=path, overrides=overrides, by_id=by_id, mocks=mocks
    )


def parse_tree(
    source: str | bytes,
    registry: NodeRegistry | None = None,
    *,
    path: Path | str = "<text>",
    overrides: Mapping[str, Mapping[str, str]] | None = None,
    by_id: Mapping[str, Mapping[str, str]] | None = None,
    mocks: Mapping[str, str] | None = None,
) -> MissionTree:
    """Load a tree from a tree file's text.

    Args:
        source: the text.
        registry: the nodes that may occur; default: all installed.
        path: what messages call the file.
        overrides: attribute values that replace the file's, by a node's name or path.
        by_id: attribute values for all nodes of an id; see `load_tree`.
        mocks: scripts of leaves; see `load_tree`.

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
    root = builder.build(overrides or {}, by_id=by_id or {}, mocks=mocks or {})
    sources = {path.resolve(): data, **document.included}
    return MissionTree(
        root,
        name=document.main,
        sources=sources,
        places=builder.places,
        replaced=builder.replaced,
    )


def check_file(path: Path, registry: NodeRegistry | None = None) -> tuple[Finding, ...]:
    """Return all that is wrong with a tree file; nothing for a good one.

    Args:
        path: the file.
        registry: the nodes that may occur; default: all installed.
    """
    try:
        tree = load_tree(path, registry)
    except InputError as error:
        return findings_of(error, path)
    return tuple(_absent(tree))


def _absent(tree: MissionTree) -> Iterator[Finding]:
    """Yield what the leaves of a tree name and will not find when they are set up."""
    for leaf in tree.leaves():
        for port in leaf.ports:
            look_up = plugins.look_up_policy if port.name == POLICY_PORT else port.look_up
            if look_up is None or isinstance(port, PalettePort) or port.name not in leaf.literals:
                continue
            try:
                look_up(leaf.literals[port.name])
            except InputError as error:
                place = tree.places[leaf.path]
                message = f"attribute '{port.name}': {error}"
                yield Finding(str(place.path), place.position, message, leaf.path)


def findings_of(error: InputError, path: Path) -> tuple[Finding, ...]:
    """Return what an error says as findings.

    Args:
        error: what was raised when a tree file was to be loaded.
        path: the file.
    """
    if isinstance(error, FileError) and not isinstance(error, TreeError):
        position = WHOLE_FILE if error.line is None else Position(error.line, 1)
        where = error.path if error.line is None else f"{error.path}:{error.line}"
        message = str(error).removeprefix(f"{where}: ")
        return (Finding(str(error.path), position, message),)
    details = error.details if isinstance(error, TreeError) else (error,)
    return tuple(
        detail if isinstance(detail, Finding) else Finding(str(path), WHOLE_FILE, str(detail))
        for detail in details
    )
