"""Leaves: calls of their methods, allowed access, and exceptions."""

from __future__ import annotations

from typing import Any, ClassVar

import pytest

from tests.worlds.trees import World
from uav_bt.board import ELAPSED, HEIGHT, STATE
from uav_bt.board.blackboard import Key
from uav_bt.errors import (
    BoardAccessError,
    InputError,
    MissionError,
    NodeFailedError,
    ProposalConflictError,
)
from uav_bt.tree import Leaf, MissionTree, Node, NodeKind, Port, Status
from uav_bt.tree.nodes import Fallback, Parallel, ReactiveFallback, Sequence
from uav_bt.types import GimbalTo, Hover, Land, Velocity

SPEED = Key("speed_mps", float, "a plug-in's own key", unit="m/s", writer="Radar", max_age_s=1.0)


class Probe(Leaf):
    """Writes down its life.

    A second paragraph that no list shows.
    """

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


def ready(world: World, root: Node) -> MissionTree:
    tree = MissionTree(root, name="Mission")
    tree.setup(world.context)
    return tree


def test_methods_run_when_py_trees_says(world: World) -> None:
    """Setup runs once, initialise at the start and terminate at the end of an activation."""
    probe = Probe("p", answers="RSS")
    tree = ready(world, probe)
    for _ in range(3):
        tree.tick()
    first = ["setup", "initialise", "update", "update", "terminate SUCCESS"]
    assert probe.life == [*first, "initialise", "update", "terminate SUCCESS"]


def test_a_halted_leaf_is_terminated_once(world: World) -> None:
    """Two halts call `terminate` of a running leaf once, and of an idle one never."""
    probe = Probe("p")
    tree = ready(world, probe)
    tree.halt()
    tree.tick()
    tree.halt()
    tree.halt()
    assert probe.life == ["setup", "initialise", "update", "terminate IDLE"]
    assert probe.node_status is Status.IDLE


def test_a_finished_leaf_is_not_terminated_again(world: World) -> None:
    """`terminate` is not called again when the parent of a finished leaf is halted."""
    done, going = Probe("done", answers="S"), Probe("going")
    tree = ready(world, Sequence("s", [done, going]))
    tree.tick()
    tree.halt()
    assert done.life[-1] == "terminate SUCCESS"
    assert going.life[-1] == "terminate IDLE"


def test_a_leaf_that_skips_itself_ends(world: World) -> None:
    """SKIPPED from the first update ends the activation; the parent continues."""
    skips, acts = Probe("skips", answers="K"), Probe("acts", answers="S")
    tree = ready(world, Sequence("s", [skips, acts]))
    assert tree.tick() is Status.SUCCESS
    assert skips.life == ["setup", "initialise", "update", "terminate IDLE"]


@pytest.mark.parametrize("answers", ["!", "R!"])
def test_an_exception_names_the_node_and_leaves_nothing_running(world: World, answers: str) -> None:
    """`terminate` is called once on the failing leaf and on the others, at any tick."""
    fails, other = Probe("fails", answers=answers), Probe("other")
    tree = ready(world, Parallel("both", [other, fails]))
    for _ in answers[1:]:
        tree.tick()
    with pytest.raises(NodeFailedError, match="'Mission/both/fails' failed: ZeroDiv") as error:
        tree.tick()
    assert isinstance(error.value.__cause__, ZeroDivisionError)
    assert [node.node_status for node in tree.nodes()] == [Status.IDLE] * 3
    assert fails.life.count("terminate IDLE") == 1
    assert other.life.count("terminate IDLE") == 1
    tree.halt()
    assert fails.life.count("terminate IDLE") == 1


def test_an_exception_in_terminate_does_not_stop_the_halting(world: World) -> None:
    """The first exception is raised, with its path, after all others have been halted."""
    bad, good = Probe("bad", answers="RRT"), Probe("good")
    tree = ready(world, Parallel("both", [bad, good]))
    tree.tick()
    with pytest.raises(NodeFailedError, match="'Mission/both/bad' failed: RuntimeError"):
        tree.halt()
    assert good.life[-1] == "terminate IDLE"
    assert [node.node_status for node in tree.nodes()] == [Status.IDLE] * 3
    tree.halt()
    assert bad.life.count("terminate IDLE") == 1


def test_an_exception_after_an_exception_is_noted(world: World) -> None:
    """The original exception is raised; exceptions of the halt are its notes."""
    tree = ready(
        world, Parallel("both", [Probe("late", answers="RT"), Probe("fails", answers="!")])
    )
    with pytest.raises(NodeFailedError, match="'Mission/both/fails'") as error:
        tree.tick()
    assert "Mission/both/late" in error.value.__notes__[0]


@pytest.mark.parametrize(("kind", "answers"), [(Probe, "?"), (BoolProbe, "R")])
def test_wrong_answers_are_refused(world: World, kind: type[Probe], answers: str) -> None:
    """A leaf must return a status, and a condition must not return RUNNING."""
    with pytest.raises(NodeFailedError, match="must return SUCCESS"):
        ready(world, kind("p", answers=answers)).tick()


def test_conditions_and_actions_have_their_kind() -> None:
    """`condition = True` makes a Condition node; the id of a subclass is its name."""
    assert Probe.kind is NodeKind.ACTION
    assert BoolProbe.kind is NodeKind.CONDITION
    assert BoolProbe.node_id == "BoolProbe"


def test_a_port_twice_is_refused() -> None:
    """A class that declares a port twice is refused at its definition."""
    with pytest.raises(TypeError, match="declares a port twice"):
        type("Twice", (Leaf,), {"ports": (Port("a", int), Port("a", str))})


@pytest.mark.parametrize(
    ("declared", "message"),
    [
        ({"ports": Port("a", int)}, r"Loose\.ports must be a tuple of Port objects, .*got Port\("),
        ({"reads": STATE}, r"Loose\.reads must be a tuple of Key objects, .*got Key\("),
        ({"writes": ("state",)}, r"Loose\.writes must be a tuple of Key objects, .*'state'"),
    ],
)
def test_what_is_declared_is_a_tuple(declared: dict[str, Any], message: str) -> None:
    """A missing comma in `(STATE,)` is found at the definition of the class."""
    with pytest.raises(TypeError, match=message):
        type("Loose", (Leaf,), declared)


def test_a_class_is_no_child() -> None:
    """The message suggests an object of the class."""
    with pytest.raises(TypeError, match=r"got the class Probe: write Probe\(\.\.\.\)"):
        Sequence("s", [Probe])  # type: ignore[list-item]


def test_an_object_stands_in_one_place_of_a_tree() -> None:
    """An object at two places of a tree would mix the states of both."""
    probe = Probe("p")
    with pytest.raises(InputError, match="node 'p' stands in tree 'Tree' 2 times: make an object"):
        MissionTree(Sequence("s", [probe, Sequence("t", [probe])]))


def test_using_a_leaf_before_setup_says_so() -> None:
    """A tree without setup is refused with a remedy."""
    with pytest.raises(MissionError, match="call setup"):
        MissionTree(Probe("p")).tick()
    with pytest.raises(MissionError, match=r"MissionTree\.setup"):
        _ = Probe("p").clock


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
            self.set_port(self.ports[2], self.port(self.ports[1]))
        elif mode == "read":
            self.read(ELAPSED)
        elif mode == "write":
            self.write(HEIGHT, 1.0)
        elif mode == "type":
            self.write(SPEED, "fast")  # type: ignore[arg-type]
        elif mode == "port":
            self.port_value("sped")
        elif mode == "stale":
            self.port_value("speed")
        return Status.SUCCESS


def test_declared_access_works(world: World) -> None:
    """A leaf reads and writes its declared keys, including own keys and those of ports."""
    tree = ready(world, Sensor("s", mode="ok"))
    world.board.declare(HEIGHT)
    world.board.write(HEIGHT, 1.5)
    assert tree.tick() is Status.SUCCESS
    assert world.board.read(SPEED).value == 3.0
    assert tree.variables["copy"] == 3.0


@pytest.mark.parametrize(
    ("mode", "message"),
    [
        ("read", "'Mission/s' reads board key 'elapsed_s' without declaring it"),
        ("write", "'Mission/s' writes board key 'height_above_ground_m' without declaring"),
        ("type", "'Mission/s': board key 'speed_mps' holds float, got str"),
        ("port", "declares no port 'sped'"),
    ],
)
def test_undeclared_access_is_refused(world: World, mode: str, message: str) -> None:
    """The message names leaf and key."""
    with pytest.raises(NodeFailedError) as error:
        ready(world, Sensor("s", mode=mode)).tick()
    assert isinstance(error.value.__cause__, BoardAccessError)
    assert message in str(error.value)


def test_a_leaf_whose_port_reads_an_unknown_key_fails(world: World) -> None:
    """The feedback names the key; a mission goes on."""
    sensor = Sensor("s", mode="stale")
    tree = ready(world, sensor)
    assert tree.tick() is Status.FAILURE
    assert "port 'speed': {@speed_mps} was never written; Radar writes" in sensor.feedback_message
    world.board.write(SPEED, 2.0)
    assert tree.tick() is Status.SUCCESS
    world.clock.advance(3.0)
    assert tree.tick() is Status.FAILURE
    assert "{@speed_mps} holds nothing fresh (age 3.00 s)" in sensor.feedback_message


def test_a_port_reading_tells_the_age(world: World) -> None:
    """A leaf that accepts stale values uses the reading."""
    sensor = Sensor("s", mode="")
    ready(world, sensor)
    assert not sensor.port_reading(Sensor.ports[1]).known
    world.board.write(SPEED, 2.0)
    assert sensor.port_reading(Sensor.ports[1]).value == 2.0
    world.clock.advance(3.0)
    reading = sensor.port_reading(Sensor.ports[1])
    assert reading.value is None
    assert reading.age_s == pytest.approx(3.0)


class Asks(Leaf):
    """Proposes."""

    def update(self) -> Status:
        self.propose(Land() if self.name == "land" else Hover())
        return Status.RUNNING


def test_two_proposals_are_an_error_that_names_both(world: World) -> None:
    """The owner of a proposal is the leaf's unique path."""
    tree = ready(world, Parallel("p", [Asks("land"), Asks("hover")]))
    with pytest.raises(NodeFailedError, match="'Mission/p/land' and 'Mission/p/hover'") as error:
        tree.tick()
    assert isinstance(error.value.__cause__, ProposalConflictError)


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


@pytest.mark.parametrize(
    ("root", "answers", "number"),
    [
        (Sequence, "SR", 2),  # the next leaf flies in the same tick
        (Sequence, "KR", 2),
        (Fallback, "FSR", 2),
        (Sequence, "SSR", 3),
        (Sequence, "S", 1),  # nobody else proposes: it stands for this tick
        (Parallel, "SRS", None),  # the second runs on when the third proposes
        (Parallel, "RS", None),
    ],
)
def test_a_leaf_that_has_ended_makes_way_for_the_next(
    world: World, root: type[Node], answers: str, number: int | None
) -> None:
    leaves = [Proposes(number=at, answer=answer) for at, answer in enumerate(answers, start=1)]
    tree = ready(world, root("p", leaves))
    if number is None:
        with pytest.raises(NodeFailedError, match="both propose a movement in one tick"):
            tree.tick()
        return
    tree.tick()
    assert world.proposals.movement == Velocity(forward_mps=number / 10)
    assert world.proposals.gimbal == GimbalTo(pitch_rad=number / 10)


def test_siblings_of_one_name_get_numbers() -> None:
    """Paths are unique, also with equal names."""
    tree = MissionTree(Sequence("s", [Probe("a"), Probe("a"), Probe("b")]), name="M")
    assert [leaf.path for leaf in tree.leaves()] == ["M/s/a", "M/s/a#2", "M/s/b"]
    assert tree.find("M/s/a#2") is tree.root.children[1]
    with pytest.raises(KeyError, match="2 nodes"):
        tree.find("a")


def test_active_path_follows_the_running_branch(world: World) -> None:
    """The active path has the names from the root to the running leaf."""
    inner = Sequence("explore", [Probe("Explore")])
    tree = ready(world, ReactiveFallback("root", [Probe("check", answers="FFFF"), inner]))
    assert tree.active_path() == ()
    tree.tick()
    assert tree.active_path() == ("root", "explore", "Explore")
    tree.halt()
    assert tree.active_path() == ()


class Narrow(Probe):
    """Declares that it never fails."""

    answers = (Status.SUCCESS, Status.RUNNING)


def test_an_answer_that_is_not_declared_is_refused(world: World) -> None:
    assert ready(world, Narrow("n", answers="S")).tick() is Status.SUCCESS
    with pytest.raises(NodeFailedError) as error:
        ready(world, Narrow("n", answers="F")).tick()
    assert "update() of Narrow must return SUCCESS or RUNNING" in str(error.value)
    assert "name it in `answers`" in str(error.value)


def test_a_condition_never_runs() -> None:
    class Ask(Leaf):
        """Asks."""

        condition = True

    assert Ask.answers == (Status.SUCCESS, Status.FAILURE)


def test_answers_are_statuses() -> None:
    with pytest.raises(TypeError, match="answers must be a tuple of Status objects"):
        type("Odd", (Leaf,), {"answers": ("SUCCESS",)})


class Mover(Leaf):
    """Moves until it is halted."""

    moves = True

    def update(self) -> Status:
        self.propose(Hover())
        return Status.RUNNING


def test_a_leaf_that_is_halted_loses_its_proposal(world: World) -> None:
    """Another leaf may move in the same tick."""
    both = Parallel("both", [Mover("first"), Probe("fails", answers="F")])
    tree = ready(world, Fallback("either", [both, Mover("second")]))
    assert tree.tick() is Status.RUNNING
    assert world.proposals.movement_owner == "Mission/either/second"
