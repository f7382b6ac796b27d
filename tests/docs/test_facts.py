"""Facts and messages that the pages state."""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, Final

import pytest
import yaml

from behaviours.nodes import NODES
from tests.docs.documents import FENCE, ROOT
from uav_bt.plugins import POLICIES

TREES: Final = (ROOT / "trees" / "README.md").read_text(encoding="utf-8")
PAGES: Final = sorted(
    path.relative_to(ROOT).as_posix()
    for path in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *ROOT.glob("[a-z]*/README.md"))
)
LINK: Final = re.compile(r"\]\(([^)\s]+)\)")
HEADING: Final = re.compile(r"^#+ (.+)$", re.MULTILINE)


def anchors(page: str) -> set[str]:
    """Return the anchors of a page's headings, as forges make them."""
    headings = HEADING.findall(FENCE.sub("", page))
    return {re.sub(r"[^\w\- ]", "", each.lower()).replace(" ", "-") for each in headings}


@pytest.mark.parametrize("name", PAGES)
def test_links_between_files_lead_somewhere(name: str) -> None:
    page = ROOT / name
    for link in LINK.findall(FENCE.sub("", page.read_text(encoding="utf-8"))):
        if link.startswith(("https://", "http://", "mailto:")):
            continue
        file, _, anchor = link.partition("#")
        target = (page.parent / file).resolve() if file else page
        assert target.exists(), f"{name}: {link}"
        if anchor:
            assert anchor in anchors(target.read_text(encoding="utf-8")), f"{name}: {link}"


def test_every_page_is_linked_from_another() -> None:
    linked = {
        (ROOT / name).parent.joinpath(link.partition("#")[0]).resolve()
        for name in PAGES
        for link in LINK.findall((ROOT / name).read_text(encoding="utf-8"))
        if not link.startswith("http")
    }
    lone = [name for name in PAGES if (ROOT / name).resolve() not in linked]
    assert set(lone) <= {"README.md"}


def test_the_page_of_missions_lists_files_leaves_and_policies() -> None:
    files = {path.name for path in (ROOT / "trees").glob("*.xml")}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for name in (*files, *(node.node_id for node in NODES), *project["entry-points"][POLICIES]):
        assert f"`{name}`" in TREES, name


# --- files about the project ---

PROJECT: Final[dict[str, Any]] = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))[
    "project"
]
CITATION: Final[dict[str, Any]] = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
HOOKS: Final[list[dict[str, Any]]] = [
    hook
    for each in yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text("utf-8"))["repos"]
    for hook in each["hooks"]
]


def test_the_citation_is_of_this_project() -> None:
    for entry in (CITATION, CITATION["preferred-citation"]):
        # Citation File Format 1.2.0: a person has a family name, an entity has a name.
        assert all(("name" in each) != ("family-names" in each) for each in entry["authors"])
    assert CITATION["version"] == PROJECT["version"]
    assert CITATION["license"] == PROJECT["license"]
    assert CITATION["preferred-citation"]["url"] == PROJECT["urls"]["Paper"]
    title = CITATION["preferred-citation"]["title"]
    assert title in " ".join((ROOT / "README.md").read_text("utf-8").split())


@pytest.mark.parametrize("hook", HOOKS, ids=lambda hook: hook["id"])
def test_a_hook_runs_the_projects_own_tool(hook: dict[str, Any]) -> None:
    """The hook runs the program of the `make` environment, which fixes its version."""
    assert hook["language"] == "system"
    program = Path(hook["entry"].split()[0])
    assert program.parent == Path(".venv/bin")
    tool = program.name
    extras = PROJECT["optional-dependencies"]["dev"]
    assert any(line.startswith(tool) for line in extras)
    assert tool in (ROOT / "Makefile").read_text("utf-8")


# --- messages ---

PAGE: Final = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
MESSAGES: Final = re.findall(r"^\*\*`(.+)`\*\*$", PAGE, re.MULTILINE)
ROOMS: Final = ("uav_bt", "behaviours", "perception", "sim_bridge")
GAP: Final = "\0"  # placeholder for values in a message


def templates_of(tree: ast.AST) -> Iterator[str]:
    """Yield the texts of a module, with gaps where values are put in."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value
        elif isinstance(node, ast.JoinedStr):
            yield "".join(
                str(part.value) if isinstance(part, ast.Constant) else GAP for part in node.values
            )


@cache
def templates() -> frozenset[str]:
    """Return all texts of the packages, and those of the installer."""
    found = {
        text
        for room in ROOMS
        for path in (ROOT / room).rglob("*.py")
        for text in templates_of(ast.parse(path.read_text(encoding="utf-8")))
    }
    installer = (ROOT / "tools" / "install.sh").read_text(encoding="utf-8")
    lines = re.sub(r'"\s*\\\n\s*"', " ", installer).splitlines()  # continued strings
    return frozenset(found | {re.sub(r"\$\w+", GAP, line) for line in lines})


def printed(message: str) -> bool:
    """Return whether a text of the source contains the message, or matches its beginning.

    `...` in the message matches any text; a gap in the text matches any words of the message.
    """
    quoted = re.compile(".*?".join(re.escape(part) for part in message.split("...")), re.DOTALL)
    if any(quoted.search(text) for text in templates()):
        return True
    for text in templates():
        constant = re.sub(GAP, "", text)
        filled = ".+?".join(re.escape(part) for part in text.split(GAP))
        if len(constant) > len(message) / 2 and re.match(filled, message):
            return True
    return False


@pytest.mark.parametrize("message", MESSAGES)
def test_a_message_is_printed(message: str) -> None:
    assert len(message.replace("...", "").strip()) > 5
    assert printed(message)


def test_a_message_that_is_not_printed_would_be_found() -> None:
    assert not printed("the drone has no wings")
    assert not printed("unknown bird '...'")


def test_there_is_a_cure_for_each() -> None:
    assert len(MESSAGES) >= 20
    assert len(set(MESSAGES)) == len(MESSAGES)
    for block in PAGE.split("\n\n"):
        if block.startswith("**`"):
            assert len(block.splitlines()) > 1, block
