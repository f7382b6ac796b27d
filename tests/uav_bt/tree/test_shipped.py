"""Shipped missions, and the described trees of trees/lib."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.worlds.tables import cases
from tests.worlds.trees import check, document
from uav_bt.board import MISSION_KEYS, Blackboard
from uav_bt.board.context import MissionContext
from uav_bt.clock import ManualClock
from uav_bt.errors import FileError, TreeError
from uav_bt.tree import NodeRegistry, Status, load_tree, parse_tree, shipped_subtree
from uav_bt.tree.describe import palette_xml, sketch
from uav_bt.tree.loading.loader import check_file
from uav_bt.tree.loading.lookup import Library, Lookup, shipped_trees
from uav_bt.tree.shipped import STARTERS, resolve_tree, tree_files, write_starter


def test_a_file_stands_for_itself_and_a_name_for_a_shipped_mission(tmp_path: Path) -> None:
    path = tmp_path / "mine.txt"
    path.write_text("<root/>", encoding="utf-8")
    assert tree_files(path) == (path,)
    assert tree_files("land_only") == (resolve_tree("land_only"),)
    assert resolve_tree("land_only").parent == shipped_trees()


def test_a_name_with_a_suffix_or_a_folder_is_a_file_and_never_a_shipped_mission(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Otherwise a different mission than the intended one would fly."""
    monkeypatch.chdir(tmp_path)
    assert resolve_tree("land_only").samefile(shipped_trees() / "land_only.xml")
    for name in ("land_only.xml", "trees/land_only.xml", "trees/land_only"):
        with pytest.raises(FileError, match="mission has no suffix; did you mean 'land_only'"):
            resolve_tree(name)
    Path("land_only.xml").write_text("mine", encoding="utf-8")
    assert resolve_tree("land_only.xml").read_text(encoding="utf-8") == "mine"


def test_a_folder_stands_for_its_xml_files_in_order_without_hidden_ones(tmp_path: Path) -> None:
    for name in ("b.xml", "a.xml", "deep/er/c.xml", ".git/d.xml", ".e.xml", "f.yaml"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("", encoding="utf-8")
    (tmp_path / "folder.xml").mkdir()
    found = [path.relative_to(tmp_path).as_posix() for path in tree_files(tmp_path)]
    assert found == ["a.xml", "b.xml", "deep/er/c.xml"]


@pytest.mark.parametrize("start", STARTERS)
def test_a_starter_is_the_shipped_mission_with_a_comment(tmp_path: Path, start: str) -> None:
    path = tmp_path / "mine.xml"
    write_starter(path, start)
    assert check_file(path) == ()
    text = path.read_text(encoding="utf-8")
    assert text.count("How to read it") == 1
    assert 'attribute="{@name}"' in text
    shipped = load_tree(resolve_tree(STARTERS[start]))
    assert sketch(parse_tree(text).root) == sketch(shipped.root)


# --- described trees: by their ID as a tag, in Python, and mocked as a whole ----------------------

CASES = cases("missions")

REGISTRY = NodeRegistry.installed()
OWN = '<BehaviorTree ID="ReturnToBase"><AlwaysSuccess name="own"/></BehaviorTree>'


def messages(body: str, more: str = "") -> list[str]:
    found = check(document(body, more), REGISTRY)
    return [f"{one.position.column}: {one.message}" for one in found]


def test_the_id_of_a_described_tree_is_short_for_a_subtree() -> None:
    short, long = (
        parse_tree(document(f'<{tag} policy="corridor"/>'), REGISTRY)
        for tag in ("ReturnToBase", 'SubTree ID="ReturnToBase"')
    )
    assert [node.path for node in short.nodes()] == [node.path for node in long.nodes()]
    leaf = short.find("Main/ReturnToBase/return_to_base/GiveWay")
    assert (leaf.port_value("gives_way"), leaf.port_value("gimbal_deg")) == (True, -30.0)


def test_a_port_chooses_another_tree() -> None:
    body = '<Sequence><{0} approach="policy"/><{0} name="again" approach="policy"/></Sequence>'
    for tag in ("ReturnToBase", 'SubTree ID="ReturnToBase"'):
        tree = parse_tree(document(body.format(tag)), REGISTRY)
        for name in ("ReturnToBase", "again"):
            inside = f"Main/Sequence/{name}/return_to_base/while_it_moves_on/RetryUntilSuccessful"
            assert tree.find(f"{inside}/find_and_go/go/GoToMarkUnderPolicy")


def test_a_tree_of_that_id_takes_its_place(tmp_path: Path) -> None:
    (tmp_path / "mine.xml").write_text(f'<root BTCPP_format="4">{OWN}</root>', encoding="utf-8")
    lookup = Lookup(Library([tmp_path / "mine.xml"]))
    for more, where in ((OWN, None), ("", lookup)):
        tree = parse_tree(document("<ReturnToBase/>", more), REGISTRY, lookup=where)
        assert [node.name for node in tree.leaves()] == ["own"]
        assert tree.find("ReturnToBase").variables is tree.variables
        assert next(tree.leaves()).variables["gives_way"] == "true"  # described as the shipped one


@pytest.mark.parametrize(("body", "expected"), CASES["refused_entries"])
def test_a_mistake_is_reported_where_it_is_written(body: str, expected: str) -> None:
    (message,) = messages(body)
    column = document(body).rpartition("\n")[2].index(body) + 1
    assert expected in message
    assert int(message.partition(":")[0]) - column in {0, 14}  # the tag, or its attribute


def test_a_mock_stands_in_place_of_the_whole_tree_or_of_a_leaf_inside() -> None:
    clock = ManualClock()
    board = Blackboard(clock, MISSION_KEYS)
    inner = '<BehaviorTree ID="Inner"><Land name="down"/></BehaviorTree>'
    for body, mocked in (("<ReturnToBase/>", "ReturnToBase"), ('<SubTree ID="Inner"/>', "Inner")):
        tree = parse_tree(document(body, inner), REGISTRY, mocks={mocked: "RS"})
        assert [node.path for node in tree.nodes()] == [f"Main/{mocked}"]
        tree.setup(MissionContext(board=board, clock=clock))
        assert [tree.tick(), tree.tick()] == [Status.RUNNING, Status.SUCCESS]
    inside = parse_tree(document('<SubTree ID="Inner"/>', inner), REGISTRY, mocks={"Land": "R"})
    inside.setup(MissionContext(board=board, clock=clock))
    assert inside.tick() is Status.RUNNING


def test_python_makes_one_with_typed_entries() -> None:
    node = shipped_subtree("ReturnToBase", "home", gives_way=False, policy="corridor")
    leaf = next(one for one in node.iterate() if one.name == "GiveWay")
    assert (node.name, leaf.port_value("gives_way")) == ("home", False)
    with pytest.raises(TreeError, match="without a port 'polcy'"):
        shipped_subtree("ReturnToBase", polcy="corridor")


def test_editors_are_offered_the_described_trees(tmp_path: Path) -> None:
    model = palette_xml(REGISTRY)
    assert '<SubTree ID="ExploreFor">' in model
    assert '<input_port name="arrive_m" type="double" default="0.12">' in model
    file = tmp_path / "m.xml"
    models = model[model.index("  <TreeNodes") : -8]
    file.write_text(document("<ReturnToBase/>", models), encoding="utf-8")
    assert load_tree(file, REGISTRY).find("ReturnToBase").kind.value == "SubTree"
