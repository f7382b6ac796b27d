"""The language server in a folder whose tree files use each other."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from lsprotocol import types
from pygls.exceptions import JsonRpcException

from tests.uav_bt.lsp.editor import Editor, applied
from uav_bt.errors import FileError, InputError
from uav_bt.lsp.desk import Desk
from uav_bt.lsp.page import Page
from uav_bt.lsp.rename import renamed
from uav_bt.lsp.workspace import Folders
from uav_bt.tree.loading.findings import errors_of
from uav_bt.tree.loading.loader import check_file
from uav_bt.tree.loading.lookup import Library, Lookup, files_in
from uav_bt.tree.registry import NodeRegistry

MAIN = """\
<root BTCPP_format="4" main_tree_to_execute="Main">
  <BehaviorTree ID="Main">
    <Sequence>
      <Script code="rounds := 0"/>
      <SubTree ID="Round" count="{rounds}"/>
      <SubTree ID="Shared" _autoremap="true"/>
    </Sequence>
  </BehaviorTree>
</root>
"""
PARTS = """\
<root BTCPP_format="4">
  <BehaviorTree ID="Round">
    <Script code="count += 1"/>
  </BehaviorTree>
  <BehaviorTree ID="Shared">
    <ScriptCondition code="rounds &gt; 0"/>
  </BehaviorTree>
</root>
"""
OTHER = """\
<root BTCPP_format="4" main_tree_to_execute="Other">
  <BehaviorTree ID="Other">
    <Sequence>
      <Script code="laps := 0; rounds := 1"/>
      <SubTree ID="Round" count="{laps}"/>
    </Sequence>
  </BehaviorTree>
</root>
"""
ALONE = """\
<root BTCPP_format="4" main_tree_to_execute="Alone">
  <BehaviorTree ID="Alone">
    <SubTree ID="Round"/>
  </BehaviorTree>
  <BehaviorTree ID="Round">
    <Script code="count := 1"/>
  </BehaviorTree>
</root>
"""

LOST = '<root BTCPP_format="4"><BehaviorTree ID="Lost"><AlwaysSuccess/></BehaviorTree></root>'


class Folder:
    """A folder that an editor has open, with files in it."""

    def __init__(self, editor: Editor, path: Path) -> None:
        self.path = path.resolve()
        self.editor = editor
        self.opened: list[str] = []
        editor.move(None, self.path)

    def write(self, name: str, text: str) -> Path:
        path = self.path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    def open(self, name: str, text: str) -> list[str]:
        """Write a document, open it, and return its diagnostics."""
        path = self.write(name, text)
        self.editor.open(path.as_uri(), text)
        self.opened.append(path.as_uri())
        return self.said(path)

    def said(self, path: Path) -> list[str]:
        return [one.message for one in self.editor.diagnostics(path.as_uri())]

    def place(self, name: str, words: str) -> tuple[str, int, int]:
        path = self.path / name
        text = path.read_text("utf-8")
        before = text[: text.index(words) + 1]
        return path.as_uri(), before.count("\n"), len(before.rpartition("\n")[2])

    def rename(self, name: str, words: str, new: str) -> set[str]:
        """Rename the name at these words, write all edited files, and return their names."""
        changes = self.editor.rename(*self.place(name, words), new)
        for uri, edits in changes.items():
            path = Path(uri.removeprefix("file://"))
            path.write_text(applied(path.read_text("utf-8"), edits), encoding="utf-8")
        lookup = Lookup(Library(files_in(self.path)))
        for path in files_in(self.path):
            if "main_tree" in path.read_text("utf-8"):
                assert check_file(path, lookup=lookup) == ()
        return {uri.rpartition("/")[2] for uri in changes}


@pytest.fixture(scope="module")
def editor(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Editor]:
    running = Editor(folders=(tmp_path_factory.mktemp("empty"),))
    yield running
    assert running.close() == 0


@pytest.fixture
def folder(editor: Editor, tmp_path: Path) -> Iterator[Folder]:
    made = Folder(editor, tmp_path)
    made.write("parts/parts.xml", PARTS)
    made.write("other.xml", OTHER)
    made.write("alone.xml", ALONE)
    yield made
    assert editor.alive
    for uri in made.opened:
        editor.close_document(uri)
    editor.move(made.path, None)


def same_verdict(folder: Folder, name: str) -> list[str]:
    """Return the findings of `uav-bt check FOLDER` in a file, in the editor's form."""
    lookup = Lookup(Library(files_in(folder.path)))
    found = check_file(folder.path / name, lookup=lookup)
    return [f"{one.node}: {one.message}" for one in found]


# --- trees of other files -------------------------------------------------------------------------


def test_trees_of_other_files_are_found_completed_and_jumped_to(folder: Folder) -> None:
    # ALONE also has a tree with this ID; PARTS' tree has no other rival.
    (folder.path / "alone.xml").unlink()
    assert folder.open("main.xml", MAIN) == []
    uri, line, column = folder.place("main.xml", '"Round"')
    items = folder.editor.complete(uri, line, column)
    assert {"Main", "Round", "Shared", "Other"} <= set(items)
    (found,) = folder.editor.define(uri, line, column)
    assert (found.uri.rpartition("/")[2], found.range.start.line) == ("parts.xml", 1)
    assert "**Round** (tree, 1 nodes), parts.xml:2" in folder.editor.hover(uri, line, column)
    uri, line, column = folder.place("main.xml", " _autoremap")
    folder.editor.change(uri, MAIN.replace(" _autoremap", "  _autoremap"))
    assert "rounds" in folder.editor.complete(uri, line, column)


def test_a_document_without_a_folder_around_it_is_by_itself(
    folder: Folder, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("elsewhere") / "main.xml"
    path.write_text(MAIN, encoding="utf-8")
    folder.editor.open(path.as_uri(), MAIN)
    folder.opened.append(path.as_uri())
    assert [one.partition("'")[0] for one in folder.said(path)] == ["SubTree "] * 2


def test_the_same_tree_in_two_files_is_refused_with_both_places_until_one_is_gone(
    folder: Folder,
) -> None:
    (folder.path / "alone.xml").unlink()
    copy = folder.write("copy.xml", PARTS)
    found = folder.open("main.xml", MAIN)
    assert found == same_verdict(folder, "main.xml")
    assert ["copy.xml:2" in one and "parts.xml:2" in one for one in found[:1]] == [True]
    assert set(folder.editor.watched) == {f"**/*.{one}" for one in ("xml", "btproj", "csv", "txt")}
    copy.unlink()
    folder.editor.disk_changed(copy)
    assert folder.said(folder.path / "main.xml") == []


def test_a_tree_that_appears_or_changes_on_the_disk_is_noticed(folder: Folder) -> None:
    (folder.path / "alone.xml").unlink()
    parts = folder.path / "parts" / "parts.xml"
    parts.unlink()
    main = folder.path / "main.xml"
    assert len(folder.open("main.xml", MAIN)) == 2
    folder.write("parts/parts.xml", PARTS)
    folder.editor.disk_changed(parts)
    assert folder.said(main) == []
    folder.write("parts/parts.xml", PARTS.replace("count +=", "missing +="))
    folder.editor.save(main.as_uri())  # the only notification of an editor that watches no files
    assert folder.said(main) == []  # the mistake is in the other file
    assert any("'missing'" in one for one in folder.said(parts))


def test_trees_that_use_each_other_in_a_circle_are_refused(folder: Folder) -> None:
    circle = MAIN.replace("Main", "There").replace("Round", "Here").replace("Shared", "Here")
    folder.write("there.xml", circle.replace(' count="{rounds}"', ""))
    here = (
        '<root BTCPP_format="4"><BehaviorTree ID="Here"><SubTree ID="There"/></BehaviorTree></root>'
    )
    folder.open("here.xml", here)
    (found, _) = folder.said(folder.path / "there.xml")
    assert "the tree contains itself: Here > There > Here" in found


def test_files_that_include_each_other_are_read_once(folder: Folder) -> None:
    folder.write(
        "a.xml", ALONE.replace("Alone", "A").replace('">\n', '">\n<include path="b.xml"/>\n', 1)
    )
    b = LOST.replace("Lost", "B").replace("<AlwaysSuccess/>", '<SubTree ID="A"/>')
    b = b.replace("<Beh", '<include path="a.xml"/><Beh', 1)
    assert folder.open("b.xml", b) == []
    (found,) = folder.editor.define(*folder.place("b.xml", '"A"'))
    assert found.uri.endswith("a.xml")


# --- renaming -------------------------------------------------------------------------------------


def test_a_tree_is_renamed_in_all_files_that_use_it(folder: Folder) -> None:
    """A file with its own tree of that name is not changed."""
    (folder.path / "alone.xml").unlink()
    folder.open("main.xml", MAIN)
    folder.write("alone.xml", ALONE)
    files = folder.rename("main.xml", '"Round"', "Lap")
    assert files == {"main.xml", "parts.xml", "other.xml"}
    assert (folder.path / "alone.xml").read_text("utf-8") == ALONE
    with pytest.raises(JsonRpcException, match="there is a tree 'Other'"):
        folder.editor.rename(*folder.place("main.xml", '"Shared"'), "Other")


def test_a_variable_is_renamed_in_all_files_that_share_it(folder: Folder) -> None:
    (folder.path / "alone.xml").unlink()
    folder.open("main.xml", MAIN)
    # A variable of Round: both files that use Round have an entry for it.
    assert folder.rename("main.xml", " count=", "passed") == {"main.xml", "parts.xml", "other.xml"}
    folder.editor.change(
        (folder.path / "main.xml").as_uri(), (folder.path / "main.xml").read_text("utf-8")
    )
    # Main's variable, which Shared gets by _autoremap; Other has a different one of that name.
    assert folder.rename("main.xml", "rounds :=", "done") == {"main.xml", "parts.xml"}


# --- bad input ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (LOST.encode()[:-3], "not well-formed XML"),
        (LOST.replace("Lost", "Lost\u00e9").encode("latin-1"), "save it as UTF-8"),
        (LOST.encode() + b" " * 50_000_000, "larger than 2000000 bytes"),
        (LOST.encode("utf-16"), "save it as UTF-8"),
    ],
    ids=["no XML", "Latin 1", "50 MB", "UTF-16"],
)
def test_a_tree_in_a_file_that_cannot_be_read_is_missed_with_the_reason(
    folder: Folder, data: bytes, reason: str
) -> None:
    (folder.path / "lost.xml").write_bytes(data)
    (found,) = folder.open("user.xml", LOST.replace("<AlwaysSuccess/>", '<SubTree ID="Gone"/>'))
    assert "there is no tree 'Gone'" in found
    assert f"could not be read: {folder.path / 'lost.xml'}" in found
    assert reason in found


def test_a_folder_with_too_many_files_is_a_warning(folder: Folder) -> None:
    for number in range(5_001):
        (folder.path / f"{number}.xml").touch()
    folder.open("alone.xml", ALONE)
    folder.editor.change((folder.path / "alone.xml").as_uri(), ALONE + "\n")
    (found,) = folder.editor.diagnostics((folder.path / "alone.xml").as_uri())
    assert found.severity == types.DiagnosticSeverity.Warning
    assert "more than 5000 tree files: choose a folder inside it" in found.message


def test_a_palette_that_is_no_xml_is_shown_and_the_server_lives(tmp_path: Path) -> None:
    palette = tmp_path / "palette.xml"
    palette.write_text("<TreeNodesModel", encoding="utf-8")
    editor = Editor("--palette", str(palette), folders=(tmp_path,))
    (found,) = editor.diagnostics(palette.as_uri())
    assert "not well-formed XML" in found.message
    mission = tmp_path / "mission.xml"
    text = LOST.replace("AlwaysSuccess", "FlyThere")
    mission.write_text(text, encoding="utf-8")
    editor.open(mission.as_uri(), text)
    assert "unknown node 'FlyThere'" in editor.diagnostics(mission.as_uri())[0].message
    palette.write_text('<TreeNodesModel><Action ID="FlyThere"/></TreeNodesModel>', encoding="utf-8")
    editor.disk_changed(palette)
    assert editor.diagnostics(palette.as_uri()) == []
    assert editor.diagnostics(mission.as_uri()) == []
    assert editor.close() == 0


def test_a_renaming_that_would_miss_files_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, text in (("main.xml", MAIN), ("parts.xml", PARTS), ("other.xml", OTHER)):
        (tmp_path / name).write_text(text, encoding="utf-8")
    page = Page(MAIN, tmp_path / "main.xml")
    folders, registry = Folders(), NodeRegistry.installed()
    folders.take([tmp_path])
    assert folders.check(page, registry) == ()
    desk = Desk(registry, lambda: [page], folders.around)
    at = MAIN.index('"Round"') + 1
    assert len(renamed(desk, page, at, "Lap").changes) == 3
    monkeypatch.setattr("uav_bt.lsp.rename.MAX_FAMILY", 3)
    with pytest.raises(InputError, match="3 files or more share this"):
        renamed(desk, page, at, "Lap")


def test_files_of_a_check_are_bounded_in_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.xml").write_text(LOST, encoding="utf-8")
    assert (
        errors_of(check_file(tmp_path / "a.xml", lookup=Lookup(Library(files_in(tmp_path))))) == ()
    )
    monkeypatch.setattr("uav_bt.tree.loading.lookup.MAX_LIBRARY_BYTES", 10)
    with pytest.raises(FileError, match="more than 10 bytes of tree files: choose a folder"):
        files_in(tmp_path)


def test_a_folder_with_a_blank_and_a_hash_is_a_folder_like_others(tmp_path: Path) -> None:
    folder = tmp_path / "My Missions #1"
    folder.mkdir()
    part = '<root BTCPP_format="4"><BehaviorTree ID="Part"><AlwaysSuccess/></BehaviorTree></root>'
    main = '<root BTCPP_format="4"><BehaviorTree ID="M"><SubTree ID="Part"/></BehaviorTree></root>'
    (folder / "part.xml").write_text(part, encoding="utf-8")
    uri, other = (folder / "main.xml").as_uri(), (folder / "part.xml").as_uri()
    assert "%20" in uri
    assert "%23" in uri
    editor = Editor(folders=(folder,))
    try:
        editor.open(uri, main)
        assert editor.diagnostics(uri) == []
        editor.change(uri, main.replace("<SubTree", "<SubTre"))
        (found,) = editor.diagnostics(uri)
        assert "unknown node 'SubTre'" in found.message
        editor.save(uri)
        assert [one.message for one in editor.diagnostics(uri)] == [found.message]
        editor.change(uri, main)
        assert editor.diagnostics(uri) == []
        editor.open(other, part)
        assert editor.diagnostics(other) == []
        edits = editor.rename(uri, 0, main.index("Part"), "Piece")
        assert set(edits) == {uri, other}
    finally:
        editor.close()


def test_a_fault_in_a_file_of_places_is_shown_in_that_file(folder: Folder) -> None:
    rounds = folder.write("rounds.txt", "mark\nhere\n")
    tree = MAIN.replace('<Script code="rounds := 0"/>', "")
    loop = '<LoopString queue="file:rounds.txt" value="{p}"><Face at="{p}"/></LoopString>'
    named = tree[: tree.index("<Sequence>")] + loop + "</BehaviorTree></root>"
    assert folder.open("main.xml", named) == []
    (finding,) = folder.said(rounds)
    assert finding.startswith("expected a place such as start:2,0")
