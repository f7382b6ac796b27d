"""Files are complete or absent; YAML files are typed values, whose problems have lines."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import pytest
from pydantic import Field

from tests.worlds.tables import cases
from uav_bt.errors import FileError, SceneError, ValueRangeError
from uav_bt.files import did_you_mean_file, reading, whole_file, write_whole
from uav_bt.yaml_file import YamlFile, read_yaml, yaml_text

CASES = cases("yaml_files")


@pytest.mark.parametrize("content", ["größer\n", b"\x00\xff"])
def test_a_whole_file_replaces_the_old_one(tmp_path: Path, content: bytes | str) -> None:
    path = tmp_path / "a.json"
    path.write_text("old")
    write_whole(path, content)
    assert path.read_bytes() == (content.encode() if isinstance(content, str) else content)
    assert list(tmp_path.iterdir()) == [path]


def test_a_break_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text("old")

    def interrupted() -> None:
        with whole_file(path) as partial:
            partial.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_what_cannot_be_written_raises_and_nothing_is_left(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    with pytest.raises(FileError, match="a: cannot be written: Is a directory"):
        write_whole(tmp_path / "a", "new")
    with pytest.raises(FileError, match="cannot be written: No such file") as caught:
        write_whole(tmp_path / "absent" / "a", "new")
    assert caught.value.path == tmp_path / "absent" / "a"
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


@pytest.mark.parametrize(("missing", "hint"), CASES["hints"])
def test_a_missing_file_is_compared_with_others(missing: str, hint: str, tmp_path: Path) -> None:
    (tmp_path / "peek.xml").touch()
    (tmp_path / "runs").mkdir()
    assert did_you_mean_file(tmp_path / missing) == hint


def test_reading_raises_the_error_that_is_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    with pytest.raises(SceneError, match="no such file"), reading(path, SceneError):
        path.read_text()
    path.write_bytes(b"\xff")
    with pytest.raises(FileError, match="cannot be read as UTF-8 text"), reading(path):
        path.read_text(encoding="utf-8")


# --- YAML -----------------------------------------------------------------------------------------

WANTED = "expected a text, a number below 2**63, true or false"


@dataclass(frozen=True, kw_only=True)
class Door:
    name: str
    width_m: Annotated[float, Field(gt=0.0, le=3.0)] = 1.0


@dataclass(frozen=True, kw_only=True)
class Room:
    size_m: tuple[float, float]
    doors: tuple[Door, ...] = ()
    lit: bool = True
    seats: int = 0
    colour: Literal["white", "grey"] | tuple[int, int, int] = "white"
    notes: dict[str, bool | int | float | str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.size_m[0] < self.size_m[1]:
            raise ValueRangeError("the longer side comes first")


def read(tmp_path: Path, text: str) -> YamlFile[Room]:
    path = tmp_path / "room.yaml"
    path.write_text(text, encoding="utf-8")
    return read_yaml(path, Room, "room file")


def problems(tmp_path: Path, text: str) -> list[str]:
    with pytest.raises(FileError) as refused:
        read(tmp_path, text)
    return str(refused.value).replace(f"{tmp_path}/", "").splitlines()


def test_every_kind_of_value_arrives(tmp_path: Path) -> None:
    text = "size_m: [5, 4.5]\ndoors:\n- {name: a}\n- {name: '7', width_m: 2}\nlit: no\n"
    file = read(tmp_path, text + "colour: [1, 2, 3]\nnotes: {a: 1, b: 1.0, c: yes, d: x}")
    assert file.value == Room(
        size_m=(5.0, 4.5),
        doors=(Door(name="a"), Door(name="7", width_m=2.0)),
        lit=False,
        colour=(1, 2, 3),
        notes={"a": 1, "b": 1.0, "c": True, "d": "x"},
    )
    assert [type(value) for value in file.value.notes.values()] == [int, float, bool, str]
    assert isinstance(file.value.size_m[0], float)


@pytest.mark.parametrize(("text", "number"), CASES["numbers"])
def test_numbers_are_those_of_yaml_1_2(tmp_path: Path, text: str, number: float | str) -> None:
    """In YAML 1.1 a leading zero makes an octal number, and a colon minutes."""
    value = read(tmp_path, f"size_m: [5, 4]\nnotes: {{a: {text}}}").value.notes["a"]
    assert (type(value), value) == (type(number), number)


def test_what_is_written_is_read_back_the_same(tmp_path: Path) -> None:
    """YAML 1.1 takes other texts for numbers than YAML 1.2 does."""
    texts = ("1e3", "1E-3", "010", "0o17", "0x1F", "1:30", "1_0", ".5", "off", "null", "~", "")
    values = (*texts, "2026-01-01", ".inf", "=", "<<", 1e-7, 1e22, 7, -0.25, True, None)
    path = tmp_path / "values.yaml"
    path.write_text(yaml_text({"values": [*values]}), encoding="utf-8")
    read = read_yaml(path, dict[str, list[str | float | int | bool | None]], "file").value["values"]
    assert [(type(one), one) for one in read] == [(type(one), one) for one in values]


def test_values_know_their_lines(tmp_path: Path) -> None:
    file = read(tmp_path, "size_m: [5, 4]\ndoors:\n- name: a\n- name: b\n  width_m: 1\n")
    assert file.line() == 1
    assert file.line("doors") == 2
    assert file.line("doors", 1, "width_m") == 5
    error = file.error("is locked", "doors", 1)
    assert str(error) == f"{file.path}:4: doors[1]: is locked"


def test_json_is_yaml_and_aliases_are_values(tmp_path: Path) -> None:
    assert read(tmp_path, '{"size_m": [5, 4]}').value == Room(size_m=(5.0, 4.0))
    assert read(tmp_path, "notes: {a: &a 3, b: *a}\nsize_m: [5, 4]").value.notes["b"] == 3


def test_all_problems_are_reported_in_the_order_of_their_lines(tmp_path: Path) -> None:
    text = "doors: [{nam: a}, 3]\nlit: maybe\nseats: 1.5\ncolour: blue\nsize_m: [5]\n"
    assert problems(tmp_path, text) == [
        "room.yaml:1: doors[0]: lacks the key 'name'",
        "room.yaml:1: doors[0].nam: unknown key; did you mean 'name'? (known: name, width_m)",
        "room.yaml:1: doors[1]: expected a mapping with name, width_m, got '3'",
        "room.yaml:2: lit: expected true or false, got 'maybe'",
        "room.yaml:3: seats: expected a whole number, got '1.5'",
        "room.yaml:4: colour: expected 'white' or 'grey' or a list, got 'blue'",
        "room.yaml:5: size_m: expected a list of 2, got a list of 1",
    ]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        *CASES["mistakes"],
        ("a:\n " + "[" * 100 + "]" * 100, "nested deeper than 40"),
        ("a:\n " + "[" * 500 + "]" * 500, "nested deeper than 40"),
        ("seats: 0x" + "f" * 5000, f"seats: {WANTED}, got '0xfff"),
        ("seats: " + "9" * 5000, f"seats: {WANTED}, got '999"),
    ],
)
def test_a_mistake_is_reported_with_its_place(tmp_path: Path, text: str, problem: str) -> None:
    assert problem in "\n".join(problems(tmp_path, text))


def test_a_bomb_of_aliases_does_not_go_off(tmp_path: Path) -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 10)]
    assert "larger than 500000 characters" in problems(tmp_path, "\n".join(lines))[0]


def test_a_text_that_aliases_repeat_makes_no_long_message(tmp_path: Path) -> None:
    """A message shows only the beginning of a value; memory is bounded by the text's size."""
    text = f"a: &a {'x' * 100_000}\nb: [{', '.join(['*a'] * 1000)}]"
    assert len("".join(problems(tmp_path, text))) < 1000
    assert len("".join(problems(tmp_path, f"a: &a {'x' * 100_000}\nb: *a\nsize_m: *a"))) < 1000


def test_a_missing_or_large_file_is_refused_with_a_remedy(tmp_path: Path) -> None:
    path = tmp_path / "room.yaml"
    with pytest.raises(SceneError, match=r"room.yaml: there is no such room file; build one"):
        read_yaml(path, Room, "room file", failure=SceneError, remedy="build one")
    path.write_text("#" * 250_001, encoding="utf-8")
    with pytest.raises(FileError, match="larger than 250000 bytes"):
        read_yaml(path, Room, "room file")
