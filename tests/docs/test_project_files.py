"""Project files for other tools: the citation and the pre-commit hooks."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, Final

import pytest
import yaml

from tests.docs.documents import ROOT

PROJECT: Final[dict[str, Any]] = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))[
    "project"
]
CITATION: Final[dict[str, Any]] = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
HOOKS: Final[dict[str, Any]] = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text("utf-8"))


def authors_are_named(entry: dict[str, Any]) -> bool:
    """A person has a family name, an entity has a name; no author has both."""
    return all(("name" in each) != ("family-names" in each) for each in entry["authors"])


def test_the_citation_has_what_its_format_requires() -> None:
    """Citation File Format 1.2.0: the required keys of the file and of a reference."""
    assert CITATION["cff-version"] == "1.2.0"
    assert {"message", "title", "authors"} <= CITATION.keys()
    assert CITATION["type"] in {"software", "dataset"}
    paper = CITATION["preferred-citation"]
    assert {"type", "title", "authors"} <= paper.keys()
    assert authors_are_named(CITATION)
    assert authors_are_named(paper)
    for identifier in paper["identifiers"]:
        assert identifier["type"] in {"doi", "url", "swh", "other"}
        assert identifier["value"]


def test_the_citation_is_of_this_project() -> None:
    assert CITATION["version"] == PROJECT["version"]
    assert CITATION["license"] == PROJECT["license"]
    assert CITATION["preferred-citation"]["url"] == PROJECT["urls"]["Paper"]
    title = CITATION["preferred-citation"]["title"]
    assert title in " ".join((ROOT / "README.md").read_text("utf-8").split())


@pytest.mark.parametrize("hook", HOOKS["repos"][0]["hooks"], ids=lambda hook: hook["id"])
def test_a_hook_runs_the_projects_own_tool(hook: dict[str, Any]) -> None:
    """The hook runs the program of the `make` environment, which fixes its version."""
    assert hook["language"] == "system"
    program = Path(hook["entry"].split()[0])
    assert program.parent == Path(".venv/bin")
    tool = program.name
    extras = PROJECT["optional-dependencies"]["dev"]
    assert any(line.startswith(tool) for line in extras)
    assert tool in (ROOT / "Makefile").read_text("utf-8")


def test_hooks_come_from_nowhere_else() -> None:
    assert [repository["repo"] for repository in HOOKS["repos"]] == ["local"]
    assert len({hook["id"] for hook in HOOKS["repos"][0]["hooks"]}) == 3
