"""Nodes that expand to a tree of `trees/lib/` or of the user, with typed ports."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar
from xml.etree import ElementTree as ET

import py_trees
import pytest

from behaviours.nodes import NODES
from tests.worlds.trees import document
from uav_bt.board import ELAPSED, MISSION_KEYS, Blackboard
from uav_bt.board.context import MissionContext
from uav_bt.clock import ManualClock
from uav_bt.errors import InputError, TreeError
from uav_bt.groot.numbering import TreeNumbering, tree_xml
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, Port, Status, SubtreeNode, parse_tree
from uav_bt.tree.describe import describe, palette_xml
from uav_bt.tree.dry_run import Simulation, read_script
from uav_bt.tree.loading.loader import check_text
from uav_bt.tree.loading.lookup import Library, Lookup
from uav_bt.tree.nodes import AlwaysSuccess, Sequence
from uav_bt.tree.render import render
from uav_bt.tree.scripted import ScriptedLeaf

POLICY = Port("policy", str, default="left", doc="where to go")


class Steer(Leaf):
    """Records the values of its ports."""

    ports = (
        POLICY,
        Port("speed_mps", float, default=0.1),
        Port("careful", bool, default=False),
        Port("way_m", float, direction="output"),
    )
    reads = (ELAPSED,)
    seen: ClassVar[list[tuple[object, ...]]] = []

    def on_setup(self, mission: MissionContext) -> None:
        del mission
        self.seen.append(tuple(self.port_value(n) for n in ("policy", "speed_mps", "careful")))

    def update(self) -> Status:
        self.set_port(self.ports[3], 2.5)
        return Status.SUCCESS


class GoBack(SubtreeNode):
    """Goes home."""

    ports = (
        POLICY,
        Port("speed_mps", float, default=0.5, least=0.0, doc="m/s"),
        Port("careful", bool, default=True),
        Port("way_m", float, direction="output"),
        Port("by", str, default="map", choices=("map", "policy")),
    )
    variants: ClassVar = {("by", "policy"): "GoBackByPolicy"}


HOME = """
  <BehaviorTree ID="GoBack">
    <Sequence name="go">
      <Steer policy="{policy}" speed_mps="{speed_mps}" careful="{careful}" way_m="{way_m}"/>
      <ScriptCondition code="careful == 1 &amp;&amp; speed_mps &lt; 1"/>
    </Sequence>
  </BehaviorTree>
  <BehaviorTree ID="GoBackByPolicy">
    <Steer name="blind" policy="{policy}"/>
  </BehaviorTree>
"""
REGISTRY = NodeRegistry([Steer, GoBack], policies=["left", "right"])


def context_of() -> MissionContext:
    clock = ManualClock()
    return MissionContext(board=Blackboard(clock, MISSION_KEYS), clock=clock)


def text_of(body: str, trees: str = HOME) -> str:
    return document(body, trees).replace("><B", ">\n<B", 1)


def flown(tree: MissionTree) -> list[tuple[object, ...]]:
    """Tick a tree until its success, and return the port values of Steer."""
    Steer.seen.clear()
    tree.setup(context_of())
    assert tree.tick() is Status.SUCCESS
    return list(Steer.seen)


def messages(source: str, lookup: Lookup | None = None) -> list[str]:
    found = check_text(source, REGISTRY, path=Path("m.xml"), lookup=lookup)
    return [str(each) for each in found]


# --- expansion ------------------------------------------------------------------------------------


def test_ports_with_their_defaults_are_the_entries_of_the_tree() -> None:
    tree = parse_tree(text_of('<GoBack policy="right"/>'), REGISTRY)
    assert flown(tree) == [("right", 0.5, True)]
    assert [node.path for node in tree.nodes()] == [
        "Main/GoBack",
        "Main/GoBack/go",
        "Main/GoBack/go/Steer",
        "Main/GoBack/go/ScriptCondition",
    ]


def test_a_node_is_written_by_its_id_or_by_its_kind() -> None:
    by_kind = parse_tree(text_of('<SubTree ID="GoBack" policy="right"/>'), REGISTRY)
    assert flown(by_kind) == [("right", 0.5, True)]


def test_variables_go_in_and_out() -> None:
    body = """<Sequence>
      <Script code="v := 0.25; c := true"/>
      <GoBack speed_mps="{v}" careful="{c}" way_m="{far}"/>
      <ScriptCondition code="far == 2.5"/>
    </Sequence>"""
    tree = parse_tree(text_of(body), REGISTRY)
    tree.variables["v"] = 0.25
    tree.variables["c"] = True
    assert flown(tree) == [("left", 0.25, True)]
    assert tree.variables["far"] == 2.5


def test_a_port_chooses_another_tree() -> None:
    tree = parse_tree(text_of('<GoBack by="policy" name="home"/>'), REGISTRY)
    assert [node.path for node in tree.nodes()] == ["Main/home", "Main/home/blind"]


def test_conditions_stand_on_the_node() -> None:
    body = '<Fallback><GoBack _skipIf="true"/><AlwaysSuccess/></Fallback>'
    assert flown(parse_tree(text_of(body), REGISTRY))[0][0] == "left"


# --- source of the tree ---------------------------------------------------------------------------


def library(folder: Path, name: str, steer: str) -> Library:
    folder.mkdir()
    file = folder / name
    tree = f'<BehaviorTree ID="GoBack"><Steer name="{steer}"/></BehaviorTree>'
    file.write_text(f'<root BTCPP_format="4">{tree}</root>', encoding="utf-8")
    return Library([file])


def test_the_missions_own_tree_comes_before_a_folders_and_that_before_the_shipped(
    tmp_path: Path,
) -> None:
    lookup = Lookup(library(tmp_path / "user", "go_home.xml", "users"))
    vars(lookup)["shipped"] = library(tmp_path / "lib", "go_home.xml", "shipped")
    alone = text_of("<GoBack/>", "")
    own = text_of("<GoBack/>", '<BehaviorTree ID="GoBack"><Steer name="own"/></BehaviorTree>')

    def leaf(source: str, lookup: Lookup) -> str:
        tree = parse_tree(source, REGISTRY, lookup=lookup)
        return next(tree.leaves()).name

    assert leaf(own, lookup) == "own"
    assert leaf(alone, lookup) == "users"
    only_shipped = Lookup()
    vars(only_shipped)["shipped"] = lookup.shipped
    assert leaf(alone, only_shipped) == "shipped"
    used = parse_tree(alone, REGISTRY, lookup=lookup).sources
    assert [path.name for path in used] == ["<text>", "go_home.xml"]


def test_a_node_whose_tree_is_nowhere_is_refused() -> None:
    assert messages(text_of("<GoBack/>", "")) == [
        "m.xml:2:25: GoBack: the node is made of tree 'GoBack', and there is no such tree"
    ]


def test_a_misspelt_tree_of_the_library_is_suggested() -> None:
    assert messages(text_of('<SubTree ID="ExplorFor"/>', "")) == [
        "m.xml:2:34: SubTree 'ExplorFor': there is no tree 'ExplorFor'; did you mean 'ExploreFor'?"
    ]


def test_a_tree_in_the_expansion_of_itself_is_refused() -> None:
    itself = '<BehaviorTree ID="GoBack"><GoBack/></BehaviorTree>'
    (message,) = messages(text_of("<GoBack/>", itself))
    assert "the tree contains itself: GoBack > GoBack" in message


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        (
            '<GoBack polcy="left"/>',
            "2:33: GoBack: unknown attribute 'polcy'; did you mean 'policy'?",
        ),
        ('<GoBack speed_mps="-1"/>', "attribute 'speed_mps': expected 0 or more, got -1.0"),
        ('<GoBack by="pol"/>', "attribute 'by': expected one of map, policy; got 'pol'"),
        (
            '<GoBack by="{way}"/>',
            "attribute 'by' chooses the tree that the node is made of: expected a literal",
        ),
        ('<GoBack policy="up"/>', "2:33: Main/GoBack: unknown policy 'up'"),
        ('<GoBack policy="{@heigt}"/>', "the board has no key 'heigt'"),
        ("<GoBack><AlwaysSuccess/></GoBack>", "needs no children, has 1"),
        ('<SubTree ID="GoBack" _autoremap="true"/>', "leave _autoremap out"),
    ],
)
def test_a_mistake_is_reported_at_the_node(body: str, expected: str) -> None:
    found = messages(text_of(body))
    assert any(expected in message for message in found), found


def test_a_variable_that_no_port_gives_is_found_in_the_users_tree() -> None:
    tree = '\n<BehaviorTree ID="GoBack"><ScriptCondition code="sped_mps &gt; 1"/></BehaviorTree>'
    (message,) = messages(text_of("<GoBack/>", tree))
    assert message.startswith("m.xml:3:44: ScriptCondition: attribute 'code': nothing writes")
    assert "did you mean 'speed_mps'?" in message


def test_a_policy_given_to_a_subtree_is_looked_up_where_it_is_given() -> None:
    trees = '<BehaviorTree ID="Inner"><Steer policy="{policy}"/></BehaviorTree>'
    found = messages(text_of('<SubTree ID="Inner" policy="up"/>', trees))
    assert found == ["m.xml:2:45: Main/Inner: unknown policy 'up' (known: left, right)"]


def test_a_value_that_a_tree_of_another_file_cannot_read_is_found_where_it_is_given(
    tmp_path: Path,
) -> None:
    part = tmp_path / "part.xml"
    part.write_text(
        '<root BTCPP_format="4">\n'
        '<BehaviorTree ID="Part"><Steer careful="{careful}"/></BehaviorTree></root>',
        encoding="utf-8",
    )
    found = messages(text_of('<SubTree ID="Part" careful="ture"/>', ""), Lookup(Library([part])))
    (message,) = found
    assert message.startswith(
        "m.xml:2:44: SubTree 'Part': attribute 'careful' holds a value that does not fit (expected"
    )
    assert message.endswith(f"; Steer, attribute 'careful', at {part}:2:32 reads it")


# --- overrides and mocks --------------------------------------------------------------------------


@pytest.mark.parametrize("target", ["GoBack", "Main/GoBack"])
def test_an_override_of_the_node_reaches_the_leaves_inside(target: str) -> None:
    tree = parse_tree(text_of("<GoBack/>"), REGISTRY, overrides={target: {"policy": "right"}})
    assert flown(tree) == [("right", 0.5, True)]


def test_an_override_reaches_a_tree_that_was_made_before() -> None:
    tree = parse_tree(text_of("<GoBack/>"), REGISTRY)
    tree.replace({"GoBack": {"policy": "right"}})
    assert flown(tree) == [("right", 0.5, True)]
    inner = '<BehaviorTree ID="Inner"><Steer policy="{policy}"/></BehaviorTree>'
    tree = parse_tree(text_of('<SubTree ID="Inner" policy="left"/>', inner), REGISTRY)
    tree.replace({"Inner": {"policy": "right"}})
    assert flown(tree)[0][0] == "right"


def test_the_tree_inside_cannot_be_replaced_by_an_override() -> None:
    with pytest.raises(TreeError, match="'by' cannot be replaced"):
        parse_tree(text_of("<GoBack/>"), REGISTRY, overrides={"GoBack": {"by": "policy"}})
    with pytest.raises(InputError, match="is made of tree 'GoBack' already"):
        parse_tree(text_of("<GoBack/>"), REGISTRY).replace({"GoBack": {"by": "policy"}})


def test_a_mock_stands_in_place_of_the_whole_tree_or_of_a_leaf_inside() -> None:
    whole = parse_tree(text_of("<GoBack/>"), REGISTRY, mocks={"GoBack": "RS"})
    assert [node.path for node in whole.nodes()] == ["Main/GoBack"]
    whole.setup(context_of())
    assert [whole.tick(), whole.tick()] == [Status.RUNNING, Status.SUCCESS]
    inside = parse_tree(text_of("<GoBack/>"), REGISTRY, mocks={"Steer": "F"})
    inside.setup(context_of())
    assert inside.tick() is Status.FAILURE


# --- display -------------------------------------------------------------------------------------


def test_drawings_show_the_node_with_its_tree() -> None:
    tree = parse_tree(text_of('<GoBack policy="right"/>'), REGISTRY)
    lines = render(tree, "ascii").splitlines()
    assert lines[1] == "`-- GoBack policy=right speed_mps=0.5 careful=true by=map"
    assert lines[2] == "    `-- Sequence 'go'"


def test_editors_are_offered_a_subtree_with_ports() -> None:
    model = palette_xml(REGISTRY)
    assert '<SubTree ID="GoBack">' in model
    assert '<input_port name="speed_mps" type="double" default="0.5">' in model
    source = text_of('<SubTree ID="GoBack"/>', HOME + model[model.index("  <TreeNodes") : -8])
    assert messages(source) == []


def test_the_node_has_the_keys_of_the_leaves_inside() -> None:
    class ExploreFor(SubtreeNode):
        """Explores."""

        ports = (POLICY,)

    registry = NodeRegistry([*NODES, ExploreFor])
    explore, avoid = registry["Explore"], registry["Avoid"]
    info = describe(ExploreFor, registry)
    assert issubclass(explore, Leaf)
    assert issubclass(avoid, Leaf)
    assert set(info.reads) == {key.name for key in (*explore.reads, *avoid.reads)}
    assert set(info.writes) == {key.name for key in (*explore.writes, *avoid.writes)}
    assert (info.kind, info.builtin) == ("SubTree", False)


def test_groot2_reads_the_tree_inside_as_a_subtree() -> None:
    tree = parse_tree(text_of('<GoBack by="policy" policy="right"/>'), REGISTRY)
    root = ET.fromstring(tree_xml(TreeNumbering(tree)))  # noqa: S314  # our own text
    main, inner = root.findall("BehaviorTree")
    assert main[0].tag == "SubTree"
    assert (main[0].get("ID"), main[0].get("policy")) == ("GoBackByPolicy", "right")
    assert (inner.get("ID"), inner.get("_fullpath")) == (
        "GoBackByPolicy",
        main[0].get("_fullpath"),
    )
    assert [node.get("name") for node in inner] == ["blind"]


@pytest.mark.parametrize(
    ("answers", "ticked"),
    [
        ("leaves: {GoBack: RS}", {"Main/GoBack": "GoBack"}),
        ("default: S", {"Main/GoBack/go/Steer": "Steer"}),
        ("leaves: {Steer: RS}", {"Main/GoBack/go/Steer": "Steer"}),
    ],
)
def test_a_dry_run_has_answers_for_the_whole_node_or_for_leaves_inside(
    tmp_path: Path, answers: str, ticked: dict[str, str]
) -> None:
    mission, script = tmp_path / "m.xml", tmp_path / "s.yaml"
    mission.write_text(text_of("<GoBack/>"), encoding="utf-8")
    script.write_text(answers, encoding="utf-8")
    tree = Simulation(mission, read_script(script), REGISTRY).tree
    scripted = [leaf for leaf in tree.leaves() if isinstance(leaf, ScriptedLeaf)]
    assert {leaf.path: leaf.node_id for leaf in scripted} == ticked


# --- in Python ------------------------------------------------------------------------------------


def home(**given: object) -> GoBack:
    steer = Steer(policy="{policy}", speed_mps="{speed_mps}", careful="{careful}")
    return GoBack("home", steer, **given)


def test_a_node_made_in_python_takes_typed_values() -> None:
    tree = MissionTree(Sequence("all", [home(careful=False, speed_mps=2), AlwaysSuccess("end")]))
    assert flown(tree) == [("left", 2.0, False)]
    assert tree.find("Steer").path == "Tree/all/home/Steer"


def test_a_node_ticks_in_a_plain_tree_of_py_trees() -> None:
    root = py_trees.composites.Sequence("mission", memory=True, children=[home(policy="right")])
    manager = py_trees.trees.BehaviourTree(root)
    Steer.seen.clear()
    manager.setup(mission=context_of())
    manager.tick()
    assert root.status is py_trees.common.Status.SUCCESS
    assert Steer.seen == [("right", 0.5, True)]
    assert [node.name for node in root.iterate()] == ["Steer", "home", "mission"]


def test_without_a_child_a_node_is_made_of_the_shipped_tree() -> None:
    class ExploreOrTurn(SubtreeNode):
        """Explores or turns."""

        ports = (
            Port("policy", str, default="corridor"),
            Port("flowing", bool, default=False),
            Port("looks_down", bool, default=False),
            Port("gives_way", bool, default=False),
        )

    node = ExploreOrTurn(policy="segmentation")
    assert [each.node_id for each in node.child.children[0].children] == ["Explore", "ForceFailure"]
    explore = node.child.children[0].children[0]
    assert explore.port_value("policy") == "segmentation"
    assert explore.path == "ExploreOrTurn/RetryUntilSuccessful/step_or_turn/Explore"


def test_a_class_that_no_tree_file_has_is_refused_with_those_there_are() -> None:
    with pytest.raises(InputError, match=r"unknown tree of trees/lib 'GoBack'.*ExploreFor"):
        GoBack()


def test_a_variant_of_no_port_is_refused_at_once() -> None:
    with pytest.raises(TypeError, match="there is no port 'way'"):
        type("Odd", (SubtreeNode,), {"variants": {("way", "x"): "Odd2"}})
