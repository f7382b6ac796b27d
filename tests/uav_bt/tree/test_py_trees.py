"""Py_trees and our nodes: behaviours as leaves, a tree of theirs as the root, ours in theirs."""

from __future__ import annotations

import enum
import logging
from typing import Any, ClassVar

import py_trees
import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import ParallelPolicy
from py_trees.common import Status as Theirs

from tests.conformance import Scripted
from tests.worlds.tables import cases
from tests.worlds.trees import World, document
from uav_bt.board import HEIGHT, MissionContext
from uav_bt.errors import InputError, MissionError, NodeFailedError, TreeError
from uav_bt.testing import TreeBench
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, Port, Status, leaf_of, parse_tree
from uav_bt.tree.describe import default_text, summary
from uav_bt.tree.nodes import Sequence
from uav_bt.tree.scripted import ScriptedLeaf
from uav_bt.types import Hover

CASES = cases("missions")

# --- our nodes in the tools and trees of py_trees -------------------------------------------------


def test_a_plain_tree_is_set_up_with_two_lines_that_its_error_says() -> None:
    inner = Scripted("a", script="RS")
    behaviour_tree = py_trees.trees.BehaviourTree(py_trees.decorators.Inverter("not", child=inner))
    with pytest.raises(MissionError, match="node 'a': setup needs") as caught:
        behaviour_tree.setup()
    first, second = (line.strip() for line in str(caught.value).splitlines()[1:])
    assert first == "from uav_bt.board import MissionContext"
    assert second == "behaviour_tree.setup(mission=MissionContext())"
    behaviour_tree.setup(mission=MissionContext())
    behaviour_tree.tick()
    behaviour_tree.tick()
    assert behaviour_tree.root.status is Theirs.FAILURE


# --- plain behaviours as leaves -------------------------------------------------------------------


class Lamp(enum.Enum):
    """Colours."""

    RED = "r"
    GREEN = "g"


class Blink(Behaviour):
    """Blinks so often, and keeps what py_trees calls.

    A second paragraph.
    """

    def __init__(
        self,
        name: str,
        times: int = 1,
        lamp: Lamp = Lamp.RED,
        rate_hz: float = 2.0,
        *,
        loud: bool = False,
        answer: str = "SUCCESS",
    ) -> None:
        super().__init__(name)
        self.given = (times, lamp, rate_hz, loud)
        self.answer = answer
        self.life: list[str] = []

    def setup(self, **kwargs: Any) -> None:
        self.life.append(f"setup {' '.join(kwargs)}".strip())

    def initialise(self) -> None:
        self.life.append("initialise")
        self.left = self.given[0]

    def update(self) -> Theirs:
        self.life.append("update")
        if self.answer == "raise":
            raise OSError("no lamp")
        self.left -= 1
        self.feedback_message = f"{self.left} left"
        answer: Theirs = Theirs.RUNNING if self.left > 0 else getattr(Theirs, self.answer, None)
        return answer

    def terminate(self, new_status: Theirs) -> None:
        self.life.append(f"terminate {new_status.name}")

    def shutdown(self) -> None:
        self.life.append("shutdown")
        if self.answer == "stuck":
            raise OSError("stuck")


class Needs(Behaviour):
    """Has an argument without a default."""

    def __init__(self, name: str, times: int) -> None:
        super().__init__(f"{name} {times}")


class Picky(Behaviour):
    """Cannot be constructed."""

    def __init__(self, name: str, size: int) -> None:
        super().__init__(name)
        raise ValueError(f"{size} is too small")

    def update(self) -> Theirs:
        return Theirs.SUCCESS


def load(body: str, world: World) -> MissionTree:
    behaviours = [Blink, Needs, Picky]
    tree = parse_tree(document(body), NodeRegistry(behaviours))
    tree.setup(world.context)
    return tree


def test_ports_come_from_the_constructor() -> None:
    blink = leaf_of(Blink)
    assert [(p.name, p.type, default_text(p), p.required) for p in blink.ports] == [
        ("times", int, "1", False),
        ("lamp", str, "RED", False),
        ("rate_hz", float, "2.0", False),
        ("loud", bool, "false", False),
        ("answer", str, "SUCCESS", False),
    ]
    assert leaf_of(Needs).ports[0].required
    assert (blink.node_id, blink.kind.value, summary(blink)) == (
        "Blink",
        "Action",
        "Blinks so often, and keeps what py_trees calls.",
    )
    assert blink.ports[1].choices == ("RED", "GREEN")


def test_its_life_is_the_one_that_py_trees_promises(world: World) -> None:
    tree = load('<Blink name="b" times="2" lamp="GREEN" loud="true"/>', world)
    behaviour = tree.find("b").behaviour  # type: ignore[attr-defined]
    assert behaviour.given == (2, Lamp.GREEN, 2.0, True)
    assert behaviour.name == "b"
    text = document('<Blink name="b" times="2"/>')
    given = {"b": {"times": "3"}}
    again = parse_tree(text, NodeRegistry([Blink]), overrides=given).find("b")
    assert again.behaviour.given[0] == 3  # type: ignore[attr-defined]
    assert [tree.tick() for _ in range(3)] == [Status.RUNNING, Status.SUCCESS, Status.RUNNING]
    assert tree.find("b").feedback_message == "1 left"
    tree.halt()
    assert behaviour.life == [
        *("setup", "initialise", "update", "update", "terminate SUCCESS"),
        *("initialise", "update", "terminate INVALID"),
    ]
    tree.shutdown()
    tree.shutdown()  # only once
    assert behaviour.life[-2:] == ["terminate INVALID", "shutdown"]


@pytest.mark.parametrize(("node", "message"), CASES["wrong_answers"])
def test_a_wrong_answer_stops_the_mission(world: World, node: str, message: str) -> None:
    tree = load(f"<Sequence><{node}/><Blink/></Sequence>", world)
    with pytest.raises(NodeFailedError, match=message):
        tree.tick()
    assert tree.find("Blink").behaviour.life == ["setup"]  # type: ignore[attr-defined]


@pytest.mark.parametrize(("node", "message"), CASES["wrong_attributes"])
def test_wrong_attributes_are_found_by_the_loader(world: World, node: str, message: str) -> None:
    with pytest.raises(InputError if "Picky" in node else TreeError, match=message):
        load(f"<{node}/>", world)


class Bare(Behaviour):
    """Does not say what `speed` is."""

    def __init__(self, name: str, speed=1.0) -> None:  # type: ignore[no-untyped-def]  # noqa: ANN001
        super().__init__(f"{name} {speed}")


class Deep(Behaviour):
    """Takes a list."""

    def __init__(self, name: str, path: list[int]) -> None:
        super().__init__(f"{name} {path}")


@pytest.mark.parametrize(
    ("node", "message"),
    [
        (Bare, r"Bare: argument 'speed' .* has no annotation"),
        (Deep, r"Deep: argument 'path' .* has a type that no port has"),
        (int, "expected a node class"),
    ],
)
def test_what_cannot_be_a_port_is_refused_at_registration(node: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        NodeRegistry([node])


# --- a tree of py_trees as the root of a mission --------------------------------------------------


class Climb(Leaf):
    """Waits until it is high enough."""

    moves = True
    reads = (HEIGHT,)

    def update(self) -> Status:
        self.propose(Hover())
        return Status.SUCCESS if (self.read(HEIGHT).value or 0.0) > 1.5 else Status.RUNNING


def sequence(*children: Behaviour | Leaf | Sequence) -> Behaviour:
    return py_trees.composites.Sequence("patrol", memory=True, children=list(children))


def together(*children: Behaviour | Leaf) -> Behaviour:
    policy = ParallelPolicy.SuccessOnAll()
    return py_trees.composites.Parallel("patrol", policy, children=list(children))


def test_nodes_of_ours_are_the_nodes_of_the_tree() -> None:
    climb, below = Climb("up"), ScriptedLeaf("says", "S")
    root = sequence(py_trees.decorators.Inverter("not", climb), Sequence("both", [below]))
    tree = MissionTree(root, name="Patrol")
    paths = ["Patrol/patrol", "Patrol/patrol/up", "Patrol/patrol/both", "Patrol/patrol/both/says"]
    assert [node.path for node in tree.nodes()] == paths
    assert list(tree.leaves()) == [climb, below]
    assert climb.has_parent_with_name("not")  # as py_trees has it


def test_leaves_propose_and_events_name_them(caplog: pytest.LogCaptureFixture) -> None:
    notes, timer = Blink("notes"), py_trees.timers.Timer("rest", 0.0)
    bench = TreeBench(MissionTree(sequence(Climb("up"), notes, timer)))
    bench.hover(height_m=1.0)
    with caplog.at_level(logging.WARNING):
        assert bench.tick() is Status.RUNNING
    assert "'Timer' of py_trees measures the computer's clock" in caplog.text
    assert bench.outcomes[-1].proposed_by == "Tree/patrol/up"
    assert bench.tree.active_path() == ("patrol", "up")
    assert "initialise" not in notes.life
    bench.hover(height_m=2.0)
    bench.tick_until(Status.SUCCESS, max_ticks=3)
    bench.log.assert_order("up started", "up succeeded", "patrol succeeded")
    bench.tree.shutdown()
    bench.tree.shutdown()
    assert notes.life == ["setup mission", "initialise", "update", "terminate SUCCESS", "shutdown"]


def test_a_branch_that_is_left_is_halted_by_py_trees() -> None:
    high, up, notes = (
        ScriptedLeaf("high", "FFS"),
        ScriptedLeaf("up", "R"),
        Blink("n", 9),
    )
    root = py_trees.composites.Selector("r", memory=False, children=[high, together(up, notes)])
    bench = TreeBench(MissionTree(root))
    assert bench.tick_until(Status.SUCCESS, max_ticks=5) == 3
    bench.log.assert_halted("up", tick=3)
    assert notes.life[-1] == "terminate INVALID"


def test_what_raises_halts_the_others() -> None:
    bench = TreeBench(MissionTree(together(ScriptedLeaf("up", "R"), Blink("n", answer="raise"))))
    with pytest.raises(NodeFailedError, match="node 'Tree/patrol' failed: OSError: no lamp"):
        bench.tick()
    bench.log.assert_halted("up")


# --- leaves that open something for the whole mission ---------------------------------------------


class Device(Leaf):
    """Opens a device for the whole mission."""

    log: ClassVar[list[str]] = []

    ports = (Port("fault", str, default="", choices=("", "open", "close")),)

    def on_setup(self, mission: MissionContext) -> None:
        del mission
        if self.port_value("fault") == "open":
            raise OSError("no device")
        self.log.append(f"{self.name} opened")

    def update(self) -> Status:
        return Status.SUCCESS

    def on_shutdown(self) -> None:
        self.log.append(f"{self.name} closed")
        if self.port_value("fault") == "close":
            raise OSError("device is gone")


@pytest.fixture
def log() -> list[str]:
    Device.log.clear()
    return Device.log


def devices(*faults: str) -> MissionTree:
    named = zip("abc", faults, strict=False)
    return MissionTree(Sequence("s", [Device(name, fault=fault) for name, fault in named]))


def test_leaves_close_what_they_opened_even_if_another_raises(world: World, log: list[str]) -> None:
    tree = devices("", "close", "")
    tree.setup(world.context)
    with pytest.raises(NodeFailedError, match="s/b' failed: OSError: device is gone"):
        tree.shutdown()
    assert log[3:] == ["a closed", "b closed", "c closed"]


def test_a_setup_that_fails_closes_what_was_opened_before(world: World, log: list[str]) -> None:
    with pytest.raises(NodeFailedError, match="s/b' failed: OSError: no device"):
        devices("", "open", "").setup(world.context)
    assert log == ["a opened", "a closed"]
