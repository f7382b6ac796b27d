"""The language server, tested by a client over standard input and output."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from lsprotocol import types
from pygls.exceptions import JsonRpcException

from tests.uav_bt.lsp.editor import Editor, applied
from uav_bt.tree.loading.loader import check_file
from uav_bt.tree.loading.lookup import Lookup

MISSION = """\
<root BTCPP_format="4" main_tree_to_execute="Mission">
  <include path="lib.xml"/>
  <BehaviorTree ID="Mission">
    <Sequence name="all">
      <Script code="speed := 0.5; goal := 1"/>
      <SubTree ID="Round" count="{goal}" limit="{=}"/>
      <Explore policy="corridor"/>
      <AlwaysSuccess _skipIf="speed &gt; 1 &amp;&amp; @height_above_ground_m &lt; 2"/>
      <SubTree ID="Lib"/>
    </Sequence>
  </BehaviorTree>
  <BehaviorTree ID="Round">
    <Sequence>
      <Script code="count += 1; limit := 2"/>
      <SubTree ID="Deep" _autoremap="true"/>
    </Sequence>
  </BehaviorTree>
  <BehaviorTree ID="Deep">
    <ScriptCondition code="count &gt; 2"/>
  </BehaviorTree>
</root>
"""
LIB = '<root BTCPP_format="4">\n<BehaviorTree ID="Lib"><AlwaysSuccess/></BehaviorTree>\n</root>\n'


@pytest.fixture(scope="module")
def editor() -> Iterator[Editor]:
    running = Editor()
    yield running
    assert running.close() == 0


class Document:
    """A document in a folder with its included files."""

    def __init__(self, editor: Editor, folder: Path, text: str = MISSION) -> None:
        (folder / "lib.xml").write_text(LIB, encoding="utf-8")
        self.editor = editor
        self.path = folder / "mission.xml"
        self.uri = self.path.as_uri()
        self.text = text
        self.path.write_text(text, encoding="utf-8", errors="surrogatepass")
        editor.open(self.uri, text)
        self.found = editor.diagnostics(self.uri)

    def place(self, words: str, shift: int = 0) -> tuple[int, int]:
        """Return the line and the character of the words in the text."""
        before = self.text[: self.text.index(words) + shift]
        return before.count("\n"), len(before.rpartition("\n")[2])

    def complete(self, words: str) -> dict[str, types.CompletionItem]:
        return self.editor.complete(self.uri, *self.place(words, len(words)))

    def part(self, range_: types.Range) -> str:
        line = self.text.splitlines()[range_.start.line]
        return line[range_.start.character : range_.end.character]


@pytest.fixture
def mission(editor: Editor, tmp_path: Path) -> Iterator[Document]:
    document = Document(editor, tmp_path)
    yield document
    editor.close_document(document.uri)
    assert editor.diagnostics(document.uri) == []


def typed(editor: Editor, folder: Path, body: str) -> Document:
    """Open a mission with this body of the tree, which ends at the cursor."""
    return Document(editor, folder, f'<root BTCPP_format="4">\n<BehaviorTree ID="M">\n{body}')


# --- diagnostics and quick fixes ------------------------------------------------------------------


def test_findings_are_those_of_check_while_one_types(mission: Document) -> None:
    assert mission.found == []
    wrong = MISSION.replace("<Explore ", "<Explor ").replace('ID="Deep" _auto', 'ID="Dep" _auto')
    mission.editor.change(mission.uri, wrong)
    found = mission.editor.diagnostics(mission.uri)
    mission.text = wrong
    mission.path.write_text(wrong, encoding="utf-8")
    said = [f"{f.node}: {f.message}" for f in check_file(mission.path)]
    assert [d.message for d in found] == said
    assert [mission.part(d.range) for d in found] == ["<Explor", 'ID="Dep"']
    mission.editor.change(mission.uri, MISSION)
    assert mission.editor.diagnostics(mission.uri) == []


def test_a_keystroke_may_come_as_a_part(mission: Document) -> None:
    line, character = mission.place("Explore ", 7)
    where = types.Range(types.Position(line, character - 1), types.Position(line, character))
    mission.editor.change(mission.uri, types.TextDocumentContentChangePartial(where, ""))
    (found,) = mission.editor.diagnostics(mission.uri)
    assert "unknown node 'Explor'; did you mean 'Explore'?" in found.message


FIXED = [
    ("<Lnad/>", "<Land/>"),
    ('<Action ID="Lnad"/>', '<Action ID="Land"/>'),
    ('<Explore polcy="corridor"/>', '<Explore policy="corridor"/>'),
    ('<Explore policy="coridor"/>', '<Explore policy="corridor"/>'),
    ('<SubTree ID="Mm"/>', '<SubTree ID="M"/>'),
    ('<AlwaysSuccess _skpIf="1"/>', '<AlwaysSuccess _skipIf="1"/>'),
    ('<AlwaysSuccess _skipIf="@phas == 1"/>', '<AlwaysSuccess _skipIf="@phase == 1"/>'),
    ('<Precondition if="1" else="SUCESS"><Land/></Precondition>', 'else="SUCCESS"'),
    ('<SetBlackboard value="{@mrk}" output_key="x"/>', '"{@mark}"'),
]


@pytest.mark.parametrize(("wrong", "right"), FIXED, ids=[wrong for wrong, _ in FIXED])
def test_a_suggestion_is_a_quick_fix(
    editor: Editor, tmp_path: Path, wrong: str, right: str
) -> None:
    ends = "\n</BehaviorTree></root>"
    document = typed(editor, tmp_path, f"<Sequence>{wrong}</Sequence>{ends}")
    meant = [one for one in document.found if "did you mean" in one.message]
    (action,) = editor.fixes(document.uri, *meant)
    assert action.kind == types.CodeActionKind.QuickFix
    assert right in applied(document.text, action.edit.changes[document.uri])


def test_a_fault_in_an_included_file_is_shown_there(mission: Document) -> None:
    library = mission.path.parent / "lib.xml"
    library.write_text(LIB.replace("AlwaysSuccess", "AlwaysSucces"), encoding="utf-8")
    mission.editor.change(mission.uri, MISSION)
    assert mission.editor.diagnostics(mission.uri) == []
    (found,) = mission.editor.diagnostics(library.as_uri())
    assert "did you mean 'AlwaysSuccess'" in found.message


def test_places_count_as_the_editor_counts(editor: Editor, tmp_path: Path) -> None:
    """A character beyond the basic plane has two units of UTF-16."""
    document = typed(
        editor, tmp_path, '<AlwaysSuccess name="\U0001f681" zzzzzz="1"/></BehaviorTree></root>'
    )
    (found,) = document.found
    assert (found.range.start.character, found.range.end.character) == (25, 35)
    assert editor.fixes(document.uri, found) == []  # nothing similar exists


# --- completion -----------------------------------------------------------------------------------


def test_nodes_and_trees_are_completed(editor: Editor, tmp_path: Path) -> None:
    document = typed(editor, tmp_path, "<Sequence>\n<Expl")
    items = document.complete("<Expl")
    assert {"Explore", "Sequence", "SubTree M"} <= set(items)
    assert items["Explore"].text_edit.new_text == "<Explore/>"
    assert document.part(items["Explore"].text_edit.range) == "<Expl"
    assert "**Explore** (Action)" in items["Explore"].documentation.value
    assert items["Sleep"].text_edit.new_text == '<Sleep msec=""/>'


def test_attributes_are_completed_but_those_that_are_there(mission: Document) -> None:
    items = mission.complete("<Explore ")
    assert "flowing" in items
    assert "policy" not in items
    assert "_skipIf" in items
    assert "count" in mission.complete('<SubTree ID="Deep" ')
    assert "count" not in mission.complete('<SubTree ID="Round" ')


def test_values_are_completed(editor: Editor, mission: Document, tmp_path: Path) -> None:
    assert {"corridor", "segmentation", "student"} <= set(mission.complete('policy="'))
    shipped = {"ExploreFor", "ExploreOrTurn"}
    assert shipped <= set(mission.complete('<SubTree ID="'))
    own = {"Mission", "Round", "Deep", "Lib"}
    assert own == set(mission.complete('<SubTree ID="')) - set(Lookup().shipped.trees)
    assert {"speed", "goal", "@height_above_ground_m"} <= set(mission.complete('_skipIf="spe'))
    folder = tmp_path / "other"
    folder.mkdir()
    document = typed(editor, folder, '<Sequence><Script code="far := 1"/><Sleep msec="{')
    assert "{far}" in document.complete('msec="{')
    assert "{@mark}" not in document.complete('msec="{')
    assert "<Sequence" not in document.complete('msec="{')


def test_names_in_the_text_of_a_message_are_known(editor: Editor, tmp_path: Path) -> None:
    text = '<Sequence><Script code="far := 1"/><Say text="it is {far} m, {@elapsed_s} s, {fa'
    document = typed(editor, tmp_path, text)
    assert {"far", "@elapsed_s"} <= set(document.complete(", {fa"))
    assert document.complete('text="it is') == {}
    text = '<Sequence><Script code="far := 1"/><Say text="{far} of {far}"/></Sequence>'
    whole = f'<root BTCPP_format="4"><BehaviorTree ID="M">{text}</BehaviorTree></root>'
    document = Document(editor, tmp_path, whole)
    assert renamed(document, "far", "wide") == whole.replace("far", "wide")


def test_an_end_tag_is_completed(editor: Editor, tmp_path: Path) -> None:
    items = typed(editor, tmp_path, "<Sequence>\n<Fallback>\n</").complete("<Fallback>\n</")
    assert [item.text_edit.new_text for item in items.values()] == ["Fallback>"]


def test_snippets_are_for_clients_that_take_them(tmp_path: Path) -> None:
    editor = Editor(snippets=True)
    items = typed(editor, tmp_path, "<Sequence>\n<").complete("<Sequence>\n<")
    assert items["Fallback"].text_edit.new_text == "<Fallback>\n  $0\n</Fallback>"
    assert items["Sleep"].text_edit.new_text == '<Sleep msec="$1"/>$0'
    assert editor.close() == 0


# --- hover, definitions, outline ------------------------------------------------------------------


def test_hover_explains_nodes_ports_keys_trees_and_variables(mission: Document) -> None:
    def said(words: str, shift: int = 1) -> str:
        return mission.editor.hover(mission.uri, *mission.place(words, shift))

    assert "Reads `@state`" in said("<Explore", 3)
    assert said("policy=").startswith("`policy` (str, default segmentation)")
    assert "height above the ground" in said("@height_above")
    assert said('"Round" count').startswith("**Round** (tree, 3 nodes), mission.xml:12")
    assert "Set at line 5: `Script`" in said("speed &gt;")
    assert "true: the node is skipped" in said("_skipIf")
    assert not said("\n")


def test_definitions_of_trees_nodes_variables_and_includes(mission: Document) -> None:
    def defined(words: str, shift: int = 1) -> list[tuple[str, int]]:
        found = mission.editor.define(mission.uri, *mission.place(words, shift))
        return [(one.uri.rpartition("/")[2], one.range.start.line) for one in found]

    assert defined('"Round" count') == [("mission.xml", 11)]
    assert defined('"Lib"') == [("lib.xml", 1)]
    assert defined('"lib.xml"') == [("lib.xml", 0)]
    assert defined("speed &gt;") == [("mission.xml", 4)]
    ((file, line),) = defined("<Explore", 3)
    assert (file, line > 5) == ("explore.py", True)


def test_references_are_all_places_of_a_name(mission: Document) -> None:
    line, character = mission.place("count +=")
    params = types.ReferenceParams(
        text_document=types.TextDocumentIdentifier(mission.uri),
        position=types.Position(line, character),
        context=types.ReferenceContext(include_declaration=True),
    )
    found = mission.editor.ask("text_document_references", params)
    assert [one.range.start.line for one in found] == [5, 13]


def test_the_outline_has_trees_and_their_nodes(mission: Document) -> None:
    params = types.DocumentSymbolParams(types.TextDocumentIdentifier(mission.uri))
    trees: Any = mission.editor.ask("text_document_document_symbol", params)
    assert [tree.name for tree in trees] == ["Mission", "Round", "Deep"]
    (sequence,) = trees[0].children
    assert (sequence.name, sequence.detail) == ("all", "Sequence")
    assert [node.name for node in sequence.children][:2] == ["Script", "SubTree Round"]


# --- renaming and formatting ----------------------------------------------------------------------


def renamed(mission: Document, words: str, new: str, shift: int = 0) -> str:
    changes = mission.editor.rename(mission.uri, *mission.place(words, shift), new)
    text = applied(mission.text, changes[mission.uri])
    mission.path.write_text(text, encoding="utf-8")
    assert check_file(mission.path) == ()
    return text


def test_a_tree_is_renamed_wherever_it_is_used(mission: Document) -> None:
    text = renamed(mission, "Round", "Lap")
    assert text == MISSION.replace("Round", "Lap")
    assert renamed(mission, "Mission", "Main") == MISSION.replace("Mission", "Main")
    changes = mission.editor.rename(mission.uri, *mission.place('"Lib"', 1), "Kit")
    assert {uri.rpartition("/")[2] for uri in changes} == {"mission.xml", "lib.xml"}


def test_a_variable_is_renamed_in_its_tree_and_where_it_is_shared(mission: Document) -> None:
    assert renamed(mission, "speed", "pace") == MISSION.replace("speed", "pace")
    # Round's `count` is an entry of Mission's SubTree, and Deep's by _autoremap.
    assert renamed(mission, "count +=", "laps") == MISSION.replace("count", "laps")
    assert renamed(mission, "goal :=", "wanted") == MISSION.replace("goal", "wanted")


def test_a_name_that_is_both_sides_is_written_out(mission: Document) -> None:
    inner = renamed(mission, "limit :=", "most")
    assert 'most="{limit}"' in inner
    assert "most := 2" in inner
    assert 'limit="{far}"' in renamed(mission, "{=}", "far", 1)


@pytest.mark.parametrize(
    ("words", "new", "reason"),
    [
        ("speed", "goal", "tree 'Mission' has a variable 'goal'"),
        ("speed", "0x", "cannot be a variable's name"),
        ("count +=", "_count", "would be private"),
        ("Round", "Deep", "there is a tree 'Deep'"),
        ("Round", "a b", "cannot be a tree's ID"),
        ("height_above", "x", "only trees and variables"),
        ("Explore", "x", "only trees and variables"),
    ],
)
def test_a_renaming_that_cannot_be_is_refused(
    mission: Document, words: str, new: str, reason: str
) -> None:
    with pytest.raises(JsonRpcException, match=reason):
        mission.editor.rename(mission.uri, *mission.place(words, 1), new)


def test_formatting_changes_what_is_crooked_only(mission: Document) -> None:
    assert mission.editor.format(mission.uri) == []
    crooked = MISSION.replace("      <Explore ", " <Explore   ")
    mission.editor.change(mission.uri, crooked)
    (edit,) = mission.editor.format(mission.uri)
    assert (edit.range.start.line, edit.range.end.line) == (6, 7)
    assert applied(crooked, [edit]) == MISSION
    mission.editor.change(mission.uri, crooked.replace("</root>", ""))
    assert mission.editor.format(mission.uri) == []


# --- bad input ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "no element found"),
        ("<", "not well-formed"),
        ("\ufeff\0\ud7ff", "not well-formed"),
        ("<a>" * 5000, "nested deeper"),
        ("<!DOCTYPE x [<!ENTITY a 'b'>]><root/>", "document type declarations"),
        ("<root>" + "x" * 3_000_000, "larger than 2000000 bytes"),
        ('<root BTCPP_format="4"><include path="\0"/></root>', "not well-formed"),
        ('<root BTCPP_format="4"><include path="../x.xml"/></root>', "outside the folder"),
    ],
    ids=str.split("empty open zero deep entity large zero-path outside"),
)
def test_the_server_lives_on_after_any_document(
    editor: Editor, tmp_path: Path, text: str, reason: str
) -> None:
    document = Document(editor, tmp_path, text)
    assert any(reason in one.message for one in document.found), document.found
    assert isinstance(editor.complete(document.uri, 0, 3), dict)
    assert editor.hover(document.uri, 7, 3) == ""
    editor.ask(
        "text_document_document_symbol",
        types.DocumentSymbolParams(types.TextDocumentIdentifier(document.uri)),
    )
    assert editor.format(document.uri) == [] or "outside" in reason
    assert editor.alive


def test_a_document_that_is_no_file_is_checked_too(editor: Editor) -> None:
    uri = "untitled:Untitled-1"
    editor.open(uri, '<root BTCPP_format="4"><BehaviorTree ID="M"><Lnad/></BehaviorTree></root>')
    (found,) = editor.diagnostics(uri)
    assert "did you mean 'Land'" in found.message


def test_a_palette_brings_its_nodes(tmp_path: Path) -> None:
    palette = tmp_path / "palette.xml"
    palette.write_text('<TreeNodesModel><Action ID="GoTo"/></TreeNodesModel>', encoding="utf-8")
    editor = Editor("--palette", str(palette))
    ends = "</BehaviorTree></root>"
    assert typed(editor, tmp_path, f"<GoTo/>{ends}").found == []
    assert editor.close() == 0


def test_leaves_and_policies_of_a_python_file_are_known(tmp_path: Path) -> None:
    file = tmp_path / "my_leaves.py"
    file.write_text(
        "from uav_bt.tree import Leaf\n"
        "class Wait(Leaf):\n    def update(self): ...\n"
        "class Spin:\n    @classmethod\n    def from_text(cls, text): ...\n"
        "    def decide(self, view): ...\n"
    )
    palette = tmp_path / "palette.xml"
    palette.write_text('<root BTCPP_format="4"><TreeNodesModel/></root>')
    running = Editor("--leaves", str(file), "--palette", str(palette))
    body = '<Sequence>\n<Wait/>\n<Explore policy="Spin:1"/>\n</Sequence>'
    text = f'<root BTCPP_format="4">\n<BehaviorTree ID="M">{body}</BehaviorTree>\n</root>\n'
    document = Document(running, tmp_path, text)
    assert document.found == []
    assert "Spin" in document.complete('policy="')
    assert running.close() == 0
