"""Values of ports and variables from outside: read from files, and checked like the tree file."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.worlds.tables import cases
from uav_bt.errors import FileError, TreeError
from uav_bt.tree import MissionTree, Parameters, parse_tree
from uav_bt.tree.loading.loader import check_text
from uav_bt.tree.loading.parameter_file import read_parameters
from uav_bt.tree.loading.parameters import Plain
from uav_bt.tree.loading.uses import Uses

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
