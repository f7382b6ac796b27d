"""Text that is no XML, but that the engine's reader takes: it is taken with a warning."""

from __future__ import annotations

from pathlib import Path

import pytest

from uav_bt.errors import TreeError
from uav_bt.tree.loading.loader import check_text
from uav_bt.tree.loading.source import Element, parse_source, walk

RAW = "a raw '&' or '<' is not XML: write &amp; or &lt;"
NBSP = "XML has no entity '&nbsp;': it stays text; write &amp;nbsp;"
DASHES = "'--' in a comment is not XML: write something else"
BLANKS = "blanks before '<?xml' are not XML: remove them"


def read(text: str) -> list[Element]:
    root = parse_source(text.encode(), Path("m.xml"))
    return [root, *walk(root)]


@pytest.mark.parametrize(
    ("text", "mended"),
    [
        ("<a b='x && y &lt; z'/>", [("1:9", RAW), ("1:10", RAW)]),
        ('<a\n  c="é<" b="1"/>', [("2:7", RAW)]),
        ("<a b='&nbsp;&amp;&#233;'/>", [("1:7", NBSP)]),
        ("<a>this & that&nbsp;</a>", [("1:9", RAW), ("1:15", NBSP)]),
        ("<a>\n<!-- --- x --- --><b/></a>", [("2:6", DASHES)]),
        ("<a><!-- x ---><b/></a>", [("1:11", DASHES)]),
        ('\n \n<?xml version="1.0"\n?><a/>', [("3:1", BLANKS)]),
        ('\ufeff\n<?xml version="1.0"?><a b="&"/>', [("2:1", BLANKS), ("2:28", RAW)]),
        ("<a><!-- & < --><![CDATA[ & < ]]><?x & < ?><b c='&'/></a>", [("1:49", RAW)]),
    ],
)
def test_what_the_engine_reads_is_mended(text: str, mended: list[tuple[str, str]]) -> None:
    assert [(str(at), why) for at, why in read(text)[0].mended] == mended


def test_what_is_mended_keeps_its_text_and_moves_nothing() -> None:
    text = "\n<?xml version='1.0'?>\n<a>\n<!-- -- --><b x='&&' y='é &nbsp; <'\n z='1'>t & u</b></a>"
    _, inner = read(text)
    assert inner.attributes == {"x": "&&", "y": "é &nbsp; <", "z": "1"}
    assert inner.text == "t & u"
    assert str(inner.position) == "4:12"
    places = {name: str(at) for name, at in inner.attribute_positions.items()}
    assert places == {"x": "4:15", "y": "4:22", "z": "5:2"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('<!-- first --><?xml version="1.0"?><a/>', "1:15: not well-formed XML: XML or text decl"),
        ("<a b='&'><c></a>", "1:8: not well-formed XML: not well-formed"),
        ("<a b='&#5;'/>", "1:7: not well-formed XML: reference to invalid character"),
        ("<a b='&' <c/></a>", "not well-formed XML"),
        ("<!DOCTYPE a [<!ENTITY nbsp 'x'>]><a b='&nbsp;'/>", "document type declarations"),
        ("\n<?xml version='1.0'?><!DOCTYPE a><a/>", "not well-formed XML"),
        ("\n\nwords", "expected a tag such as <root>, got 'words'"),
    ],
)
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
