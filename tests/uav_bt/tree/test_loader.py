"""The loader: accepted files, and the errors of refused ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conformance import Scripted
from tests.worlds.tables import cases
from tests.worlds.trees import World, document, leaf
from uav_bt.board import MARK
from uav_bt.errors import TreeError
from uav_bt.tree import Leaf, NodeRegistry, Port, Status, load_tree, parse_tree
from uav_bt.tree.loading.findings import WARNING
from uav_bt.tree.loading.loader import check_text
from uav_bt.tree.observer import observe
from uav_bt.types import MarkFix

CASES = cases("loading")


class Steer(Leaf):
    """Steers."""

    ports = (
        Port("policy", str, default="segmentation", doc="leaf policy"),
        Port("height_m", float, default=1.5, doc="height, m"),
        Port("pad", MarkFix, default="{@mark}", doc="the pad"),
    )
    reads = (MARK,)


class Safe(Leaf):
    """Always succeeds."""

    condition = True

    def update(self) -> Status:
        return Status.SUCCESS


REGISTRY = NodeRegistry([Scripted, Steer, Safe])


def findings(text: str) -> list[str]:
    """Return the errors, without the path."""
    with pytest.raises(TreeError) as error:
        parse_tree(text, REGISTRY, path="m.xml")
    assert error.value.exit_code == 2
    return [finding.removeprefix("m.xml:") for finding in error.value.findings]


def warnings_of(text: str) -> list[str]:
    """Return the warnings of an accepted text, without the path."""
    found = check_text(text, REGISTRY, path=Path("m.xml"))
    assert {finding.severity for finding in found} <= {WARNING}
    parse_tree(text, REGISTRY)
    return [str(finding).removeprefix("m.xml:") for finding in found]


def test_a_file_becomes_a_tree(tmp_path: Path) -> None:
    text = """<?xml version="1.0" encoding="UTF-8"?>
    <root BTCPP_format="4" main_tree_to_execute="Mission" project_name="lab">
      <!-- a comment -->
      <BehaviorTree ID="Mission" _fullpath="">
        <ReactiveSequence name="fly" _uid="1">
          <Condition ID="Safe"/>
          <Steer name="explore" height_m="1.25"/>
          <SubTree ID="Home" _collapsed="true" speed="{v}"/>
        </ReactiveSequence>
      </BehaviorTree>
      <BehaviorTree ID="Home"><Action ID="Steer" policy="rule"/></BehaviorTree>
      <TreeNodesModel>
        <Action ID="Steer" editable="true">
          <input_port name="policy" type="std::string" default="segmentation">Which one</input_port>
        </Action>
        <SubTree ID="Home"><input_port name="speed"/></SubTree>
        <Control ID="SomebodyElses"/>
      </TreeNodesModel>
    </root>"""
    path = tmp_path / "mission.xml"
    path.write_text(text, encoding="utf-8")
    tree = load_tree(path, REGISTRY)
    assert tree.name == "Mission"
    assert tree.text == text
    assert [leaf.path for leaf in tree.leaves()] == [
        "Mission/fly/Safe",
        "Mission/fly/explore",
        "Mission/fly/Home/Steer",
    ]
    steer = tree.find("explore")
    assert [steer.port_value(name) for name in ("height_m", "policy")] == [1.25, "segmentation"]


@pytest.mark.parametrize(("body", "message"), CASES["refused_nodes"])
def test_refused_nodes(body: str, message: str) -> None:
    (found,) = findings(document(body, '<BehaviorTree ID="Other"><Safe/></BehaviorTree>'))
    assert message in found


@pytest.mark.parametrize(
    ("text", "message"),
    [
        *CASES["refused_documents"],
        ("<a>" * 300 + "</a>" * 300, "nested deeper than 256"),
        ("<root>" + "<a/>" * 20_001 + "</root>", "more than 20000 elements"),
        (f"<root>{' ' * 2_000_000}</root>", "larger than 2000000 bytes: SubTrees can"),
        ("<root " + " ".join(f"a{n}='1'" for n in range(201)) + "/>", "more than 200 attributes"),
        (f"<root a='{'x' * 20_001}'/>", "a name or an attribute is longer than 20000 characters"),
    ],
)
def test_refused_documents(text: str, message: str) -> None:
    (found,) = findings(text)
    assert message in found


def test_a_described_subtree_knows_its_ports() -> None:
    text = document(
        '<SubTree ID="Home" sped="1"/>',
        '<BehaviorTree ID="Home"><Safe/></BehaviorTree>',
        '<TreeNodesModel><SubTree ID="Home"><input_port name="speed"/></SubTree></TreeNodesModel>',
    )
    found = findings(text)
    assert len(found) == 2
    assert "entry 'speed' is missing: the tree is described with it, without a def" in found[0]
    (refused,) = findings(text.replace('sped="1"', 'sped="1" speed="1"'))
    assert "without a port 'sped' and does not use it; did you mean 'speed'" in refused
    used = text.replace('sped="1"', 'speed="1" x="2"').replace("<Safe/>", '<Script code="x += 1"/>')
    (warned,) = warnings_of(used)
    assert "the tree is described without a port 'x'" in warned
    for right in ('speed="1"', '_autoremap="true"'):
        parse_tree(text.replace('sped="1"', right), REGISTRY)


def supply(*members: str) -> str:
    inner = "".join(f"<Member {member}/>" for member in members)
    return f'<TreeNodesModel><Enumeration ID="Supply">{inner}</Enumeration></TreeNodesModel>'


@pytest.mark.parametrize("colour", ["Blue", "1", "'Blue'", "3 - 2"])
def test_a_case_of_a_switch_may_be_a_member_of_an_enumeration(world: World, colour: str) -> None:
    model = (
        '<TreeNodesModel><Enumeration ID="Colour"><Member name="Red" value="0"/>'
        '<Member name="Blue" value="1"/></Enumeration></TreeNodesModel>'
    )
    tree = world.tree(
        f'<Sequence><Script code="colour := {colour}"/><SubTree ID="In" colour="{{colour}}"'
        ' low="Blue"/></Sequence>',
        '<BehaviorTree ID="In"><Sequence><Switch2 variable="{colour}" case_1="Red" case_2="Blue">'
        "<AlwaysFailure/><AlwaysSuccess/><AlwaysFailure/></Switch2>"
        '<ScriptCondition code="low == 1 &amp;&amp; low == Blue &amp;&amp; low &lt; 2"/>'
        "</Sequence></BehaviorTree>",
        model,
    )
    assert tree.tick() is Status.SUCCESS


def test_a_member_has_one_value_in_all_files_and_the_palette(tmp_path: Path) -> None:
    full, other = supply('name="FULL" value="4"'), supply('name="FULL" value="5"')
    part, path = tmp_path / "part.xml", tmp_path / "tree.xml"
    part.write_text(f'<root BTCPP_format="4">{other}</root>')
    tree = '<BehaviorTree ID="A"><Safe/></BehaviorTree>'
    path.write_text(f'<root BTCPP_format="4"><include path="part.xml"/>{tree}{full}</root>')
    with pytest.raises(TreeError, match="'FULL' is 4 already"):
        load_tree(path, REGISTRY)
    part.write_text(f'<root BTCPP_format="4">{full}</root>')
    load_tree(path, REGISTRY)
    registry = NodeRegistry([Safe])
    registry.enum_members["FULL"] = 3
    with pytest.raises(TreeError, match="'FULL' is 3 already"):
        load_tree(path, registry)


def test_all_errors_come_together_with_their_places() -> None:
    text = """<root BTCPP_format="4">
  <BehaviorTree ID="Main">
    <Sequence name="s" nme="t">
      <Steer
          height_m="high"
          polcy="x"/>
      <Sttter/>
    </Sequence>
  </BehaviorTree>
</root>"""
    assert findings(text) == [
        "3:24: Sequence 's': unknown attribute 'nme'",
        "5:11: Steer: attribute 'height_m': expected a number, got 'high'",
        "6:11: Steer: unknown attribute 'polcy'; did you mean 'policy'?",
        "7:7: Sttter: unknown node 'Sttter'; did you mean 'Steer'?",
    ]


@pytest.mark.parametrize(
    ("uses", "levels", "message"),
    [(2, 30, "more than 20000 nodes"), (1, 3_000, "deeper than 256 once")],
)
def test_subtrees_cannot_explode(uses: int, levels: int, message: str) -> None:
    tree = '<BehaviorTree ID="T{}"><Sequence>{}</Sequence></BehaviorTree>'
    chain = [tree.format(n, f'<SubTree ID="T{n + 1}"/>' * uses) for n in range(levels)]
    chain.append(tree.format(levels, "<Safe/>"))
    assert message in findings(document('<SubTree ID="T0"/>', *chain))[0]


def test_the_deepest_allowed_tree_ticks(world: World) -> None:
    levels = 255
    body = '<Inverter _post="n := 1">' * levels + leaf("a", "RS") + "</Inverter>" * levels
    tree = world.tree(body)
    observe(tree.nodes(), lambda _node, _event: None)
    assert [tree.tick().name, tree.tick().name] == ["RUNNING", "FAILURE"]
    tree = world.tree(body)
    tree.tick()
    tree.halt()
    deeper = "<Inverter>" * 256 + "<AlwaysSuccess/>" + "</Inverter>" * 256
    assert "nested deeper than 256" in findings(document(deeper))[0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            f"<{'x' * 1_000_000} a='1'/>",
            "1:1: a name or an attribute is longer than 20000 characters",
        ),
        (
            "<root " + " ".join(f"a{n}='{'x' * 9_000}'" for n in range(200)) + "/>",
            "1:1: root: the file has no BehaviorTree",
        ),
        (f"<root a='1'{' ' * 1_000_000}b='2'/>", "1:1: root: the file has no BehaviorTree"),
    ],
    ids=["tag", "value", "blanks"],
)
def test_long_tags_are_read_in_linear_time(text: str, message: str) -> None:
    """In quadratic time a tag of a megabyte would take hours."""
    assert findings(text) == [message]


def test_positions_count_characters_after_any_layout() -> None:
    text = "<root  BTCPP_format = '4'\n  \u00e4='x=\"1\"' wrong=\n'2'><!--c--></root>"
    found = check_text(text, REGISTRY, path=Path("m.xml"))
    assert {str(finding.position) for finding in found} == {"1:1", "2:3", "2:13"}


def test_a_report_ends_somewhere() -> None:
    found = findings(document(f"<Sequence>{'<Stear/>' * 15_000}</Sequence>"))
    assert len(found) == 501
    assert any("500 errors are enough: the rest of the file was not checked" in f for f in found)


def test_text_in_thousands_of_pieces_is_read_once() -> None:
    found = warnings_of(document(f"<Safe>{'x<!---->' * 100_000}</Safe>"))
    assert len(found) == 1
    assert found[0].endswith(f"Safe: text between tags means nothing: '{'x' * 40}'")


def test_thousands_of_copies_are_followed_only_so_far() -> None:
    copies = "".join(
        f'<SetBlackboard value="{{v{n}}}" output_key="v{n + 1}"/>'
        f'<Repeat num_cycles="{{v{n}}}"><Safe/></Repeat>'
        for n in range(1_000)
    )
    first = '<SetBlackboard value="x" output_key="v0"/>'
    found = findings(document(f"<Sequence>{first}{copies}</Sequence>"))
    assert 90 < len(found) <= 100


def test_included_files_join(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    tree = '<BehaviorTree ID="{}"><Safe/></BehaviorTree>'
    (tmp_path / "parts" / "a.xml").write_text(
        f'<root BTCPP_format="4"><include path="../more.xml"/>{tree.format("A")}</root>'
    )
    (tmp_path / "more.xml").write_text(f'<root BTCPP_format="4">{tree.format("B")}</root>')
    main = tmp_path / "main.xml"
    body = '<Sequence><SubTree ID="A"/><SubTree ID="B"/></Sequence>'
    main.write_text(document(body, '<include path="parts/a.xml"/><include path="more.xml"/>'))
    assert len(list(load_tree(main, REGISTRY).leaves())) == 2
    (tmp_path / "more.xml").write_text('<root BTCPP_format="3"/>')
    with pytest.raises(TreeError, match=r"more\.xml:1:7: root: expected BTCPP_format"):
        load_tree(main, REGISTRY)


def test_files_that_include_each_other_are_refused(tmp_path: Path) -> None:
    """The engine would not terminate; each include that closes a circle has its position."""
    text = '<root BTCPP_format="4"><include path="{}.xml"/><include path="{}.xml"/></root>'
    (tmp_path / "a.xml").write_text(text.format("b", "c"))
    (tmp_path / "b.xml").write_text(text.format("c", "a"))
    (tmp_path / "c.xml").write_text(text.format("c", "none"))
    main = tmp_path / "main.xml"
    main.write_text(document("<Safe/>", '<include path="a.xml"/>'))
    with pytest.raises(TreeError) as caught:
        load_tree(main, REGISTRY)
    circles = [found for found in caught.value.findings if "circle" in found]
    assert len(circles) == 2
    assert f"{tmp_path}/b.xml:1:56: include: " in circles[0]
    assert "circle, a.xml > b.xml > a.xml: take one of these includes out" in circles[0]
    assert f"{tmp_path}/c.xml:1:33: include: " in circles[1]
    assert "circle, c.xml > c.xml: " in circles[1]


@pytest.mark.parametrize(
    ("include", "message"),
    [*CASES["refused_includes"], (f'<include path="{"x" * 300}.xml"/>', "name too long")],
)
def test_refused_includes(tmp_path: Path, include: str, message: str) -> None:
    folder = tmp_path / "trees"
    folder.mkdir()
    (tmp_path / "secret.xml").write_text(document("<Safe/>"))
    (folder / "link.xml").symlink_to(tmp_path / "secret.xml")
    main = folder / "main.xml"
    main.write_text(document("<Safe/>", include))
    with pytest.raises(TreeError, match=message):
        load_tree(main, REGISTRY)
