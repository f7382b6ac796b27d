"""A campaign flies each variant of its parameters, and only what its workers can read."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from uav_bt import app
from uav_bt.campaign import make_plan, plan_of
from uav_bt.campaign.plan import CampaignPlan
from uav_bt.campaign.store import CampaignStore
from uav_bt.errors import InputError

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


@pytest.mark.parametrize("tree", ["text", "object"])
def test_what_no_worker_can_read_is_refused(hop: Path, tree: str) -> None:
    given = hop.read_text() if tree == "text" else app.check(hop, variables={"wait_s": 1})
    with pytest.raises(InputError, match="a campaign flies tree files, which its workers read"):
        make_plan([given], variables={"wait_s": 1}, flights=1)  # type: ignore[list-item]


def test_a_policy_object_is_refused_with_the_reason() -> None:
    class Mine:
        def decide(self, view: object) -> None:
            """Decide nothing."""

    with pytest.raises(InputError, match="a campaign's policies are names of installed policies"):
        make_plan(["survey_and_land"], policies={"Explore": Mine()}, flights=1)  # type: ignore[dict-item]
