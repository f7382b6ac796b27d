"""Text that is no XML, but that the engine's reader takes: it is taken with a warning."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.worlds.tables import cases
from uav_bt.errors import TreeError
from uav_bt.tree.loading.loader import check_text
from uav_bt.tree.loading.source import Element, parse_source, walk

CASES = cases("loading")

DASHES = "'--' in a comment is not XML: write something else"


def read(text: str) -> list[Element]:
    root = parse_source(text.encode(), Path("m.xml"))
    return [root, *walk(root)]


@pytest.mark.parametrize(("text", "mended"), CASES["mended"])
def test_what_the_engine_reads_is_mended(text: str, mended: list[list[str]]) -> None:
    assert [[str(at), why] for at, why in read(text)[0].mended] == mended


def test_what_is_mended_keeps_its_text_and_moves_nothing() -> None:
    text = "\n<?xml version='1.0'?>\n<a>\n<!-- -- --><b x='&&' y='é &nbsp; <'\n z='1'>t & u</b></a>"
    _, inner = read(text)
    assert inner.attributes == {"x": "&&", "y": "é &nbsp; <", "z": "1"}
    assert inner.text == "t & u"
    assert str(inner.position) == "4:12"
    places = {name: str(at) for name, at in inner.attribute_positions.items()}
    assert places == {"x": "4:15", "y": "4:22", "z": "5:2"}


@pytest.mark.parametrize(("text", "words"), CASES["refused_texts"])
def test_other_faults_are_refused_where_they_stand(text: str, words: str) -> None:
    with pytest.raises(TreeError) as caught:
        read(text)
    assert words in caught.value.findings[0]


@pytest.mark.parametrize("part", ["<a'\"", "<!--", "<a x='&'>", "<?x ", "&"])
def test_hostile_text_is_refused_in_linear_time(part: str) -> None:
    with pytest.raises(TreeError):
        read(part * (1_000_000 // len(part)))


def test_each_is_one_warning_of_the_file() -> None:
    text = '<root BTCPP_format="4">\n<!-- -- -->\n</root>'
    found = [str(one) for one in check_text(text, path=Path("m.xml"))]
    assert f"m.xml:2:6: warning: {DASHES}" in found
