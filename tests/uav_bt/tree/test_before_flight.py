"""A file that check calls good can be flown: values, keys, policies and movers of a whole tree."""

from __future__ import annotations

from pathlib import Path

import pytest

from behaviours.fly.say import Say
from uav_bt.board import ODOMETRY, PHASE
from uav_bt.board.blackboard import Key
from uav_bt.tree import Leaf, NodeRegistry, Port, Status
from uav_bt.tree.loading.findings import WARNING
from uav_bt.tree.loading.loader import check_text

RED = Key("red_share", float, "share of red in the picture", writer="RedDetector")


class RedDetector(Leaf):
    """Writes the share of red."""

    writes = (RED,)

    def update(self) -> Status:
        return Status.SUCCESS


class Fly(Leaf):
    """Moves."""

    moves = True
    ports = (Port("speed_mps", float, default=1.0, doc="m/s"),)
    writes = (PHASE,)

    def update(self) -> Status:
        return Status.RUNNING


class Tilt(Leaf):
    """Points the camera."""

    points = True

    def update(self) -> Status:
        return Status.RUNNING


class Steer(Leaf):
    """Asks a policy."""

    moves = True
    ports = (Port("policy", str, doc="name"),)
    reads = (ODOMETRY,)

    def update(self) -> Status:
        return Status.RUNNING


REGISTRY = NodeRegistry([RedDetector, Fly, Tilt, Steer, Say])


def findings(body: str, inner: str = "<AlwaysSuccess/>", main: str = "Main") -> list[str]:
    """Return the messages on a mission; warnings begin with `warning:`."""
    text = (
        f'<root BTCPP_format="4" main_tree_to_execute="{main}"><BehaviorTree ID="Main">{body}'
        f'</BehaviorTree><BehaviorTree ID="Inner">{inner}</BehaviorTree></root>'
    )
    found = check_text(text, REGISTRY, path=Path("m.xml"))
    return ["warning: " * (one.severity == WARNING) + one.message for one in found]


# --- variables ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("body", "name"),
    [
        ('<ScriptCondition code="nobody &gt;= 2"/>', "nobody"),
        ('<Fly speed_mps="{nobody}"/>', "nobody"),
        ('<SubTree ID="Inner" speed="{outer}"/>', "outer"),
    ],
)
def test_a_variable_of_the_mission_that_nothing_sets_is_refused(body: str, name: str) -> None:
    (message,) = findings(body, inner='<Fly speed_mps="{speed}"/>' if "Sub" in body else "<Fly/>")
    assert f"nothing sets variable '{name}' of the main tree" in message
    assert "warning" not in message


def test_a_variable_whose_absence_may_be_harmless_is_a_warning() -> None:
    body = '<LoopString queue="{points}" value="{p}"><AlwaysSuccess/></LoopString>'
    (message,) = findings(body)
    assert message.startswith("warning: attribute 'queue': nothing sets variable 'points'")


def test_a_variable_that_a_script_sets_is_good() -> None:
    body = '<Sequence><Script code="v := 2"/><Fly speed_mps="{v}"/></Sequence>'
    assert findings(body, inner='<Fly speed_mps="{v}"/>') == []


# --- board keys -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "body",
    [
        '<ScriptCondition code="@red_share &gt; 0.5"/>',
        '<Fly _while="@red_share &gt; 0.5"/>',
        '<SubTree ID="Inner" share="{@red_share}"/>',
    ],
)
def test_a_script_on_a_key_that_no_leaf_of_the_tree_writes_is_refused(body: str) -> None:
    inner = '<ScriptCondition code="share &gt; 0.5"/>' if "Sub" in body else "<Fly/>"
    (message,) = findings(body, inner)
    assert "no leaf of the tree writes board key 'red_share'" in message
    assert findings(f"<Sequence><RedDetector/>{body}</Sequence>", inner) == []


def test_keys_of_the_runner_and_of_leaves_may_be_read() -> None:
    code = "@elapsed_s &gt; 1 &amp;&amp; @height_above_carpet_m &gt; 1"
    assert findings(f'<Sequence><ScriptCondition code="{code}"/></Sequence>') == []
    (message,) = findings('<Sequence><ScriptCondition code="@phase == 1"/></Sequence>')
    assert "board key 'phase'" in message
    assert findings('<Sequence><Fly/><ScriptCondition code="@phase == 1"/></Sequence>') == []


def test_names_in_the_text_of_a_message_are_checked_as_in_scripts() -> None:
    script = '<Script code="n := 1"/>'
    good = '<Say text="{n} of {n}: {@elapsed_s} s"/>'
    assert findings(f"<Sequence>{script}{good}</Sequence>") == []
    for text, why in (
        ("{m} of {n}", "nothing sets variable 'm' of the main tree"),
        ("{n}: {@red_share}", "no leaf of the tree writes board key 'red_share'"),
        ("{n}: {@blue_share}", "the board has no key 'blue_share'"),
        ("{n}: {@site_map}", "board key 'site_map' holds SiteMap, no number and no text"),
        ("{n", "'{' belongs to no placeholder"),
    ):
        (message,) = findings(f'<Sequence>{script}<Say text="{text}"/></Sequence>')
        assert why in message, text


# --- movers ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("parallel", ["Parallel", "ParallelAll"])
@pytest.mark.parametrize(
    ("second", "what"),
    [("Fly", "a movement"), ("Tilt", "a camera direction")],
)
def test_two_leaves_that_ask_for_the_same_thing_at_once_are_refused(
    parallel: str, second: str, what: str
) -> None:
    one = f'<Sequence><{second} name="one"/></Sequence>'
    two = f'<Timeout msec="900"><{second} name="two"/></Timeout>'
    (message,) = findings(f"<{parallel}>{one}<AlwaysSuccess/>{two}</{parallel}>")
    assert message.startswith(f"'one' and 'two' ask for {what} in the same tick")


@pytest.mark.parametrize(
    "children",
    [
        "<Fly/><Tilt/>",
        '<Fly/><Delay delay_msec="900"><Fly/></Delay>',
        '<Fly/><Fly _skipIf="@elapsed_s &lt; 9"/>',
        '<Fly/><Sequence><ScriptCondition code="@elapsed_s &gt; 9"/><Fly/></Sequence>',
    ],
)
def test_leaves_that_may_take_turns_are_good(children: str) -> None:
    assert findings(f"<Parallel>{children}</Parallel>") == []


# --- policies -------------------------------------------------------------------------------------


def test_a_policy_that_a_variable_names_is_refused() -> None:
    body = "<Sequence><Script code=\"rule := 'a'\"/>{}</Sequence>"
    (message,) = findings(body.format('<Steer policy="{rule}"/>'))
    assert "the policy is made before the take-off, when {rule} has no value" in message
    inner = '<Steer policy="{policy}"/>'
    assert findings(body.format('<SubTree ID="Inner" policy="a"/>'), inner) == []
