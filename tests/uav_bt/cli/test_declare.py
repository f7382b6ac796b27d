"""Commands made of functions: arguments, options, bounds, groups and their parts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
from annotated_types import Ge, Gt, Le
from click.testing import CliRunner

from uav_bt.cli.declare import command
from uav_bt.errors import InputError
from uav_bt.option import Option, pairs

SEEN: list[dict[str, Any]] = []
NONE: Mapping[str, str] = {}


def _values(texts: tuple[str, ...]) -> dict[str, str]:
    return pairs(texts, "name", "NAME=VALUE")


@dataclass(frozen=True, kw_only=True)
class Size:
    width: Annotated[int, Ge(1), Le(9), Option("Width.", "", "Size")] = 3
    height: Annotated[int, Option("For Python only.")] = 2


@command(sections=("Size",))
def example(
    name: str,
    files: Annotated[tuple[Path, ...], Option(form="[FILE]...")] = (),
    *,
    size: Annotated[Size, Option(parts=Size, only=("width",), defaults={"width": 4})],
    share: Annotated[float | None, Gt(0), Option("Share.", "--part SHARE")] = None,
    form: Literal["a", "b"] = "a",
    on: bool = True,
    values: Annotated[Mapping[str, str], Option("Values.", read=_values)] = NONE,
    where: Annotated[str | None, Option("Where.", "[WHERE]", alone="here")] = None,
) -> None:
    """Note what was given.

    Options:
        form: Form
            of letters.
        on: Whether it is on.
    """
    SEEN.append(locals())


@pytest.mark.parametrize(
    ("line", "given"),
    [
        ("x", {}),
        ("x f g --width 9", {"files": (Path("f"), Path("g")), "size": Size(width=9)}),
        ("x --part 0.5 --form b --no-on", {"share": 0.5, "form": "b", "on": False}),
        ("x --values a=1 --values b=2", {"values": {"a": "1", "b": "2"}}),
        ("x --where", {"where": "here"}),
        ("x --where there", {"where": "there"}),
    ],
)
def test_a_function_gets_what_the_command_line_says(line: str, given: dict[str, Any]) -> None:
    assert CliRunner().invoke(example, line.split()).exit_code == 0
    defaults = {"name": "x", "files": (), "size": Size(width=4), "share": None}
    defaults |= {"form": "a", "on": True, "values": {}, "where": None}
    assert SEEN.pop() == {**defaults, **given}


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("", "Missing argument 'NAME'"),
        ("x --width 0", "'--width': 0 is not in the range 1<=x<=9"),
        ("x --part 0", "'--part': 0.0 is not in the range x>0"),
        ("x --width 1.5", "'--width': '1.5' is not a valid integer"),
        ("x --part half", "'--part': 'half' is not a valid number"),
        ("x --part nan", "'--part': 'nan' is not a finite number"),
        ("x --form c", "'c' is not one of 'a', 'b'"),
        ("x --height 3", "No such option '--height'"),
        ("x --values a", "'--values': expected NAME=VALUE, got 'a'"),
    ],
)
def test_what_it_does_not_take_is_refused(line: str, words: str) -> None:
    result = CliRunner().invoke(example, line.split())
    assert (result.exit_code, words in result.stderr) == (2, True), result.stderr


def test_the_help_has_sections_and_then_the_other_options() -> None:
    lines = CliRunner().invoke(example, ["--help"]).stdout.splitlines()
    assert [line for line in lines if line.endswith(":")] == ["Size:", "Options:"]
    assert lines[lines.index("Size:") + 1].split()[:3] == ["--width", "INTEGER", "Width."]
    assert [line.split()[2:] for line in lines if "--form" in line] == [["Form", "of", "letters."]]


def test_pairs_have_a_name_and_one_value() -> None:
    assert pairs(["a=b=c"], "name", "") == {"a": "b=c"}
    assert pairs(["a=b=c"], "name", "", last=True) == {"a=b": "c"}
    for texts, words in ((["=c"], "expected NAME=VALUE, got '=c'"), (["a=1", "a=2"], "two values")):
        with pytest.raises(InputError, match=words):
            pairs(texts, "name", "NAME=VALUE")
