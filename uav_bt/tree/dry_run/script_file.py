"""Script files: answers of a mission's leaves in a dry run.

A YAML file:

    leaves:                  # by path, name or node id, as `uav-bt tree render` shows them
      TakeOff: RRS           # running, running, success; the last letter is answered for ever
      Explore: (RRS)         # letters in brackets are answered over and over
    default: S               # for all leaves without a script
    outputs:                 # values that a leaf writes to its output ports at each success
      Measure: {depth_m: 1.5}
    variables: {laps: 3}     # of the main tree, before the first tick
    board: {phase: explore}  # keys of the mission board; numbers, texts, true and false
    nodes:                   # nodes that stand in for a palette's control nodes and decorators
      RecoveryNode: {is: RetryUntilSuccessful, num_attempts: 3}

Only `leaves` or `default` must be there. The letters are those of `uav_bt.tree.scripted`.
`scripted_tree` loads a tree whose leaves answer by such a file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, Field

from uav_bt.errors import FileError, TreeError, ValueRangeError, hint_for
from uav_bt.tree import Leaf, MissionTree, Node, NodeRegistry, Port, load_tree
from uav_bt.tree.dry_run.stand_ins import with_stand_ins, without_stand_in
from uav_bt.tree.expanded import ExpandedNode
from uav_bt.tree.loading.findings import WHOLE_FILE, Finding
from uav_bt.tree.loading.lookup import Lookup
from uav_bt.tree.nodes import BUILTIN_NODES
from uav_bt.tree.scripted import AnswerScript, ScriptedLeaf, mock_class
from uav_bt.yaml_file import read_yaml

Plain = bool | int | float | str
"""Values of a variable or a board key in a script file."""


@dataclass(frozen=True)
class Scalar:
    """A value with the line that has it."""

    value: Plain
    line: int


@dataclass(frozen=True, kw_only=True)
class SimulationScript:
    """The content of a script file; selectors are paths, names or node ids of leaves."""

    path: Path
    leaves: Mapping[str, Scalar] = field(default_factory=dict)  # answers by selector
    default: str | None = None  # answers of all other leaves
    outputs: Mapping[str, Mapping[str, Scalar]] = field(default_factory=dict)  # by port
    variables: Mapping[str, Scalar] = field(default_factory=dict)
    board: Mapping[str, Scalar] = field(default_factory=dict)
    nodes: Mapping[str, object] = field(default_factory=dict)  # see `stand_ins`
    lines: Mapping[str, int | None] = field(default_factory=dict)  # of `nodes`


def read_script(path: Path) -> SimulationScript:
    """Read a script file.

    Raises:
        FileError: it cannot be read, is no YAML, or has an entry that no script has; with
            the line.
    """
    file = read_yaml(path, _ScriptFile, "script file")
    found = file.value

    def scalars(*section: str) -> dict[str, Scalar]:
        values = found.outputs[section[1]] if len(section) > 1 else getattr(found, section[0])
        return {name: Scalar(value, file.line(*section, name)) for name, value in values.items()}

    return SimulationScript(
        path=path,
        leaves=scalars("leaves"),
        default=None if found.default is None else str(found.default),
        outputs={selector: scalars("outputs", selector) for selector in found.outputs},
        variables=scalars("variables"),
        board=scalars("board"),
        nodes=found.nodes,
        lines={name: file.line("nodes", name) for name in found.nodes},
    )


def _answers(value: Plain) -> Plain:
    AnswerScript.parse(str(value))
    return value


# A variable may be infinite; nothing else may.
_Value = bool | int | Annotated[float, Field(allow_inf_nan=True)] | str
_Answers = Annotated[_Value, AfterValidator(_answers)]


@dataclass(frozen=True, kw_only=True)
class _ScriptFile:
    leaves: dict[str, _Answers] = field(default_factory=dict)
    default: _Answers | None = None
    outputs: dict[str, dict[str, _Value]] = field(default_factory=dict)
    variables: dict[str, _Value] = field(default_factory=dict)
    board: dict[str, _Value] = field(default_factory=dict)
    nodes: dict[str, str | dict[str, _Value]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.leaves and self.default is None:
            raise ValueRangeError("expected 'leaves' with answers of leaves, or a 'default'")


def scripted_tree(
    path: Path,
    script: SimulationScript,
    registry: NodeRegistry | None = None,
    *,
    tree_id: str | None = None,
    lookup: Lookup | None = None,
) -> MissionTree:
    """Load a tree file with scripted leaves; the format's own run as ever without a script.

    Args:
        path: the tree file.
        script: what its leaves answer.
        registry: the nodes that may occur; default: all installed.
        tree_id: which of the file's trees; see `load_tree`.
        lookup: where to look for trees and included files; see `load_tree`.

    Raises:
        TreeError: the tree was refused, or a leaf has no script.
        FileError: the script does not fit the tree.
    """
    # Scripted leaves ask for no policy.
    registry = (NodeRegistry.installed() if registry is None else registry).with_any_policy()
    first = load_tree(path, registry, tree_id=tree_id, lookup=lookup)
    mocks = _mocks(first, path, script, registry)
    for node_id, entry in script.nodes.items():
        try:
            registry = with_stand_ins(registry, {node_id: entry})
        except ValueRangeError as error:
            raise FileError(script.path, f"nodes: {error}", script.lines[node_id]) from error
    tree = load_tree(path, registry, tree_id=tree_id, lookup=lookup, mocks=mocks)
    if unknown := without_stand_in(tree.nodes()):
        raise FileError(
            script.path,
            f"known from a palette only, so nothing says how to tick it: {', '.join(unknown)}; "
            f"say what each is taken for, as in nodes: {{{unknown[0]}: Sequence}}",
        )
    _connect_outputs(tree, script, registry)
    return tree


def _connect_outputs(tree: MissionTree, script: SimulationScript, registry: NodeRegistry) -> None:
    for selector, outputs in script.outputs.items():
        leaves = [leaf for leaf in tree.leaves() if _fits(selector, leaf)]
        if not leaves:
            line = next((scalar.line for scalar in outputs.values()), None)
            raise _unknown_leaf(script, selector, tree, registry, line)
        for leaf in leaves:
            values = dict(_output(script, leaf, name, scalar) for name, scalar in outputs.items())
            if isinstance(leaf, ScriptedLeaf):  # of the others none has an output
                leaf.outputs |= values


def _mocks(
    tree: MissionTree, path: Path, script: SimulationScript, registry: NodeRegistry
) -> dict[str, str]:
    """Return the answers of all leaves that do not run by themselves, by selector."""
    mocks = {selector: str(scalar.value) for selector, scalar in script.leaves.items()}
    for selector, scalar in script.leaves.items():
        nodes = [node for node in _scriptable(tree) if _fits(selector, node)]
        if not nodes:
            raise _unknown_leaf(script, selector, tree, registry, scalar.line)
        for node in nodes:
            _check_answers(script, node, mocks[selector], scalar.line)
    # In place of a node that is made of a tree and has answers stands one leaf.
    replaced = [
        f"{node.path}/"
        for node in _scriptable(tree)
        if isinstance(node, ExpandedNode) and any(_fits(name, node) for name in mocks)
    ]
    missing = [
        leaf
        for leaf in tree.leaves()
        if type(leaf) not in BUILTIN_NODES
        and not any(_fits(name, leaf) for name in mocks)
        and not leaf.path.startswith(tuple(replaced))
    ]
    if missing and script.default is None:
        raise TreeError(path, [_without_script(tree, leaf, path, script) for leaf in missing])
    return mocks | _defaults(tree, missing, script)


def _defaults(tree: MissionTree, missing: list[Leaf], script: SimulationScript) -> dict[str, str]:
    """Return the default answers of the leaves without a script, by selector."""
    text = script.default or ""
    for leaf in missing:
        _check_answers(script, leaf, text, None)
    left_out = {leaf.path for leaf in missing}
    others = {
        name for leaf in tree.leaves() if leaf.path not in left_out for name in _selectors(leaf)
    }
    # By id where that means no other leaf: a large tree has thousands of leaves, but few ids.
    return {leaf.path if leaf.node_id in others else leaf.node_id: text for leaf in missing}


def _scriptable(tree: MissionTree) -> Iterator[Leaf | ExpandedNode]:
    """Yield what can answer by a script: leaves, and nodes that are made of a tree."""
    for node in tree.nodes():
        if isinstance(node, (Leaf, ExpandedNode)):
            yield node


def _selectors(node: Node) -> tuple[str, str, str]:
    return node.path, node.name, node.node_id


def _fits(selector: str, node: Node) -> bool:
    return selector in _selectors(node)


def _check_answers(
    script: SimulationScript, node: Leaf | ExpandedNode, text: str, line: int | None
) -> None:
    try:
        mock_class(type(node)).check_script(text)
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
    script: SimulationScript,
    selector: str,
    tree: MissionTree,
    registry: NodeRegistry,
    line: int | None,
) -> FileError:
    known = {name for node in _scriptable(tree) for name in _selectors(node)}
    hint = hint_for(selector, known, registry.successors(selector))
    message = f"the tree has no leaf '{selector}'{hint}"
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
