"""Lists of places from files: `file:rounds.csv` in a tree file becomes the places of that file.

The file is found relative to the tree file that names it. Its text is kept with those of the tree
files, so that checksums, records and replays have it.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Final

from uav_bt.errors import FileError, InputError
from uav_bt.files import did_you_mean_file, read_bounded
from uav_bt.tree.loading.elements import node_attributes, node_id_of
from uav_bt.tree.loading.findings import WHOLE_FILE, Findings, Position, Rule
from uav_bt.tree.loading.parameters import VAR, Parameters
from uav_bt.tree.loading.places_file import MAX_BYTES, read_places
from uav_bt.tree.loading.source import Element
from uav_bt.tree.mission_tree import Place
from uav_bt.tree.node import NodeKind
from uav_bt.tree.port import CONDITION_ATTRIBUTES
from uav_bt.tree.registry import NodeRegistry
from uav_bt.types.place import FILE_PREFIX, FILE_SUFFIXES, SEPARATOR

MAX_FILES: Final = 50  # of a mission, as of included files
# Stands for the places of a file with faults, so that no port adds a second finding. An area has
# three corners.
_STAND_IN: Final = "start:-1,-1;start:2,-1;start:-1,2"
_NAMED: Final = re.compile(
    rf"\s*{FILE_PREFIX}\s*(?P<name>[^;{{}}]*(?:{'|'.join(map(re.escape, FILE_SUFFIXES))}))\s*",
    re.IGNORECASE,
)


class PlaceLists:
    """Replaces files of places by their content; each is read once."""

    def __init__(self, sources: dict[Path, bytes], findings: Findings) -> None:
        self._sources = sources  # takes the texts of the files
        self._findings = findings
        self._texts: dict[Path, str] = {}

    def in_tree(self, element: Element, registry: NodeRegistry) -> Element:
        """Return a tree with the places of the files that it names.

        Elements are shared by the readings of a file, so those that change are copied.
        """
        children = [self.in_tree(child, registry) for child in element.children]
        changed = {
            name: self._at(element, name, text)
            for name, text in node_attributes(element).items()
            if FILE_PREFIX in text and takes_places(element, name, registry)
        }
        if not changed and all(a is b for a, b in zip(children, element.children, strict=True)):
            return element
        return replace(element, attributes={**element.attributes, **changed}, children=children)

    def in_default(self, port: Element, text: str) -> str:
        """Return the default of a described SubTree's port with the places of files."""
        return self._at(port, "default", text)

    def in_override(self, text: str, port: str, home: Path, place: Place) -> str:
        """Return the value of a port from outside, at a place, with files beside the mission."""
        return self._expanded(text, home, place, f"port '{port}'")

    def in_parameters(self, parameters: Parameters, home: Path) -> Parameters:
        """Return parameters whose variables have the places of files beside a tree file."""
        variables = dict(parameters.variables)
        for name, value in parameters.variables.items():
            if isinstance(value, str):
                place = parameters.places.get((VAR, name), Place(home, Position(1, 1)))
                variables[name] = self._expanded(value, home, place, f"variable '{name}'")
        return replace(parameters, variables=variables)

    def _at(self, element: Element, name: str, text: str) -> str:
        place = Place(element.path, element.at(name))
        return self._expanded(text, element.path, place, f"attribute '{name}'", element.label)

    def _expanded(self, text: str, home: Path, place: Place, what: str, node: str = "") -> str:
        """Return a list with the places of the files beside `home`; messages name what and node."""
        parts = text.split(SEPARATOR)
        for index, part in enumerate(parts):
            named = _NAMED.fullmatch(part)
            if named is None:
                continue
            try:
                parts[index] = self._places(named["name"].strip(), home, place, what, node)
            except InputError as error:
                message = f"{what}: {error}"
                self._findings.add(place.path, place.position, message, node, rule=Rule.PLACES)
                parts[index] = _STAND_IN
        return SEPARATOR.join(parts)

    def _places(self, name: str, home: Path, place: Place, what: str, node: str) -> str:
        """Return the places of a file and note its faults, or raise an InputError."""
        target = _target(name, home.resolve())
        if target in self._texts:
            return self._texts[target]
        if len(self._texts) >= MAX_FILES:
            raise InputError(f"more than {MAX_FILES} files of places are named")
        data = self._sources[target] = read_bounded(target, MAX_BYTES, FileError)
        text, faults = read_places(data, target.suffix.lower())
        who = f"{node}, {what}," if node else what
        for line, message in faults:
            self._findings.add(
                home.parent / name,
                Position(line, 1) if line else WHOLE_FILE,
                f"{message}; {who} at {place} names the file",
                rule=Rule.PLACES,
            )
        self._texts[target] = text or _STAND_IN
        return self._texts[target]


def takes_places(element: Element, name: str, registry: NodeRegistry) -> bool:
    """Return whether an attribute can be a list of places: a declared port or a SubTree's entry."""
    if name in CONDITION_ATTRIBUTES:
        return False
    if element.tag == NodeKind.SUBTREE.value:
        return True
    node = registry.get(node_id_of(element))
    return node is not None and any(port.places and port.name == name for port in node.ports)


def _target(name: str, home: Path) -> Path:
    """Return the file that a tree file names, or raise an InputError."""
    folder = home.parent
    if not home.is_file():
        raise InputError(f"'{name}': only a tree that is loaded from a file can name one of places")
    pure = PurePosixPath(name)
    try:
        target = (folder / name).resolve()
        there = target.exists()
    except (OSError, ValueError) as error:  # too long for the system, or with a zero byte
        raise InputError(f"'{name:.40}' is no name of a file: {error}") from error
    if pure.is_absolute() or ".." in pure.parts or not target.is_relative_to(folder):
        raise InputError(
            f"'{name}' lies outside the folder {folder}: expected a file of places beside the tree "
            "file or below"
        )
    if not there:
        raise InputError(
            f"no such file of places '{name}' in {folder}{did_you_mean_file(folder / name)}"
        )
    return target
