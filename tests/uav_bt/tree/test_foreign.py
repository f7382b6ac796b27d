"""Py_trees behaviours in tree files, and our leaves in py_trees trees."""

from __future__ import annotations

import enum
from typing import Any, ClassVar

import py_trees
import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status as Theirs

from tests.worlds.trees import World, document
from uav_bt.board import HEIGHT
from uav_bt.board.blackboard import Blackboard
from uav_bt.board.context import MissionContext, Proposals
from uav_bt.clock import ManualClock
from uav_bt.errors import InputError, NodeFailedError, TreeError
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, Port, Status, leaf_of, parse_tree
from uav_bt.tree.describe import describe
from uav_bt.types import Hover


class Lamp(enum.Enum):
    """Colours."""

    RED = "r"
    GREEN = "g"


class Blink(Behaviour):
    """Blinks so often.

    A second paragraph.
    """

    life: list[str]

    def __init__(
        self,
        name: str,
        times: int,
        lamp: Lamp = Lamp.RED,
        rate_hz: float = 2.0,
        *,
        loud: bool = False,
    ) -> None:
        super().__init__(name)
        self.given = (times, lamp, rate_hz, loud)
        self.life = []

    def setup(self, **kwargs: Any) -> None:
        self.life.append(f"setup {kwargs}")

    def initialise(self) -> None:
        self.life.append("initialise")
        self.left = self.given[0]

    def update(self) -> Theirs:
        self.life.append("update")
        self.left -= 1
        self.feedback_message = f"{self.left} left"
        return Theirs.RUNNING if self.left else Theirs.SUCCESS

    def terminate(self, new_status: Theirs) -> None:
        self.life.append(f"terminate {new_status.name}")

    def shutdown(self) -> None:
        self.life.append("shutdown")


class Answers(Behaviour):
    """Returns the status that its text names."""

    def __init__(self, name: str, answer: str) -> None:
        super().__init__(name)
        self.answer = answer

    def update(self) -> Theirs:
        if self.answer == "raise":
            raise OSError("no lamp")
        return Theirs[self.answer]


def load(body: str, world: World, *behaviours: type[Behaviour]) -> MissionTree:
    tree = parse_tree(document(body), NodeRegistry([Blink, Answers, *behaviours]))
    tree.setup(world.context)
    return tree


def test_ports_come_from_the_constructor() -> None:
    """Annotated arguments become ports with defaults; enumerations use their members' names."""
    info = describe(leaf_of(Blink))
    assert [(p.name, p.type, p.default, p.required) for p in info.ports] == [
        ("times", "int", None, True),
        ("lamp", "str", "RED", False),
        ("rate_hz", "float", "2.0", False),
        ("loud", "bool", "false", False),
    ]
    assert (info.node_id, info.kind, info.doc) == ("Blink", "Action", "Blinks so often.")
    assert info.ports[1].choices == ("RED", "GREEN")


def test_its_life_is_the_one_that_py_trees_promises(world: World) -> None:
    """Its methods are called for setup, start, ticks, end, restart and halt."""
    tree = load('<Blink name="b" times="2" lamp="GREEN" loud="true"/>', world)
    behaviour = tree.find("b").behaviour  # type: ignore[attr-defined]
    assert behaviour.given == (2, Lamp.GREEN, 2.0, True)
    assert behaviour.name == "b"
    assert [tree.tick() for _ in range(3)] == [Status.RUNNING, Status.SUCCESS, Status.RUNNING]
    assert tree.find("b").feedback_message == "1 left"
    tree.halt()
    assert behaviour.life == [
        *("setup {}", "initialise", "update", "update", "terminate SUCCESS"),
        *("initialise", "update", "terminate INVALID"),
    ]
    tree.shutdown()
    tree.shutdown()  # only once
    assert behaviour.life[-2:] == ["terminate INVALID", "shutdown"]


class Forgets(Behaviour):
    """Forgets to answer."""

    def update(self) -> Theirs:  # type: ignore[empty-body]
        pass


class Guards(py_trees.composites.Sequence):
    """Has one child, which forgets to answer."""

    def __init__(self, name: str) -> None:
        super().__init__(name, memory=False, children=[Forgets("inner")])


@pytest.mark.parametrize("node", ["Forgets", "Guards"])
def test_a_forgotten_answer_stops_the_mission_and_is_not_passed_over(
    world: World, node: str
) -> None:
    tree = load(f'<Sequence><{node}/><Blink times="1"/></Sequence>', world, Forgets, Guards)
    with pytest.raises(
        NodeFailedError, match=r"update\(\) of Forgets must return a status"
    ) as error:
        tree.tick()
    assert error.value.node_path == f"Main/Sequence/{node}"
    assert tree.find("Blink").behaviour.life == ["setup {}"]  # type: ignore[attr-defined]


def test_a_timer_of_py_trees_warns_that_it_measures_another_clock(
    world: World, caplog: pytest.LogCaptureFixture
) -> None:
    load('<Timer duration="2"/>', world, py_trees.timers.Timer)
    (warning,) = caplog.messages
    assert "node 'Main/Timer': 'Timer' of py_trees measures the computer's clock" in warning


@pytest.mark.parametrize(
    ("answer", "status"),
    [
        ("RUNNING", "RUNNING"),
        ("SUCCESS", "SUCCESS"),
        ("FAILURE", "FAILURE"),
        ("INVALID", "SKIPPED"),
    ],
)
def test_answers_keep_their_meaning(world: World, answer: str, status: str) -> None:
    """INVALID is neither success nor failure: the node counts as skipped."""
    tree = load(f'<Answers answer="{answer}"/>', world)
    assert tree.tick() is Status[status]


def test_an_exception_names_the_path(world: World) -> None:
    """The error is like that of our leaves; an exception of a constructor is an input error."""
    tree = load('<Sequence><Answers name="x" answer="raise"/></Sequence>', world)
    with pytest.raises(NodeFailedError, match="node 'Main/Sequence/x' failed: OSError: no lamp"):
        tree.tick()

    class Picky(Behaviour):
        def __init__(self, name: str, size: int) -> None:
            super().__init__(name)
            raise ValueError(f"{size} is too small")

        def update(self) -> Theirs:
            return Theirs.SUCCESS

    with pytest.raises(InputError, match=r"'p'.*constructed: ValueError: 3 is too small"):
        load('<Picky name="p" size="3"/>', world, Picky)


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ("", "attribute 'times' is missing"),
        ('times="few"', "expected an integer, got 'few'"),
        ('times="{n}"', "expected a literal, got '{n}'"),
        ('times="2" lamp="BLUE"', "expected one of RED, GREEN; got 'BLUE'"),
        ('times="2" rate="1"', "unknown attribute 'rate'; did you mean 'rate_hz'"),
    ],
)
def test_wrong_attributes_are_found_by_the_loader(
    world: World, attributes: str, message: str
) -> None:
    with pytest.raises(TreeError, match=message):
        load(f"<Blink {attributes}/>", world)


def test_what_cannot_be_a_port_is_refused_at_registration() -> None:
    """An argument without annotation or of another type is refused; so is another class."""

    class Bare(Behaviour):
        def __init__(self, name: str, speed=1.0) -> None:  # type: ignore[no-untyped-def]  # noqa: ANN001
            super().__init__(f"{name} {speed}")

        def update(self) -> Theirs:
            return Theirs.SUCCESS

    class Deep(Bare):
        def __init__(self, name: str, path: list[int]) -> None:
            super().__init__(name, len(path))

    with pytest.raises(InputError, match=r"Bare: argument 'speed' .* has no annotation"):
        NodeRegistry([Bare])
    with pytest.raises(InputError, match=r"Deep: argument 'path' .* has a type that no port has"):
        NodeRegistry([Deep])
    with pytest.raises(InputError, match="expected a node class"):
        NodeRegistry([int])  # type: ignore[list-item]


def test_a_leaf_of_ours_flies_in_a_plain_tree() -> None:
    """`BehaviourTree.setup(mission=...)` gives every leaf of ours its board."""

    class Climb(Leaf):
        ports = (Port("to_m", float),)
        reads = (HEIGHT,)

        def update(self) -> Status:
            self.propose(Hover())
            height_m = self.read(HEIGHT).value or 0.0
            return Status.SUCCESS if height_m >= self.port_value("to_m") else Status.RUNNING

    clock = ManualClock()
    board = Blackboard(clock, (HEIGHT,))
    mission = MissionContext(board=board, clock=clock, proposals=Proposals(), policy=pytest.fail)
    counting = Blink("blink", 2)
    root = py_trees.composites.Sequence("s", memory=True, children=[Climb(to_m=1.5), counting])
    tree = py_trees.trees.BehaviourTree(root)
    tree.add_pre_tick_handler(lambda _: mission.proposals.clear())
    tree.setup(mission=mission)
    seen = []
    for height_m in (1.0, 1.6, 1.6, 1.0):
        board.write(HEIGHT, height_m)
        tree.tick()
        seen.append((root.status, mission.proposals.movement is not None))
    R, S = Theirs.RUNNING, Theirs.SUCCESS  # noqa: N806
    assert seen == [(R, True), (R, True), (S, False), (R, True)]
    root.stop(Theirs.INVALID)
    assert root.children[0].status is Theirs.INVALID


class Port9600(Leaf):
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
    Port9600.log.clear()
    return Port9600.log


def devices(*faults: str) -> MissionTree:
    nodes = "".join(
        f'<Port9600 name="{name}" fault="{fault}"/>'
        for name, fault in zip("abc", faults, strict=False)
    )
    return parse_tree(document(f"<Sequence>{nodes}</Sequence>"), NodeRegistry([Port9600]))


def test_leaves_close_what_they_opened_even_if_another_raises(world: World, log: list[str]) -> None:
    tree = devices("", "close", "")
    tree.setup(world.context)
    with pytest.raises(NodeFailedError, match="Sequence/b' failed: OSError: device is gone"):
        tree.shutdown()
    assert log[3:] == ["a closed", "b closed", "c closed"]


def test_a_setup_that_fails_closes_what_was_opened_before(world: World, log: list[str]) -> None:
    with pytest.raises(NodeFailedError, match="Sequence/b' failed: OSError: no device"):
        devices("", "open", "").setup(world.context)
    assert log == ["a opened", "a closed"]


def test_a_tree_of_py_trees_shuts_our_leaves_down(world: World, log: list[str]) -> None:
    root = py_trees.composites.Sequence("root", memory=True, children=[Port9600("a")])
    theirs = py_trees.trees.BehaviourTree(root)
    theirs.setup(mission=world.context)
    theirs.shutdown()
    assert log == ["a opened", "a closed"]
