"""What a mission's file alone shows before its flight: its rules, places, keys and units."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.worlds.tables import cases
from tests.worlds.trees import check, document, subtree
from uav_bt import app
from uav_bt.board import FLIGHT_HEIGHT, ODOMETRY, PERCEIVED_KEYS
from uav_bt.errors import InputError, TreeError
from uav_bt.lab.shipped import load_lab
from uav_bt.mission.judge import JudgeConfig
from uav_bt.tree import Leaf, MissionTree, NodeRegistry, parse_tree
from uav_bt.tree.loading.findings import Finding, Rule, errors_of
from uav_bt.tree.loading.loader import check_file, check_text
from uav_bt.tree.loading.lookup import Library, Lookup, files_in
from uav_bt.tree.rules import Rules
from uav_bt.types.place import LandOn, MissionRules

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


@pytest.mark.parametrize(
    ("leaf", "key"),
    [
        ('<GoTo to="start:1,0"/>', "site_map"),
        ('<GoTo to="mark"/>', "mark"),
        ('<MoveBy forward_m="1"/>', "site_map"),
        ('<MoveBy up_m="1"/>', None),
        ('<NextObject place="{p}" label="{l}"/>', "site_map"),
        ("<HelipadCenter/>", None),
    ],
)
def test_a_leaf_that_cannot_work_without_perception_is_refused(leaf: str, key: str | None) -> None:
    assert [text for text in found(MAP, UP, leaf, DOWN) if "it needs" in text] == []
    texts = [text for text in found(UP, leaf, DOWN) if "it needs board key" in text]
    assert len(texts) == (key is not None)
    for text in texts:
        assert f"'{key}'" in text
        assert text.endswith(f", or {MAP}")


def test_perceive_writes_what_its_name_is_the_remedy_for() -> None:
    tree = parse_tree(document(f"<Sequence>{MAP}</Sequence>"), REGISTRY)
    assert {key for leaf in tree.leaves() for key in leaf.writes} >= set(PERCEIVED_KEYS)


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
def test_a_leaf_that_halts_the_next_is_a_warning(first: str, later: str, *, warns: bool) -> None:
    texts = found(MAP, f"<ReactiveSequence>{first}{later}</ReactiveSequence>", DOWN)
    told = [one for one in texts if "begins anew in every tick and halts" in one]
    assert ["warning: " in one for one in told] == [True] * warns


@pytest.mark.parametrize(("leaf", "message"), CASES["lacking_labs"])
def test_what_a_lab_lacks_is_refused_there_and_elsewhere_a_warning(leaf: str, message: str) -> None:
    body = (MAP, UP, leaf, DOWN)
    (text,) = found(*body)
    assert "warning: " in text
    assert message in text
    mission = document(f"<Sequence>{''.join(body)}</Sequence>")
    with pytest.raises(TreeError, match=re.escape(message)):
        app.check(mission, lab=load_lab())


# --- rules of a mission ---------------------------------------------------------------------------


class Up(Leaf):
    """Takes off."""

    moves = True
    writes = (FLIGHT_HEIGHT,)


class Track(Leaf):
    """Keeps the odometry."""

    writes = (ODOMETRY,)


RULES = NodeRegistry([Rules, Up, Track])
SQUARE = "start:-1,-1; start:3,-1; lab:3,1; start:-1,1"


def messages(body: str, inner: str = "<AlwaysSuccess/>") -> list[str]:
    text = document(body, subtree("Inner", inner))
    return [each.message for each in check(text, RULES)]


def stated(body: str, inner: str = "<AlwaysSuccess/>") -> MissionRules:
    tree: MissionTree = parse_tree(document(body, subtree("Inner", inner)), RULES)
    (leaf,) = (leaf for leaf in tree.leaves() if isinstance(leaf, Rules))
    return leaf.stated()


def test_rules_are_read_from_the_file() -> None:
    assert stated("<Rules/>") == MissionRules(land_on=LandOn.MARK)
    rules = stated(f'<Rules time_limit_s="90" land_on="any" area="{SQUARE}"/>')
    assert (rules.time_limit_s, rules.land_on) == (90.0, LandOn.ANY)
    assert [str(corner) for corner in rules.area or ()] == SQUARE.split("; ")


def test_an_entry_of_a_subtree_is_known_before_the_take_off() -> None:
    body, inner = '<SubTree ID="Inner" limit="45"/>', '<Rules time_limit_s="{limit}"/>'
    assert messages(body, inner) == []
    assert stated(body, inner).time_limit_s == 45.0


@pytest.mark.parametrize(("body", "words"), CASES["refused_rules"])
def test_rules_that_cannot_be_kept_are_refused(body: str, words: str) -> None:
    (message,) = messages(body)
    assert words in message


def test_rules_that_can_be_kept_are_good() -> None:
    assert messages(f'<Sequence><Rules area="{SQUARE}"/><Track/><Up/></Sequence>') == []
    assert messages('<Sequence><Rules land_on="none"/><Track/></Sequence>') == []


def test_python_gets_the_same_error() -> None:
    with pytest.raises(InputError, match="expected one of mark, ground, any, none"):
        Rules(land_on="box")


# --- values that were probably written in another unit --------------------------------------------


def checked(body: str) -> tuple[Finding, ...]:
    return check(document(body))


def doubt(body: str) -> str:
    (found,) = checked(body)
    assert errors_of((found,)) == ()
    assert found.rule is Rule.UNIT
    return found.message


@pytest.mark.parametrize(
    ("written", "meant"),
    [("-1.047", "-60"), ("1.57", "90"), ("0.79", "45"), ("3.14159", "180"), ("6.283", "360")],
)
def test_a_fraction_of_pi_in_degrees_looks_like_radians(written: str, meant: str) -> None:
    message = doubt(f'<Turn degrees="{written}"/>')
    assert message.startswith("attribute 'degrees': ")
    assert message.endswith(f"looks like radians; for {meant} degrees write {meant}")


def test_a_port_that_ends_in_deg_is_in_degrees() -> None:
    assert "for -30 degrees write -30" in doubt('<TakeOff gimbal_deg="-0.5236"/>')


@pytest.mark.parametrize("written", ["0", "-60", "3", "1.5", "-0.5", "0.3", "0.7", "15.71", "1.6"])
def test_other_angles_are_degrees(written: str) -> None:
    """Zero, whole and half degrees, more than 1 % from a multiple of 15 degrees, or over 2 pi."""
    assert checked(f'<Turn degrees="{written}"/>') == ()


def test_a_time_beyond_the_time_limit_of_a_mission_is_doubted() -> None:
    assert JudgeConfig().limit_s == 300.0
    assert checked('<HoverFor seconds="300"/>') == ()
    message = doubt('<HoverFor seconds="1000"/>')
    assert "1000 s is longer than a mission, whose time limit is 300 s" in message
    assert "attribute 'give_up_s': 400 s" in doubt('<TakeOff give_up_s="400"/>')


def test_milliseconds_below_ten_look_like_seconds() -> None:
    limited = '<Timeout msec="{}"><AlwaysSuccess/></Timeout>'
    assert "5 ms is shorter than a tick; for 5 s write 5000" in doubt(limited.format(5))
    assert checked(limited.format(0)) == ()  # no limit
    assert checked(limited.format(10)) == ()
    late = '<Delay delay_msec="2"><AlwaysSuccess/></Delay>'
    assert "attribute 'delay_msec': 2 ms" in doubt(late)


def test_defaults_and_references_are_not_doubted() -> None:
    script = '<Script code="angle := 1.047"/>'
    assert checked(f'<Sequence>{script}<Turn degrees="{{angle}}"/></Sequence>') == ()


def test_the_time_limit_of_a_missions_rules_is_a_limit_itself() -> None:
    assert checked('<Rules time_limit_s="1000"/>') == ()
