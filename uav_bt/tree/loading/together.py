"""Checks tree files that use each other's trees: a folder, or the files that pytest collects."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from uav_bt.tree.loading.findings import Finding
from uav_bt.tree.loading.loader import check_file
from uav_bt.tree.loading.lookup import Lookup
from uav_bt.tree.registry import NodeRegistry


class FilesTogether:
    """Tree files of one workspace; each is checked when it is first asked for."""

    def __init__(
        self,
        files: Iterable[Path],
        registry: NodeRegistry,
        *,
        tree_id: str | None = None,
        lookup: Lookup,
    ) -> None:
        self._called = {str(path.resolve()): str(path) for path in files}
        self._registry = registry
        self._tree_id = tree_id
        self._lookup = lookup
        self._found: dict[str, tuple[Finding, ...]] = {}

    def findings(self, path: Path) -> tuple[Finding, ...]:
        """Return the findings of a file.

        A finding in another of the files is in the report of that other file, except when it
        depends on this file's use of it.
        """
        return tuple(one for one in self._all(str(path)) if not self._is_reported(one, str(path)))

    def _is_reported(self, finding: Finding, path: str) -> bool:
        if finding.path == path or finding.path not in self._called.values():
            return False
        return _matter(finding) in map(_matter, self._all(finding.path))

    def _all(self, path: str) -> tuple[Finding, ...]:
        if path not in self._found:
            found = check_file(
                Path(path), self._registry, tree_id=self._tree_id, lookup=self._lookup
            )
            self._found[path] = tuple(
                replace(one, path=self._called.get(one.path, one.path)) for one in found
            )
        return self._found[path]


def _matter(finding: Finding) -> tuple[object, ...]:
    """Return the subject of a finding, without the node's path, which depends on the tree."""
    return finding.path, finding.position, finding.severity, finding.message
