"""The layout of tree files: uniform, lossless and stable."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests.conformance import REGISTRY, read_traces
from tests.uav_bt.tree.test_mutations import mutated
from tests.worlds.trees import World
from uav_bt.errors import NodeFailedError, TreeError
from uav_bt.tree import parse_tree
from uav_bt.tree.editing.layout import format_source

ROOT = Path(__file__).parents[4]
HERE = Path("here.xml")


def formatted(text: str) -> str:
    once = format_source(text.encode(), HERE)
    assert format_source(once, HERE) == once
    return once.decode()


def inside(body: str) -> str:
    """Return the formatted content of a sequence, two levels less indented."""
    text = formatted(f"<root><BehaviorTree>{body}</BehaviorTree></root>")
    lines = text.splitlines()[2:-2]
    return "\n".join(line.removeprefix("    ") for line in lines)


def test_one_element_a_line_and_two_blanks_a_level() -> None:
    crooked = "<root><BehaviorTree ID = 'A'  ><A></A><B />\t<C>\n</C></BehaviorTree></root>"
    lines = ["<root>", '  <BehaviorTree ID="A">', "    <A/>", "    <B/>", "    <C/>"]
    assert formatted(crooked).splitlines() == [*lines, "  </BehaviorTree>", "</root>"]


def test_a_tag_that_is_too_long_has_one_attribute_a_line() -> None:
    long = "x" * 60
    assert inside(f'<A a="{long}" b="{long}"><B/></A>') == (
        f'<A\n  a="{long}"\n  b="{long}"\n>\n  <B/>\n</A>'
    )
    assert inside(f'<A a="{long * 3}"/>') == f'<A a="{long * 3}"/>'  # no place for a line break
    fits = "y" * 40
    assert inside(f'<A a="{fits}"\n\n b="{fits}"/>') == f'<A a="{fits}" b="{fits}"/>'


def test_values_stay_as_they_are_written() -> None:
    assert inside("""<A a='say "yes"' b='it&apos;s' c="x &gt; 1&#10;"/>""") == (
        """<A a='say "yes"' b="it&apos;s" c="x &gt; 1&#10;"/>"""
    )
    assert inside('<Script code="a := 1;\n      b := 2" name="n"/>') == (
        '<Script\n  code="a := 1;\n  b := 2"\n  name="n"\n/>'
    )


def test_comments_stay_where_they_belong() -> None:
    assert inside("<!--a--><A/> <!-- of A --><!-- too -->\n<!-- of B --><B/>") == (
        "<!--a-->\n<A/> <!-- of A --> <!-- too -->\n<!-- of B -->\n<B/>"
    ).replace("<!--a-->\n", "")  # it was on the line of the tree's tag


def test_a_comments_lines_move_together() -> None:
    assert inside("<A/>\n<!-- one\n     two\n\n  three -->") == (
        "<A/>\n<!-- one\n     two\n\n  three -->"
    )
    assert inside("<A/>\n      \t<!-- one\n      \t     two -->").endswith("<!-- one\n     two -->")


def test_single_blank_lines_stay_and_others_go() -> None:
    assert inside("\n\n<A>\n\n<B/>\n\n\n\n<C/>\n<D/>\n\n</A>") == (
        "<A>\n  <B/>\n\n  <C/>\n  <D/>\n</A>"
    )


def test_texts_stay() -> None:
    model = '<TreeNodesModel><Action ID="A"><input_port name="x">how fast'
    model += "\n (m/s) </input_port></Action>"
    text = formatted(
        f"<root>{model}<!-- c --> words <b/><![CDATA[ <raw> ]]></TreeNodesModel></root>"
    )
    assert '      <input_port name="x">how fast\n (m/s)</input_port>\n' in text
    assert "\n    </Action> <!-- c -->\n    words\n    <b/>\n    <![CDATA[ <raw> ]]>\n" in text


def test_line_ends_stay_and_a_byte_order_mark_goes() -> None:
    text = '\ufeff<?xml version="1.0"?>\r\n<root>\r\n<A/>\r\n</root>'
    assert formatted(text) == '<?xml version="1.0"?>\r\n<root>\r\n  <A/>\r\n</root>\r\n'


@pytest.mark.parametrize("path", sorted((ROOT / "trees").rglob("*.xml")), ids=lambda p: p.stem)
def test_shipped_missions_are_laid_out(path: Path) -> None:
    assert format_source(path.read_bytes(), path) == path.read_bytes()


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("<root><A></root>", "1:12: not well-formed XML: mismatched tag"),
        ("<!DOCTYPE root><root/>", "document type declarations"),
        ("", "no element found"),
        ("<root/>\udcff", "expected UTF-8 text"),
    ],
)
def test_what_is_no_tree_file_is_refused_with_its_place(text: str, reason: str) -> None:
    with pytest.raises(TreeError, match=reason):
        format_source(text.encode(errors="surrogateescape"), HERE)


def answers(text: str, world: World) -> list[str]:
    """Return the answers of a tree in six ticks, and the calls of its leaves."""
    tree = parse_tree(text, REGISTRY)
    tree.setup(world.context)
    found = []
    try:
        found += [tree.tick().letter for _ in range(6)]
        tree.halt()
    except NodeFailedError as error:
        found.append(str(error))
    return found + world.events()


def test_a_formatted_tree_ticks_as_before(world: World) -> None:
    traces = [*read_traces(ROOT / "tests" / "data" / "bt_traces_sample.jsonl")]
    for trace in traces:
        assert answers(formatted(trace["xml"]), world) == answers(trace["xml"], world)
    assert len(traces) > 50


def test_mutated_files_are_formatted_or_refused() -> None:
    random_ = random.Random(20)  # noqa: S311  # no secret
    counts = {True: 0, False: 0}
    for _ in range(1000):
        try:
            formatted(mutated(random_))
        except TreeError as error:
            counts[False] += "please report" not in str(error)
        else:
            counts[True] += 1
    assert sum(counts.values()) == 1000
    assert min(counts.values()) > 100
