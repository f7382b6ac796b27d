"""The scripting language: its results and its errors."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.worlds.tables import cases
from uav_bt.board import HEIGHT
from uav_bt.board.blackboard import Blackboard, Key
from uav_bt.clock import ManualClock
from uav_bt.errors import UnknownValueError
from uav_bt.tree.script.parser import parse_question, parse_script
from uav_bt.tree.script.values import Environment, ScriptError
from uav_bt.tree.variables import Variables

CASES = cases("scripts")


def run(source: str, **variables: object) -> object:
    """Return the value of a script."""
    return parse_script(source).run(Environment(_scope(variables)))


def after(source: str, **variables: object) -> dict[str, object]:
    """Return the variables after a run of a script."""
    scope = _scope(variables)
    parse_script(source).run(Environment(scope))
    return scope.snapshot()


def _scope(variables: dict[str, object]) -> Variables:
    scope = Variables()
    for name, value in variables.items():
        scope[name] = value
    return scope


@pytest.mark.parametrize(("source", "value"), CASES["values"])
def test_expressions(source: str, value: object) -> None:
    """Precedence, chains, texts and numbers give the same values as in the engine."""
    assert run(source) == value


@pytest.mark.parametrize(("source", "before", "result"), CASES["assignments"])
def test_assignments(source: str, before: dict[str, object], result: dict[str, object]) -> None:
    changed = after(source, **before)
    assert changed == result
    assert [type(value) for value in changed.values()] == [type(v) for v in result.values()]


@pytest.mark.parametrize(
    ("source", "message"),
    [
        *CASES["refused"],
        ("+".join(["1"] * 300), "more than 200 operators"),
        ("1" * 5000, "longer than 4000"),
    ],
)
def test_refused_scripts(source: str, message: str) -> None:
    with pytest.raises(ScriptError, match=message):
        parse_script(source)


@pytest.mark.parametrize(
    ("source", "message"), [*CASES["fails"], ("9" * 400 + " + 1", "int too large")]
)
def test_failing_scripts(source: str, message: str) -> None:
    with pytest.raises(ScriptError, match=message):
        run(source, count=1, word="w", thing=[1], long="x" * 60_000)


def test_enumerations_come_before_variables() -> None:
    scope = _scope({"RED": 7})
    scope.enum_members["RED"] = 2
    assert parse_script("RED + 1").run(Environment(scope)) == 3.0


@pytest.mark.parametrize(("code", "unknown", "known"), CASES["known"])
def test_known_asks_for_a_value(code: str, unknown: float, known: float) -> None:
    share = Key("share", float, "of red", max_age_s=1.0)
    clock = ManualClock()
    board = Blackboard(clock, (share,))
    script = parse_script(code)
    assert script.run(Environment(Variables(), board)) == unknown
    board.write(share, 0.75)
    assert script.run(Environment(Variables(), board)) == known
    clock.advance(2.0)  # a stale value is not known
    assert script.run(Environment(Variables(), board)) == unknown


@pytest.mark.parametrize("code", ["@share > 0.5 && true", "false || @share > 0.5", "-@share"])
def test_an_unknown_key_counts_where_it_decides(code: str) -> None:
    board = Blackboard(ManualClock(), (Key("share", float, "of red"),))
    with pytest.raises(UnknownValueError, match="board key 'share' has no value yet"):
        parse_script(code).run(Environment(Variables(), board))


def test_a_key_that_no_leaf_declares_is_not_known() -> None:
    environment = Environment(Variables(), Blackboard(ManualClock(), (HEIGHT,)))
    assert parse_script("known(@share) && @share > 1").run(environment) == 0.0
    with pytest.raises(UnknownValueError, match="unknown board key 'share'"):
        parse_script("@share").run(environment)


@given(st.text(alphabet="ab1.5'\" +-*/()<>=!&|?:;@~^,{}\n\\x", max_size=40))
def test_any_text_is_a_script_or_is_refused(source: str) -> None:
    try:
        run(source, a=1, b="x")
    except ScriptError:
        return


def test_statements_need_no_semicolon_between_them() -> None:
    """The engine accepts this since 4.9; the check of a file warns."""
    variables = Variables()
    script = parse_script("a := 1;; b := 2 c := a + b;")
    assert script.run(Environment(variables)) == 3.0
    assert script.oddities == ("column 17: no ';' before 'c'",)
    assert parse_script("a := 1; b := 2").oddities == ()
    assert parse_script("x := f('os')").oddities == ("column 7: no ';' before '('",)


def test_only_a_script_that_is_asked_needs_content() -> None:
    assert parse_script("").statements == ()
    for empty in ("", " ; "):
        with pytest.raises(ScriptError, match="the script is empty"):
            parse_question(empty)
