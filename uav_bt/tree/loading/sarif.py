"""Findings as SARIF 2.1.0, which tools for code review read."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

import uav_bt
from uav_bt.tree.loading.findings import Finding, Rule

_SCHEMA: Final = (
    "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
)
_RULES: Final = tuple(Rule)
_BASE: Final = "%SRCROOT%"  # the name by which code review tools know a repository's folder


def sarif_log(reports: Iterable[tuple[Path, Iterable[Finding]]], folder: Path) -> str:
    """Return a log of one run.

    A finding about a whole file stands at its first line: tools for code review show nothing that
    has no line.

    Args:
        reports: the checked files, each with its findings.
        folder: paths below it are relative to it; the repository's, as a rule.
    """
    files: list[Path] = []
    findings: dict[Finding, None] = {}
    for path, found in reports:
        files.append(path)
        findings.update(dict.fromkeys(found))
    places = _Places(folder)
    driver = {
        "name": "uav-bt check",
        "version": uav_bt.__version__,
        "rules": [{"id": rule.id, "shortDescription": {"text": rule.text}} for rule in _RULES],
    }
    run = {
        "tool": {"driver": driver},
        "columnKind": "unicodeCodePoints",
        "originalUriBaseIds": {_BASE: {"description": {"text": "Where uav-bt was called."}}},
        "artifacts": [
            {"location": places.of(path), "roles": ["analysisTarget"]}
            for path in dict.fromkeys(files)
        ],
        "results": [_result(finding, places) for finding in findings],
    }
    return json.dumps({"$schema": _SCHEMA, "version": "2.1.0", "runs": [run]}, indent=2)


def _result(finding: Finding, places: _Places) -> dict[str, Any]:
    region = {"startLine": max(1, finding.position.line)}
    if finding.position.column:
        region["startColumn"] = finding.position.column
    location = {"artifactLocation": places.of(Path(finding.path)), "region": region}
    return {
        "ruleId": finding.rule.id,
        "ruleIndex": _RULES.index(finding.rule),
        "level": finding.severity,  # ERROR and WARNING are SARIF's own words
        "message": {"text": ": ".join(filter(None, (finding.node, finding.message)))},
        "locations": [{"physicalLocation": location}],
    }


class _Places:
    """Names files by URIs."""

    def __init__(self, folder: Path) -> None:
        self._folders = (Path(os.path.abspath(folder)), folder.resolve())  # noqa: PTH100  # links stay

    def of(self, path: Path) -> dict[str, str]:
        """Return a file's artifactLocation: relative to the folder, or absolute outside it."""
        whole = Path(os.path.abspath(path))  # noqa: PTH100  # as it was called, without links
        for folder in self._folders:
            if whole.is_relative_to(folder):
                return {"uri": _uri(whole.relative_to(folder)), "uriBaseId": _BASE}
        return {"uri": f"file://{_uri(whole)}"}


def _uri(path: Path) -> str:
    return quote(os.fsencode(path))
