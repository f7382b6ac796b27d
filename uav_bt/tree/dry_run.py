"""Dry runs: a mission's tree ticked with leaves that answer by a script; nothing flies.

The tree is the real one, with its control nodes, decorators, conditions, scripts and timers. The
format's own leaves (`Script`, `Sleep`, ...) do what they always do, unless the script has answers
for them. A script is a YAML file:

    leaves:                  # by path, name or node id, as `uav-bt tree render` shows them
      TakeOff: RRS           # running, running, success; the last letter is answered for ever
      Explore: (RRS)         # letters in brackets are answered over and over
    default: S               # for all leaves without a script
    outputs:                 # values that a leaf writes to its output ports at each success
      Measure: {depth_m: 1.5}
    variables: {laps: 3}     # of the main tree, before the first tick
    board: {phase: explore}  # keys of the mission board; numbers, texts, true and false

Only `leaves` or `default` must be there. The letters are those of `uav_bt.tree.scripted`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple, Unpack

from pydantic import AfterValidator, Field

from uav_bt.board import ELAPSED, MISSION_KEYS
from uav_bt.board.blackboard import Blackboard
from uav_bt.board.context import MissionContext
from uav_bt.board.keys import QUIET
from uav_bt.clock import ManualClock
from uav_bt.errors import BoardAccessError, NodeFailedError, TreeError, ValueRangeError
from uav_bt.tree import MissionTree, Node, NodeRegistry, Status, load_tree
from uav_bt.tree.loading.findings import Finding, Position
from uav_bt.tree.loading.loader import TreeOptions
from uav_bt.tree.loading.parameters import Plain
from uav_bt.tree.loading.uses import Uses
from uav_bt.tree.mission_tree import Place
from uav_bt.tree.nodes import BUILTIN_NODES, SubTree
from uav_bt.tree.observer import ANSWERS, NodeEvent, observe
from uav_bt.tree.scripted import ALL_LEAVES, AnswerScript, Mock, ScriptedLeaf
from uav_bt.yaml_file import YamlFile, read_yaml

# A variable may be infinite; nothing else may.
_Value = bool | int | Annotated[float, Field(allow_inf_nan=True)] | str


def _answers(value: Plain) -> Plain:
    AnswerScript.parse(str(value))
    return value


_Answers = Annotated[_Value, AfterValidator(_answers)]


@dataclass(frozen=True, kw_only=True)
class SimulationScript:
    """The content of a script file."""

    leaves: dict[str, _Answers] = field(default_factory=dict)
    default: _Answers | None = None
    outputs: dict[str, dict[str, _Value]] = field(default_factory=dict)
    variables: dict[str, _Value] = field(default_factory=dict)
    board: dict[str, _Value] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.leaves and self.default is None:
            raise ValueRangeError("expected 'leaves' with answers of leaves, or a 'default'")


def read_script(path: Path) -> YamlFile[SimulationScript]:
    """Read a script file, or raise a FileError that names the line."""
    return read_yaml(path, SimulationScript, "script file")


def _mocks(file: YamlFile[SimulationScript]) -> dict[str, Mock]:
    """Return the mocks of a script, as `load_tree` takes them."""
    script = file.value

    def mock(answers: Plain | None, name: str, *steps: str) -> Mock:
        place = Place(file.path, Position(file.line(*steps), 1))
        given = None if answers is None else str(answers)
        return Mock(given, script.outputs.get(name, {}), place)

    mocks = {name: mock(None, name, "outputs", name) for name in script.outputs}
    mocks |= {name: mock(given, name, "leaves", name) for name, given in script.leaves.items()}
    if script.default is not None:
        mocks[ALL_LEAVES] = mock(script.default, ALL_LEAVES, "default")
    return mocks


class SimulatedTick(NamedTuple):
    """What happened in a tick."""

    tick: int  # counted from 1
    time_s: float  # of the mission clock
    status: Status  # of the root
    answers: tuple[tuple[str, Status], ...]  # leaves and answers in the order of the tick
    halted: tuple[str, ...]  # leaves that were stopped while they ran
    changed: Mapping[str, Any]  # variables (those of subtrees as `subtree.name`) and `@board_key`s


class Simulation:
    """A mission file with scripted leaves, ready to be ticked.

    Parameters take precedence over the script's variables; the rest is as for `load_tree`.
    """

    def __init__(
        self,
        tree: Path,
        script: YamlFile[SimulationScript],
        registry: NodeRegistry | None = None,
        *,
        tick_s: float = 0.1,
        **options: Unpack[TreeOptions],
    ) -> None:
        # Scripted leaves ask for no policy.
        registry = (NodeRegistry.installed() if registry is None else registry).with_any_policy()
        options["mocks"] = _mocks(script)
        self.tree: Final = load_tree(tree, registry, **options)
        for name, value in script.value.variables.items():
            if name not in self.tree.variables:
                self.tree.variables[name] = value
        if faults := list(_unscripted(self.tree, script.path)):
            raise TreeError(tree, faults)
        self._script = script
        self._tick_s = tick_s
        self._clock = ManualClock()
        self._board = Blackboard(self._clock, MISSION_KEYS)
        count = Counter(leaf.name for leaf in self.tree.leaves())
        self._names = {
            leaf.path: leaf.name if count[leaf.name] == 1 else leaf.path
            for leaf in self.tree.leaves()
        }
        self._answers: list[tuple[str, Status]] = []
        self._halted: list[str] = []
        self._given: dict[str, Any] = {}  # values that the script wrote to the board
        self.tree.setup(MissionContext(board=self._board, clock=self._clock))
        self._write_board()
        observe(self.tree.leaves(), self._note)

    def run(self, max_ticks: int) -> Iterator[SimulatedTick]:
        """Tick until the root ends or the limit of ticks is reached, and yield each tick."""
        before = self._values()
        for tick in range(1, max_ticks + 1):
            self._clock.sleep_until((tick - 1) * self._tick_s)
            self._write_board()
            self._answers.clear()
            self._halted.clear()
            try:
                status = self.tree.tick()
            except NodeFailedError as error:
                # All that the script has yet to give: the first may not be the last.
                if unset := [*Uses(self.tree).unset()]:
                    values = ", ".join(f"{name}: 0" for name in unset)
                    error.add_note(
                        f"nothing in the tree file sets {', '.join(unset)}: give them values in "
                        f"{self._script.path}, as in variables: {{{values}}}"
                    )
                raise
            now = self._values()
            changed = {
                name: value
                for name, value in now.items()
                if name not in before or _differs(before[name], value)
            } | dict.fromkeys(name for name in before if name not in now)
            answers, halted = tuple(self._answers), tuple(self._halted)
            yield SimulatedTick(tick, self._clock.now(), status, answers, halted, changed)
            before = now
            if status is not Status.RUNNING:
                return

    def _note(self, node: Node, event: NodeEvent) -> None:
        name = self._names[node.path]
        if event is NodeEvent.HALTED:
            self._halted.append(name)
        elif event in ANSWERS:
            self._answers.append((name, ANSWERS[event]))

    def _write_board(self) -> None:
        self._board.write(ELAPSED, self._clock.now())
        written = self._board.snapshot()
        for number, value in QUIET.items():
            if number.name not in written:
                self._board.write(number, value)
        for name, given in self._script.value.board.items():
            # A value that a leaf wrote over it stays.
            if name in self._given and written[name][0] is not self._given[name]:
                continue
            self._given[name] = given
            try:
                self._board.write(self._board.key(name), given)
            except BoardAccessError as error:
                raise self._script.error(str(error), "board", name) from error

    def _values(self) -> dict[str, Any]:
        values = self.tree.variables.snapshot()
        for node in self.tree.nodes():
            if isinstance(node, SubTree):
                inner = node.child.variables.snapshot()
                values |= {f"{node.name}.{name}": value for name, value in inner.items()}
        board = self._board.snapshot()
        del board[ELAPSED.name]  # it changes every tick
        return values | {f"@{name}": value for name, (value, _) in board.items()}


def _unscripted(tree: MissionTree, script: Path) -> Iterator[Finding]:
    """Yield a finding for each leaf without a script, but for the format's own."""
    for leaf in tree.leaves():
        if not isinstance(leaf, ScriptedLeaf) and type(leaf) not in BUILTIN_NODES:
            place = tree.places[leaf.path]
            message = f"has no answers in {script}: add '{leaf.name}' to its leaves, or a default"
            yield Finding(str(place.path), place.at(""), message, f"{leaf.node_id} '{leaf.name}'")


def _differs(before: Any, now: Any) -> bool:
    # Only plain values are compared: equality of others may not be defined.
    plain = type(before) is type(now) and isinstance(now, bool | int | float | str)
    return before is not now and not (plain and before == now)
