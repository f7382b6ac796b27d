"""Types of variables over a whole file: certain failures in flight are refused before."""

from __future__ import annotations

import pytest

from tests.worlds.trees import document
from uav_bt.board import HEIGHT, MARK
from uav_bt.errors import TreeError
from uav_bt.tree import Leaf, NodeRegistry, Port, Status, parse_tree
from uav_bt.types import MarkFix


class FindPad(Leaf):
    """Finds the pad."""

    ports = (Port("pad", MarkFix, doc="the pad", direction="output"),)
    reads = (MARK, HEIGHT)

    def update(self) -> Status:
        return Status.SUCCESS


class Measure(Leaf):
    """Measures."""

    ports = (
        Port("height_m", float, doc="height, m", direction="output"),
        Port("count", int, doc="how many", direction="output"),
        Port("sure", bool, doc="is it", direction="output"),
        Port("word", str, doc="what", direction="output"),
        Port("thing", object, doc="whatever", direction="output"),
    )

    def update(self) -> Status:
        return Status.SUCCESS


class Use(Leaf):
    """Uses."""

    ports = (
        Port("height_m", float, default=1.0, doc="height, m"),
        Port("count", int, default=1, doc="how many"),
        Port("sure", bool, default=True, doc="is it"),
        Port("word", str, default="", doc="what"),
        Port("side", str, default="left", doc="which", choices=("left", "right")),
        Port("pad", MarkFix, default="{@mark}", doc="the pad"),
        Port("both", float, default="{x_m}", doc="read and written, m", direction="inout"),
    )

    def update(self) -> Status:
        return Status.SUCCESS


class Need(Leaf):
    """Needs a height."""

    ports = (Port("height_m", float, doc="height, m"),)

    def update(self) -> Status:
        return Status.SUCCESS


REGISTRY = NodeRegistry([FindPad, Measure, Use, Need])


def sequence(*nodes: str) -> str:
    return f"<Sequence>{''.join(nodes)}</Sequence>"


def inner(*nodes: str, tree_id: str = "In") -> str:
    return f'<BehaviorTree ID="{tree_id}">{sequence(*nodes)}</BehaviorTree>'


def findings(*parts: str) -> list[str]:
    """Return the errors of a file, without its path."""
    try:
        parse_tree(document(*parts), REGISTRY, path="m.xml")
    except TreeError as error:
        return [finding.removeprefix("m.xml:") for finding in error.findings]
    return []


# --- accepted files ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("writer", "reader"),
    [
        ('<FindPad pad="{x}"/>', '<Use both="{x}"/>'),  # the port also writes
        ('<Measure word="{x}"/>', '<Use count="{x}"/>'),  # a text may be a number
        ('<Measure thing="{x}"/>', '<Use pad="{x}"/>'),
        ('<SetBlackboard value="right" output_key="x"/>', '<Use side="{x}"/>'),
        ('<SetBlackboard value="{@mark}" output_key="x"/>', '<Use pad="{x}"/>'),
        ("<Script code=\"x := 'far'; x = '2'\"/>", '<Use count="{x}"/>'),
        ("<Script code=\"x := y ? 'far' : 2\"/>", '<Use count="{x}"/>'),
        ('<Script code="x := y"/>', '<Use pad="{x}"/>'),
        ('<Script code="y := x"/>', '<Use pad="{x}"/>'),
        ('<FindPad pad="{x}"/>', '<Use _skipIf="y == 1"/>'),
        ('<SetBlackboard value="a" output_key="{k}"/>', '<Use height_m="{x}"/>'),
        ('<FindPad pad="{x}"/><Measure height_m="{x}"/>', '<Use height_m="{x}" pad="{x}"/>'),
        ('<FindPad pad="{x}"/><Script code="{code}"/>', '<Use height_m="{x}"/>'),
        ("", '<Use height_m="{x}" pad="{x}"/>'),  # set from Python
    ],
)
def test_what_may_go_well_is_accepted(writer: str, reader: str) -> None:
    assert findings(sequence(writer, reader)) == []


# --- refusals ------------------------------------------------------------------------------------


FIND = '<FindPad pad="{x}"/>'
COPY = '<SetBlackboard value="%s" output_key="x"/>'
HIGH, PAD = '<Use height_m="{x}"/>', '<Use pad="{x}"/>'


@pytest.mark.parametrize(
    ("writer", "reader", "message"),
    [
        (FIND, HIGH, "variable 'x' holds MarkFix, from FindPad, attribute 'pad', at m.xml:1:"),
        ('<Measure height_m="{x}"/>', PAD, "'pad' takes MarkFix, but variable 'x' holds float"),
        (
            COPY % "high",
            HIGH,
            "holds 'high', from SetBlackboard, attribute 'output_key'",
        ),
        (
            COPY % "rihgt",
            '<Use side="{x}"/>',
            "got 'rihgt'; did you mean 'right'?",
        ),
        (COPY % "{@mark}", HIGH, "variable 'x' holds MarkFix"),
        ('<FindPad pad="{y}"/>' + COPY % "{y}", HIGH, "'x' holds MarkFix, from FindPad"),
        (
            '<FindPad pad="{y}"/><Script code="x := y"/>',
            HIGH,
            "'y' holds MarkFix, from FindPad",
        ),
        ('<Script code="x := 1 + 2"/>', PAD, "holds 3.0, from Script"),
        ("<Script code=\"x := y ? 'a' : 'b'\"/>", PAD, "holds str"),
        (FIND, '<Use _skipIf="x &gt; 1"/>', "'_skipIf' variable 'x' holds MarkFix, from FindPad"),
        (FIND + '<Measure sure="{x}"/>', HIGH, "'x' holds MarkFix"),
        ('<LoopInt queue="1;2" value="{x}"><FindPad/></LoopInt>', PAD, "holds int"),
    ],
)
def test_what_must_fail_is_refused(writer: str, reader: str, message: str) -> None:
    found = findings(sequence(writer, reader))
    assert any(message in finding for finding in found), found


# --- through subtrees -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "door",
    ['<SubTree ID="In" y="{x}"/>', '<SubTree ID="Mid" z="{x}"/>'],
)
def test_types_pass_through_remapped_subtrees(door: str) -> None:
    middle = inner('<SubTree ID="In" y="{z}"/>', tree_id="Mid")
    use = inner('<Use height_m="{y}"/>')
    used = [use, middle] if "Mid" in door else [use]
    assert findings(sequence('<Measure height_m="{x}"/>', door), *used) == []
    found = findings(sequence('<FindPad pad="{x}"/>', door), *used)
    assert len(found) == 1
    assert "attribute 'height_m' takes float, but variable 'x' holds MarkFix" in found[0]


def test_autoremapped_names_are_shared_and_private_ones_are_not() -> None:
    """`_autoremap` carries a type in, but not that of `_x`."""
    door = '<SubTree ID="In" _autoremap="true"/>'
    pads = sequence('<FindPad pad="{x}"/>', '<FindPad pad="{_x}"/>', door)
    assert len(findings(pads, inner('<Use height_m="{x}"/>'))) == 1
    assert findings(pads, inner('<Use height_m="{_x}"/>')) == []
    assert findings(pads.replace(' _autoremap="true"', ""), inner('<Use height_m="{x}"/>')) == []


def test_a_subtree_is_checked_for_each_of_its_uses() -> None:
    found = findings(
        sequence(
            '<Measure height_m="{a}"/>',
            '<FindPad name="wrong" pad="{b}"/>',
            '<SubTree ID="In" y="{a}"/>',
            '<SubTree ID="In" y="{b}"/>',
        ),
        inner('<Use height_m="{y}"/>'),
    )
    assert len(found) == 1
    assert "FindPad 'wrong'" in found[0]


def test_literal_entries_are_texts() -> None:
    use = inner('<Use height_m="{y}"/>')
    assert findings('<SubTree ID="In" y="1.5"/>', use) == []
    found = findings('<SubTree ID="In" y="high"/>', use)
    assert len(found) == 1
    assert "holds 'high', from SubTree 'In', attribute 'y'" in found[0]
    (remapped,) = findings('<SubTree ID="In" y="high" _autoremap="true"/>', use)
    assert "holds 'high', from SubTree 'In', attribute 'y'" in remapped


# --- variables without a writer -------------------------------------------------------------------


def test_a_misspelt_entry_is_found_with_the_right_one() -> None:
    found = findings('<SubTree ID="In" sped="1"/>', inner('<Need height_m="{speed}"/>'))
    assert len(found) == 2
    assert "entry 'sped' is used by no node of tree 'In'; did you mean 'speed'?" in found[0]
    assert "nothing writes variable 'speed'" in found[1]
    assert found[1].endswith("did you mean 'sped'?")


def test_an_unwritten_name_in_a_script_is_found() -> None:
    door = '<SubTree ID="In"/>'
    found = findings(door, inner('<AlwaysSuccess _skipIf="n &gt; 1"/>'))
    assert "attribute '_skipIf': nothing writes variable 'n' of tree 'In'" in found[0]
    found = findings(door, inner('<Script code="n += 1"/>'))
    assert "attribute 'code': nothing writes variable 'n' of tree 'In'" in found[0]
    assert findings(door, inner('<Script code="n := 1; n += n"/>')) == []
    assert findings(door, inner('<Script code="x := 1; y := x ? 1 : n"/>')) == []
    assert findings(door, inner('<Script code="x := 1; y := x == 2 == n"/>')) == []


@pytest.mark.parametrize(
    ("door", "nodes"),
    [
        ('<SubTree ID="In" speed="{v}"/>', '<Need height_m="{speed}"/>'),  # the outer tree's
        ('<SubTree ID="In" _autoremap="1"/>', '<Need height_m="{speed}"/>'),
        ('<SubTree ID="In"/>', '<Script code="speed := 1"/><Need height_m="{speed}"/>'),
        ('<SubTree ID="In"/>', '<Need height_m="{_speed}"/>'),  # private: a leaf may keep it
        ('<SubTree ID="In"/>', '<Use pad="{pad}"/>'),  # not required
        ('<SubTree ID="In" unused="1" a="{b}"/>', "<AlwaysSuccess/>"),
        ('<SubTree ID="In"/>', '<WasEntryUpdated entry="{e}"/>'),
        ('<SubTree ID="In"/>', '<Script code="{c}"/><Need height_m="{speed}"/>'),
    ],
)
def test_variables_that_may_have_a_value_are_accepted(door: str, nodes: str) -> None:
    assert findings(sequence("<Script code=\"c := 'speed := 1'\"/>", door), inner(nodes)) == []


# --- board keys under another name ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("nodes", "message"),
    [
        ('<Use pad="{p}"/>', None),
        ('<Use height_m="{p}"/>', "but 'p' is board key 'mark', which holds MarkFix"),
        ('<FindPad pad="{p}"/>', None),
        ('<Measure height_m="{p}"/>', "takes float, but 'p' is board key 'mark'"),
        ('<Script code="p := 1"/>', "'p' is board key 'mark'; only a leaf's output port writes"),
        ('<UnsetBlackboard key="p"/>', "only a leaf's output port writes that"),
        ('<Use _skipIf="p == 1"/>', "which holds MarkFix, no number and no text"),
        ('<SetBlackboard value="{p}" output_key="q"/><Use pad="{q}"/>', None),
        ('<SetBlackboard value="{p}" output_key="q"/><Use word="{q}"/>', "holds MarkFix"),
        ('<SubTree ID="Deep" d="{p}"/>', "takes float, but 'd' is board key 'mark'"),
    ],
)
def test_board_keys_keep_their_type(nodes: str, message: str | None) -> None:
    """`{@key}` as an entry: the subtree's variable is the key, with its type and its rules."""
    deep = inner('<Use height_m="{d}"/>', tree_id="Deep") if "Deep" in nodes else ""
    found = findings('<SubTree ID="In" p="{@mark}"/>', inner(nodes), deep)
    if message is None:
        assert found == []
    else:
        assert len(found) == 1
        assert message in found[0]


@pytest.mark.parametrize(
    ("first", "second", "message"),
    [
        ('<Measure height_m="{x}"/>', '<Use count="{x}"/>', "takes int, but variable 'x' is float"),
        ('<Measure count="{x}"/>', '<Use height_m="{x}"/>', "takes float, but variable 'x' is int"),
        ('<Measure count="{x}"/>', '<Use word="{x}"/>', "takes str, but variable 'x' is int for M"),
    ],
)
def test_a_variable_has_the_type_of_its_first_port(first: str, second: str, message: str) -> None:
    """The engine refuses a second type, unless the first is a text."""
    (found,) = findings(f"<Sequence>{first}{second}</Sequence>")
    assert message in found
    assert findings('<Sequence><Measure word="{x}"/><Use count="{x}"/></Sequence>') == []
