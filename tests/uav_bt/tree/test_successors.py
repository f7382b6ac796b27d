"""Messages about nodes, ports and board keys of earlier versions name their successors."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.worlds.trees import document
from uav_bt.board import ELAPSED
from uav_bt.board.blackboard import Blackboard, Key
from uav_bt.clock import ManualClock
from uav_bt.errors import BoardAccessError, InputError, TreeError
from uav_bt.tree import Leaf, NodeRegistry, Port, Status, parse_tree
from uav_bt.tree.dry_run.script_file import read_script, scripted_tree
from uav_bt.tree.loading.loader import check_text

HEADING = Key("heading_rad", float, "heading", unit="rad", formerly=("yaw",))


class Answers(Leaf):
    """Succeeds."""

    def update(self) -> Status:
        return Status.SUCCESS


class TrackMotion(Answers):
    """Follows the motion."""

    formerly = ("Remember",)
    reads = (HEADING,)
    ports = (Port("turn_rad", float, default=0.0, formerly=("yaw_rad",)),)


class MapSite(Answers):
    """Keeps the map."""

    formerly = ("Remember", "Survey")


class MapMore(MapSite):
    """A user's leaf."""


REGISTRY = NodeRegistry([TrackMotion, MapSite, MapMore])


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("<Remember/>", "unknown node 'Remember'; it was replaced by TrackMotion and MapSite"),
        ("<Survey/>", "unknown node 'Survey'; it was replaced by MapSite"),
        (
            '<TrackMotion yaw_rad="0.5"/>',
            "unknown attribute 'yaw_rad'; it was replaced by turn_rad",
        ),
        (
            '<TrackMotion turn_rad="{@yaw}"/>',
            "the board has no key 'yaw'; it was replaced by heading_rad",
        ),
        (
            '<ScriptCondition code="@yaw &gt; 1"/>',
            "the board has no key 'yaw'; it was replaced by heading_rad",
        ),
    ],
)
def test_a_file_is_refused_with_the_successors(body: str, expected: str) -> None:
    (finding,) = check_text(document(body), REGISTRY, path=Path("m.xml"))
    assert finding.message.endswith(expected)


def test_a_name_that_is_still_there_is_used() -> None:
    class Survey(Answers):
        """A former leaf that a user's package still has."""

    registry = REGISTRY.with_nodes(Survey)
    assert check_text(document("<Survey/>"), registry, path=Path("m.xml")) == ()


def test_mocks_and_dry_runs_say_the_same(tmp_path: Path) -> None:
    expected = "'Remember'.*; it was replaced by TrackMotion and MapSite"
    with pytest.raises(TreeError, match=expected.replace("'", ".")):
        parse_tree(document("<MapSite/>"), REGISTRY, mocks={"Remember": "S"})
    tree, script = tmp_path / "m.xml", tmp_path / "s.yaml"
    tree.write_text(document("<MapSite/>"), encoding="utf-8")
    script.write_text("leaves: {Remember: S}\n", encoding="utf-8")
    with pytest.raises(InputError, match=expected):
        scripted_tree(tree, read_script(script), REGISTRY)


def test_lookups_from_python_say_the_same() -> None:
    with pytest.raises(InputError, match="it was replaced by MapSite"):
        REGISTRY["Survey"]
    board = Blackboard(ManualClock(), [ELAPSED, HEADING])
    with pytest.raises(BoardAccessError, match="'yaw'; it was replaced by heading_rad"):
        board.key("yaw")
