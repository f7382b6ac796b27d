"""No tree that check calls good raises, and check refuses none that is right.

`python -m pytest tests/uav_bt/tree/test_random_trees.py --hypothesis-profile many-trees` draws
other trees each time, and many of them.
"""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, Final
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st

from tests.worlds.trees import document
from uav_bt.board import ELAPSED, HEIGHT, Key
from uav_bt.board.context import MissionContext
from uav_bt.errors import InputError, MissionError
from uav_bt.testing import TreeBench
from uav_bt.tree import Leaf, NodeRegistry, Port, Status, parse_tree
from uav_bt.tree.loading.findings import errors_of
from uav_bt.tree.loading.loader import check_text
from uav_bt.tree.nodes import BUILTIN_NODES
from uav_bt.tree.shipped import tree_files
from uav_bt.types import GimbalTo, Hover

TICKS: Final = 150
NODES: Final = NodeRegistry.installed()


def nodes(text: str) -> list[str]:
    """Return the nodes of a text, one after another."""
    return [ET.tostring(node, encoding="unicode").strip() for node in ET.XML(f"<all>{text}</all>")]


MISSIONS: Final = ("hover_and_look", "land_only", "survey_and_land", "explore_and_land_depth")
PARALLEL: Final = ("Parallel failure_count='-1'", "ParallelAll")
SEQUENCES: Final = ("Sequence", "ReactiveSequence", "SequenceWithMemory", "AsyncSequence")
WRAPPERS: Final = (*SEQUENCES, "Fallback", "ReactiveFallback", *PARALLEL)
DECORATORS: Final = (
    *("Inverter", "ForceSuccess", "RunOnce", "Repeat num_cycles='2'", "Timeout msec='700'"),
    *("RetryUntilSuccessful num_attempts='2'", "Delay delay_msec='200'"),
    *("Precondition if='n &gt; 0'", "LoopInt queue='1;2;3' value='{i}'"),
)
MOVERS: Final = nodes("""
    <Turn degrees="45"/> <HoverFor seconds="{n}"/> <PointCamera pitch_deg="-30"/> <TakeOff/>
    <SubTree ID="Part" n="{n}"/> <SubTree ID="Part" n="2"/>""")
CALM: Final = nodes("""
    <Segment/> <FindMark/> <Hovering/> <Script code="n := n + 1"/> <Script code="m := 1; m += n"/>
    <Script code="n := 2" _onSuccess="word := 'red'"/> <ScriptCondition code="n &gt; 2"/>
    <ScriptCondition code="word == 'red'"/> <ScriptCondition code="@elapsed_s &gt; 1"/>
    <AlwaysFailure _skipIf="n &lt; 4"/> <SetBlackboard value="{n}" output_key="m"/>""")
PARTS: Final = nodes("""
    <BehaviorTree ID="Part"><Sequence><HoverFor seconds="{n}"/><Script code="n := n + 1"/>
    </Sequence></BehaviorTree> <BehaviorTree ID="TypedPart"><HoverFor seconds="{v}"/></BehaviorTree>
    <BehaviorTree ID="KeyPart"><AlwaysSuccess _failureIf="key &gt; 1"/></BehaviorTree>
    <BehaviorTree ID="PolicyPart"><Explore policy="{rule}"/></BehaviorTree>""")

# Words in the mistakes below; one of each is drawn.
WORDS: Final = {
    "NAME": ("nobody", "late"),  # nothing sets the one, another branch may set the other
    "QUEUE": ("1;x", "{@phase}", "{@site_map}", "{five}", "{text}", "{words}", "{half}"),
    "KEY": (
        *("elapsed_s", "height_above_ground_m", "phase", "flight_height_m", "site_map"),
        *("flight_pitch_rad", "track_tried_s", "corridor", "mark", "odometry"),
    ),
    "VALUE": ("'fast'", "5", "-5", "'7'", "0.5", "1"),
    "LOOP": ("LoopInt", "LoopDouble", "LoopBool", "LoopString"),
    "TOGETHER": ("Parallel", "ParallelAll"),
    "WHEN": ("_skipIf", "_while", "name"),
    "<MOVER />": nodes("""
        <Turn degrees="90"/> <HoverFor seconds="1"/> <PointCamera pitch_deg="-40"/>
        <AlwaysSuccess/> <Script code="n := 3"/> <Explore policy="segmentation"/>
        <Explore policy="segmentation" looks_down="true"/>
        <Delay delay_msec="300"><HoverFor seconds="1"/></Delay>
        <Sequence><ScriptCondition code="@elapsed_s &gt; 2"/><Turn degrees="20"/></Sequence>"""),
}
VALUES: Final = """v := VALUE; five := 5; text := '1;2'; words := 'a;b'; half := 0.5;
    rule := 'segmentation'; net := 'unet'; side := 1"""
# What is put into a tree after a script with the values above: around a node (HERE), or before it.
MISTAKES: Final = {
    "removed setter": [],
    "exchanged nodes": [],
    "unset variable": nodes("""
        <ScriptCondition code="NAME &gt;= 2"/> <HoverFor seconds="{NAME}"/>
        <Script code="NAME += 1"/> <AlwaysSuccess _skipIf="NAME == 1"/>
        <AlwaysSuccess _onSuccess="x := NAME"/> <SetBlackboard value="{NAME}" output_key="x"/>
        <LoopString queue="{NAME}" value="{p}"><AlwaysSuccess/></LoopString>"""),
    "board key": nodes("""
        <ScriptCondition code="@KEY &gt; 1"/> <AlwaysSuccess _while="@KEY &lt; 1"/>
        <Script code="x := @KEY"/> <ScriptCondition code="known(@KEY) &amp;&amp; @KEY &gt; 0"/>
        <HoverFor seconds="{@KEY}"/> <SetBlackboard value="{@KEY}" output_key="x"/>
        <SubTree ID="KeyPart" key="{@KEY}"/>"""),
    "parallel branches": nodes("""
        <TOGETHER><MOVER/><HERE/></TOGETHER> <TOGETHER><HERE/><MOVER/></TOGETHER>
        <TOGETHER><MOVER/><HERE/><MOVER/></TOGETHER>"""),
    "loop": nodes("""<LOOP queue="QUEUE" value="{e}"><HERE/></LOOP>"""),
    "type": nodes("""
        <HoverFor seconds="{v}"/> <Turn degrees="{v}"/> <ScriptCondition code="v &gt; 1"/>
        <Script code="w := v * 2"/> <Script code="v := 'red'"/> <Script code="v := 2"/>
        <Repeat num_cycles="{v}"><AlwaysSuccess/></Repeat> <SubTree ID="TypedPart" v="{v}"/>
        <SetBlackboard value="slow" output_key="v"/>"""),
    "late value": nodes("""
        <Explore policy="{rule}"/> <Segment model="{net}"/> <BuildCorridor side_m="{side}"/>
        <SubTree ID="PolicyPart" rule="{rule}"/> <SubTree ID="PolicyPart" rule="segmentation"/>"""),
    "choice": nodes("""
        <IfThenElse><AlwaysSuccess WHEN="@elapsed_s &gt; 1"/><HERE/></IfThenElse>
        <WhileDoElse><AlwaysSuccess WHEN="@elapsed_s &gt; 1"/><HERE/></WhileDoElse>
        <Parallel success_count="3"><AlwaysSuccess/><HERE/></Parallel>"""),
}


def right_tree(draw: random.Random) -> str:
    """Return a small tree file without a mistake."""
    begin = "<Script code=\"n := 1; word := 'a'\"/>"
    return document(f"<Sequence>{begin}{_branch(draw, 3, MOVERS)}</Sequence>", *PARTS)


def _branch(draw: random.Random, depth: int, movers: list[str]) -> str:
    """Return a branch; one inside a Parallel does not move, so that the tree is right."""
    if depth == 0 or draw.random() < 0.2:
        return draw.choice([*CALM, *movers])
    wraps = draw.random() > 0.35
    node = draw.choice(WRAPPERS if wraps else DECORATORS)
    kinds = [movers] + [[] if node in PARALLEL else movers] * (draw.randint(0, 3) if wraps else 0)
    children = "".join(_branch(draw, depth - 1, each) for each in kinds)
    return f"<{node}>{children}</{node.partition(' ')[0]}>"


def wrong_tree(mistake: str, draw: random.Random) -> str:
    """Return a small or a shipped tree with a mistake."""
    root = ET.XML(right_tree(draw))
    if draw.random() < 0.5:
        root = ET.XML(tree_files(draw.choice(MISSIONS))[0].read_bytes())
        root.extend(map(ET.XML, PARTS))
    trees = root.findall("BehaviorTree")[: -len(PARTS)]
    found = [node for tree in trees for node in tree.iter()]
    scripts = [node for node in found if node.tag == "Script"]
    if mistake == "removed setter" and scripts:
        draw.choice(scripts).set("_skipIf", draw.choice(("true", "@elapsed_s > 1")))
    elif mistake == "exchanged nodes":
        parent = draw.choice([node for node in found if len(node) > 1])
        index = draw.randrange(1, len(parent))
        parent[index - 1], parent[index] = parent[index], parent[index - 1]
    else:
        text = draw.choice(MISTAKES[mistake] or MISTAKES["unset variable"])
        if "<HERE />" not in text:
            text = f"<ForceSuccess>{text}</ForceSuccess><HERE />"
        _put(draw, trees, f'<Script code="{VALUES}"/>{text}')
        _put(draw, trees, '<Script code="late := 1"/><HERE />')
    return ET.tostring(root, encoding="unicode")


def _put(draw: random.Random, trees: list[ET.Element], text: str) -> None:
    """Put a sequence in the place of a node, which becomes HERE in it."""
    places = [(node, at) for tree in trees for node in tree.iter() for at in range(len(node))]
    parent, index = draw.choice(places)
    for word, choices in WORDS.items():
        text = text.replace(word, draw.choice(choices))
    here = ET.tostring(parent[index], encoding="unicode")
    parent[index] = ET.XML(f"<Sequence>{text.replace('<HERE />', here)}</Sequence>")


class RandomLeaf(Leaf):
    """Reads its ports, answers at random, and proposes as its class declares."""

    acts_for: ClassVar[type[Leaf]]  # the class whose declarations it has
    draw: ClassVar[random.Random]

    def on_setup(self, mission: MissionContext) -> None:
        del mission
        for port in self.ports:
            if port.at_setup or port.name == "policy":
                self.port(port)

    def may_point(self) -> bool:
        return self.acts_for.may_point(self)

    def update(self) -> Status:
        for port in self.ports:
            if port.direction != "output":
                self.port(port)
        for key in self.writes:
            if (value := self._value(key)) is not None and self.draw.random() < 0.7:
                self.write(key, value)
        status = self.draw.choice(self.answers)
        if status is Status.RUNNING and self.moves:
            self.propose(Hover())
        if status is Status.RUNNING and self.may_point():
            self.point(GimbalTo(pitch_rad=-0.5))
        for port in self.ports:
            if status is Status.SUCCESS and port.direction != "input":
                self.set_port(port, self._value(port))
        return status

    def _value(self, of: Key[Any] | Port[Any]) -> Any:
        """Return a value for a key or an output; None for a type that scripts do not read."""
        values: dict[type, tuple[object, ...]] = {str: ("explore", "red", ""), bool: (True, False)}
        values |= {int: (0, 1, 2, 3), float: (0.0, self.draw.uniform(0.0, 3.0))}
        return self.draw.choice(values[of.type]) if of.type in values else None


def refused(text: str) -> str | None:
    """Return the first error that `check` finds in a tree file."""
    errors = errors_of(check_text(text, NODES, path=Path("tree.xml")))
    return str(errors[0]) if errors else None


def raised(text: str, draw: random.Random) -> str | None:
    """Return the first error of a tree whose leaves answer at random; one that ends begins anew."""
    names = ("node_id", "ports", "reads", "writes", "answers", "moves", "points", "condition")
    made = [NODES[node_id] for node_id in NODES]
    for index, node in enumerate(made):
        if issubclass(node, Leaf) and node not in BUILTIN_NODES:
            body = {name: getattr(node, name) for name in names}
            made[index] = type(
                node.__name__, (RandomLeaf,), body | {"acts_for": node, "draw": draw}
            )
    try:
        bench = TreeBench(parse_tree(text, replace(NODES, nodes=made)))
        bench.allow_stale()
        bench.setup()
        for _ in range(TICKS):
            bench.board[ELAPSED] = bench.clock.now()
            if draw.random() < 0.7:
                bench.board[HEIGHT] = draw.uniform(0.0, 2.0)
            bench.tick()
            bench.log.events.clear()
            bench.outcomes[:-1] = []
    except (InputError, MissionError) as error:
        return str(error)
    return None


# What is imported late changes the limit.
pytestmark = pytest.mark.filterwarnings("ignore:The recursion limit will not be reset")

draws = st.builds(random.Random, st.integers(0, 2**32 - 1))
few = settings(max_examples=7, derandomize=True)
examples = settings.default if settings.default == settings.get_profile("many-trees") else few


@pytest.mark.parametrize("mistake", MISTAKES)
@examples
@given(draw=draws)
def test_no_tree_that_raises_is_called_good(mistake: str, draw: random.Random) -> None:
    text = wrong_tree(mistake, draw)
    note(text)
    if refused(text) is None:
        assert raised(text, draw) is None


@examples
@given(draw=draws)
def test_trees_without_a_mistake_fly_and_are_not_refused(draw: random.Random) -> None:
    text = right_tree(draw)
    note(text)
    complaint, error = refused(text), raised(text, draw)
    assert (complaint is None) is (error is None), (complaint, error)


@pytest.mark.parametrize("mistake", MISTAKES)
def test_some_trees_of_each_mistake_are_refused(mistake: str) -> None:
    assert any(refused(wrong_tree(mistake, draw)) for draw in map(random.Random, range(20)))


def test_the_oracle_finds_what_check_would_miss() -> None:
    movers = document('<Parallel><HoverFor/><Turn degrees="9"/></Parallel>')
    unset = document('<HoverFor seconds="{nobody}"/>')
    one, other = map(raised, (movers, unset), map(random.Random, range(2)))
    assert "both propose a movement in one tick" in str(one)
    assert "holds nothing" in str(other)
