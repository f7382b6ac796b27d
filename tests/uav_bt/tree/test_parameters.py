"""Values from outside: parameters, parameter files, and files of places."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.worlds.tables import cases
from tests.worlds.trees import tree_file
from uav_bt.errors import FileError, TreeError
from uav_bt.tree import MissionTree, Parameters, load_tree, parse_tree
from uav_bt.tree.loading.loader import check_file, check_text
from uav_bt.tree.loading.lookup import Library, Lookup
from uav_bt.tree.loading.parameter_file import read_parameters
from uav_bt.tree.loading.parameters import Plain
from uav_bt.tree.loading.places import MAX_BYTES, MAX_PLACES, read_places
from uav_bt.tree.loading.uses import Uses
from uav_bt.tree.rules import Rules

CASES = cases("given")

PATROL = """<root BTCPP_format="4" main_tree_to_execute="Main">
  <BehaviorTree ID="Main">
    <Sequence>
      <TakeOff height_m="{height}"/>
      <Repeat num_cycles="{laps}"><HoverFor seconds="1"/></Repeat>
      <SubTree ID="Side" wait="{wait_s}" rule="{rule}"/>
      <HoverFor name="last" seconds="2"/>
      <ScriptCondition code="laps &gt; 1"/>
      <Land/>
    </Sequence>
  </BehaviorTree>
  <BehaviorTree ID="Side">
    <Sequence>
      <HoverFor seconds="{wait}"/>
      <Explore policy="{rule}"/>
    </Sequence>
  </BehaviorTree>
</root>"""
GIVEN: dict[str, Plain] = {"height": 1.2, "laps": 2, "wait_s": "1.5", "rule": "corridor"}


def patrol(ports: dict[str, str] | None = None, **variables: Plain) -> MissionTree:
    given = Parameters(ports=ports or {}, variables={**GIVEN, **variables})
    return parse_tree(PATROL, parameters=given)


def findings(given: Parameters | None) -> list[str]:
    return [str(one) for one in check_text(PATROL, path=Path("patrol.xml"), parameters=given)]


def test_variables_reach_the_ports_that_read_them_and_the_scripts() -> None:
    tree = patrol()
    at = {leaf.path: leaf for leaf in tree.leaves()}
    assert at["Main/Sequence/TakeOff"].port_value("height_m") == 1.2
    assert at["Main/Sequence/Side/Sequence/HoverFor"].port_value("seconds") == 1.5
    assert at["Main/Sequence/Side/Sequence/Explore"].port_value("policy") == "corridor"
    assert tree.variables["laps"] == 2
    assert Uses(tree).unset() == {}
    assert findings(Parameters(variables=GIVEN)) == []


@pytest.mark.parametrize(("variables", "message"), CASES["refused_variables"])
def test_a_variable_is_checked_like_the_file(variables: dict[str, Plain], message: str) -> None:
    with pytest.raises(TreeError) as refused:
        patrol(**variables)
    assert message in str(refused.value)
    assert message in "\n".join(findings(Parameters(variables={**GIVEN, **variables})))


def test_a_value_that_needs_caution_is_a_warning_as_in_the_file() -> None:
    (warning,) = findings(Parameters(variables={**GIVEN, "height": 9}))
    assert "warning: Main/Sequence/TakeOff: variable 'height': 9 m lies above the ceil" in warning
    (warning,) = findings(Parameters(variables=GIVEN, ports={"TakeOff.height_m": "9"}))
    assert "warning: Main/Sequence/TakeOff: attribute 'height_m': 9 m lies above" in warning


def test_a_variable_that_the_file_sets_too_is_a_warning() -> None:
    text = PATROL.replace("<Sequence>", '<Sequence><Script code="laps := 3"/>', 1)
    given = Parameters(variables=GIVEN)
    (warning,) = check_text(text, path=Path("patrol.xml"), parameters=given)
    assert "variable 'laps': Script, attribute 'code', at patrol.xml:3:23 sets it, too" in str(
        warning
    )
    assert warning.severity == "warning"


@pytest.mark.parametrize(("ports", "message"), CASES["refused_ports"])
def test_a_wrong_port_is_refused(ports: dict[str, str], message: str) -> None:
    with pytest.raises(TreeError) as refused:
        patrol(ports)
    assert message in str(refused.value)


@pytest.mark.parametrize(
    ("body", "name", "message"),
    [
        ("", "Main.x", "needs exactly one child, has 0"),
        ("<HoverFor/><Land/>", "Main.x", "needs exactly one child, has 2"),
        ('<SubTree ID="Missing"/>', "Missing.x", "there is no tree 'Missing'"),
        ("<Inverter/>", "AlwaysSuccess.x", "Inverter: needs exactly one child, has 0"),
        ('<SetBlackboard value="1"/>', "SetBlackboard.value", "'output_key' is missing"),
        ('<HoverFor secnds="2"/>', "HoverFor.seconds", "unknown attribute 'secnds'"),
    ],
)
def test_a_wrong_tree_is_told_beside_a_port(body: str, name: str, message: str) -> None:
    text = f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>'
    with pytest.raises(TreeError) as refused:
        parse_tree(text, parameters=Parameters(ports={name: "1"}))
    assert message in str(refused.value)


def test_a_port_below_a_mocked_subtree_is_taken() -> None:
    given = Parameters(ports={"Explore.policy": "student"}, variables=GIVEN)
    tree = parse_tree(PATROL, parameters=given, mocks={"Side": "S"})
    assert not any("Explore" in path for path in tree.replaced)


def test_an_entry_of_a_subtree_is_a_port() -> None:
    tree = patrol({"Side.wait": "4"}, wait_s=1)
    assert tree.find("Main/Sequence/Side/Sequence/HoverFor").port_value("seconds") == 4.0
    assert tree.replaced == {"Main/Sequence/Side": {"wait": "4"}}


# --- parameter files ------------------------------------------------------------------------------

FILE = """
set: {last.seconds: 0.5}
var:
  height: 1.2
  laps: 2
  wait_s: 1
  rule: corridor
"""
VARIANTS = """
variants:
  slow: {}
  fast:
    set: {last.seconds: 0.1}
    var: {laps: 5}
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "params.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_variant_has_the_values_of_the_file_beneath_its_own(tmp_path: Path) -> None:
    file = read_parameters(written(tmp_path, FILE + VARIANTS))
    assert file.variants["slow"] == file.common
    fast = file.variants["fast"]
    assert fast.ports == {"last.seconds": "0.1"}
    assert fast.variables == {**file.common.variables, "laps": 5}
    assert fast.places["var", "laps"].position.line == 13
    assert fast.places["var", "height"].position.line == 4


@pytest.mark.parametrize(("old", "new", "line", "message"), CASES["refused_values"])
def test_a_mistake_is_reported_with_its_line_in_the_parameter_file(
    tmp_path: Path, old: str, new: str, line: int, message: str
) -> None:
    path = written(tmp_path, FILE.replace(old, new))
    given = read_parameters(path).common
    found = findings(given)
    assert found
    assert found[0].startswith(f"{path}:{line}:1: ")
    assert message in found[0]
    with pytest.raises(TreeError, match=r"params\.yaml"):
        parse_tree(PATROL, parameters=given)


@pytest.mark.parametrize(("text", "message"), CASES["refused_files"])
def test_a_wrong_parameter_file_is_refused(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(FileError) as refused:
        read_parameters(written(tmp_path, text))
    assert message in str(refused.value)


LOOP = '<LoopString queue="{}" value="{{p}}"><Face at="{{p}}"/></LoopString>'
SHARED = '<SubTree ID="Visit" places="file:rounds.txt"/>'
VISIT = (
    '<BehaviorTree ID="Visit">'
    + LOOP.format("{{places}}").replace("{p}", "{{p}}")
    + "</BehaviorTree>"
    '<TreeNodesModel><SubTree ID="Visit"><input_port name="places" default="{}"/></SubTree>'
    "</TreeNodesModel>"
)


def queue_of(tree: MissionTree) -> str:
    loop = next(node for node in tree.nodes() if type(node).__name__ == "LoopString")
    return str(loop.literals["queue"])


# --- files of places ------------------------------------------------------------------------------


@pytest.mark.parametrize(("suffix", "text", "places"), CASES["lists_of_places"])
def test_places_are_read_in_their_order(suffix: str, text: str, places: str) -> None:
    found, faults = read_places(text.encode(), is_table=suffix == ".csv")
    assert ([place for _, place in found], faults) == (places.split(";"), [])


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


# --- trees that name them -------------------------------------------------------------------------


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


def test_entries_of_subtrees_and_variables_are_lists_too(rounds: Path, tmp_path: Path) -> None:
    for body, default in ((SHARED, "mark"), ('<SubTree ID="Visit"/>', "file:rounds.txt")):
        tree = load_tree(tree_file(tmp_path, body, "m.xml", VISIT.format(default)))
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
    (tmp_path / "parts").mkdir()
    part = tree_file(tmp_path / "parts", LOOP.format("file:rounds.txt"), "part.xml")
    part.write_text(part.read_text().replace('"Main"', '"Part"'))
    (tmp_path / "rounds.txt").write_text("mark\n")
    (part.parent / "rounds.txt").write_text("object:3\n")
    for lookup, more in ((Lookup(Library([part])), ""), (None, '<include path="parts/part.xml"/>')):
        path = tree_file(tmp_path, '<SubTree ID="Part"/>', "m.xml", more)
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
    folder.mkdir()
    path = tree_file(folder, f"<Sequence>{LOOP.format(f'file:{name}')}</Sequence>")
    rounds.rename(folder / "rounds.txt")
    (tmp_path / "outside.txt").write_text("mark\n")
    (folder / "link.txt").symlink_to(tmp_path / "outside.txt")
    (folder / "folder.txt").mkdir()
    (folder / "huge.csv").write_bytes(bytes(MAX_BYTES + 1))
    found = check_file(path)
    assert len(found) == 1
    assert (found[0].path, found[0].position.line) == (str(path), 1)
    assert words in found[0].message


def test_a_faulty_file_is_reported_once_though_two_nodes_name_it(tmp_path: Path) -> None:
    (tmp_path / "area.txt").write_text("start:0,0\nhere\n")
    body = f'<Sequence><Rules area="file:area.txt"/>{LOOP.format("file:area.txt")}</Sequence>'
    found = check_file(tree_file(tmp_path, body))
    assert [(Path(one.path).name, one.position.line) for one in found] == [("area.txt", 2)]
    assert "got 'here'; Rules, attribute 'area', at " in found[0].message
