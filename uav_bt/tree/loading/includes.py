"""Files that a tree file includes: from its own folder and below, and not without end."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from uav_bt.tree.loading.findings import Findings
from uav_bt.tree.loading.source import Element, parse_source, read_source

MAX_INCLUDES: Final = 50


class Includes:
    """Reads included files, each once.

    Args:
        main: the file that was asked for; its folder bounds what may be included.
    """

    def __init__(self, main: Path) -> None:
        self._folder = main.resolve().parent if main.is_file() else None
        self._main = main.resolve()
        self.sources: dict[Path, bytes] = {}  # of the included files, by path

    def read(self, include: Element, findings: Findings) -> list[Element]:
        """Return the root of the included file; nothing when it was read before or is refused.

        Args:
            include: the element that names the file.
            findings: where they are added.

        Raises:
            TreeError: the file cannot be read or is no XML.
        """
        attributes = include.attributes
        message = ""
        if set(attributes) != {"path"} or not attributes["path"]:
            message = "needs exactly the attribute 'path'"
        elif self._folder is None:
            message = "only a tree that is loaded from a file can include another"
        elif len(self.sources) >= MAX_INCLUDES:
            message = f"more than {MAX_INCLUDES} files are included"
        else:
            target = (include.path.parent / attributes["path"]).resolve()
            if target == self._main or target in self.sources:
                return []
            if not target.is_relative_to(self._folder):
                message = f"'{attributes['path']}' lies outside the folder {self._folder}"
            elif not target.is_file():
                message = f"'{attributes['path']}': no such file beside {include.path}"
            else:
                self.sources[target] = read_source(target)
                return [parse_source(self.sources[target], target)]
        findings.add(include.path, include.at("path"), message, "include")
        return []
