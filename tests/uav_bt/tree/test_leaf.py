"""Leaves: calls of their methods, allowed access, exceptions, and board keys without a value."""

from __future__ import annotations

import logging
from typing import Any, ClassVar

import pytest

from tests.worlds.tables import cases
from tests.worlds.trees import World, document, subtree
from uav_bt.board import ELAPSED, HEIGHT, STATE
from uav_bt.board.blackboard import Key
from uav_bt.errors import (
    BoardAccessError,
    InputError,
    MissionError,
    NodeFailedError,
    ProposalConflictError,
)
from uav_bt.tree import Leaf, MissionTree, Node, NodeRegistry, Port, Status, parse_tree
from uav_bt.tree.nodes import Parallel, Sequence
from uav_bt.types import GimbalTo, Hover, Velocity

CASES = cases("missions")

SPEED = Key("speed_mps", float, "a plug-in's own key", unit="m/s", writer="Radar", max_age_s=1.0)


class Probe(Leaf):
    """Writes down its life."""

    answers = (Status.SUCCESS, Status.FAILURE, Status.RUNNING, Status.SKIPPED)
    ports = (Port("answers", str, default="R", doc="one letter a tick"),)
    letters: ClassVar = {
        "S": Status.SUCCESS,
        "F": Status.FAILURE,
        "R": Status.RUNNING,
        "K": Status.SKIPPED,
        "?": None,
    }

    def __init__(self, name: str | None = None, /, **given: object) -> None:
        super().__init__(name, **given)
        self.life: list[str] = []

    def on_setup(self, mission: object) -> None:
        del mission
        self.life.append("setup")

    def initialise(self) -> None:
        self.life.append("initialise")

    def update(self) -> Status:
        self.life.append("update")
        letter = self.port_value("answers")[min(self.life.count("update"), 9) - 1 :][:1]
        if letter == "!":
            raise ZeroDivisionError("on purpose")
        return self.letters[letter or "R"]  # type: ignore[no-any-return]

    def terminate(self, new_status: Status) -> None:
        self.life.append(f"terminate {new_status.name}")
        if "T" in self.port_value("answers"):
            raise RuntimeError("in terminate")


class BoolProbe(Probe):
    condition = True


class Narrow(Probe):
    """Declares that it never fails."""

    answers = (Status.SUCCESS, Status.RUNNING)


def ready(world: World, root: Node) -> MissionTree:
    tree = MissionTree(root, name="Mission")
    tree.setup(world.context)
    return tree


def test_methods_run_when_py_trees_says(world: World) -> None:
    probe = Probe("p", answers="RSSR")
    tree = ready(world, probe)
    tree.halt()  # an idle leaf is not terminated
    for _ in range(4):
        tree.tick()
    tree.halt()
    tree.halt()
    assert probe.life == [
        *("setup", "initialise", "update", "update", "terminate SUCCESS"),
        *("initialise", "update", "terminate SUCCESS"),
        *("initialise", "update", "terminate IDLE"),
    ]
    assert probe.node_status is Status.IDLE


def test_an_exception_after_an_exception_is_noted(world: World) -> None:
    leaves = [Probe("late", answers="RT"), Probe("fails", answers="!")]
    with pytest.raises(NodeFailedError, match="'Mission/both/fails'") as error:
        ready(world, Parallel("both", leaves)).tick()
    assert "Mission/both/late" in error.value.__notes__[0]
    assert isinstance(error.value.__cause__, ZeroDivisionError)
    assert [leaf.node_status for leaf in leaves] == [Status.IDLE] * 2
    assert [leaf.life.count("terminate IDLE") for leaf in leaves] == [1, 1]


@pytest.mark.parametrize(
    ("kind", "answers", "message"),
    [
        (Probe, "?", "must return SUCCESS, FAILURE, RUNNING or SKIPPED, got None$"),
        (BoolProbe, "R", "must return SUCCESS, FAILURE or SKIPPED, got .*: name it in `answers`"),
        (Narrow, "F", r"update\(\) of Narrow must return SUCCESS or RUNNING, got "),
    ],
)
def test_wrong_answers_raise(world: World, kind: type[Probe], answers: str, message: str) -> None:
    with pytest.raises(NodeFailedError, match=message):
        ready(world, kind("p", answers=answers)).tick()


@pytest.mark.parametrize(
    ("declared", "message"),
    [
        ({"ports": Port("a", int)}, r"Loose\.ports must be a tuple of Port objects, .*got Port\("),
        ({"reads": STATE}, r"Loose\.reads must be a tuple of Key objects, .*got Key\("),
        ({"writes": ("state",)}, r"Loose\.writes must be a tuple of Key objects, .*'state'"),
        ({"answers": ("SUCCESS",)}, "answers must be a tuple of Status objects"),
        ({"ports": (Port("a", int), Port("a", str))}, "declares a port twice"),
    ],
)
def test_what_is_declared_is_a_tuple(declared: dict[str, Any], message: str) -> None:
    """A missing comma in `(STATE,)` is found at the definition of the class."""
    with pytest.raises(TypeError, match=message):
        type("Loose", (Leaf,), declared)


def test_children_are_objects_in_one_place_of_a_tree() -> None:
    with pytest.raises(TypeError, match=r"got the class Probe: write Probe\(\.\.\.\)"):
        Sequence("s", [Probe])  # type: ignore[list-item]
    probe = Probe("p")
    with pytest.raises(InputError, match="node 'p' stands in tree 'Tree' 2 times: make an object"):
        MissionTree(Sequence("s", [probe, Sequence("t", [probe])]))


def test_using_a_leaf_before_setup_says_so() -> None:
    with pytest.raises(MissionError, match="call setup"):
        MissionTree(Probe("p")).tick()
    with pytest.raises(MissionError, match=r"MissionTree\.setup"):
        _ = Probe("p").clock


def test_siblings_of_one_name_get_numbers() -> None:
    tree = MissionTree(Sequence("s", [Probe("a"), Probe("a"), Probe("b")]), name="M")
    assert [leaf.path for leaf in tree.leaves()] == ["M/s/a", "M/s/a#2", "M/s/b"]
    assert tree.find("M/s/a#2") is tree.root.children[1]
    with pytest.raises(KeyError, match="2 nodes"):
        tree.find("a")


# --- the board ------------------------------------------------------------------------------------


class Sensor(Leaf):
    """Reads and writes the board according to `mode`."""

    ports = (
        Port("mode", str),
        Port("speed", float, default="{@speed_mps}"),
        Port("out", float, default="{copy}", direction="output"),
    )
    reads = (HEIGHT,)
    writes = (SPEED,)

    def update(self) -> Status:
        mode = self.port_value("mode")
        if mode == "ok":
            height_m = self.read(HEIGHT).value or 0.0
            self.write(SPEED, height_m * 2)
            self.set_port("out", self.port(self.ports[1]))
        elif mode == "read":
            self.read(ELAPSED)
        elif mode == "write":
            self.write(HEIGHT, 1.0)
        elif mode == "type":
            self.write(SPEED, "fast")  # type: ignore[arg-type]
        elif mode == "port":
            self.set_port("ot", 1.0)
        elif mode == "stale":
            self.port_value("speed")
        return Status.SUCCESS


def test_declared_access_works(world: World) -> None:
    tree = ready(world, Sensor("s", mode="ok"))
    world.board.declare(HEIGHT)
    world.board.write(HEIGHT, 1.5)
    assert tree.tick() is Status.SUCCESS
    assert world.board.read(SPEED).value == tree.variables["copy"] == 3.0


@pytest.mark.parametrize(("mode", "message"), CASES["undeclared"])
def test_undeclared_access_is_refused(world: World, mode: str, message: str) -> None:
    with pytest.raises(NodeFailedError, match=message) as error:
        ready(world, Sensor("s", mode=mode)).tick()
    assert isinstance(error.value.__cause__, BoardAccessError)


def test_a_leaf_whose_port_reads_a_key_without_a_value_fails(world: World) -> None:
    sensor = Sensor("s", mode="stale")
    tree = ready(world, sensor)
    assert tree.tick() is Status.FAILURE
    assert "port 'speed': {@speed_mps} was never written; Radar writes" in sensor.feedback_message
    assert sensor.held(Sensor.ports[1]) is None
    world.board.write(SPEED, 2.0)
    assert tree.tick() is Status.SUCCESS
    assert sensor.held(Sensor.ports[1]) == 2.0
    world.clock.advance(3.0)
    assert tree.tick() is Status.FAILURE
    assert "{@speed_mps} holds nothing fresh (age 3.00 s)" in sensor.feedback_message
    assert sensor.held(Sensor.ports[1]) is None


SHARE = Key("share", float, "share of red in the picture", max_age_s=1.0)
WAIT = Key("wait_ms", int, "how long", unit="ms")


class Detect(Leaf):
    """Declares the keys; the test writes them."""

    writes = (SHARE, WAIT)

    def update(self) -> Status:
        return Status.SUCCESS


class Fly(Leaf):
    """Proposes a movement, then reads its port."""

    moves = True
    ports = (Port("speed_mps", float, default=1.0, doc="m/s"),)
    ended: tuple[Status, ...] = ()

    def update(self) -> Status:
        self.propose(Hover())
        self.port_value("speed_mps")
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        self.ended = (*self.ended, new_status)


def with_keys(world: World, body: str) -> tuple[MissionTree, Any]:
    """Return a tree, set up, and its last leaf."""
    inner = subtree("In", '<ScriptCondition code="red &gt; 0"/>')
    text = document(f"<Sequence><Detect/>{body}</Sequence>", inner, tree_id="M")
    tree = parse_tree(text, NodeRegistry([Detect, Fly]))
    tree.setup(world.context)
    return tree, [*tree.leaves()][-1]


@pytest.mark.parametrize("body", CASES["unknown_keys"])
def test_a_node_that_reads_a_key_without_a_value_fails(world: World, body: str) -> None:
    assert with_keys(world, body)[0].tick() is Status.FAILURE


def test_the_log_names_node_and_key_once(world: World, caplog: pytest.LogCaptureFixture) -> None:
    tree, _ = with_keys(world, '<ScriptCondition name="red" code="@share &gt; 0.5"/>')
    with caplog.at_level(logging.WARNING):
        assert [tree.tick(), tree.tick()] == [Status.FAILURE] * 2
    (line,) = caplog.messages
    assert line.startswith("Warning: node 'M/Sequence/red' fails: script '@share > 0.5'")
    assert line.endswith("board key 'share' has no value yet")


@pytest.mark.parametrize(("body", "ended"), CASES["ends"])
def test_what_runs_ends_when_a_key_becomes_unknown(world: World, body: str, ended: str) -> None:
    tree, flies = with_keys(world, body)
    world.board.write(SHARE, 0.7)
    assert tree.tick() is Status.RUNNING
    world.clock.advance(2.0)
    world.context.proposals.clear()
    tree.tick()
    tree.halt()
    assert flies.ended == (Status[ended],)
    assert world.context.proposals.movement is None
    assert "x" not in tree.variables


# --- proposals ------------------------------------------------------------------------------------


class Proposes(Leaf):
    """Flies and points with a tenth of its number; its answer is one letter."""

    answers = Probe.answers
    moves = points = True
    ports = (Port("number", float), Port("answer", str, default="R"))

    def update(self) -> Status:
        number: float = self.port_value("number") / 10
        self.propose(Velocity(forward_mps=number))
        self.point(GimbalTo(pitch_rad=number))
        return Probe.letters[self.port_value("answer")]  # type: ignore[no-any-return]


@pytest.mark.parametrize(("root", "answers", "number"), CASES["makes_way"])
def test_a_leaf_that_has_ended_makes_way_for_the_next(
    world: World, root: str, answers: str, number: int | None
) -> None:
    leaves = [Proposes(number=at, answer=answer) for at, answer in enumerate(answers, start=1)]
    tree = ready(world, NodeRegistry()[root]("p", leaves))
    if number is None:
        with pytest.raises(NodeFailedError, match="both propose a movement in one tick") as error:
            tree.tick()
        assert isinstance(error.value.__cause__, ProposalConflictError)
        assert "'Mission/p/Proposes" in str(error.value)
        return
    tree.tick()
    assert world.proposals.movement == Velocity(forward_mps=number / 10)
    assert world.proposals.gimbal == GimbalTo(pitch_rad=number / 10)
