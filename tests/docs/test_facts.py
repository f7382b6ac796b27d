"""Pages agree with each other and with the source, and their links have targets."""

from __future__ import annotations

import math
import re
import tomllib
from typing import Any, Final

import pytest

from behaviours.nodes import NODES
from tests.docs.documents import FENCE, ROOT
from uav_bt.board import MISSION_KEYS
from uav_bt.board.blackboard import Key
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


@pytest.mark.parametrize("key", MISSION_KEYS, ids=lambda key: key.name)
def test_the_table_of_board_keys_says_how_old_a_value_may_be(key: Key[Any]) -> None:
    row = re.search(rf"^\| `{key.name}` \|.*\| (.+?) \|$", TREES, re.MULTILINE)
    assert row is not None, "the key has no row"
    assert row[1] == ("-" if math.isinf(key.max_age_s) else f"{key.max_age_s:g} s")


def test_the_page_of_missions_lists_files_leaves_and_policies() -> None:
    files = {path.name for path in (ROOT / "trees").glob("*.xml")}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for name in (*files, *(node.node_id for node in NODES), *project["entry-points"][POLICIES]):
        assert f"`{name}`" in TREES, name
