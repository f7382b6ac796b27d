"""A campaign flies what it was given: variants of parameters, and trees with replaced values."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from uav_bt import app
from uav_bt.campaign import make_plan, plan_of
from uav_bt.campaign.plan import CampaignPlan
from uav_bt.campaign.store import CampaignStore
from uav_bt.errors import InputError
from uav_bt.tree import MissionTree, NodeRegistry, Parameters, parse_tree
from uav_bt.tree.loading.replacements import replace_in
from uav_bt.tree.nodes import AlwaysSuccess

BODY = '<Sequence><TakeOff height_m="1.0"/><HoverFor seconds="{wait_s}"/><Land/></Sequence>'
VARIANTS = """
set: {TakeOff.height_m: 1.1}
var: {wait_s: 1}
variants:
  slow: {}
  fast: {var: {wait_s: 2}, set: {TakeOff.height_m: 1.2}}
"""


@pytest.fixture
def hop(tmp_path: Path) -> Path:
    path = tmp_path / "hop.xml"
    path.write_text(
        '<root BTCPP_format="4" main_tree_to_execute="Main">'
        f'<BehaviorTree ID="Main">{BODY}</BehaviorTree></root>'
    )
    return path


@pytest.fixture
def params(tmp_path: Path) -> Path:
    path = tmp_path / "params.yaml"
    path.write_text(VARIANTS)
    return path


def flown(plan: CampaignPlan) -> dict[str, tuple[object, object]]:
    """Return height and wait of each tree's flights, as their workers get them."""
    options = {task.tree: task.flight_options() for task in plan.tasks()}
    return {
        tree: (how.ports.get("TakeOff.height_m"), how.variables.get("wait_s"))
        for tree, how in options.items()
    }


def test_each_variant_is_a_row_of_its_own(hop: Path, params: Path) -> None:
    plan = make_plan([hop], params=params, flights=1, scenes=["val-a"])
    assert flown(plan) == {"hop[slow].xml": ("1.1", 1), "hop[fast].xml": ("1.2", 2)}
    assert [Path(tree.name).stem for tree in plan.trees] == ["hop[slow]", "hop[fast]"]
    again = CampaignPlan.from_json(json.loads(json.dumps(plan.to_json())))
    assert flown(again) == flown(plan)
    assert again.differences(plan) == []


def test_the_command_line_counts_before_every_variant(hop: Path, params: Path) -> None:
    plan = make_plan([hop], params=params, variables={"wait_s": 5}, flights=1, scenes=["val-a"])
    assert flown(plan) == {"hop[slow].xml": ("1.1", 5), "hop[fast].xml": ("1.2", 5)}


def test_another_value_is_another_campaign(hop: Path, params: Path) -> None:
    before = make_plan([hop], params=params, flights=1, scenes=["val-a"])
    params.write_text(VARIANTS.replace("wait_s: 2", "wait_s: 3"))
    now = make_plan([hop], params=params, flights=1, scenes=["val-a"])
    assert now.differences(before) == ["hop[fast].xml: '{wait_s}' was 2, now 3"]
    plain = make_plan([hop], variables={"wait_s": 1}, flights=1, scenes=["val-a"])
    other = make_plan([hop], variables={"wait_s": 2}, flights=1, scenes=["val-a"])
    assert other.differences(plain) == ["variables: 'wait_s' was 1, now 2"]


def test_a_campaign_goes_on_with_its_variants(hop: Path, params: Path, tmp_path: Path) -> None:
    plan = make_plan([hop], params=params, flights=1, scenes=["val-a"])
    with CampaignStore.opened(tmp_path / "run", plan, {}):
        pass
    params.unlink()
    assert flown(plan_of(tmp_path / "run")) == flown(plan)


def test_a_wrong_value_of_a_variant_is_refused_by_its_line(hop: Path, params: Path) -> None:
    params.write_text(VARIANTS.replace("wait_s: 2", "wait: 2"))
    with pytest.raises(InputError, match=r"params.yaml:6:1: no node uses a variable 'wait'"):
        make_plan([hop], params=params, flights=1)


def replaced(tree: MissionTree, name: str, text: str) -> None:
    replace_in(tree, NodeRegistry.installed(), Parameters(ports={name: text}), {}, {})


# --- trees that were loaded before ----------------------------------------------------------------


def test_a_loaded_tree_flies_with_its_values(hop: Path) -> None:
    tree = app.check(hop, variables={"wait_s": 1})
    replaced(tree, "TakeOff.height_m", "1.4")
    tree.variables["wait_s"] = 3
    plan = make_plan([tree], flights=1, scenes=["val-a"])
    (options,) = [task.flight_options() for task in plan.tasks()]
    assert options.ports == {"Main/Sequence/TakeOff.height_m": "1.4"}
    assert options.variables == {"wait_s": 3}
    (task,) = plan.tasks()
    assert task.tree_path == str(hop)
    again = app.check(task.tree_path, ports=options.ports, variables=options.variables)
    assert again.find("TakeOff").port_value("height_m") == 1.4


def test_the_tree_of_a_shipped_mission_flies_with_its_values() -> None:
    tree = app.check("survey_and_land")
    replaced(tree, "Explore.looks_down", "false")
    plan = make_plan([tree], flights=1, scenes=["val-a"])
    (values,) = [one.ports for one in plan.trees]
    assert set(values.values()) == {"false"}
    assert all(name.endswith("Explore.looks_down") for name in values)
    assert plan.trees[0].path == "survey_and_land"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda _: MissionTree(AlwaysSuccess()), "tree 'Tree' has no file"),
        (lambda hop: parse_tree(hop.read_text()), "tree 'Main' has no file"),
        (lambda hop: hop.read_text(), "a campaign flies tree files, .* got a text"),
    ],
)
def test_a_tree_without_a_file_is_refused(hop: Path, make: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make_plan([make(hop)], variables={"wait_s": 1}, flights=1)  # type: ignore[operator]


def test_a_tree_whose_file_has_changed_is_refused(hop: Path) -> None:
    tree = app.check(hop, variables={"wait_s": 1})
    hop.write_text(hop.read_text().replace("1.0", "1.1"))
    with pytest.raises(InputError, match="its files have changed"):
        make_plan([tree], flights=1)


def test_a_variable_that_no_file_can_hold_is_refused(hop: Path) -> None:
    tree = app.check(hop, variables={"wait_s": 1})
    tree.variables["queue"] = [1, 2]
    with pytest.raises(InputError, match=r"variable 'queue' of tree 'Main' is \[1, 2\]"):
        make_plan([tree], flights=1)


def test_a_policy_object_is_refused_with_the_reason() -> None:
    class Mine:
        def decide(self, view: object) -> None:
            """Decide nothing."""

    with pytest.raises(InputError, match="a campaign's policies are names of installed policies"):
        make_plan(["survey_and_land"], policies={"Explore": Mine()}, flights=1)  # type: ignore[dict-item]
