"""The language server, tested by a client over standard input and output."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

import pytest
from lsprotocol import types

from tests.uav_bt.lsp.editor import Editor
from tests.worlds.tables import cases
from uav_bt.tree.loading.loader import check_file

CASES = cases("lsp")
MISSION = CASES["mission"]
LIB = '<root BTCPP_format="4">\n<BehaviorTree ID="Lib"><AlwaysSuccess/></BehaviorTree>\n</root>\n'
USER = '<root BTCPP_format="4"><BehaviorTree ID="User"><SubTree ID="Part"/></BehaviorTree></root>'
PART = '<root BTCPP_format="4"><BehaviorTree ID="Part"><AlwaysSuccess/></BehaviorTree></root>'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the editor's folder, whose name has a blank and a hash."""
    path = tmp_path_factory.mktemp("My Missions #1").resolve()
    (path / "parts").mkdir()
    return path


@pytest.fixture(scope="module")
def editor(folder: Path) -> Iterator[Editor]:
    running = Editor(folder)
    yield running
    assert running.close() == 0


class Document:
    """An open document."""

    def __init__(self, editor: Editor, path: Path, text: str) -> None:
        self.editor = editor
        self.path = path
        self.uri = path.as_uri()
        self.text = text
        path.write_text(text, encoding="utf-8")
        self.found = editor.open(self.uri, text)

    def place(self, words: str, shift: int) -> tuple[str, int, int]:
        """Return a line and a character, by words in the text."""
        before = self.text[: self.text.rindex(words) + shift]
        return self.uri, before.count("\n"), len(before.rpartition("\n")[2])

    def complete(self, words: str) -> dict[str, types.CompletionItem]:
        return self.editor.complete(*self.place(words, len(words)))

    def hover(self, words: str, shift: int = 1) -> str:
        return self.editor.hover(*self.place(words, shift))

    def part(self, range_: types.Range) -> str:
        assert range_.start.line == range_.end.line
        line = self.text.splitlines()[range_.start.line]
        return line[range_.start.character : range_.end.character]


@pytest.fixture
def mission(editor: Editor, folder: Path) -> Iterator[Document]:
    (folder / "lib.xml").write_text(LIB, encoding="utf-8")
    document = Document(editor, folder / "mission.xml", MISSION)
    yield document
    assert editor.close_document(document.uri) == []


@pytest.fixture
def typed(editor: Editor, folder: Path) -> Iterator[Document]:
    """Return a document with a tree that is still being typed."""
    document = Document(editor, folder / "typed.xml", "")
    yield document
    editor.close_document(document.uri)


def write(typed: Document, body: str) -> list[types.Diagnostic]:
    typed.text = f'<root BTCPP_format="4">\n<BehaviorTree ID="M">\n{body}'
    return typed.editor.change(typed.uri, typed.text)


# --- diagnostics ----------------------------------------------------------------------------------


def test_findings_are_those_of_check_while_one_types(mission: Document) -> None:
    assert mission.found == []
    wrong = MISSION.replace("<Explore ", "<Explor ").replace('ID="Round" c', 'ID="Rond" c')
    found = mission.editor.change(mission.uri, MISSION.replace("<Explore ", "<Expl "), wrong)
    mission.text = wrong
    mission.path.write_text(wrong, encoding="utf-8")
    said = [f"{f.node}: {f.message}" for f in check_file(mission.path)]
    assert [d.message for d in found] == said
    assert [mission.part(d.range) for d in found] == ['ID="Rond"', "<Explor"]
    assert {d.severity for d in found} == {types.DiagnosticSeverity.Error}
    assert mission.editor.change(mission.uri, MISSION) == []


def test_a_finding_in_an_included_file_is_shown_in_the_first_line(mission: Document) -> None:
    library = mission.path.parent / "lib.xml"
    library.write_text(LIB.replace("AlwaysSuccess", "AlwaysSucces"), encoding="utf-8")
    (found,) = mission.editor.change(mission.uri, MISSION)
    assert found.message.startswith(f"{library}:2:24: AlwaysSucces: unknown node")
    assert (found.range.start.line, mission.part(found.range)) == (0, MISSION.splitlines()[0])


def test_places_count_as_the_editor_counts(typed: Document) -> None:
    """A character beyond the basic plane has two units of UTF-16, and only line ends end lines."""
    warned = '<AlwaysSuccess name="\U0001f681\u2028" _zzz="1"/>\r\n</BehaviorTree></root>'
    (found,) = write(typed, warned)
    assert (found.range.start.character, found.range.end.character) == (26, 34)
    assert (found.range.start.line, found.severity) == (2, types.DiagnosticSeverity.Warning)
    write(typed, '<Sequence name="{far}">\n<Sleep name="\U0001f681" msec="')
    item = typed.editor.complete(typed.uri, 3, 23)["{far}"]
    assert item.text_edit.range == types.Range(types.Position(3, 23), types.Position(3, 23))


# --- other files of the folder --------------------------------------------------------------------


def test_trees_of_other_files_are_looked_up_as_saved(editor: Editor, folder: Path) -> None:
    part = folder / "parts" / "part.xml"
    part.write_text(PART, encoding="utf-8")
    user = Document(editor, folder / "user.xml", USER)
    assert user.found == []
    assert 'SubTree ID="Part"' in user.complete("<Sub")
    part.write_text(PART.replace("Part", "Past"), encoding="utf-8")
    editor.save(user.uri)
    (found,) = editor.diagnostics(user.uri)
    assert "there is no tree 'Part'; did you mean 'Past'?" in found.message
    assert user.part(found.range) == 'ID="Part"'
    part.write_text(PART[:-3], encoding="utf-8")
    assert editor.open(part.as_uri(), PART) == []
    (found,) = editor.change(user.uri, USER)
    assert f"could not be read: {part}" in found.message  # open, but not saved
    editor.close_document(part.as_uri())
    editor.close_document(user.uri)
    part.unlink()


def test_a_file_outside_a_folder_is_alone(editor: Editor, folder: Path, tmp_path: Path) -> None:
    (folder / "part.xml").write_text(PART, encoding="utf-8")
    user = Document(editor, tmp_path / "user.xml", USER)
    assert "there is no tree 'Part'" in user.found[0].message
    editor.close_document(user.uri)
    (folder / "part.xml").unlink()


def test_a_folder_that_is_too_large_is_a_message(tmp_path: Path) -> None:
    for number in range(26):
        with (tmp_path / f"{number}.xml").open("wb") as file:
            file.truncate(2_000_000)  # they use no space on the disk
    editor = Editor(tmp_path)
    assert editor.open((tmp_path / "part.xml").as_uri(), PART) == []
    shown = editor.messages.get(timeout=60).message
    assert "more than 50000000 bytes of tree files: choose a folder inside it" in shown
    assert editor.close() == 0


def test_the_uris_of_an_editor_come_back_as_it_writes_them(editor: Editor, folder: Path) -> None:
    (folder / "part.xml").write_text(PART, encoding="utf-8")
    path = folder / "a (1): b+c.xml"
    for uri in (path.as_uri(), f"file://{quote(str(path), safe='/')}"):  # as VS Code: %28, %3A, %2B
        assert editor.open(uri, USER) == []
        assert "Part" in editor.complete(uri, 0, USER.index('"Part"') + 1)
        (found,) = editor.change(uri, USER.replace("SubTree ", "SubTre "))
        assert "unknown node 'SubTre'" in found.message
        assert editor.close_document(uri) == []
    (folder / "part.xml").unlink()


# --- completion -----------------------------------------------------------------------------------


def test_elements_are_completed(typed: Document) -> None:
    write(typed, "<Sequence>\n<Expl")
    items = typed.complete("<Expl")
    assert {"Explore", "Sequence", 'SubTree ID="M"', 'SubTree ID="ExploreFor"'} <= set(items)
    assert items["Explore"].text_edit.new_text == "Explore"
    assert typed.part(items["Explore"].text_edit.range) == "Expl"
    assert "## Explore" in items["Explore"].documentation.value
    write(typed, "<Sequence>\n<Fallback>\n<Land/></")
    assert [item.text_edit.new_text for item in typed.complete("</").values()] == ["Fallback>"]
    typed.text = '<root BTCPP_format="4">\n<'
    typed.editor.change(typed.uri, typed.text)
    assert set(typed.complete("\n<")) == {"BehaviorTree", "include"}
    write(typed, "<!-- <Expl")
    assert typed.complete("<Expl") == {}


def test_attributes_that_are_not_there_are_completed(mission: Document, typed: Document) -> None:
    items = mission.complete("<Explore ")
    assert {"flowing", "_skipIf", "name"} <= set(items)
    assert "policy" not in items
    assert items["flowing"].text_edit.new_text == 'flowing=""'
    assert {"count", "_autoremap"}.isdisjoint(mission.complete("<Explore "))
    write(typed, '<SubTree ID="ExploreFor" dur')
    items = typed.complete("dur")
    assert {"policy", "duration_ms", "_autoremap"} <= set(items)
    assert typed.part(items["duration_ms"].text_edit.range) == "dur"


@pytest.mark.parametrize(("body", "there", "absent"), CASES["completions"])
def test_values_are_completed(
    typed: Document, body: str, there: list[str], absent: list[str]
) -> None:
    known = '<Script code="far := 1"/><Sleep msec="{near}"/><SetBlackboard output_key="out"/>\n'
    write(typed, known + body)
    items = typed.complete(body)
    assert set(there) <= set(items)
    assert set(absent).isdisjoint(items)
    write(typed, f'{known}{body}"/>\n</Sequence>')
    assert set(there) <= set(typed.complete(body))


# --- hover ----------------------------------------------------------------------------------------


def test_hover_explains_nodes_ports_and_keys(mission: Document) -> None:
    assert "Reads `state`" in mission.hover("<Explore")
    assert "Reads `state`" in mission.hover("<Explore", 7)
    assert mission.hover("policy=").startswith("`policy` (str, default segmentation)")
    assert "height above the ground" in mission.hover("@height_above", 5)
    assert not mission.hover("speed &gt;")
    assert not mission.hover("\n")


# --- options and bad input ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        *CASES["documents"],
        ("\ufeff\0\ud7ff", "not well-formed"),
        ("<a>" * 5000, "nested deeper"),
        ("<root>" + "x" * 2_000_000, "larger than 2000000 bytes"),
    ],
    ids=str.split("empty text entity outside zero deep large"),
)
def test_the_server_lives_on_after_any_document(typed: Document, text: str, reason: str) -> None:
    found = typed.editor.change(typed.uri, text)
    assert any(reason in one.message for one in found), found
    assert isinstance(typed.editor.complete(typed.uri, 0, 3), dict)
    assert typed.editor.hover(typed.uri, 7, 3) == ""


def test_a_palette_and_a_python_file_bring_their_nodes(tmp_path: Path) -> None:
    file, palette = tmp_path / "my_leaves.py", tmp_path / "palette.xml"
    file.write_text(
        "from uav_bt.tree import Leaf\n"
        "class Wait(Leaf):\n    def update(self): ...\n"
        "class Spin:\n    @classmethod\n    def from_text(cls, text): ...\n"
        "    def decide(self, view): ...\n"
    )
    palette.write_text(
        '<root BTCPP_format="4"><TreeNodesModel><Action ID="Dock"/></TreeNodesModel></root>'
    )
    editor = Editor(tmp_path, "--leaves", str(file), "--palette", str(palette))
    body = '<Sequence>\n<Wait/><Dock/>\n<Explore policy="Spin:1"/>\n</Sequence>'
    document = Document(editor, tmp_path / "m.xml", PART.replace("<AlwaysSuccess/>", body))
    assert document.found == []
    assert "Spin" in document.complete('policy="')
    assert {"Wait", "Dock"} <= set(document.complete("<Wa"))
    assert editor.close() == 0
