"""A mission's tree whose leaves answer by a script file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from uav_bt.errors import FileError, TreeError, ValueRangeError, did_you_mean
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, Port, load_tree
from uav_bt.tree.dry_run.script_file import Scalar, SimulationScript
from uav_bt.tree.loading.findings import WHOLE_FILE, Finding
from uav_bt.tree.nodes import BUILTIN_NODES
from uav_bt.tree.scripted import ScriptedLeaf, mock_class


def scripted_tree(
    path: Path, script: SimulationScript, registry: NodeRegistry | None = None
) -> MissionTree:
    """Load a tree file with scripted leaves; the format's own run as ever without a script.

    Args:
        path: the tree file.
        script: what its leaves answer.
        registry: the nodes that may occur; default: all installed.

    Raises:
        TreeError: the tree was refused, or a leaf has no script.
        FileError: the script does not fit the tree.
    """
    # Scripted leaves ask for no policy.
    registry = (NodeRegistry.installed() if registry is None else registry).with_any_policy()
    mocks = _mocks(load_tree(path, registry), path, script)
    tree = load_tree(path, registry, mocks=mocks)
    _connect_outputs(tree, script)
    return tree


def _connect_outputs(tree: MissionTree, script: SimulationScript) -> None:
    for selector, outputs in script.outputs.items():
        leaves = [leaf for leaf in tree.leaves() if _fits(selector, leaf)]
        if not leaves:
            line = next((scalar.line for scalar in outputs.values()), None)
            raise _unknown_leaf(script, selector, tree, line)
        for leaf in leaves:
            values = dict(_output(script, leaf, name, scalar) for name, scalar in outputs.items())
            if isinstance(leaf, ScriptedLeaf):  # of the others none has an output
                leaf.outputs |= values


def _mocks(tree: MissionTree, path: Path, script: SimulationScript) -> dict[str, str]:
    """Return the answers of all leaves that do not run by themselves, by selector."""
    mocks = {selector: str(scalar.value) for selector, scalar in script.leaves.items()}
    for selector, scalar in script.leaves.items():
        leaves = [leaf for leaf in tree.leaves() if _fits(selector, leaf)]
        if not leaves:
            raise _unknown_leaf(script, selector, tree, scalar.line)
        for leaf in leaves:
            _check_answers(script, leaf, mocks[selector], scalar.line)
    missing = [
        leaf
        for leaf in tree.leaves()
        if type(leaf) not in BUILTIN_NODES and not any(_fits(name, leaf) for name in mocks)
    ]
    if missing and script.default is None:
        raise TreeError(path, [_without_script(tree, leaf, path, script) for leaf in missing])
    return mocks | _defaults(tree, missing, script)


def _defaults(tree: MissionTree, missing: list[Leaf], script: SimulationScript) -> dict[str, str]:
    """Return the answers of the leaves that have none of their own, by selector."""
    text = script.default or ""
    for leaf in missing:
        _check_answers(script, leaf, text, None)
    left_out = {leaf.path for leaf in missing}
    others = {
        name for leaf in tree.leaves() if leaf.path not in left_out for name in _selectors(leaf)
    }
    # By id where that means no other leaf: a large tree has thousands of leaves, but few ids.
    return {leaf.path if leaf.node_id in others else leaf.node_id: text for leaf in missing}


def _selectors(leaf: Leaf) -> tuple[str, str, str]:
    return leaf.path, leaf.name, leaf.node_id


def _fits(selector: str, leaf: Leaf) -> bool:
    return selector in _selectors(leaf)


def _check_answers(script: SimulationScript, leaf: Leaf, text: str, line: int | None) -> None:
    try:
        mock_class(type(leaf)).check_script(text)
    except ValueRangeError as error:
        raise FileError(script.path, str(error), line) from error


def _without_script(tree: MissionTree, leaf: Leaf, path: Path, script: SimulationScript) -> Finding:
    place = tree.places.get(leaf.path)
    return Finding(
        str(path if place is None else place.path),
        WHOLE_FILE if place is None else place.position,
        f"has no answers in {script.path}: add '{leaf.name}' to its leaves, or a default",
        f"{leaf.node_id} '{leaf.name}'",
    )


def _unknown_leaf(
    script: SimulationScript, selector: str, tree: MissionTree, line: int | None
) -> FileError:
    known = {name for leaf in tree.leaves() for name in _selectors(leaf)}
    message = f"the tree has no leaf '{selector}'{did_you_mean(selector, known)}"
    return FileError(script.path, message, line)


def _output(
    script: SimulationScript, leaf: Leaf, name: str, scalar: Scalar
) -> tuple[Port[Any], Any]:
    ports = {port.name: port for port in leaf.ports if port.direction != "input"}
    if name not in ports:
        known = ", ".join(ports) or "none"
        message = f"leaf '{leaf.name}' has no output '{name}' (known: {known})"
        raise FileError(script.path, message, scalar.line)
    try:
        return ports[name], ports[name].convert(scalar.value)
    except ValueError as error:
        raise FileError(script.path, f"output '{name}': {error}", scalar.line) from error
