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

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field

from uav_bt.errors import FileError, TreeError, ValueRangeError
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, load_tree
from uav_bt.tree.dry_run.stand_ins import with_stand_ins, without_stand_in
from uav_bt.tree.loading.findings import WHOLE_FILE, Finding, Position
from uav_bt.tree.loading.lookup import Lookup
from uav_bt.tree.loading.parameters import Parameters, Plain
from uav_bt.tree.mission_tree import Place
from uav_bt.tree.nodes import BUILTIN_NODES
from uav_bt.tree.scripted import ALL_LEAVES, AnswerScript, Mock, ScriptedLeaf
from uav_bt.yaml_file import read_yaml


@dataclass(frozen=True)
class Scalar:
    """A value with the line that has it."""

    value: Plain
    line: int


@dataclass(frozen=True, kw_only=True)
class SimulationScript:
    """The content of a script file."""

    path: Path
    mocks: Mapping[str, Mock] = field(default_factory=dict)  # as `load_tree` takes them
    variables: Mapping[str, Plain] = field(default_factory=dict)
    board: Mapping[str, Scalar] = field(default_factory=dict)
    nodes: Mapping[str, object] = field(default_factory=dict)  # see `stand_ins`
    lines: Mapping[str, int | None] = field(default_factory=dict)  # of `nodes`


def read_script(path: Path) -> SimulationScript:
    """Read a script file.

    Raises:
        FileError: the file cannot be read, is not valid YAML, or has an unknown entry. The message
            names the line.
    """
    file = read_yaml(path, _ScriptFile, "script file")
    found = file.value

    def at(*steps: str) -> Place:
        return Place(path, Position(file.line(*steps), 1))

    mocks = {
        selector: Mock(
            None if (answers := found.leaves.get(selector)) is None else str(answers),
            found.outputs.get(selector, {}),
            at("outputs" if answers is None else "leaves", selector),
        )
        for selector in {**found.leaves, **found.outputs}
    }
    if found.default is not None:
        mocks[ALL_LEAVES] = Mock(str(found.default), place=at("default"))
    return SimulationScript(
        path=path,
        mocks=mocks,
        variables=found.variables,
        board={
            name: Scalar(value, file.line("board", name)) for name, value in found.board.items()
        },
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
    parameters: Parameters | None = None,
) -> MissionTree:
    """Load a tree file with scripted leaves; the format's own leaves run unless they have a script.

    Args:
        path: the tree file.
        script: the answers of its leaves.
        registry: the nodes that may occur; default: all installed.
        tree_id: which of the file's trees; see `load_tree`.
        lookup: where to look for trees and included files; see `load_tree`.
        parameters: values from outside; they take precedence over the script's variables.

    Raises:
        TreeError: the tree was refused, a leaf has no script, or a script does not fit.
        FileError: the script's `nodes` do not fit the tree.
    """
    # Scripted leaves ask for no policy.
    registry = (NodeRegistry.installed() if registry is None else registry).with_any_policy()
    for node_id, entry in script.nodes.items():
        try:
            registry = with_stand_ins(registry, {node_id: entry})
        except ValueRangeError as error:
            raise FileError(script.path, f"nodes: {error}", script.lines[node_id]) from error
    tree = load_tree(
        path, registry, tree_id=tree_id, lookup=lookup, mocks=script.mocks, parameters=parameters
    )
    for name, value in script.variables.items():
        if name not in tree.variables:
            tree.variables[name] = value
    unscripted = [
        leaf
        for leaf in tree.leaves()
        if not isinstance(leaf, ScriptedLeaf) and type(leaf) not in BUILTIN_NODES
    ]
    if unscripted:
        raise TreeError(path, [_without_script(tree, leaf, path, script) for leaf in unscripted])
    if unknown := without_stand_in(tree.nodes()):
        raise FileError(
            script.path,
            f"known from a palette only, so nothing says how to tick it: {', '.join(unknown)}; "
            f"say what each is taken for, as in nodes: {{{unknown[0]}: Sequence}}",
        )
    return tree


def _without_script(tree: MissionTree, leaf: Leaf, path: Path, script: SimulationScript) -> Finding:
    place = tree.places.get(leaf.path)
    return Finding(
        str(path if place is None else place.path),
        WHOLE_FILE if place is None else place.position,
        f"has no answers in {script.path}: add '{leaf.name}' to its leaves, or a default",
        f"{leaf.node_id} '{leaf.name}'",
    )
