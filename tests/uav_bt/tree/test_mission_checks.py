"""What a mission's file alone shows before its flight: places, take-off, landing, keys, names."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.worlds.tables import cases
from tests.worlds.trees import document
from uav_bt import app
from uav_bt.errors import TreeError
from uav_bt.lab.shipped import load_lab
from uav_bt.tree import NodeRegistry
from uav_bt.tree.loading.loader import check_file, check_text
from uav_bt.tree.loading.lookup import Library, Lookup, files_in

CASES = cases("missions")

REGISTRY = NodeRegistry.installed()
AREA = "start:-0.5,-0.5; start:1,-0.5; start:1,0.5; start:-0.5,0.5"
UP, DOWN, MAP = '<TakeOff height_m="1.2"/>', "<Land/>", '<SubTree ID="Perceive"/>'


def found(*body: str, rules: str = '<Rules land_on="any"/>') -> list[str]:
    text = document(f"<Sequence>{rules}{''.join(body)}</Sequence>")
    return [str(one) for one in check_text(text, REGISTRY, path=Path("m.xml"))]


@pytest.mark.parametrize(("body", "message"), CASES["found_in_the_file"])
def test_what_the_file_alone_shows(body: tuple[str, ...], message: str) -> None:
    rules = (
        f'<Rules land_on="any" area="{AREA}"/>' if "area" in message else '<Rules land_on="any"/>'
    )
    (text,) = found(*body, rules=rules)
    assert re.search(message, text), text


def test_what_can_be_flown_is_not_refused() -> None:
    named = '<Script code="goal := \'there\'"/><SetBlackboard value="x" output_key="{goal}"/>'
    inside = f'<Rules land_on="any" area="{AREA}"/>'
    assert found(MAP, UP, named, '<GoTo to="start:0.9,0"/>', DOWN, rules=inside) == []
    assert found('<HoverFor seconds="1"/>', rules='<Rules land_on="none"/>') == []


def test_a_main_tree_may_stand_in_another_file_of_the_folder(tmp_path: Path) -> None:
    spin = tmp_path / "spin.xml"
    part = '<BehaviorTree ID="Spin"><Sleep msec="100"/></BehaviorTree>'
    spin.write_text(f'<root BTCPP_format="4" main_tree_to_execute="Try">{part}</root>')
    other = '<BehaviorTree ID="Try"><SubTree ID="Spin"/></BehaviorTree>'
    (tmp_path / "try.xml").write_text(f'<root BTCPP_format="4">{other}</root>')
    assert check_file(spin, REGISTRY, lookup=Lookup(Library(files_in(tmp_path)))) == ()
    (alone,) = check_file(spin, REGISTRY)
    assert "there is no tree 'Try'" in str(alone)


@pytest.mark.parametrize(("first", "later", "warns"), CASES["begins_anew"])
def test_a_leaf_that_begins_anew_and_halts_the_next_is_a_warning(
    first: str, later: str, *, warns: bool
) -> None:
    texts = found(MAP, f"<ReactiveSequence>{first}{later}</ReactiveSequence>", DOWN)
    told = [one for one in texts if "begins anew in every tick and halts" in one]
    assert ["warning: " in one for one in told] == [True] * warns


@pytest.mark.parametrize(("leaf", "message"), CASES["lacking_labs"])
def test_what_a_lab_lacks_is_refused_there_and_a_warning_for_the_default_lab(
    leaf: str, message: str
) -> None:
    body = (MAP, UP, leaf, DOWN)
    (text,) = found(*body)
    assert "warning: " in text
    assert message in text
    mission = document(f"<Sequence>{''.join(body)}</Sequence>")
    with pytest.raises(TreeError, match=re.escape(message)):
        app.check(mission, lab=load_lab())
