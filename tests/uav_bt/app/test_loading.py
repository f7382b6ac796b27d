"""A mission that would fail in the air is refused before it flies."""

from __future__ import annotations

import pytest

from uav_bt.app.loading import load_mission
from uav_bt.app.options import FlightOptions
from uav_bt.errors import InputError
from uav_bt.tree import parse_tree


def mission(body: str) -> str:
    """Return a tree file's text, which does not name its main tree."""
    return f'<root BTCPP_format="4"><BehaviorTree ID="M">{body}</BehaviorTree></root>'


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ('<HoverFor seconds="{t}"/>', "nothing sets variable 't' of tree 'M'"),
        ('<ScriptCondition code="t &gt; 1"/>', "nothing sets variable 't' of tree 'M'"),
        ('<ScriptCondition code="@flight_height_m &gt; 1"/>', "board key 'flight_height_m'"),
        ('<Parallel><HoverFor/><Turn degrees="90"/></Parallel>', "ask for a movement in the same"),
        ("<Parallel><PointCamera/><PointCamera/></Parallel>", "ask for a camera direction in the"),
        ('<Explore policy="{rule}"/>', "the policy is made before the take-off"),
    ],
)
def test_what_fails_in_the_air_is_refused_on_the_ground(body: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_mission(mission(f"<Sequence>{body}<Land/></Sequence>"), FlightOptions())


def test_python_may_set_the_variables_of_a_tree() -> None:
    tree = parse_tree(mission('<HoverFor seconds="{t}"/>'))
    tree.variables["t"] = 2.0
    assert load_mission(tree, FlightOptions()) is tree
