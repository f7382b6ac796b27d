"""What two tree files differ in: nodes added, removed, moved, changed; never their layout."""

from __future__ import annotations

from pathlib import Path

import pytest

from uav_bt.tree.editing.difference import Change, differences
from uav_bt.tree.editing.layout import format_source
from uav_bt.tree.loading.source import MAX_DEPTH, parse_source

HERE = Path("mission.xml")
SHIPPED = sorted((Path(__file__).parents[4] / "trees").glob("*.xml"))


def changes(before: str, after: str) -> list[tuple[str, str, str]]:
    """Return change, path and details of what differs between two main trees."""
    texts = [
        text if "<root" in text else f'<root><BehaviorTree ID="M">{text}</BehaviorTree></root>'
        for text in (before, after)
    ]
    old, new = (parse_source(text.encode(), HERE) for text in texts)
    return [
        (each.change.value, each.path, ", ".join(each.details)) for each in differences(old, new)
    ]


def test_layout_comments_spelling_and_editors_notes_are_no_difference() -> None:
    before = '<Sequence><Stay for_s="1"/><SubTree ID="B" _autoremap="true"/></Sequence>'
    after = (
        '<!-- all --><Control ID="Sequence" _uid="7" _x="1">\n\n  <Action  for_s="1" ID="Stay" '
        "_fullpath='a'/>\n<SubTree _autoremap='true' ID='B' _description='why'/></Control>"
    )
    assert changes(before, after) == []


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_formatted_mission_is_the_same(path: Path) -> None:
    data = path.read_bytes()
    mixed = data.replace(b"\n", b" \n \n").replace(b"<Sequence", b"<Sequence\n")
    tidy = format_source(mixed, path)
    assert mixed != data
    assert differences(parse_source(data, path), parse_source(tidy, path)) == ()


def test_an_inserted_node_leaves_its_neighbours_alone() -> None:
    before = "<Sequence><Stay/><Land/></Sequence>"
    after = "<Sequence><Stay/><Hop/><Land/></Sequence>"
    assert changes(before, after) == [("added", "M/Sequence/Hop", "")]
    assert changes(after, before) == [("removed", "M/Sequence/Hop", "")]


def test_attributes_that_differ_are_named_with_both_values() -> None:
    before = '<TakeOff name="up" height_m="1.0" a="1"/>'
    after = '<TakeOff name="up" height_m="1.5" _skipIf="true"/>'
    assert changes(before, after) == [
        ("changed", "M/up", 'height_m="1.0" is now "1.5", a="1" is gone, _skipIf="true" is new')
    ]


def test_of_several_alike_the_changed_one_is_found() -> None:
    before = '<Sequence><Turn d="1"/><Turn d="2"/><Turn d="3"/></Sequence>'
    after = '<Sequence><Turn d="1"/><Turn d="9"/><Turn d="3"/></Sequence>'
    assert changes(before, after) == [("changed", "M/Sequence/Turn#2", 'd="2" is now "9"')]


def test_a_node_that_stands_elsewhere_has_moved() -> None:
    before = '<Sequence><Turn d="1"/><Stay/><Land/></Sequence>'
    after = '<Sequence><Stay/><Land/><Turn d="1"/></Sequence>'
    assert changes(before, after) == [("moved", "M/Sequence/Turn", "from M/Sequence/Turn")]
    before = '<Sequence><Fallback><Turn d="1"/><Hop/></Fallback><Stay/></Sequence>'
    after = '<Sequence><Fallback><Hop/></Fallback><Stay/><Turn d="1"/></Sequence>'
    assert changes(before, after) == [("moved", "M/Sequence/Turn", "from M/Sequence/Fallback/Turn")]


def test_what_is_put_around_a_node_is_added_and_the_node_moved() -> None:
    before = '<Sequence><Turn d="1"/><Land/></Sequence>'
    after = '<Fallback><Sequence><Turn d="2"/><Land/></Sequence><Stay/></Fallback>'
    assert changes(before, after) == [
        ("added", "M/Fallback", "with 1 more inside"),
        ("moved", "M/Fallback/Sequence", "from M/Sequence"),
        ("changed", "M/Fallback/Sequence/Turn", 'd="1" is now "2"'),
    ]


def test_a_moved_node_of_a_name_is_known_again_though_it_changed() -> None:
    before = '<Sequence><Turn name="look" d="1"/><Fallback><Stay/></Fallback></Sequence>'
    after = '<Sequence><Fallback><Stay/><Turn name="look" d="2"/></Fallback></Sequence>'
    assert changes(before, after) == [
        ("moved", "M/Sequence/Fallback/look", "from M/Sequence/look"),
        ("changed", "M/Sequence/Fallback/look", 'd="1" is now "2"'),
    ]


def test_trees_are_compared_by_their_id() -> None:
    one = '<BehaviorTree ID="A"><Stay/></BehaviorTree>'
    two = '<BehaviorTree ID="B"><Sequence><Land/></Sequence></BehaviorTree>'
    three = '<BehaviorTree ID="C"><Hop/></BehaviorTree>'
    assert changes(f"<root>{one}{two}</root>", f"<root>{two}{one}</root>") == []
    assert changes(f"<root>{one}{two}</root>", f"<root>{three}{one}</root>") == [
        ("added", "C", "with 1 more inside"),
        ("removed", "B", "with 2 more inside"),
    ]
    before = f'<root main_tree_to_execute="A">{one}{two}</root>'
    after = f'<root main_tree_to_execute="B">{one}{two}</root>'
    assert changes(before, after) == [
        ("changed", "root", 'main_tree_to_execute="A" is now "B"'),
    ]


def test_models_are_compared_by_name_and_kind() -> None:
    model = '<root><TreeNodesModel><{} ID="X"><input_port name="a"{}/></{}></TreeNodesModel></root>'
    assert changes(model.format("Action", "", "Action"), model.format("Action", "", "Action")) == []
    assert changes(
        model.format("Action", "", "Action"), model.format("Condition", ' default="1"', "Condition")
    ) == [
        ("changed", "TreeNodesModel/X", 'kind="Action" is now "Condition"'),
        ("changed", "TreeNodesModel/X/a", 'default="1" is new'),
    ]


def test_a_difference_has_the_places_in_both_files() -> None:
    old = parse_source(b'<root>\n<BehaviorTree ID="M">\n<Turn d="1"/></BehaviorTree></root>', HERE)
    new = parse_source(b'<root><BehaviorTree ID="M"><Turn d="2"/></BehaviorTree></root>', HERE)
    (only,) = differences(old, new)
    assert only.change is Change.CHANGED
    assert (str(only.before), str(only.after)) == ("3:1", "1:28")


@pytest.mark.parametrize("count", [3000])
def test_large_files_are_compared_in_bounded_time(count: int) -> None:
    many = [f'<Turn d="{number}"/>' for number in range(count)]
    before, after = "".join(many), "".join(reversed(many))
    found = changes(f"<Sequence>{before}</Sequence>", f"<Sequence>{after}</Sequence>")
    assert {change for change, _, _ in found} == {"moved"}
    assert len(found) == count - 1


def test_the_deepest_files_are_compared() -> None:
    inner = "<Inverter>" * (MAX_DEPTH - 1), "</Inverter>" * (MAX_DEPTH - 1)
    found = changes("<Stay/>".join(inner), "<Land/>".join(inner))
    assert [change for change, _, _ in found] == ["added", "removed"]
