"""Findings of `uav-bt check` as an editor underlines them, and quick fixes of "did you mean"."""

from __future__ import annotations

import difflib
import re
from pathlib import Path
from typing import Final

from lsprotocol import types

from uav_bt.lsp.page import Page
from uav_bt.tree.loading.findings import WARNING, WHOLE_FILE, Finding

SOURCE: Final = "uav-bt"
_ABOUT: Final = re.compile(r"attribute '(\w+)'")
_MEANT: Final = re.compile(r"; did you mean '([^']*)'\?")
_QUOTED: Final = re.compile(r"'([^']*)'")


def diagnostic(finding: Finding, page: Page) -> types.Diagnostic:
    """Return a finding as a diagnostic of the text's part that it concerns.

    Args:
        finding: of the page's file.
        page: the text that was checked.
    """
    return types.Diagnostic(
        range=page.range(*_part(finding, page)),
        message=f"{finding.node}: {finding.message}" if finding.node else finding.message,
        severity=types.DiagnosticSeverity.Warning
        if finding.severity == WARNING
        else types.DiagnosticSeverity.Error,
        source=SOURCE,
    )


def _part(finding: Finding, page: Page) -> tuple[int, int]:
    if finding.position == WHOLE_FILE:
        return 0, page.text.find("\n") if "\n" in page.text else len(page.text)
    start = page.place(finding.position.line, finding.position.column)
    tag = page.tag_from(start)
    if tag is None:
        return start, min(start + 1, len(page.text))
    attributes = {one.start: one for one in tag.attributes}
    if start in attributes:
        return start, attributes[start].end
    about = _ABOUT.match(finding.message)
    for one in tag.attributes:
        if about is not None and one.name == about[1]:
            return one.start, one.end
    return tag.start, tag.start + 1 + len(tag.name)


def quick_fix(found: types.Diagnostic, page: Page) -> types.TextEdit | None:
    """Return the edit that takes a diagnostic's suggestion; None when it has none.

    The edit replaces a word that the message quotes and the underlined part contains. If there are
    several, it replaces the one most similar to the suggestion, as `did_you_mean` compares them.
    """
    meant = _MEANT.search(found.message)
    if meant is None:
        return None
    start, end = page.part(found.range)
    text = page.text[start:end]
    places = {}
    for word in _QUOTED.findall(found.message[: meant.start()]):
        place = re.search(rf"(?<![\w.\-]){re.escape(word)}(?![\w.\-])", text) if word else None
        if place is not None:
            places[word] = place
    if not places:
        return None
    word = max(places, key=lambda one: difflib.SequenceMatcher(None, one, meant[1]).ratio())
    at = places[word]
    return types.TextEdit(page.range(start + at.start(), start + at.end()), meant[1])


def code_actions(page: Page, uri: str, params: types.CodeActionParams) -> list[types.CodeAction]:
    """Return the quick fixes of a request's diagnostics."""
    actions = []
    for found in params.context.diagnostics:
        edit = quick_fix(found, page) if found.source == SOURCE else None
        if edit is not None:
            actions.append(
                types.CodeAction(
                    title=f"Change to '{edit.new_text}'",
                    kind=types.CodeActionKind.QuickFix,
                    diagnostics=[found],
                    is_preferred=True,
                    edit=types.WorkspaceEdit(changes={uri: [edit]}),
                )
            )
    return actions


class Reports:
    """Findings by file, for each document whose check found them."""

    def __init__(self) -> None:
        self._found: dict[str, dict[Path, list[Finding]]] = {}

    def update(self, owner: str, findings: tuple[Finding, ...]) -> set[Path]:
        """Keep the findings of a check, and return the files whose findings changed.

        Args:
            owner: the document that was checked.
            findings: in the document and the files that it includes.
        """
        before = self._found.pop(owner, {})
        after: dict[Path, list[Finding]] = {}
        for finding in findings:
            after.setdefault(Path(finding.path), []).append(finding)
        if after:
            self._found[owner] = after
        return {path for path in {*before, *after} if before.get(path) != after.get(path)}

    def of(self, path: Path) -> list[Finding]:
        """Return the findings of all checks in a file, each once."""
        found = [one for report in self._found.values() for one in report.get(path, ())]
        return sorted(set(found))
