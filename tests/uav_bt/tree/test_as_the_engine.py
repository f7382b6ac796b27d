"""Input that BehaviorTree.CPP accepts is accepted here, with a warning if it has no effect."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from tests.uav_bt.tree.test_loader import REGISTRY, warnings_of
from tests.worlds.tables import cases
from tests.worlds.trees import document
from uav_bt.errors import FileError, TreeError
from uav_bt.tree import NodeRegistry, load_tree, parse_tree
from uav_bt.tree.loading.findings import ERROR, errors_of
from uav_bt.tree.loading.loader import check_file, check_text
from uav_bt.tree.loading.lookup import Library, Lookup, files_in, shipped_trees
from uav_bt.tree.loading.models import with_palette
from uav_bt.tree.loading.source import Element, parse_source, walk

WARNINGS = cases("warnings")
SPARE = '<BehaviorTree ID="B">{}</BehaviorTree>'


@pytest.mark.parametrize(("text", "message"), WARNINGS)
def test_what_the_engine_takes_is_a_warning(text: str, message: str) -> None:
    (found,) = warnings_of(text)
    assert message in found
    assert ": warning: " in found


def test_what_editors_write_is_no_warning() -> None:
    text = document('<Steer name="" _uid="3"/>', "<MetadataFields><x y='1'/></MetadataFields>")
    assert warnings_of(text) == []
    assert parse_tree(text, REGISTRY).root.name == "Steer"


def test_a_tree_can_be_chosen(caplog: pytest.LogCaptureFixture) -> None:
    """A file that Groot2 saved does not name the tree to fly."""
    trees = (
        '<root BTCPP_format="4"><BehaviorTree ID="Step"><Safe/></BehaviorTree>'
        '<BehaviorTree ID="All"><Sequence><SubTree ID="Step"/></Sequence></BehaviorTree>{}</root>'
    )
    text = trees.format("")
    assert parse_tree(text, REGISTRY).name == "All"
    assert parse_tree(text, REGISTRY, tree_id="Step").name == "Step"
    with pytest.raises(TreeError, match="there is no tree 'Stp'; did you mean 'Step'"):
        parse_tree(text, REGISTRY, tree_id="Stp")
    assert not caplog.messages
    spare = trees.format(SPARE.format('<Steer polcy="x"/>'))
    with pytest.raises(TreeError, match="which of these trees is meant: All, B"):
        parse_tree(spare, REGISTRY)
    assert parse_tree(spare, REGISTRY, tree_id="All").name == "All"
    assert "unknown attribute 'polcy'" in caplog.messages[0]
    # Without a choice each of them may be flown, so each must be valid.
    (finding,) = check_text(spare, REGISTRY, path=Path("m.xml"))
    assert finding.severity == ERROR
    single = '<root BTCPP_format="4"><BehaviorTree><Safe/></BehaviorTree></root>'
    assert parse_tree(single, REGISTRY).name == "BehaviorTree_0"  # it needs no ID


@pytest.mark.parametrize("path", sorted(shipped_trees().rglob("*.xml")), ids=lambda path: path.stem)
def test_our_missions_load_as_groot2_saves_them(path: Path, tmp_path: Path) -> None:
    """Groot2 drops main_tree_to_execute, sorts trees by name, and adds attributes."""
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    text = "".join(lines).replace(" main_tree_to_execute=", " project_name=", 1)
    saved = tmp_path / path.name
    saved.write_text(text, encoding="utf-8")
    assert check_file(saved) == ()
    before, after = load_tree(path), load_tree(saved)
    assert [node.path for node in after.nodes()] == [node.path for node in before.nodes()]


# --- several files --------------------------------------------------------------------------------


def tree(tree_id: str, body: str) -> str:
    return f'<root BTCPP_format="4"><BehaviorTree ID="{tree_id}">{body}</BehaviorTree></root>'


def test_subtrees_are_found_in_other_files(tmp_path: Path) -> None:
    main = tmp_path / "main.xml"
    main.write_text(tree("Main", '<SubTree ID="A"/>'))
    (tmp_path / "a.xml").write_text(tree("A", '<SubTree ID="B" x="1"/>'))
    (tmp_path / "parts").mkdir()
    part = tmp_path / "parts" / "b.xml"
    part.write_text(tree("B", "<Safe/>"))
    (tmp_path / "broken.xml").write_text("<root")
    lookup = Lookup(Library(files_in(tmp_path)))
    loaded = load_tree(main, REGISTRY, lookup=lookup)
    assert [leaf.path for leaf in loaded.leaves()] == ["Main/A/B/Safe"]
    assert {path.name for path in loaded.sources} == {"main.xml", "a.xml", "b.xml"}
    assert loaded.places["Main/A/B/Safe"].path == part
    assert "there is no tree 'A'" in str(check_file(main, REGISTRY)[0])
    (tmp_path / "b2.xml").write_text(tree("B", "<Safe/>"))
    (finding,) = check_file(main, REGISTRY, lookup=Lookup(Library(files_in(tmp_path))))
    assert "tree 'B' stands in several files" in finding.message
    assert finding.message.endswith("rename one")
    assert f"{part}:1:24" in finding.message


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (tree("Lost", "<Safe/>").encode()[:-3], "not well-formed XML"),
        (tree("Lost\u00e9", "<Safe/>").encode("latin-1"), "save it as UTF-8"),
        (tree("Lost", "<Safe/>").encode("utf-16-le"), "save it as UTF-8"),
        (tree("Lost", "<Safe/>").encode() + b" " * 2_000_000, "larger than 2000000 bytes"),
    ],
    ids=["no XML", "Latin 1", "UTF-16", "2 MB"],
)
def test_a_tree_in_a_file_that_cannot_be_read_is_missed_with_the_reason(
    tmp_path: Path, data: bytes, reason: str
) -> None:
    main, lost = tmp_path / "main.xml", tmp_path / "lost.xml"
    main.write_text(tree("Main", '<SubTree ID="Gone"/>'))
    lost.write_bytes(data)
    (finding,) = check_file(main, REGISTRY, lookup=Lookup(Library(files_in(tmp_path))))
    assert "there is no tree 'Gone'" in finding.message
    assert f"could not be read: {lost}" in finding.message
    assert reason in finding.message


def test_a_folder_with_too_much_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("a.xml", "b.xml"):
        (tmp_path / name).write_text(tree("A", "<Safe/>"))
    limits = {"LIBRARY_FILES": "1 tree files", "FOLDER_FILES": "1 files"}
    for limit, words in (*limits.items(), ("LIBRARY_BYTES", "1 bytes of tree files")):
        with monkeypatch.context() as patch:
            patch.setattr(f"uav_bt.tree.loading.lookup.MAX_{limit}", 1)
            with pytest.raises(FileError, match=f"more than {words}: choose a folder inside it"):
                files_in(tmp_path)
    assert len(files_in(tmp_path)) == 2


def test_files_above_are_included_when_allowed(tmp_path: Path) -> None:
    (tmp_path / "trees").mkdir()
    (tmp_path / "package").mkdir()
    (tmp_path / "up.xml").write_text(tree("Up", "<Safe/>"))
    (tmp_path / "package" / "in.xml").write_text(tree("In", "<Safe/>"))
    main = tmp_path / "trees" / "main.xml"
    includes = '<include path="../up.xml"/><include ros_pkg="robot" path="in.xml"/>'
    main.write_text(document('<Sequence><SubTree ID="Up"/><SubTree ID="In"/></Sequence>', includes))
    found = [finding.message for finding in check_file(main, REGISTRY)]
    assert any("allow it with --include-root DIR" in message for message in found)
    assert any("add --ros-pkg robot=DIR" in message for message in found)
    lookup = Lookup(include_root=tmp_path, packages={"robot": tmp_path / "package"})
    assert check_file(main, REGISTRY, lookup=lookup) == ()


# --- text that is no XML, but that the engine's reader takes --------------------------------------

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


# --- files in the style of public projects: their findings equal verdicts.yaml --------------------

FILES = Path(__file__).parents[2] / "data" / "tree_files"
VERDICTS = yaml.safe_load((FILES / "verdicts.yaml").read_text(encoding="utf-8"))
PALETTE = with_palette(NodeRegistry(), FILES / "palette.xml")
WORKSPACE = Lookup(Library(path for path in files_in(FILES / "workspace") if path.suffix == ".xml"))


@pytest.mark.parametrize("name", VERDICTS)
def test_verdict(name: str) -> None:
    verdict = VERDICTS[name]
    found = check_file(FILES / name, PALETTE, lookup=WORKSPACE)
    got = "refused" if errors_of(found) else "warned" if found else "taken"
    assert got == verdict["here"], found
    assert verdict.get("words", "") in "\n".join(map(str, found))
    # We accept exactly the files that the engine accepts, except for texts in double quotes, which
    # all releases before 4.9 accept.
    if name != "double_quotes.xml":
        assert (got == "refused") == (verdict["engine"] != "taken")


def test_every_file_has_a_verdict() -> None:
    assert {str(path.relative_to(FILES)) for path in files_in(FILES)} == {*VERDICTS, "palette.xml"}


# --- projects: each has a project.yaml, with its palette and words of its warnings ----------------

PROJECTS = Path(__file__).parents[2] / "data" / "tree_projects"
PROJECT_FILES = [
    pytest.param(project.parent, path, id=f"{project.parent.name}/{path.name}")
    for project in sorted(PROJECTS.glob("*/project.yaml"))
    for path in files_in(project.parent)
]


@pytest.mark.parametrize(("project", "path"), PROJECT_FILES)
def test_findings_of_a_file(project: Path, path: Path) -> None:
    asked = yaml.safe_load((project / "project.yaml").read_text(encoding="utf-8"))
    known = with_palette(NodeRegistry(), project / asked["palette"])
    found = check_file(path, known, lookup=Lookup(Library(sorted(project.rglob("*.xml")))))
    words = asked["warned"].get(str(path.relative_to(project)), [])
    assert not errors_of(found)
    assert bool(found) == bool(words), found
    for each in words:
        assert each in "\n".join(map(str, found))
