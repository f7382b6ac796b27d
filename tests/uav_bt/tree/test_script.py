"""The scripting language: its results and its errors."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_bt.board import HEIGHT
from uav_bt.board.blackboard import Blackboard, Key
from uav_bt.clock import ManualClock
from uav_bt.errors import UnknownValueError
from uav_bt.tree.script import Environment, ScriptError, parse_question, parse_script
from uav_bt.tree.variables import Variables


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


@pytest.mark.parametrize(
    ("source", "value"),
    [
        ("1", 1),
        ("0x1F", 31),
        ("'a b'", "a b"),
        ('"it\'s"', "it's"),
        ("true", 1.0),
        ("1 + 2 * 3", 7.0),
        ("(1 + 2) * 3", 9.0),
        ("8 / 2 / 2", 2.0),
        ("-2 * -3", 6.0),
        ("3 / 2", 1.5),
        ("6 & 3 | 8", 10.0),
        ("6 ^ 3", 5.0),
        ("~0", -1.0),
        ("!0 && !(1 == 2)", 1.0),
        ("1 < 2 <= 2 != 3", 1.0),
        ("true || false && false", 1.0),
        ("1 + 1 == 2 && 'a' < 'b'", 1.0),
        ("0.1 + 0.2 == 0.3", 1.0),
        ("'3' == 3", 1.0),
        ("'x' + 'y'", "xy"),
        ("'n' .. 1", "n1"),
        ("2 > 1 ? 'yes' : 'no'", "yes"),
        ("0 ? 1 : 0 ? 2 : 3", 3),
        ("'' ? 1 : 2", 2),
        ("'false' ? 60 : 1", 1),
        ("!'true'", 0.0),
        ("'false' || 'False'", 0.0),
        ("1; 2; 3", 3),
        ("1 +\n 2", 3.0),
    ],
)
def test_expressions(source: str, value: object) -> None:
    """Precedence, chains, texts and numbers give the same values as in the engine."""
    assert run(source) == value


@pytest.mark.parametrize(
    ("source", "before", "result"),
    [
        ("x := 3", {}, {"x": 3}),
        ("x = 4", {"x": 1}, {"x": 4}),
        ("x = 4.0", {"x": 1}, {"x": 4}),
        ("x = 4", {"x": 1.5}, {"x": 4.0}),
        ("x = '4'", {"x": 1}, {"x": 4}),
        ("x += 2; x -= 1; x *= 6; x /= 3", {"x": 1}, {"x": 4}),
        ("x += 'b'", {"x": "a"}, {"x": "ab"}),
        ("x := y := 2", {}, {"x": 2, "y": 2}),
        ("x = x > 1 ? 0 : x + 1", {"x": 1}, {"x": 2}),
        ("on = 1 == 1", {"on": False}, {"on": True}),
    ],
)
def test_assignments(source: str, before: dict[str, object], result: dict[str, object]) -> None:
    changed = after(source, **before)
    assert changed == result
    assert [type(value) for value in changed.values()] == [type(v) for v in result.values()]


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("1 +", "column 4: expected a value, got the end"),
        ("1 ? 2", "column 6: expected ':'"),
        ("1 = 2", "column 1: only a variable can stand left of '='"),
        ("'open", "column 1: unexpected '''"),
        ("3x", "column 1: unexpected '3x'"),
        ("state.battery", r"column 6: unexpected '\.'; a script reads whole values, no members"),
        ("@state.battery", r"column 7: unexpected '\.'; a script reads whole values, no members"),
        ("x := [1]", r"unexpected '\['"),
        ("(" * 50 + "1" + ")" * 50, "nested deeper than 40"),
        ("+".join(["1"] * 300), "more than 200 operators"),
        ("1" * 5000, "longer than 4000"),
        ("known()", r"column 7: expected a variable or an @key, got '\)'"),
    ],
)
def test_refused_scripts(source: str, message: str) -> None:
    with pytest.raises(ScriptError, match=message):
        parse_script(source)


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("cout + 1", "'cout' has no value; did you mean 'count'"),
        ("cout += 1", "there is no variable 'cout'; make a new one with ':='"),
        ("1 / 0", "division by zero"),
        ("count = 1.5", "'count': the variable holds an integer, got 1.5"),
        ("word = 1", "the variable holds a text"),
        ("word + 1", r"'\+' cannot be applied to a text and a number"),
        ("-word", "'-' cannot be applied to a text"),
        ("1 .. 2", r"'\.\.' cannot be applied to numbers"),
        ("2 && 1", "expected true or false"),
        ("1.5 & 1", "expected an integer"),
        ("thing + 1", "'thing' is a list"),
        ("thing = 1", "the variable holds list"),
        ("1e308 * 10 - 1e308 * 10 && 1", "expected true or false"),
        ("@height", "there is no mission board"),
        ("@height = 2", "'@height' is a board key; leaves write those, scripts only read"),
        ("9" * 400 + " + 1", "int too large"),
        ("false && missing", "'missing' has no value"),  # both sides are evaluated
        ("long += long", "longer than 100000"),
        ("!word", "expected a number, got 'w'"),  # no text that spells a truth value
        ("word ? 60 : 1", "expected a number, got 'w'"),
    ],
)
def test_failing_scripts(source: str, message: str) -> None:
    with pytest.raises(ScriptError, match=message):
        run(source, count=1, word="w", thing=[1], long="x" * 60_000)


def test_enumerations_come_before_variables() -> None:
    scope = _scope({"RED": 7})
    scope.enum_members["RED"] = 2
    assert parse_script("RED + 1").run(Environment(scope)) == 3.0


@pytest.mark.parametrize(
    ("code", "unknown", "known"),
    [
        ("known(@share)", 0.0, 1.0),
        ("known(@share) && @share > 0.5", 0.0, 1.0),
        ("@share > 0.5 && known(@share)", 0.0, 1.0),
        ("!known(@share) || @share < 0.5", 1.0, 0.0),
        ("known(@share) ? @share : 7", 7.0, 0.75),
        ("known(v)", 0.0, 0.0),
        ("v := 1; known(v)", 1.0, 1.0),
        ("known := 2; known + 1", 3.0, 3.0),
    ],
)
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


def test_the_texts_of_a_tree_cannot_fill_the_memory_together() -> None:
    outer = Variables()
    inner = Environment(Variables(outer))
    for number in range(20):
        inner.write(f"v{number}", "x" * 100_000)
    with pytest.raises(ScriptError, match="'more': the tree's texts grow longer than 2000000"):
        Environment(outer).write("more", "x")
    inner.write("v0", "y" * 100_000)
    inner.write("v0", "short")
    Environment(outer).write("more", "x" * 90_000)
    assert outer.characters == 1_990_005
    del outer["more"]
    assert outer.characters == 1_900_005


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
