"""A file that check calls good can be flown: values, keys, policies and movers of a whole tree."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from behaviours.fly.say import Say
from tests.worlds.trees import check, document, subtree
from uav_bt.board import ODOMETRY, PHASE
from uav_bt.board.blackboard import Key
from uav_bt.tree import Leaf, NodeRegistry, Port, Status
from uav_bt.tree.loading.findings import WARNING
from uav_bt.tree.loading.parameters import Parameters

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


def _is_place(text: str) -> None:
    if text.strip() not in {"door", "window"}:
        raise ValueError(f"expected door or window, got '{text}'")


class Visit(Leaf):
    """Flies to a place."""

    moves = True
    ports = (Port("to", str, check=_is_place, doc="door or window"),)

    def update(self) -> Status:
        return Status.RUNNING


class Steer(Leaf):
    """Asks a policy."""

    moves = True
    ports = (Port("policy", str, doc="name"),)
    reads = (ODOMETRY,)

    def update(self) -> Status:
        return Status.RUNNING


REGISTRY = NodeRegistry([RedDetector, Fly, Tilt, Steer, Say, Visit])


def findings(
    body: str, inner: str = "<AlwaysSuccess/>", given: Mapping[str, float] | None = None
) -> list[str]:
    """Return the messages on a mission; warnings begin with `warning:`."""
    text = document(body, subtree("Inner", inner))
    found = check(text, REGISTRY, parameters=Parameters(variables=given) if given else None)
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
    assert f"nothing sets variable '{name}' of tree" in message
    assert "warning" not in message


@pytest.mark.parametrize(
    "body",
    [
        '<LoopString queue="{points}" value="{p}"><AlwaysSuccess/></LoopString>',
        '<SetBlackboard value="{points}" output_key="p"/>',
        '<ScriptCondition code="@elapsed_s &gt; 9 ? points : false"/>',
    ],
)
def test_a_variable_that_nothing_sets_is_refused_where_it_is_not_always_read(body: str) -> None:
    (message,) = findings(body)
    assert "nothing sets variable 'points'" in message
    assert "--var points=VALUE" in message


def test_a_script_that_asks_whether_a_variable_is_known_may_read_it() -> None:
    assert findings('<ScriptCondition code="known(v) ? v == 1 : false"/>') == []


# --- the order of writes and reads ----------------------------------------------------------------

SET = '<Script code="v := 2"/>'
READ = '<Fly speed_mps="{v}"/>'
UNSET = '<UnsetBlackboard key="v"/>'
LATER = '<ScriptCondition code="@elapsed_s &gt; 1"/>'
TIMED = f'<Timeout msec="900">{SET}</Timeout>'
TWICE = '<Repeat num_cycles="2">{}</Repeat>'
LOOP = '<LoopDouble queue="1;2" value="{{v}}">{}</LoopDouble>'
EARLY = "variable 'v' may have no value here"


@pytest.mark.parametrize(
    "body",
    [
        f"<Sequence>{READ}{SET}</Sequence>",
        f"<Fallback>{SET}{READ}</Fallback>".replace(
            "<Script", '<Script _failureIf="@elapsed_s&gt;1"'
        ),
        f"<Sequence><Fallback>{LATER}{SET}</Fallback>{READ}</Sequence>",
        f'<Sequence><Script code="v := 2" _skipIf="@elapsed_s &gt; 1"/>{READ}</Sequence>',
        f"<Sequence><ForceSuccess>{TIMED}</ForceSuccess>{READ}</Sequence>",
        f"<Sequence>{SET}{UNSET}{READ}</Sequence>",
        f"<Sequence>{SET}{TWICE.format(f'<Sequence>{READ}{UNSET}</Sequence>')}</Sequence>",
        f"<Sequence>{LOOP.format('<AlwaysSuccess/>')}{READ}</Sequence>",
        f'<Sequence><SubTree ID="Inner" v="{{v}}"/>{READ}</Sequence>',
        f'<Switch2 variable="a" case_1="a" case_2="b">{SET}{READ}<AlwaysSuccess/></Switch2>',
    ],
)
def test_a_read_before_the_write_is_refused(body: str) -> None:
    inner = f'<Fallback><ScriptCondition code="@elapsed_s &gt; 1"/>{SET}</Fallback>'
    found = findings(body, inner if "Sub" in body else "<AlwaysSuccess/>")
    assert len(found) == 1
    assert EARLY in found[0]


@pytest.mark.parametrize(
    "body",
    [
        f"<ReactiveSequence>{SET}<Sequence>{READ}</Sequence></ReactiveSequence>",
        f"<Sequence>{TIMED}{READ}</Sequence>",
        f"<Sequence><Parallel>{SET}<Tilt/></Parallel>{READ}</Sequence>",
        f"<Fallback><Inverter>{SET}</Inverter>{READ}</Fallback>",
        f'<IfThenElse><ScriptCondition code="v := 1; true"/>{READ}{READ}</IfThenElse>',
        f'<Sequence><AlwaysSuccess _onSuccess="v := 2"/>{READ}</Sequence>',
        LOOP.format(READ),
        f'<Sequence><SubTree ID="Inner" v="{{v}}"/>{READ}</Sequence>',
        f'<Sequence><SubTree ID="Inner" _autoremap="true"/>{READ}</Sequence>',
        '<Sequence><Script code="v := 2; w := v + 1"/><Fly speed_mps="{w}"/></Sequence>',
    ],
)
def test_a_read_after_the_write_is_good(body: str) -> None:
    assert findings(body, SET if "Sub" in body else "<AlwaysSuccess/>") == []


# --- values of the wrong type ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("code", "reader", "message"),
    [
        ("v := 'fast'", READ, "takes float, but variable 'v' may hold 'fast', from Script"),
        ("v := 1", "<Script code=\"v := 'a'\"/>", "keeps the type of its first value"),
        ("v := 'a'", '<Script code="v := 1"/>', "keeps the type of its first value"),
        ("v := 'a'", '<ScriptCondition code="v &gt; 1"/>', "needs a number, but 'v'"),
        ("v := '7'", '<Script code="w := 2 * v"/>', "needs a number, but 'v'"),
        ("v := 5", '<LoopInt queue="{v}"><AlwaysSuccess/></LoopInt>', "variable 'v' holds 5"),
    ],
)
def test_a_value_that_the_reader_cannot_use_is_refused(
    code: str, reader: str, message: str
) -> None:
    first = '<Script code="v := 1"/>' if reader == READ else ""  # one of two values is enough
    found = findings(f'<Sequence>{first}<Script code="{code}"/>{reader}</Sequence>')
    assert found
    assert any(message in one for one in found), found


@pytest.mark.parametrize(
    "body",
    [
        '<Sequence><Script code="v := \'1.5\'"/><Fly speed_mps="{v}"/></Sequence>',
        "<Sequence><Script code=\"v := 'a'\"/><ScriptCondition code=\"v == 'b'\"/></Sequence>",
        '<Sequence><Script code="v := \'1;2\'"/><LoopInt queue="{v}"><Fly/></LoopInt></Sequence>',
        '<Sequence><Script code="v := \'7\'"/><ScriptCondition code="v == 7"/></Sequence>',
        "<Sequence><Script code=\"v := 'a'\"/><Script code=\"v += 'b'\"/></Sequence>",
        '<Sequence><Script code="v := 2; v := v / 2; v += 1"/><Fly speed_mps="{v}"/></Sequence>',
    ],
)
def test_a_value_that_the_reader_converts_is_good(body: str) -> None:
    assert findings(body) == []


# --- board keys -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "body",
    [
        '<ScriptCondition code="@red_share &gt; 0.5"/>',
        '<Fly _while="@red_share &gt; 0.5"/>',
        '<SubTree ID="Inner" share="{@red_share}"/>',
        '<ScriptCondition code="@elapsed_s &gt; 1 ? @red_share == 1 : true"/>',
        '<Fly speed_mps="{@red_share}"/>',
    ],
)
def test_a_script_on_a_key_that_no_leaf_of_the_tree_writes_is_refused(body: str) -> None:
    inner = '<ScriptCondition code="share &gt; 0.5"/>' if "Sub" in body else "<Fly/>"
    (message,) = findings(body, inner)
    assert "no leaf of the tree writes board key 'red_share'" in message
    assert findings(f"<Sequence><RedDetector/>{body}</Sequence>", inner) == []


def test_a_script_that_asks_whether_a_key_is_known_may_read_it() -> None:
    assert (
        findings('<ScriptCondition code="known(@red_share) &amp;&amp; @red_share &gt; 1"/>') == []
    )
    (message,) = findings('<ScriptCondition code="known(@read_share)"/>')
    assert "the board has no key 'read_share'; did you mean 'red_share'?" in message


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ('<LoopDouble queue="{@odometry}"><AlwaysSuccess/></LoopDouble>', "holds MotionEstimate"),
        ('<LoopDouble queue="{@elapsed_s}"><AlwaysSuccess/></LoopDouble>', "holds float"),
        ('<LoopInt queue="{@phase}"><AlwaysSuccess/></LoopInt>', "may be no queue of int"),
        ('<ScriptCondition code="@phase == 1"/>', "needs a number, but '@phase' may hold str"),
        ('<AlwaysSuccess _skipIf="@odometry == 1"/>', "holds MotionEstimate, no number and no"),
    ],
)
def test_a_loop_or_script_on_a_key_of_another_type_is_refused(body: str, message: str) -> None:
    (found,) = findings(f'<Sequence><Steer policy="a"/><Fly/>{body}</Sequence>')
    assert message in found


def test_names_in_the_text_of_a_message_are_checked_as_in_scripts() -> None:
    script = '<Script code="n := 1"/>'
    good = '<Say text="{n} of {n}: {@elapsed_s} s"/>'
    assert findings(f"<Sequence>{script}{good}</Sequence>") == []
    for text, why in (
        ("{m} of {n}", "nothing sets variable 'm' of tree 'Main'"),
        ("{n}: {@red_share}", "no leaf of the tree writes board key 'red_share'"),
        ("{n}: {@blue_share}", "the board has no key 'blue_share'"),
        ("{n}: {@site_map}", "board key 'site_map' holds SiteMap, no number and no text"),
        ("{n", "'{' belongs to no placeholder"),
    ):
        (message,) = findings(f'<Sequence>{script}<Say text="{text}"/></Sequence>')
        assert why in message, text


# --- texts that a leaf refuses --------------------------------------------------------------------

VISITS = '<LoopString queue="{queue}" value="{{p}}">{visit}</LoopString>'


def test_a_place_in_a_queue_is_checked() -> None:
    visit = '<Visit to="{p}"/>'
    assert findings(VISITS.format(queue="door;window", visit=visit)) == []
    (message,) = findings(VISITS.format(queue="door;wndow;", visit=visit))
    assert "variable 'p' may hold 'wndow'" in message
    assert message.endswith("expected door or window, got 'wndow'")


def test_an_entry_from_outside_is_checked() -> None:
    inner = subtree("Inner", '<Visit to="{at}"/>')
    text = document('<SubTree ID="Inner" at="door"/>', inner)
    for place, good in (("window", True), ("wndow", False)):
        given = Parameters(ports={"Inner.at": place})
        found = check(text, REGISTRY, parameters=given)
        assert (found == ()) is good


@pytest.mark.parametrize(
    "visit",
    [
        "<Fly speed_mps=\"{p}\" _skipIf=\"p == 'door' || p == 'photo'\"/>",
        '<Visit to="{p}" _skipIf="p == \'photo\'"/>',
        (
            '<Switch2 variable="{p}" case_1="photo" case_2="rest">'
            '<Tilt/><Tilt/><Visit to="{p}"/></Switch2>'
        ),
    ],
)
def test_an_element_that_the_tree_asks_for_first_is_no_fault(visit: str) -> None:
    assert findings(VISITS.format(queue="door;photo", visit=visit)) == []


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
    assert message.startswith(f"'one' and 'two' may ask for {what} in the same tick")


@pytest.mark.parametrize(
    "children",
    [
        '<Fly/><Delay delay_msec="900"><Fly/></Delay>',
        '<Fly/><Fly _skipIf="@elapsed_s &lt; 9"/>',
        '<Fly/><Sequence><ScriptCondition code="@elapsed_s &gt; 9"/><Fly/></Sequence>',
    ],
)
def test_leaves_that_may_move_later_are_refused(children: str) -> None:
    (message,) = findings(f"<Parallel>{children}</Parallel>")
    assert "'Fly' and 'Fly' may ask for a movement in the same tick" in message


@pytest.mark.parametrize(
    "children",
    ["<Fly/><Tilt/>", '<Fly/><Fly _skipIf="true"/>', "<Sequence><Fly/><Fly/></Sequence>"],
)
def test_leaves_that_never_ask_for_the_same_thing_at_once_are_good(children: str) -> None:
    assert findings(f"<Parallel>{children}<AlwaysSuccess/></Parallel>") == []


def test_a_condition_of_a_choice_that_may_be_skipped_is_refused() -> None:
    body = '<IfThenElse><AlwaysSuccess _skipIf="@elapsed_s &gt; 9"/><Fly/></IfThenElse>'
    (message,) = findings(body)
    assert "the condition of IfThenElse must not be skipped" in message


# --- policies -------------------------------------------------------------------------------------


def test_a_policy_that_a_variable_names_is_refused() -> None:
    body = "<Sequence><Script code=\"rule := 'a'\"/>{}</Sequence>"
    (message,) = findings(body.format('<Steer policy="{rule}"/>'))
    assert "its value is needed before the take-off, when {rule} has none" in message
    inner = '<Steer policy="{policy}"/>'
    assert findings(body.format('<SubTree ID="Inner" policy="a"/>'), inner) == []


# --- parts of missions ----------------------------------------------------------------------------


def test_a_part_is_refused_for_what_fails_in_every_mission() -> None:
    reads = '<ScriptCondition code="v &gt; 1 &amp;&amp; @red_share &gt; 1"/>'
    body = f"<Sequence>{reads}<Parallel><Fly/><Fly/></Parallel></Sequence>"
    text = f'<root BTCPP_format="4"><BehaviorTree ID="Part">{body}</BehaviorTree></root>'
    (found,) = check(text, REGISTRY)
    assert "may ask for a movement in the same tick" in found.message
