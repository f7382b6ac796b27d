"""A file that check calls good can be flown: values, keys, policies and movers of a whole tree."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from behaviours.fly.look import Say
from tests.worlds.tables import cases
from tests.worlds.trees import check, document, subtree
from uav_bt.board import HEIGHT, MARK, ODOMETRY, PHASE
from uav_bt.board.blackboard import Key
from uav_bt.errors import FileError, InputError, TreeError
from uav_bt.tree import Leaf, NodeRegistry, Port, parse_tree
from uav_bt.tree.loading.findings import WHOLE_FILE, Finding, Position
from uav_bt.tree.loading.loader import check_file, findings_of
from uav_bt.tree.loading.parameters import Parameters
from uav_bt.types import MarkFix

CASES = cases("findings")
RED = Key("red_share", float, "share of red in the picture", writer="RedDetector")


def _is_place(text: str) -> None:
    if text.strip() not in {"door", "window"}:
        raise ValueError(f"expected door or window, got '{text}'")


class RedDetector(Leaf):
    """Writes the share of red."""

    writes = (RED,)


class Fly(Leaf):
    """Moves."""

    moves = True
    ports = (Port("speed_mps", float, default=1.0, most=20, doc="m/s"),)
    writes = (PHASE,)


class Tilt(Leaf):
    """Points the camera."""

    points = True


class Visit(Leaf):
    """Flies to a place."""

    moves = True
    ports = (Port("to", str, check=_is_place, doc="door or window"),)


class Steer(Leaf):
    """Asks a policy."""

    moves = True
    ports = (Port("policy", str, doc="name"),)
    reads = (ODOMETRY,)


class FindPad(Leaf):
    """Finds the pad."""

    ports = (Port("pad", MarkFix, doc="the pad", direction="output"),)
    reads = (MARK, HEIGHT)


class Measure(Leaf):
    """Measures."""

    ports = (
        Port("height_m", float, doc="height, m", direction="output"),
        Port("count", int, doc="how many", direction="output"),
        Port("sure", bool, doc="is it", direction="output"),
        Port("word", str, doc="what", direction="output"),
        Port("thing", object, doc="whatever", direction="output"),
    )


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


class Need(Leaf):
    """Needs a height."""

    ports = (Port("height_m", float, doc="height, m"),)


REGISTRY = NodeRegistry(
    [RedDetector, Fly, Tilt, Steer, Say, Visit, FindPad, Measure, Use, Need],
)


def errors(case: dict[str, Any]) -> list[str]:
    text = document(case["body"], *case.get("trees", ()))
    if "load" not in case:
        given = Parameters(variables=case["given"]) if "given" in case else None
        return [one.message for one in check(text, REGISTRY, parameters=given)]
    try:
        parse_tree(text, REGISTRY, path="m.xml")
    except TreeError as error:
        return list(error.findings)
    return []


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, id=f"{about}-{number}")
        for about, cases in CASES.items()
        for number, case in enumerate(cases)
    ],
)
def test_a_tree_is_good_or_its_errors_are_told(case: dict[str, Any]) -> None:
    found, wanted = errors(case), case.get("errors", [])
    assert len(found) == len(wanted), found
    for message, words in zip(found, wanted, strict=True):
        assert words in message


def test_an_entry_from_outside_is_checked() -> None:
    inner = subtree("Inner", '<Visit to="{at}"/>')
    text = document('<SubTree ID="Inner" at="door"/>', inner)
    for place, good in (("window", True), ("wndow", False)):
        given = Parameters(ports={"Inner.at": place})
        found = check(text, REGISTRY, parameters=given)
        assert (found == ()) is good


def test_a_part_is_refused_for_what_fails_in_every_mission() -> None:
    reads = '<ScriptCondition code="v &gt; 1 &amp;&amp; @red_share &gt; 1"/>'
    body = f"<Sequence>{reads}<Parallel><Fly/><Fly/></Parallel></Sequence>"
    text = f'<root BTCPP_format="4"><BehaviorTree ID="Part">{body}</BehaviorTree></root>'
    (found,) = check(text, REGISTRY)
    assert "may ask for a movement in the same tick" in found.message


# --- findings without a place in the file ---------------------------------------------------------


def test_a_file_that_is_not_there_is_a_finding_about_the_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "absent.xml"
    assert check_file(path) == (Finding(str(path), WHOLE_FILE, "no such file"),)
    assert str(check_file(path)[0]) == f"{path}: no such file"


def test_other_errors_become_findings_too() -> None:
    path = Path("m.xml")
    assert findings_of(FileError("x.yaml", "broken", 7), path) == (
        Finding("x.yaml", Position(7, 1), "broken"),
    )
    assert findings_of(InputError("two packages"), path) == (
        Finding("m.xml", WHOLE_FILE, "two packages"),
    )
