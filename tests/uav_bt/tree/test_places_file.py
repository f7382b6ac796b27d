"""Files of places, and the trees that name them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.worlds.tables import cases
from uav_bt.tree import MissionTree, load_tree
from uav_bt.tree.loading.loader import check_file
from uav_bt.tree.loading.lookup import Library, Lookup
from uav_bt.tree.loading.parameters import Parameters
from uav_bt.tree.loading.places import MAX_BYTES, MAX_PLACES, read_places
from uav_bt.tree.rules import Rules

CASES = cases("given")

LOOP = '<LoopString queue="{}" value="{{p}}"><Face at="{{p}}"/></LoopString>'
SHARED = '<SubTree ID="Visit" places="file:rounds.txt"/>'
VISIT = (
    '<BehaviorTree ID="Visit">'
    + LOOP.format("{{places}}").replace("{p}", "{{p}}")
    + "</BehaviorTree>"
    '<TreeNodesModel><SubTree ID="Visit"><input_port name="places" default="{}"/></SubTree>'
    "</TreeNodesModel>"
)


def tree_file(folder: Path, body: str, more: str = "", name: str = "mission.xml") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    path.write_text(
        '<root BTCPP_format="4" main_tree_to_execute="Main">\n'
        f'<BehaviorTree ID="Main">{body}</BehaviorTree>{more}</root>'
    )
    return path


def queue_of(tree: MissionTree) -> str:
    loop = next(node for node in tree.nodes() if type(node).__name__ == "LoopString")
    return str(loop.literals["queue"])


# --- the file -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("suffix", "text", "places"), CASES["lists_of_places"])
def test_places_are_read_in_their_order(suffix: str, text: str, places: str) -> None:
    assert read_places(text.encode(), is_table=suffix == ".csv") == (places.split(";"), [])


@pytest.mark.parametrize(
    ("suffix", "data", "line", "words"),
    [
        *CASES["refused_lists"],
        (".txt", "start:1,0@" + "9" * 400, 1, "expected a heading in degrees, got 99999"),
    ],
)
def test_each_fault_has_its_line(suffix: str, data: str, line: int, words: str) -> None:
    _, faults = read_places(data.encode(), is_table=suffix == ".csv")
    assert [number for number, _ in faults] == [line]
    assert words in faults[0][1]


def test_what_is_no_text_and_what_is_too_long_is_refused() -> None:
    assert read_places(b"mark\n\xff\xfe", is_table=False)[1] == [(2, "expected UTF-8 text")]
    long = read_places(b"mark\n" * (MAX_PLACES + 1), is_table=False)[1]
    assert long == [(MAX_PLACES + 1, f"more than {MAX_PLACES} places")]


# --- the tree -------------------------------------------------------------------------------------


@pytest.fixture
def rounds(tmp_path: Path) -> Path:
    path = tmp_path / "rounds.txt"
    path.write_text("start:2,0\nmark\n")
    return path


@pytest.mark.parametrize(
    ("body", "given", "places"),
    [
        (LOOP.format("file:rounds.txt"), Parameters(), "start:2,0;mark"),
        (LOOP.format(" body:1,0;file: rounds.txt"), Parameters(), " body:1,0;start:2,0;mark"),
        (
            LOOP.format("mark"),
            Parameters(ports={"LoopString.queue": "file:rounds.txt"}),
            "start:2,0;mark",
        ),
    ],
)
def test_a_file_stands_for_its_places(
    body: str, given: Parameters, places: str, rounds: Path, tmp_path: Path
) -> None:
    tree = load_tree(tree_file(tmp_path, body), parameters=given)
    assert queue_of(tree) == places
    assert tree.sources[rounds] == rounds.read_bytes()


def test_the_entry_of_a_subtree_its_default_and_a_variable_are_lists_too(
    rounds: Path, tmp_path: Path
) -> None:
    for body, default in ((SHARED, "mark"), ('<SubTree ID="Visit"/>', "file:rounds.txt")):
        tree = load_tree(tree_file(tmp_path, body, VISIT.format(default)))
        assert tree.root.attributes["places"] == "start:2,0;mark"  # type: ignore[attr-defined]
        assert rounds in tree.sources
    path = tree_file(tmp_path, LOOP.format("{places}"))
    tree = load_tree(path, parameters=Parameters(variables={"places": "file:rounds.txt"}))
    assert (tree.variables["places"], rounds in tree.sources) == ("start:2,0;mark", True)


def test_an_area_may_stand_in_a_file(tmp_path: Path) -> None:
    (tmp_path / "area.csv").write_text("frame,x,y\nstart,-1,-1\nstart,3,-1\nstart,-1,3\n")
    tree = load_tree(tree_file(tmp_path, '<Rules area="file:area.csv"/>'))
    assert isinstance(tree.root, Rules)
    assert list(map(str, tree.root.stated().area or ())) == [
        "start:-1,-1",
        "start:3,-1",
        "start:-1,3",
    ]


def test_a_subtree_finds_its_file_beside_its_own(tmp_path: Path) -> None:
    part = tree_file(tmp_path / "parts", LOOP.format("file:rounds.txt"), name="part.xml")
    part.write_text(part.read_text().replace('"Main"', '"Part"'))
    (tmp_path / "rounds.txt").write_text("mark\n")
    (part.parent / "rounds.txt").write_text("object:3\n")
    for lookup, more in ((Lookup(Library([part])), ""), (None, '<include path="parts/part.xml"/>')):
        path = tree_file(tmp_path, '<SubTree ID="Part"/>', more)
        assert queue_of(load_tree(path, lookup=lookup)) == "object:3"


def test_texts_that_are_no_lists_stay(rounds: Path, tmp_path: Path) -> None:
    body = (
        '<Sequence><Say text="file:rounds.txt"/><AlwaysSuccess name="file:rounds.txt"/></Sequence>'
    )
    tree = load_tree(tree_file(tmp_path, body))
    assert rounds not in tree.sources
    assert tree.root.children[0].literals["text"] == "file:rounds.txt"


@pytest.mark.parametrize(
    ("name", "words"), [*CASES["refused_names"], ("x" * 300 + ".txt", "is no name of a file")]
)
def test_a_file_that_cannot_be_read_is_one_finding_at_the_attribute(
    name: str, words: str, rounds: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "tree"
    path = tree_file(folder, f"<Sequence>{LOOP.format(f'file:{name}')}</Sequence>")
    rounds.rename(folder / "rounds.txt")
    (tmp_path / "outside.txt").write_text("mark\n")
    (folder / "link.txt").symlink_to(tmp_path / "outside.txt")
    (folder / "folder.txt").mkdir()
    (folder / "huge.csv").write_bytes(bytes(MAX_BYTES + 1))
    found = check_file(path)
    assert len(found) == 1
    assert (found[0].path, found[0].position.line) == (str(path), 2)
    assert words in found[0].message


def test_a_faulty_file_is_reported_once_though_two_nodes_name_it(tmp_path: Path) -> None:
    (tmp_path / "area.txt").write_text("start:0,0\nhere\n")
    body = f'<Sequence><Rules area="file:area.txt"/>{LOOP.format("file:area.txt")}</Sequence>'
    found = check_file(tree_file(tmp_path, body))
    assert [(Path(one.path).name, one.position.line) for one in found] == [("area.txt", 2)]
    assert "got 'here'; Rules, attribute 'area', at " in found[0].message
